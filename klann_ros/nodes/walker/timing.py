"""When the commands of `walker_node` are due."""

from collections.abc import Callable
from functools import partial
from typing import Any

from klann_ros.nodes.clocks import ControlClock
from klann_ros.nodes.endpoints import create_steady_timer
from klann_ros.nodes.raw_executor import RawCallbackGroup
from rclpy.node import Node

# Period of the watchdog [s]; where feedback drives this part of all commands, no timer does.
WATCH_PERIOD, DRIVEN_RATIO = 0.1, 0.8
# A beat restarts when it is off by this number of periods.
BEAT_RESTART = 10
# A command may be early by this part of a period: feedback jitters.
EARLY = 0.3


class Beat:
    """A mean period [s], kept by events that are frequent enough."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._due_time = 0.0

    def take(self, now: float) -> bool:
        """Return whether the next beat is due at a time [s]; if so, count it."""
        if abs(now - self._due_time) > BEAT_RESTART * self._period:
            self._due_time = now
        if now < self._due_time - EARLY * self._period:
            return False
        self._due_time += self._period
        return True


class CommandPacer:
    """
    Calls `command` with the control time, once a period [s] in the mean.

    Feedback drives it, which is quicker than a timer and costs half as much. Where too little
    feedback arrives, a timer helps.
    """

    def __init__(
        self, node: Node, clock: ControlClock, period: float, command: Callable[[float], None]
    ) -> None:
        self._period = period
        self._command = command
        self._command_beat = Beat(period)
        self._feedback_beat = Beat(period)
        # Beats of the feedback since the last check.
        self._feedback_count = 0
        create_timer = (
            node.create_timer if clock.is_simulated else partial(create_steady_timer, node)
        )
        self._timer: Any = create_timer(
            period, lambda: self._command_if_due(clock.now()), RawCallbackGroup()
        )

    def on_feedback(self, now: float) -> None:
        """Command if a command is due."""
        # Also where the timer was first: or it would go on for ever.
        self._feedback_count += self._feedback_beat.take(now)
        self._command_if_due(now)

    def check_timer(self) -> None:
        """Start or stop the timer; call it once in WATCH_PERIOD."""
        is_driven = self._feedback_count * self._period >= DRIVEN_RATIO * WATCH_PERIOD
        self._feedback_count = 0
        if is_driven and not self._timer.is_canceled():
            self._timer.cancel()
        elif not is_driven and self._timer.is_canceled():
            self._timer.reset()

    def _command_if_due(self, now: float) -> None:
        if self._command_beat.take(now):
            self._command(now)
