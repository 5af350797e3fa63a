"""One process, one node: from the command line to the exit code."""

import argparse
from collections.abc import Callable, Sequence
import gc
import sys
from typing import Protocol

from klann_ros import __version__
from klann_ros.stop_signals import StopSignals
import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos_overriding_options import InvalidQosOverridesError
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from .lean_loop import LeanLoop


class StartError(Exception):
    """What a node cannot start with; its text is the one line that the user reads."""


# What rclpy raises when a node, its parameters, its topics or their overridden QoS make no sense.
START_ERRORS = (
    StartError,
    ParameterException,
    NameValidationException,
    InvalidQosOverridesError,
    RCLError,
    RuntimeError,
    ValueError,
)


class Finish(Protocol):
    """Ends the process, orderly, with an exit code; the first call counts."""

    def __call__(self, code: int = 0) -> None:
        """Ask for the end."""


class ProcessNode(Node):
    """A node that has something to put in order before its process ends."""

    def close(self) -> int:
        """Put it in order; return the exit code."""
        return 0


def command_line(name: str, description: str, epilog: str = '') -> argparse.ArgumentParser:
    """Return the parser of an executable: `--help` and `--version`, arguments to be added."""
    parser = argparse.ArgumentParser(
        prog=name,
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    return parser


def arguments(parser: argparse.ArgumentParser, argv: Sequence[str]) -> argparse.Namespace:
    """Parse what is not meant for ROS."""
    own, _ = split(argv)
    return parser.parse_args(own[1:])


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


def run(
    name: str,
    make_node: Callable[[Finish], Node],
    argv: Sequence[str],
    stop: StopSignals,
    *,
    lean: bool = False,
    rest: float = 0.0,
) -> int:
    """
    Run a node until a signal stops it, or it asks for its end.

    Parameters
    ----------
    name : str
        The executable's name, for messages.
    make_node : callable
        Makes the node; is given what ends the process.
    argv : sequence of str
        The command line, program name first.
    stop : StopSignals
        The process's signals.
    lean : bool
        Whether a LeanLoop runs it: worth it where messages come in, not where timers do the work.
    rest : float
        How long that loop rests after all that waited was taken [s].

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

    try:
        # Signals are this process's own affair: see StopSignals.
        rclpy.init(args=split(argv)[1], signal_handler_options=SignalHandlerOptions.NO)
    except START_ERRORS as error:
        return _refused(name, error)
    try:
        stop.on_stop(finish)
        return _run(name, lambda: make_node(finish), finished, lean=lean, rest=rest)
    finally:
        rclpy.try_shutdown()


def _run(
    name: str, make_node: Callable[[], Node], finished: Future, *, lean: bool, rest: float
) -> int:
    executor = SingleThreadedExecutor()
    try:
        node = make_node()
    except START_ERRORS as error:
        return _refused(name, error)
    try:
        executor.add_node(node)
        # What is there by now stays: the collector need not walk through it again and again.
        gc.freeze()
        spinner = LeanLoop(executor, rest=rest) if lean else executor
        spinner.spin_until_future_complete(finished)
    finally:
        executor.remove_node(node)
        closed = node.close() if isinstance(node, ProcessNode) else 0
        node.destroy_node()
        executor.shutdown()
    return int(finished.result() or closed)


def _refused(name: str, error: Exception) -> int:
    print(f'{name}: {one_line(error)}', file=sys.stderr)
    return 1


def one_line(error: Exception) -> str:
    """Return an error's text on one line, without the places in ROS's C sources."""
    return ' '.join(str(error).split()).partition(', at /')[0]
