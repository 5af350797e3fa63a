"""Spinning for days, whatever the network sends: nothing piles up, and no message is the end."""

from collections.abc import Callable
from pathlib import Path
import traceback
from typing import Any

from klann_ros.untrusted.text import printable
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future

# How often a failed callback is logged at most [s].
THROTTLE = 2.0


def spin_plain(executor: Any, future: Future) -> None:
    """Let an executor run callbacks until a future is done, or the executor is shut down."""

    def wake(_: Future) -> None:
        executor.wake()

    future.add_done_callback(wake)
    try:
        executor.spin_until_future_complete(_Awaited(future))
    finally:
        future.remove_done_callback(wake)


def spin_on(spin: Callable[[], None], node: Node) -> None:
    """
    Spin, and go on after a callback has failed, which is logged.

    rclpy itself raises for messages that anybody may send: a parameter of an unknown type, a clock
    before 1970. Nobody's message may end a node that turns a leg or records a run.

    Parameters
    ----------
    spin : callable
        Runs callbacks until all ends; raises what they raise.
    node : rclpy.node.Node
        Whose callbacks they are.

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
            f'a callback failed, and the node goes on: {described(error)}',
            throttle_duration_sec=THROTTLE,
        )
        return False
    return True


def described(error: Exception) -> str:
    """Return on one line what an error says, and where it was raised."""
    *_, last = traceback.extract_tb(error.__traceback__)
    place = f'{Path(last.filename).name}:{last.lineno}'
    return f'{type(error).__name__}: {printable(error)} ({place})'


class _Awaited:
    """
    A future, as an executor may wait for it for days.

    rclpy adds a callback to the future for each thing that it does, and keeps them all: 264 bytes
    each, 2 GB a day at 100 Hz.
    """

    def __init__(self, future: Future) -> None:
        self.done, self.cancelled = future.done, future.cancelled

    def add_done_callback(self, callback: Any) -> None:
        """Do without: whoever made this wakes the executor."""
