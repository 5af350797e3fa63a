"""`recorder_node`: leg topics in, crash-safe MCAP run out."""

from collections.abc import Sequence
from datetime import datetime, timezone
from fnmatch import fnmatchcase
import os
from pathlib import Path
import platform
from time import monotonic
from typing import Any

from klann_ros import __version__
from klann_ros.log.background_writer import BackgroundWriter
from klann_ros.log.errors import LogError, UnknownTypeError
from klann_ros.log.mcap_file import COMPRESSIONS
from klann_ros.log.run_parameters import (
    LOSS_RECORD,
    loss_record,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
)
from klann_ros.log.writer import RunWriter
from klann_ros.stop_signals import StopSignals
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
import yaml

from .message_types import UnknownMessageTypeError
from .parameters import declare, Declared, usage
from .process import arguments, command_line, Finish, ProcessNode, run, StartError
from .recorded_topic import RecordedTopic
from .solver_watch import SolverWatch

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
)
# How often new topics are looked for [s].
LOOK_PERIOD = 0.1
# How long the end waits for a solver's parameters that have been asked for [s].
LAST_ANSWERS = 1.0


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
        self._patterns = ['*'] if values['all_topics'] else self._resolved(values['topics'])
        self._topics: dict[str, RecordedTopic] = {}
        self._skipped: set[str] = set()
        self._solvers = SolverWatch(self, self._on_solver)
        self._writer = _open(values['output'] or _default_output(), values['compression'])
        self._background = BackgroundWriter(
            self._writer,
            flush_period=values['flush_period'],
            on_failure=lambda: finish(1),
        )
        self._background.put_entry(_describe_recorder)
        self.create_timer(LOOK_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f'recording to {self._writer.path}')

    def close(self) -> int:
        """Take what still waits, and finish the run."""
        self._await_answers()
        for topic in self._topics.values():
            topic.take_waiting()
        self._background.put_entry(self._describe_losses)
        failure = self._background.close()
        received = sum(topic.received for topic in self._topics.values())
        said = (
            f'{received - self._background.dropped} messages of {len(self._topics)} topics are in '
            f'{self._writer.path}'
        )
        if failure is not None:
            self.get_logger().error(
                f'the recording stopped early: {failure}; about {said}, and `recover` finishes it'
            )
            return 1
        lost = sum(topic.loss.lost for topic in self._topics.values())
        self.get_logger().info(f'{said}; {lost + self._background.dropped} were lost')
        return 0

    def _await_answers(self) -> None:
        """Let the answers come that explain a run which was stopped early."""
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        end = monotonic() + LAST_ANSWERS
        while self._solvers.waiting and monotonic() < end:
            executor.spin_once(timeout_sec=0.02)
        executor.remove_node(self)

    def _describe_losses(self, writer: RunWriter) -> None:
        lost = {
            name: None if topic.loss.shared else topic.loss.lost
            for name, topic in self._topics.items()
        }
        writer.add_metadata(LOSS_RECORD, loss_record(lost))

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

    def _look(self) -> None:
        """Subscribe to what has appeared."""
        for name, _ in self.get_topic_names_and_types():
            if name not in self._topics and name not in self._skipped and self._wanted(name):
                self._subscribe(name)
        for name, recorded in self._topics.items():
            if recorded.topic.type == 'sensor_msgs/msg/JointState':
                self._solvers.add(self.get_publishers_info_by_topic(name))
        self._solvers.ask()

    def _wanted(self, name: str) -> bool:
        hidden = any(part.startswith('_') for part in name.split('/'))
        return not hidden and any(fnmatchcase(name, pattern) for pattern in self._patterns)

    def _subscribe(self, name: str) -> None:
        publishers = self.get_publishers_info_by_topic(name)
        if not publishers:
            return
        try:
            self._topics[name] = RecordedTopic(self, name, publishers, self._background.put)
        except (UnknownMessageTypeError, UnknownTypeError) as error:
            self._skipped.add(name)
            self.get_logger().warning(f'{name} is not recorded: {error}')

    def _on_solver(self, solver: SolverParameters) -> None:
        name = f'{solver.node.strip("/").replace("/", "_")}.yaml'
        file = yaml.safe_dump({solver.node: {'ros__parameters': solver.parameters}}).encode()

        def describe(writer: RunWriter) -> None:
            writer.add_metadata(SOLVER_RECORD, solver_record(solver))
            writer.attach(name, 'text/yaml', file, solver.time)

        self._background.put_entry(describe)


def _default_output() -> str:
    return f'runs/{datetime.now(timezone.utc):%Y-%m-%dT%H-%M-%SZ}'


def _open(output: str, compression: str) -> RunWriter:
    try:
        return RunWriter(Path(output).expanduser(), compression=compression)
    except (LogError, OSError) as error:
        raise StartError(str(error)) from error


def _describe_recorder(writer: RunWriter) -> None:
    writer.add_metadata(
        'klann_ros.recorder',
        {
            'version': __version__,
            'host': platform.node(),
            'system': platform.platform(),
            'python': platform.python_version(),
            'ros_distro': os.environ.get('ROS_DISTRO', 'jazzy'),
            'started': datetime.now(timezone.utc).isoformat(),
        },
    )


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = command_line(
        'recorder_node',
        'Record the topics of a leg to an MCAP run that survives a crash. Ctrl-C finishes it.',
        usage(PARAMETERS),
    )
    arguments(parser, argv)
    return run('recorder_node', RecorderNode, argv, stop)
