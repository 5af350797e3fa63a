"""The executor alone, as a loop that may run for days."""

from typing import Any

from rclpy.task import Future


def spin_plain(executor: Any, future: Future) -> None:
    """Let an executor run callbacks until a future is done, or the executor is shut down."""

    def wake(_: Future) -> None:
        executor.wake()

    future.add_done_callback(wake)
    try:
        executor.spin_until_future_complete(_Waitable(future))
    finally:
        future.remove_done_callback(wake)


class _Waitable:
    """
    A future, as an executor may wait for it for days.

    rclpy adds a callback to the future for each thing that it does, and keeps them all: 264 bytes
    each, 2 GB a day at 100 Hz.
    """

    def __init__(self, future: Future) -> None:
        self.done, self.cancelled = future.done, future.cancelled

    def add_done_callback(self, callback: Any) -> None:
        """Do nothing: the caller wakes the executor."""
