"""`recorder_node`: leg topics in, crash-safe MCAP run out."""

from collections.abc import Callable, Sequence
from time import monotonic, time_ns
from typing import Any, TYPE_CHECKING

from klann_ros.log.events.session import EventSession
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import Pause, SolverParameters, ToldFinding
from klann_ros.nodes.endpoints import create_trigger
from klann_ros.nodes.parameters import declare, overrides, usage
from klann_ros.nodes.process import arguments, Finish, ProcessNode, run, spin_on
from klann_ros.sanitize.arguments import ArgumentParser
from klann_ros.stop_signals import StopSignals
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor

from .interface import PARAMETERS, RecordingDiagnostics, SERVICES
from .opening import open_events, open_run
from .solver_watch import SolverWatch
from .topic_watch import TopicWatch

if TYPE_CHECKING:
    from klann_ros.log.write.recording import Recording

    from .judging import Judging

# How long the end waits for a solver's parameters that have been asked for [s].
LAST_ANSWERS = 1.0
# Nobody waits for an answer of a recorder: one wake-up for many messages [s]. The queues of its
# subscriptions hold what comes meanwhile up to 100 kHz.
BATCH_PERIOD = 0.02
# How often it is looked what is due of an event [s].
TICK = 0.1


class RecorderNode(ProcessNode):
    """
    Record topics, each from when it appears, until the node is closed.

    Parameters
    ----------
    finish : Finish
        Is called when the disk says no.

    Raises
    ------
    StartError
        A parameter is refused, or the run's folder cannot be made; the text says why.

    """

    def __init__(self, finish: Finish, **options: Any) -> None:
        """Declare, validate, open the run; `options` are those of Node."""
        super().__init__('recorder_node', **options)
        values = declare(self, PARAMETERS)
        waits = values['pre_trigger'] > 0.0
        # Who waits for a cause looks for one, unless that is said not to be wanted.
        judges = values['judge'] or (waits and 'judge' not in overrides(self))
        self._diagnostics = RecordingDiagnostics(self)
        self._judging = self._judge(values['judge_limits']) if judges else None
        teller = self.get_logger()
        self._recording: Recording
        if waits:
            self._recording = self._events = open_events(values, teller)
            self._wait_for_causes(self._events)
        else:
            self._recording = open_run(values, teller, finish)
        self._pauses = self._recording.pauses
        self._solvers = SolverWatch(self, self._on_solver)
        self._watch = TopicWatch(
            self,
            ['*'] if values['all_topics'] else self._full_names(values['topics']),
            put=self._put(),
            ledger=self._recording.ledger,
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
        """Take what still waits, and finish the run."""
        self._await_answers()
        self._watch.stop()
        self._watch.take_queued()
        if self._judging is not None:
            self._judging.stop()
        if self._pauses.paused:
            self._resume()
        is_well, said = self._recording.finish()
        if is_well:
            self.get_logger().info(said)
        else:
            self.get_logger().error(said)
            self._diagnostics.report(self._recording.state())
            self._diagnostics.flush()
        return 0 if is_well else 1

    def _judge(self, limits: str) -> 'Judging':
        from .judging import Judging  # noqa: PLC0415 - who does not judge does not pay for it

        judging = Judging(
            self,
            limits,
            published=self._published,
            has_stalled=lambda: self._watch.has_stalled,
            lost=self._lost,
            on_new=self._on_findings,
        )
        self._diagnostics.also(judging.status)
        return judging

    def _published(self) -> set[str]:
        return self._watch.published()

    def _put(self) -> Callable[[Message], None]:
        """Return what takes every message; who does not judge pays nothing for it."""
        put = self._recording.put
        if self._judging is None:
            return put
        judge = self._judging.add

        def put_and_judge(message: Message) -> None:
            put(message)
            judge(message)

        return put_and_judge

    def _on_solver(self, solver: SolverParameters) -> None:
        self._recording.tell(solver)
        if self._judging is not None:
            self._judging.tell(solver)

    def _on_stall(self, stall: Pause) -> None:
        """Write to the run when this process did not run: silence is no fault then."""
        self._watch.take_queued()
        self._recording.describe_pause(stall)
        self.get_logger().warning(stall.reason)
        if self._judging is not None:
            self._judging.excuse(stall)

    def _lost(self) -> dict[str, int]:
        """Return how many messages were lost before they were received, where that is known."""
        counts = self._recording.ledger.counts()
        return {name: count.unheard or 0 for name, count in counts.items()}

    def _on_findings(self, findings: Sequence[ToldFinding]) -> None:
        """Write to the run what is new, and tell it at once."""
        for finding in findings:
            self._recording.describe_finding(finding)
        self._diagnostics.report(self._recording.state())

    def _wait_for_causes(self, events: EventSession) -> None:
        """Let events begin and end in time, and begin when somebody asks for one."""
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(TICK, events.tick, clock=clock)
        create_trigger(self, 'trigger', self._trigger)

    def _trigger(self) -> tuple[bool, str]:
        self._watch.take_queued()
        return self._events.trigger()

    def _await_answers(self) -> None:
        """Let the answers come that explain a run which was stopped early."""
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        end = monotonic() + LAST_ANSWERS

        def spin() -> None:
            while self._solvers.unanswered and monotonic() < end:
                executor.spin_once(timeout_sec=0.02)

        spin_on(spin, self)
        executor.remove_node(self)

    def _pause(self) -> tuple[bool, str]:
        if self._pauses.paused:
            return True, 'it was paused already'
        self._watch.take_queued()
        self._pauses.begin(time_ns())
        if self._judging is not None:
            self._judging.pause()
        return True, 'paused'

    def _resume(self) -> tuple[bool, str]:
        if not self._pauses.paused:
            return True, 'it was recording already'
        self._pauses.end(time_ns())
        # What was received meanwhile is to be in the record of the pause.
        self._watch.take_queued()
        self._recording.describe_pause(self._pauses.last())
        if self._judging is not None:
            self._judging.resume()
        return True, 'recording again'

    def _full_names(self, names: Sequence[str]) -> list[str]:
        """Return full names; a pattern is taken in this node's namespace, and not remapped."""
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
    return run('recorder_node', RecorderNode, argv, stop, raw=True, batch_period=BATCH_PERIOD)
