"""`recorder_node`: leg topics in, crash-safe MCAP run out."""

from collections.abc import Callable, Sequence
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
import os
from pathlib import Path
import platform
from time import monotonic, time_ns
from typing import Any, TYPE_CHECKING

from klann_ros import __version__
from klann_ros.cli import ArgumentParser
from klann_ros.log import (
    BackgroundWriter,
    check_free_space,
    EventSession,
    EventSettings,
    Message,
    Pause,
    QUEUE_CAPACITY,
    RecordedFinding,
    RECORDER_RECORD,
    Recording,
    RecordingSession,
    ros_distro,
    RunFaults,
    RunWriter,
    SolverParameters,
    SplitLimits,
    unfinished_runs,
)
from klann_ros.log.errors import LogError
from klann_ros.nodes.endpoints import create_steady_timer, create_trigger
from klann_ros.nodes.parameters import declare, overrides, StartError, usage
from klann_ros.nodes.process import arguments, Finish, ProcessNode, run, spin_through_errors
from klann_ros.nodes.solver_watch import SolverWatch
from klann_ros.sanitize.files import with_home
from klann_ros.sanitize.text import printable
from klann_ros.stop_signals import StopSignals
from rclpy import spin_once
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.utilities import get_rmw_implementation_identifier

from .interface import RECORDER_PARAMETERS, RecordingDiagnostics, SERVICES
from .topic_watch import TopicWatch

if TYPE_CHECKING:
    from .judging import Judging

# Timeout at the end for requested solver parameters [s].
_RESPONSE_TIMEOUT = 1.0
# Batching delay: one wake-up for many messages [s]. The subscriptions' queues suffice for 50 kHz.
_BATCH_PERIOD = 0.04
_EVENT_PERIOD = 0.1
# A finished chunk must fit into the reserve of a full disk [bytes].
_CHUNK_SIZE = 128 * 1024
_DEFAULT_FOLDER = Path('runs')


class RecorderNode(ProcessNode):
    """Record topics, each from when it appears, until the node is closed or the disk fails."""

    def __init__(self, finish: Finish, **options: Any) -> None:
        """Open the run; a StartError names a refused parameter, or the folder's problem."""
        super().__init__('recorder_node', **options)
        values = declare(self, RECORDER_PARAMETERS)
        has_trigger = values['pre_trigger'] > 0.0
        # Triggers come from the judge, unless the user disables it.
        has_judge = values['judge'] or (has_trigger and 'judge' not in overrides(self))
        self._diagnostics = RecordingDiagnostics(self)
        self._judging = self._start_judging(values['judge_limits']) if has_judge else None
        logger = self.get_logger()
        self._recording: Recording
        if has_trigger:
            self._recording = self._events = _open_events(values, logger)
            create_steady_timer(self, _EVENT_PERIOD, self._events.tick)
            create_trigger(self, 'trigger', self._trigger)
        else:
            self._recording = _open_run(values, logger, finish)
        self._pauses = self._recording.pauses
        self._solvers = SolverWatch(self, self._on_solver)
        self._watch = TopicWatch(
            self,
            ['*'] if values['all_topics'] else self._full_names(values['topics']),
            recording=self._recording,
            put=self._message_sink(),
            solvers=self._solvers,
            diagnostics=self._diagnostics,
            on_stall=self._on_stall,
        )
        create_steady_timer(self, values['diagnostics_period'], self._report)
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
            self._report()
            self._diagnostics.flush()
        return 0 if ok else 1

    def _start_judging(self, limits_file: str) -> 'Judging':
        from .judging import Judging, RecorderQueries  # noqa: PLC0415 - a slow import

        queries = RecorderQueries(
            published=lambda: self._watch.published,
            has_stalled=lambda: self._watch.has_stalled,
            missed=self._missed,
        )
        return Judging(self, limits_file, queries, self._on_findings)

    def _message_sink(self) -> Callable[[Message], None]:
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
            self._judging.add_context(solver)

    def _on_stall(self, stall: Pause) -> None:
        """Write a stall of this process to the run, in which a gap is no fault."""
        self._watch.take_queued()
        self._recording.add_pause(stall)
        self.get_logger().warning(stall.reason)
        if self._judging is not None:
            self._judging.add_context(stall)

    def _missed(self) -> dict[str, int]:
        """Return the messages of each topic lost before reception, as far as known."""
        counts = self._recording.counters.counts()
        return {name: count.missed or 0 for name, count in counts.items()}

    def _on_findings(self, findings: Sequence[RecordedFinding]) -> None:
        for finding in findings:
            self._recording.add_finding(finding)
        self._report()

    def _report(self) -> None:
        statuses = [] if self._judging is None else [self._judging.status()]
        self._diagnostics.report(self._recording.state(), *statuses)

    def _trigger(self) -> tuple[bool, str]:
        self._watch.take_queued()
        return self._events.trigger()

    def _await_responses(self) -> None:
        """Wait for requested solver parameters, which explain a short run."""
        executor = SingleThreadedExecutor(context=self.context)
        end_time = monotonic() + _RESPONSE_TIMEOUT

        def spin() -> None:
            while self._solvers.pending and monotonic() < end_time:
                spin_once(self, executor=executor, timeout_sec=0.02)

        spin_through_errors(spin, self)

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
        full_names = []
        for name in names:
            if name.startswith('/'):
                full_names.append(name)
            elif '*' in name:
                full_names.append(f'{namespace}/{name}')
            else:
                full_names.append(self.resolve_topic_name(name))
        return full_names


