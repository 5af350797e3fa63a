"""`recorder_node`: leg topics in, crash-safe MCAP run out."""

from collections.abc import Sequence
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
import os
from pathlib import Path
import platform
from time import monotonic, time_ns
from typing import Any

from klann_ros import __version__
from klann_ros.log.background_writer import BackgroundWriter
from klann_ros.log.errors import LogError
from klann_ros.log.free_space import check_free_space, free_space
from klann_ros.log.mcap_file import COMPRESSIONS
from klann_ros.log.pauses import Pauses
from klann_ros.log.run_parameters import (
    LOSS_RECORD,
    loss_record,
    PAUSE_RECORD,
    pause_record,
    RECORDER_RECORD,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
    TopicCount,
)
from klann_ros.log.split_limits import SplitLimits
from klann_ros.log.unfinished import unfinished_runs
from klann_ros.log.writer import RunWriter
from klann_ros.stop_signals import StopSignals
from rclpy.executors import SingleThreadedExecutor
from rclpy.utilities import get_rmw_implementation_identifier
import yaml

from .parameters import declare, Declared, usage
from .process import arguments, command_line, Finish, ProcessNode, run, StartError
from .recorder_services import offer, SERVICES
from .recording_reports import RecordingReports
from .recording_status import RecordingState
from .solver_watch import SolverWatch
from .topic_watch import TopicWatch

