"""
Drives: the crank or the walk that a page controls, with a client watchdog.

A drive belongs to one page at a time. A page that sends nothing for CLIENT_TIMEOUT loses it: a
closed page, a suspended machine, a broken connection, a stalled server. Times are arguments, so
nothing here needs ROS or waits.
"""

from dataclasses import dataclass
from math import isfinite

# Pages send a keep-alive ten times a second [s].
CLIENT_TIMEOUT = 0.35
# Limits of manual driving [rad/s], [m/s], [rad/s].
MAX_CRANK_RATE = 40.0
MAX_WALK_SPEED = 1.0
MAX_TURN_RATE = 3.0
# The largest crank angle that a solver accepts [rad].
_MAX_ANGLE = 1e6


class DriveError(Exception):
    """A refused drive command; the text says why."""


@dataclass
class _Drive:
    """A drive: the page that controls it, and the time of the page's last message [s]."""

    owner: int | None = None
    alive_at: float = 0.0

    def is_lost(self, now: float) -> bool:
        """Return whether its page has timed out."""
        return self.owner is not None and now - self.alive_at > CLIENT_TIMEOUT


@dataclass
class LiveCrankDrive(_Drive):
    """A crank driven by a page: to an angle by a slider, or at a speed."""

    # The published angle [rad], its rate [rad/s] and its time [s].
    angle: float = 0.0
    speed: float = 0.0
    _angle_time: float = 0.0

    def take(self, owner: int, now: float, angle: float) -> None:
        """Give control to a page, at the current crank angle."""
        self.owner = owner
        self.angle = angle
        self.speed = 0.0
        self.alive_at = now
        self._angle_time = now

    def turn_to(self, angle: float, now: float) -> None:
        """Turn to an angle, and stay there; a DriveError for an invalid one."""
        if not isfinite(angle) or abs(angle) > _MAX_ANGLE:
            raise DriveError(f'a crank angle is within +-{_MAX_ANGLE:g} rad')
        self.angle = angle
        self.speed = 0.0
        self._angle_time = now

    def spin(self, speed: float, now: float) -> None:
        """Turn at a constant rate; a DriveError beyond the limit."""
        if not isfinite(speed) or abs(speed) > MAX_CRANK_RATE:
            raise DriveError(f'the crank turns at {MAX_CRANK_RATE:g} rad/s at most')
        self.advance(now)
        self.speed = speed

    def advance(self, now: float) -> float:
        """Return the angle at a time [rad]."""
        if self.speed:
            self.angle += self.speed * (now - self._angle_time)
        self._angle_time = now
        return self.angle


@dataclass
class WalkDrive(_Drive):
    """A walker that a page steers."""

    # Velocities [m/s], [rad/s].
    forward: float = 0.0
    turn: float = 0.0

    def take(self, owner: int, now: float, _: float = 0.0) -> None:
        """Give control to a page, at rest."""
        self.owner = owner
        self.forward = 0.0
        self.turn = 0.0
        self.alive_at = now

    def walk(self, forward: float, turn: float) -> None:
        """Walk at a constant velocity; a DriveError beyond the limits."""
        if not (abs(forward) <= MAX_WALK_SPEED and abs(turn) <= MAX_TURN_RATE):
            raise DriveError(
                f'at most {MAX_WALK_SPEED:g} m/s and {MAX_TURN_RATE:g} rad/s are walked from here'
            )
        self.forward = forward
        self.turn = turn


def crank_at(alpha: float, direction: float, phase: float) -> float:
    """Return the crank's angle where a leg's is alpha = direction * crank + phase [rad]."""
    angle = (alpha - phase) / direction if direction else alpha
    return angle if isfinite(angle) and abs(angle) <= _MAX_ANGLE else 0.0
