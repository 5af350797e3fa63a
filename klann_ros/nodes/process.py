"""One process, one node: from the command line to the exit code."""

import argparse
from collections.abc import Callable, Sequence
from functools import partial
import gc
from pathlib import Path
import sys
import traceback
from typing import Protocol

from klann_ros.sanitize.text import printable, printable_line
from klann_ros.sanitize.units import report_unit_warnings
from klann_ros.stop_signals import StopSignals
import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from .parameters import prepare_sets, StartError
from .raw_executor import RawMessageExecutor
from .unused_arguments import unreadable_params_file, unused_arguments

# Arguments for ROS before which users forget --ros-args.
_ROS_FLAGS = ('-p', '--param', '--params-file', '-r', '--remap', '--log-level', '-e', '--enclave')
# Errors of rclpy about a topic or its quality of service.
ROS_ERRORS = (NameValidationException, RCLError, RuntimeError, ValueError)
# And about a node or its parameters.
_START_ERRORS = (StartError, ParameterException, *ROS_ERRORS)
# ROS writes its log files there, and does not start where it cannot.
_LOG_FOLDER_REMEDY = 'set ROS_LOG_DIR (or HOME) to a folder that can be written'
# Period of repeated warnings and errors in the log [s].
LOG_PERIOD = 2.0


class Finish(Protocol):
    """Ends the process, orderly, with an exit code; the first call counts."""

    def __call__(self, code: int = 0) -> None:
        """Request the end."""


class ProcessNode(Node):
    """A node with an orderly shutdown."""

    def close(self) -> int:
        """Shut down before the process ends; return the exit code."""
        return 0


def arguments(parser: argparse.ArgumentParser, argv: Sequence[str]) -> argparse.Namespace:
    """Parse the arguments outside --ros-args."""
    own, _ = split(argv)
    options, rest = parser.parse_known_args(own[1:])
    if rest:
        parser.error(f'unrecognized arguments: {printable(" ".join(rest))}{_hint(rest)}')
    return options


def split(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """
    Return a command line's own arguments, and those meant for ROS: from --ros-args to --.

    ROS's own function would take every OLD:=NEW for a remapping, in an old syntax of its own.
    """
    own: list[str] = []
    ros: list[str] = []
    for_ros = False
    for argument in argv:
        for_ros = for_ros or argument == '--ros-args'
        (ros if for_ros else own).append(argument)
        for_ros = for_ros and argument != '--'
    return own, ros


def _hint(rest: Sequence[str]) -> str:
    """Return a hint about arguments that look like ROS's."""
    if any(argument in _ROS_FLAGS or ':=' in argument for argument in rest):
        return '; arguments for ROS go behind --ros-args'
    if any(argument.endswith(('.yaml', '.yml')) for argument in rest):
        return '; a parameter file is given as --ros-args --params-file FILE'
    return ''


def run(
    name: str,
    make_node: Callable[[Finish], Node],
    argv: Sequence[str],
    stop: StopSignals,
    *,
    raw: bool = False,
    batch_period: float = 0.0,
) -> int:
    """
    Run a node until a signal stops it, or it requests its end.

    Parameters
    ----------
    name : str
        The executable's name, for messages.
    make_node : callable
        Makes the node from the function that ends the process.
    argv : sequence of str
        The command line, program name first.
    stop : StopSignals
        The process's signals.
    raw : bool
        Whether a RawMessageExecutor runs it: for nodes driven by messages, not timers.
    batch_period : float
        Batching delay of that executor after its queues are drained [s].

    Returns
    -------
    int
        The exit code: 0 after a signal, 1 for a node that cannot start, else the node's own.

    """
    # Made before the node, so that a signal during start-up is an orderly end as well.
    finished = Future()

    def finish(code: int = 0) -> None:
        if not finished.done():
            finished.set_result(code)

    for_ros = split(argv)[1]
    unreadable = unreadable_params_file(for_ros)
    if unreadable:
        return _refuse(name, StartError(unreadable))
    try:
        # StopSignals handles them.
        rclpy.init(args=for_ros, signal_handler_options=SignalHandlerOptions.NO)
    except UnknownROSArgsError as error:
        known = '-p NAME:=VALUE, --params-file FILE, -r OLD:=NEW, --log-level LEVEL'
        return _refuse(name, StartError(f'unknown arguments for ROS {error}; it takes {known}'))
    except _START_ERRORS as error:
        if 'log directory' in str(error):
            error = StartError(f'{ros_error(error)}; {_LOG_FOLDER_REMEDY}')
        return _refuse(name, error)
    try:
        stop.on_stop(finish)
        report_unit_warnings(lambda text: get_logger(name).warning(text))
        try:
            node = make_node(finish)
        except _START_ERRORS as error:
            return _refuse(name, error)
        closed = _spin(name, node, finished, for_ros, raw=raw, batch_period=batch_period)
        return int(finished.result() or closed)
    finally:
        rclpy.try_shutdown()


def _spin(
    name: str,
    node: Node,
    finished: Future,
    for_ros: Sequence[str],
    *,
    raw: bool,
    batch_period: float,
) -> int:
    """Run a node until its end; return the exit code of its shutdown."""
    executor = SingleThreadedExecutor()
    try:
        prepare_sets(node, name)
        for warning in unused_arguments(node, name, for_ros):
            node.get_logger().warning(warning)
        executor.add_node(node)
        # These objects stay: the garbage collector need not scan them again.
        gc.freeze()
        loop = RawMessageExecutor(executor, plain=not raw, batch_period=batch_period)
        spin_on(partial(loop.spin_until_future_complete, finished), node)
    finally:
        executor.remove_node(node)
        closed = node.close() if isinstance(node, ProcessNode) else 0
        node.destroy_node()
        executor.shutdown()
    return closed


def _refuse(name: str, error: Exception) -> int:
    print(f'{name}: {ros_error(error)}', file=sys.stderr)
    return 1


def ros_error(error: Exception) -> str:
    """Return an error's text on one line, without the places in ROS's C sources."""
    return printable_line(error).partition(', at /')[0]


def spin_on(spin: Callable[[], None], node: Node) -> None:
    """
    Call `spin`, and again after a callback has failed, which is logged.

    rclpy itself raises for messages of any sender: a parameter of an unknown type, a clock before
    1970. No message may end a node that turns a leg or records a run.
    """
    while not _has_ended(spin, node):
        pass


def _has_ended(spin: Callable[[], None], node: Node) -> bool:
    try:
        spin()
    except ExternalShutdownException:
        raise
    except Exception as error:
        node.get_logger().error(
            f'a callback failed, and the node goes on: {error_and_place(error)}',
            throttle_duration_sec=LOG_PERIOD,
        )
        return False
    return True


def error_and_place(error: Exception) -> str:
    """Return an error and its place in the source on one line."""
    *_, last = traceback.extract_tb(error.__traceback__)
    place = f'{Path(last.filename).name}:{last.lineno}'
    return f'{type(error).__name__}: {printable(error)} ({place})'