TOPICS = (
    'crank_angle',
    'crank_state',
    'joint_states',
    'point_h',
    'velocity_h',
    '*/point_h',
    '*/velocity_h',
    'markers',
    'robot_description',
    '/diagnostics',
)
PARAMETERS = (
    Declared(
        'output', '', 'folder of the run; empty: runs/<UTC time>', constraint='not there yet'
    ),
    Declared('topics', list(TOPICS), 'names of the topics; * stands for anything'),
    Declared('all_topics', False, 'record every topic that is not hidden'),
    Declared('compression', 'zstd', 'of the chunks', choices=tuple(COMPRESSIONS)),
    Declared('flush_period', 0.5, 'a crash costs at most this much [s]', limits=(0.01, 60.0)),
    Declared(
        'max_file_size',
        0,
        'a larger file is finished, and the next one begun [bytes]; 0: no limit',
        limits=(0, 2**62),
    ),
    Declared(
        'max_file_duration',
        0.0,
        'a longer file is finished, and the next one begun [s]; 0: no limit',
        limits=(0.0, 1e9),
        any_number=True,
    ),
    Declared(
        'min_free_space',
        500_000_000,
        'the recording ends when less is free on the disk [bytes]; 0: when it is full',
        limits=(0, 2**62),
    ),
)
# A finished chunk is what a full disk has to have room for yet [bytes].
CHUNK_SIZE = 128 * 1024
# How long the end waits for a solver's parameters that have been asked for [s].
LAST_ANSWERS = 1.0
# Nobody waits for an answer of a recorder: one wake-up for many messages [s]. The queues of its
# subscriptions hold what comes meanwhile up to 100 kHz.
REST = 0.02


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
        self._writer = _open(values)
        for left in unfinished_runs(self._writer.path.parent):
            self.get_logger().warning(f'{left} was not finished; `recover {left}` makes it whole')
        self._background = BackgroundWriter(
            self._writer,
            flush_period=values['flush_period'],
            on_failure=lambda: finish(1),
            limits=SplitLimits(values['max_file_size'], values['max_file_duration']),
            min_free_space=values['min_free_space'],
        )
        self._background.put_entry(_describe_recorder)
        self._pauses = Pauses()
        self._solvers = SolverWatch(self, self._on_solver)
        patterns = ['*'] if values['all_topics'] else self._resolved(values['topics'])
        self._watch = TopicWatch(
            self,
            patterns,
            put=self._background.put,
            pauses=self._pauses,
            solvers=self._solvers,
            reports=RecordingReports(self, self._state),
        )
        offer(self, self._split, self._pause, self._resume)
        self.get_logger().info(f'recording to {self._writer.path}')

    def close(self) -> int:
        """Take what still waits, and finish the run."""
        self._await_answers()
        self._watch.stop()
        self._watch.take_waiting()
        if self._pauses.paused:
            self._resume()
        failure = self._background.close(self._describe_losses)
        counts = self._final_counts()
        written = sum(count.written for count in counts.values())
        lost = sum(count.lost or 0 for count in counts.values())
        said = f'{written} messages of {len(counts)} topics are in {self._writer.path}'
        if failure is None:
            self.get_logger().info(f'{said}; {lost} were lost')
            return 0
        whole = self._writer.failure is None
        how = '' if whole else f'; it was not finished, `recover {self._writer.path}` does that'
        self.get_logger().error(
            f'the recording stopped early: {failure}; {said}, {lost} were lost{how}'
        )
        return 1

    def _await_answers(self) -> None:
        """Let the answers come that explain a run which was stopped early."""
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        end = monotonic() + LAST_ANSWERS
        while self._solvers.waiting and monotonic() < end:
            executor.spin_once(timeout_sec=0.02)
        executor.remove_node(self)

    def _describe_losses(self, writer: RunWriter) -> None:
        writer.add_metadata(LOSS_RECORD, loss_record(self._final_counts()))

    def _final_counts(self) -> dict[str, TopicCount]:
        """Return what became of every message when nothing is queued any more."""
        written, left_out = self._writer.counts, self._pauses.left_out
        return {
            name: TopicCount(
                received=topic.received,
                written=written.get(name, 0),
                dropped=topic.received - left_out[name] - written.get(name, 0),
                left_out=left_out[name],
                unheard=topic.unheard,
            )
            for name, topic in self._watch.topics.items()
        }

    def _state(self) -> RecordingState:
        written, left_out = self._writer.counts, self._pauses.left_out
        failure = self._background.failure
        return RecordingState(
            counts={
                name: TopicCount(
                    received=topic.received,
                    written=written.get(name, 0),
                    dropped=self._background.dropped(name),
                    left_out=left_out[name],
                    unheard=topic.unheard,
                )
                for name, topic in self._watch.topics.items()
            },
            queued=self._background.queued,
            file=str(self._writer.file_path),
            size=self._writer.file_size,
            free=free_space(self._writer.path),
            paused=self._pauses.paused,
            failure='' if failure is None else str(failure),
        )

    def _split(self) -> tuple[bool, str]:
        if self._writer.file_is_empty:
            return False, f'there is no message in {self._writer.file_path.name} yet'
        return True, self._background.split()

    def _pause(self) -> tuple[bool, str]:
        if self._pauses.paused:
            return True, 'it was paused already'
        self._watch.take_waiting()
        self._pauses.begin(time_ns())
        return True, 'paused'

    def _resume(self) -> tuple[bool, str]:
        if not self._pauses.paused:
            return True, 'it was recording already'
        self._pauses.end(time_ns())
        # What was received meanwhile is to be in the record of the pause.
        self._watch.take_waiting()
        record = pause_record(self._pauses.last())
        self._background.put_entry(lambda writer: writer.add_metadata(PAUSE_RECORD, record))
        return True, 'recording again'

    def _resolved(self, names: Sequence[str]) -> list[str]:
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

    def _on_solver(self, solver: SolverParameters) -> None:
        name = f'{solver.node.strip("/").replace("/", "_")}.yaml'
        file = yaml.safe_dump({solver.node: {'ros__parameters': solver.parameters}}).encode()

        def describe(writer: RunWriter) -> None:
            writer.add_metadata(SOLVER_RECORD, solver_record(solver), in_every_file=True)
            writer.attach(name, 'text/yaml', file, solver.time, in_every_file=True)

        self._background.put_entry(describe)


def _default_output() -> str:
    return f'runs/{datetime.now(timezone.utc):%Y-%m-%dT%H-%M-%SZ}'


def _open(values: dict[str, Any]) -> RunWriter:
    output = Path(values['output'] or _default_output()).expanduser()
    try:
        check_free_space(output, values['min_free_space'])
        return RunWriter(
            output, compression=values['compression'], chunk_size=CHUNK_SIZE, reserve=True
        )
    except (LogError, OSError) as error:
        raise StartError(str(error)) from error


def _describe_recorder(writer: RunWriter) -> None:
    writer.add_metadata(
        RECORDER_RECORD,
        {
            'version': __version__,
            'host': platform.node(),
            'system': platform.platform(),
            'python': platform.python_version(),
            'ros_distro': os.environ.get('ROS_DISTRO', 'jazzy'),
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
    parser = command_line(
        'recorder_node',
        'Record the topics of a leg to an MCAP run that survives a crash. Ctrl-C finishes it.',
        f'{usage(PARAMETERS)}\n\n{SERVICES}',
    )
    arguments(parser, argv)
    return run('recorder_node', RecorderNode, argv, stop, lean=True, rest=REST)
