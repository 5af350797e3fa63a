"""`recorder_node`: leg topics in, crash-safe MCAP run out."""

from collections.abc import Callable, Sequence
from time import monotonic, time_ns
from typing import Any, TYPE_CHECKING

from klann_ros.log.records import Message
from klann_ros.log.run_parameters import Pause, RecordedFinding, SolverParameters
from klann_ros.log.write.event_session import EventSession
from klann_ros.nodes.endpoints import create_trigger
from klann_ros.nodes.parameters import declare, overrides, usage
from klann_ros.nodes.process import arguments, Finish, ProcessNode, run, spin_on
from klann_ros.sanitize.arguments import ArgumentParser
from klann_ros.stop_signals import StopSignals
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor

from .interface import PARAMETERS, RecordingDiagnostics, SERVICES
from .sessions import open_events, open_run
from .solver_watch import SolverWatch
from .topic_watch import TopicWatch

if TYPE_CHECKING:
    from klann_ros.log.write.recording import Recording

    from .judging import Judging

# Timeout at the end for requested solver parameters [s].
_RESPONSE_TIMEOUT = 1.0
# Batching delay: one wake-up for many messages [s]. The subscriptions' queues suffice for 100 kHz.
_BATCH_PERIOD = 0.02
_EVENT_PERIOD = 0.1


class RecorderNode(ProcessNode):
    """
    Record topics, each from when it appears, until the node is closed.

    Parameters
    ----------
    finish : Finish
        Called when the disk refuses.

    Raises
    ------
    StartError
        A parameter is refused, or the run's folder cannot be created.

    """

    def __init__(self, finish: Finish, **options: Any) -> None:
        """Declare, validate, open the run; `options` are those of Node."""
        super().__init__('recorder_node', **options)
        values = declare(self, PARAMETERS)
        has_trigger = values['pre_trigger'] > 0.0
        # Triggers come from the judge, unless the user disables it.
        has_judge = values['judge'] or (has_trigger and 'judge' not in overrides(self))
        self._diagnostics = RecordingDiagnostics(self)
        self._judging = self._judge(values['judge_limits']) if has_judge else None
        logger = self.get_logger()
        self._recording: Recording
        if has_trigger:
            self._recording = self._events = open_events(values, logger)
            self._start_events(self._events)
        else:
            self._recording = open_run(values, logger, finish)
        self._pauses = self._recording.pauses
        self._solvers = SolverWatch(self, self._on_solver)
        self._watch = TopicWatch(
            self,
            ['*'] if values['all_topics'] else self._full_names(values['topics']),
            put=self._put(),
            counters=self._recording.counters,
            pauses=self._pauses,
            solvers=self._solvers,
            diagnostics=self._diagnostics,
            on_stall=self._on_stall,
        )
        self._diagnostics.start(self._recording.state)
        create_trigger(self, 'split', self._recording.split)
        create_trigger(self, 'pause', self._pause)
        create_trigger(self, 'resume', self._resume)

    def close(self) -> int:
        """Read the queued messages, and finish the run."""
        self._await_responses()
        self._watch.stop()
        self._watch.take_queued()
        if self._judging is not None:
            self._judging.stop()
        if self._pauses.paused:
            self._resume()
        ok, message = self._recording.finish()
        if ok:
            self.get_logger().info(message)
        else:
            self.get_logger().error(message)
            self._diagnostics.report(self._recording.state())
            self._diagnostics.flush()
        return 0 if ok else 1

    def _judge(self, limits: str) -> 'Judging':
        from .judging import Judging  # noqa: PLC0415 - a slow import

        judging = Judging(
            self,
            limits,
            published=self._published,
            has_stalled=lambda: self._watch.has_stalled,
            missed=self._missed,
            on_findings=self._on_findings,
        )
        self._diagnostics.add_status(judging.status)
        return judging

    def _published(self) -> set[str]:
        return self._watch.published()

    def _put(self) -> Callable[[Message], None]:
        """Return the sink of every message, without overhead if nothing is judged."""
        put = self._recording.put
        if self._judging is None:
            return put
        judge = self._judging.add

        def put_and_judge(message: Message) -> None:
            put(message)
            judge(message)

        return put_and_judge

    def _on_solver(self, solver: SolverParameters) -> None:
        self._recording.add_solver(solver)
        if self._judging is not None:
            self._judging.add_solver(solver)

    def _on_stall(self, stall: Pause) -> None:
        """Write a stall of this process to the run, in which a gap is no fault."""
        self._watch.take_queued()
        self._recording.add_pause(stall)
        self.get_logger().warning(stall.reason)
        if self._judging is not None:
            self._judging.excuse(stall)

    def _missed(self) -> dict[str, int]:
        """Return the messages of each topic lost before reception, as far as known."""
        counts = self._recording.counters.counts()
        return {name: count.missed or 0 for name, count in counts.items()}

    def _on_findings(self, findings: Sequence[RecordedFinding]) -> None:
        """Write new findings to the run, and report them at once."""
        for finding in findings:
            self._recording.add_finding(finding)
        self._diagnostics.report(self._recording.state())

    def _start_events(self, events: EventSession) -> None:
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_EVENT_PERIOD, events.tick, clock=clock)
        create_trigger(self, 'trigger', self._trigger)

    def _trigger(self) -> tuple[bool, str]:
        self._watch.take_queued()
        return self._events.trigger()

    def _await_responses(self) -> None:
        """Wait for requested solver parameters, which explain a short run."""
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        end = monotonic() + _RESPONSE_TIMEOUT

        def spin() -> None:
            while self._solvers.pending and monotonic() < end:
                executor.spin_once(timeout_sec=0.02)

        spin_on(spin, self)
        executor.remove_node(self)

    def _pause(self) -> tuple[bool, str]:
        if self._pauses.paused:
            return True, 'already paused'
        self._watch.take_queued()
        self._pauses.begin(time_ns())
        if self._judging is not None:
            self._judging.pause()
        return True, 'paused'

    def _resume(self) -> tuple[bool, str]:
        if not self._pauses.paused:
            return True, 'already recording'
        self._pauses.end(time_ns())
        # The pause's record counts the messages received meanwhile.
        self._watch.take_queued()
        self._recording.add_pause(self._pauses.take_last())
        if self._judging is not None:
            self._judging.resume()
        return True, 'recording again'

    def _full_names(self, names: Sequence[str]) -> list[str]:
        """Return full names; patterns are relative to this node's namespace, and not remapped."""
        namespace = self.get_namespace().rstrip('/')
        return [
            name
            if name.startswith('/')
            else f'{namespace}/{name}'
            if '*' in name
            else self.resolve_topic_name(name)
            for name in names
        ]


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = ArgumentParser(
        'recorder_node',
        'Record the topics of a leg to an MCAP run that survives a crash. Ctrl-C finishes it.',
        f'{usage({"": PARAMETERS})}\n\n{SERVICES}',
    )
    arguments(parser, argv)
    return run('recorder_node', RecorderNode, argv, stop, raw=True, batch_period=_BATCH_PERIOD)