def _open_run(values: dict[str, Any], logger: RcutilsLogger, finish: Finish) -> RecordingSession:
    name = f'{datetime.now(timezone.utc):%Y-%m-%dT%H-%M-%SZ}'
    try:
        folder = with_home(values['output'] or _DEFAULT_FOLDER / name)
        run, background = _open_writer(folder, values, logger, on_failure=lambda: finish(1))
    except (LogError, OSError, ValueError) as error:
        raise StartError(str(error)) from error
    _report_unfinished(run.path.parent, logger)
    background.put_entry(_write_recorder_info)
    logger.info(f'recording to {printable(run.path)}')
    return RecordingSession(run, background)


def _open_events(values: dict[str, Any], logger: RcutilsLogger) -> EventSession:
    """Return a session with a run for each event in a folder; a StartError if it is unusable."""
    try:
        folder = with_home(values['output'] or _DEFAULT_FOLDER).absolute()
        folder.mkdir(parents=True, exist_ok=True)
        check_free_space(folder, values['min_free_space'])
        is_run = (folder / 'metadata.yaml').exists() or any(folder.glob('*.mcap'))
    except FileExistsError:
        raise StartError(
            f'{printable(folder)} is not a folder, so no runs can be created in it'
        ) from None
    except (LogError, OSError, ValueError) as error:
        raise StartError(str(error)) from error
    if is_run:
        raise StartError(
            f'{printable(folder)} is a run; output must be a folder for the runs of events'
        )
    if not os.access(folder, os.W_OK | os.X_OK):
        raise StartError(f'{printable(folder)} is not writable')
    _report_unfinished(folder, logger)
    settings = EventSettings(
        values['pre_trigger'], values['post_trigger'], values['pre_trigger_bytes']
    )
    capacity = QUEUE_CAPACITY + settings.max_bytes
    logger.info(
        f'waiting: a finding or a call of ~/trigger writes the {settings.pre_trigger:g} s before '
        f'it and {settings.post_trigger:g} s after it to {printable(folder)}'
    )
    return EventSession(
        folder,
        settings,
        open_run=lambda path: _open_writer(path, values, logger, capacity=capacity),
        entries=[_write_recorder_info],
        on_status=lambda ok, text: logger.info(text) if ok else logger.error(text),
    )


def _open_writer(
    path: Path,
    values: dict[str, Any],
    logger: RcutilsLogger,
    *,
    on_failure: Callable[[], object] = lambda: None,
    capacity: int = QUEUE_CAPACITY,
) -> tuple[RunWriter, BackgroundWriter]:
    """Open the run in a folder; return its writer, and the queue in front of it."""
    check_free_space(path, values['min_free_space'])
    run = RunWriter(
        path,
        compression=values['compression'],
        chunk_size=_CHUNK_SIZE,
        reserve=True,
        faults=RunFaults(logger.error),
    )
    period = values['flush_period']
    background = BackgroundWriter(
        run,
        # The batching delay counts as part of it.
        flush_period=max(period - _BATCH_PERIOD, period / 2.0),
        on_failure=on_failure,
        limits=SplitLimits(values['max_file_size'], values['max_file_duration']),
        min_free_space=values['min_free_space'],
        capacity=capacity,
    )
    return run, background


def _report_unfinished(folder: Path, logger: RcutilsLogger) -> None:
    for unfinished in unfinished_runs(folder):
        name = printable(unfinished)
        logger.warning(f'{name} was not finished; `recover {name}` repairs it')


def _write_recorder_info(run: RunWriter) -> None:
    run.add_metadata(
        RECORDER_RECORD,
        {
            'version': __version__,
            'host': platform.node(),
            'system': platform.platform(),
            'python': platform.python_version(),
            'ros_distro': ros_distro(),
            'rclpy': _version('rclpy'),
            'rmw': get_rmw_implementation_identifier(),
            'mcap': _version('mcap'),
            'started': datetime.now(timezone.utc).isoformat(),
        },
        in_every_file=True,
    )


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return 'unknown'


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = ArgumentParser(
        'recorder_node',
        'Record the topics of a leg to an MCAP run that survives a crash. Ctrl-C finishes it.',
        f'{usage({"": RECORDER_PARAMETERS})}\n\n{SERVICES}',
    )
    arguments(parser, argv)
    return run('recorder_node', RecorderNode, argv, stop, raw=True, batch_period=_BATCH_PERIOD)
