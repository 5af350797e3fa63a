"""`recorder_node`: leg topics in, crash-safe MCAP run out."""

from collections.abc import Sequence
from datetime import datetime, timezone
from functools import partial
from importlib.metadata import PackageNotFoundError, version
import os
from pathlib import Path
import platform
from time import monotonic, time_ns
from typing import Any

from klann_ros import __version__
from klann_ros.log.errors import LogError
from klann_ros.log.run_parameters import (
    RECORDER_RECORD,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
)
from klann_ros.log.writing.background_writer import BackgroundWriter, SplitLimits
from klann_ros.log.writing.disk_space import check_free_space
from klann_ros.log.writing.file_watch import Faults
from klann_ros.log.writing.recording import Pauses, RecordingSession
from klann_ros.log.writing.unfinished import remove_old_reserves, unfinished_runs
from klann_ros.log.writing.writer import RunWriter
from klann_ros.nodes.endpoints import create_trigger
from klann_ros.nodes.parameters import declare, StartError, usage
from klann_ros.nodes.process import arguments, command_line, Finish, ProcessNode, run, spin_on
from klann_ros.stop_signals import StopSignals
from klann_ros.untrusted.text import printable
from rclpy.executors import SingleThreadedExecutor
from rclpy.utilities import get_rmw_implementation_identifier
import yaml

from .interface import PARAMETERS, RecordingDiagnostics, SERVICES
from .solver_watch import SolverWatch
from .topic_watch import TopicWatch

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
        teller = self.get_logger()
        self._writer = _open(values, Faults(error=teller.error, warning=teller.warning))
        remove_old_reserves(self._writer.path.parent)
        for left in unfinished_runs(self._writer.path.parent):
            name = printable(left)
            teller.warning(f'{name} was not finished; `recover {name}` makes it whole')
        self._background = BackgroundWriter(
            self._writer,
            flush_period=values['flush_period'],
            on_failure=lambda: finish(1),
            limits=SplitLimits(values['max_file_size'], values['max_file_duration']),
            min_free_space=values['min_free_space'],
        )
        self._background.put_entry(_describe_recorder)
        self._pauses = Pauses(self._background.ledger)
        self._solvers = SolverWatch(
            self, lambda solver: self._background.put_entry(partial(_describe_solver, solver))
        )
        self._diagnostics = RecordingDiagnostics(self)
        self._watch = TopicWatch(
            self,
            ['*'] if values['all_topics'] else self._full_names(values['topics']),
            put=self._background.put,
            ledger=self._background.ledger,
            pauses=self._pauses,
            solvers=self._solvers,
            diagnostics=self._diagnostics,
        )
        self._recording = RecordingSession(self._writer, self._background, self._pauses)
        self._diagnostics.start(self._recording.state)
        create_trigger(self, 'split', self._recording.split)
        create_trigger(self, 'pause', self._pause)
        create_trigger(self, 'resume', self._resume)
        teller.info(f'recording to {printable(self._writer.path)}')

    def close(self) -> int:
        """Take what still waits, and finish the run."""
        self._await_answers()
        self._watch.stop()
        self._watch.take_queued()
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
        return True, 'paused'

    def _resume(self) -> tuple[bool, str]:
        if not self._pauses.paused:
            return True, 'it was recording already'
        self._pauses.end(time_ns())
        # What was received meanwhile is to be in the record of the pause.
        self._watch.take_queued()
        self._recording.describe_pause()
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


def _default_output() -> str:
    return f'runs/{datetime.now(timezone.utc):%Y-%m-%dT%H-%M-%SZ}'


def _open(values: dict[str, Any], faults: Faults) -> RunWriter:
    output = Path(values['output'] or _default_output()).expanduser()
    try:
        check_free_space(output, values['min_free_space'])
        return RunWriter(
            output,
            compression=values['compression'],
            chunk_size=CHUNK_SIZE,
            reserve=True,
            faults=faults,
        )
    except (LogError, OSError) as error:
        raise StartError(str(error)) from error


def _describe_recorder(run: RunWriter) -> None:
    """Write which versions of what record, and where."""
    run.add_metadata(
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


def _describe_solver(solver: SolverParameters, run: RunWriter) -> None:
    """Write a solver's parameters: as a record, and as the file that starts it so again."""
    name = f'{solver.node.strip("/").replace("/", "_")}.yaml'
    file = yaml.safe_dump({solver.node: {'ros__parameters': solver.parameters}}).encode()
    run.add_metadata(SOLVER_RECORD, solver_record(solver), in_every_file=True)
    run.attach(name, 'text/yaml', file, solver.time, in_every_file=True)


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
        f'{usage({"": PARAMETERS})}\n\n{SERVICES}',
    )
    arguments(parser, argv)
    return run('recorder_node', RecorderNode, argv, stop, lean=True, rest=REST)
