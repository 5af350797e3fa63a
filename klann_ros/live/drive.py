"""
Drives: the crank or the walk that a page controls, with a client watchdog.

A drive belongs to one page at a time. A page that sends nothing for CLIENT_TIMEOUT loses it, for
whatever reason: a closed page, a sleeping machine, a cable, a stalled server. Times are arguments:
nothing here knows ROS or waits.
"""

from dataclasses import dataclass
from math import isfinite

# Pages send a keep-alive ten times a second [s].
CLIENT_TIMEOUT = 0.35
# Limits of manual driving [rad/s], [m/s], [rad/s].
FASTEST_CRANK = 40.0
FASTEST_WALK = 1.0
FASTEST_TURN = 3.0
# A crank angle that a solver still takes [rad].
_LARGEST_ANGLE = 1e6


class DriveError(Exception):
    """A refused drive command; the text says why."""


@dataclass
class CrankDrive:
    """A crank driven by a page: to an angle by a slider, or at a speed."""

    # The page that has it.
    owner: int | None = None
    # The published angle [rad] and its rate [rad/s].
    angle: float = 0.0
    speed: float = 0.0
    # When the page was heard of last [s].
    alive_at: float = 0.0
    _turned: float = 0.0

    def take(self, owner: int, now: float, angle: float) -> None:
        """Give it to a page, at the angle where the crank is."""
        self.owner, self.angle, self.speed = owner, angle, 0.0
        self.alive_at = self._turned = now

    def turn_to(self, angle: float, now: float) -> None:
        """
        Turn to an angle, and stay there.

        Raises
        ------
        DriveError
            It is no crank angle.

        """
        if not isfinite(angle) or abs(angle) > _LARGEST_ANGLE:
            raise DriveError(f'a crank angle is within +-{_LARGEST_ANGLE:g} rad')
        self.angle, self.speed, self._turned = angle, 0.0, now

    def spin(self, speed: float, now: float) -> None:
        """
        Turn on and on.

        Raises
        ------
        DriveError
            It is too fast.

        """
        if not isfinite(speed) or abs(speed) > FASTEST_CRANK:
            raise DriveError(f'the crank turns at {FASTEST_CRANK:g} rad/s at most')
        self.advance(now)
        self.speed = speed

    def advance(self, now: float) -> float:
        """Return the angle at a time [rad]."""
        if self.speed:
            self.angle += self.speed * (now - self._turned)
        self._turned = now
        return self.angle

    def is_lost(self, now: float) -> bool:
        """Return whether its page was not heard of for too long."""
        return self.owner is not None and now - self.alive_at > CLIENT_TIMEOUT


@dataclass
class WalkDrive:
    """A walker that a page steers."""

    # The page that has it.
    owner: int | None = None
    # Velocities [m/s], [rad/s].
    forward: float = 0.0
    turn: float = 0.0
    # When the page was heard of last [s].
    alive_at: float = 0.0

    def take(self, owner: int, now: float, _: float = 0.0) -> None:
        """Give it to a page, at rest."""
        self.owner, self.forward, self.turn, self.alive_at = owner, 0.0, 0.0, now

    def walk(self, forward: float, turn: float) -> None:
        """
        Walk on and on.

        Raises
        ------
        DriveError
            It is too fast.

        """
        if not (abs(forward) <= FASTEST_WALK and abs(turn) <= FASTEST_TURN):
            raise DriveError(
                f'at most {FASTEST_WALK:g} m/s and {FASTEST_TURN:g} rad/s are walked from here'
            )
        self.forward, self.turn = forward, turn

    def is_lost(self, now: float) -> bool:
        """Return whether its page was not heard of for too long."""
        return self.owner is not None and now - self.alive_at > CLIENT_TIMEOUT


def crank_at(alpha: float, direction: float, phase: float) -> float:
    """Return the crank's angle where a leg's is alpha = direction * crank + phase [rad]."""
    crank = (alpha - phase) / direction if direction else alpha
    return crank if isfinite(crank) and abs(crank) <= _LARGEST_ANGLE else 0.0
