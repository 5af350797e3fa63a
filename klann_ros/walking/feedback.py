"""What the cranks' encoders say: held against what cranks can do, and watched for silence."""

from dataclasses import dataclass, field
from math import isfinite, nan

from klann_ros.kinematics.angles import TURN

# Angles beyond this are no crank's [rad].
LARGEST = 1e6
# Beyond what its greatest rate would have turned it a crank may be off by this [rad], ...
SLACK = 0.1
# ... and a time between two messages is never less than this [s]: stamps and transport jitter.
SHORTEST = 0.02
# A rate beyond this many times what it can turn at is none.
FASTEST = 10.0
# A jump is believed after so many readings in a row that agree with each other.
BELIEVED = 5


@dataclass
class CrankFeedback:
    """
    A crank as its encoder tells it.

    Parameters
    ----------
    joint : str
        Its name.
    max_rate : float
        What it can turn at [rad/s].

    Attributes
    ----------
    position : float
        The last angle that is believed, without the encoder's whole turns [rad]; NaN before the
        first.
    velocity : float
        The rate that it told, or else that from angle to angle [rad/s].
    at : float
        When [s].
    rejected, jumps, believed : int
        Readings that were no angles; times that it jumped, and that it stayed there.
    jumped_by : float
        By how much it jumped last [rad].

    """

    joint: str
    max_rate: float
    position: float = nan
    velocity: float = 0.0
    at: float = nan
    rejected: int = 0
    jumps: int = 0
    believed: int = 0
    jumped_by: float = 0.0
    _turns: float = field(default=0.0, repr=False)
    _doubted: list[float] = field(default_factory=list, repr=False)

    @property
    def is_known(self) -> bool:
        """Return whether it was ever heard of."""
        return isfinite(self.position)

    def age(self, now: float) -> float:
        """Return for how long it is silent [s]; infinite before the first reading."""
        return now - self.at if self.is_known else float('inf')

    def read(self, position: float, velocity: float | None, at: float) -> bool:
        """
        Take a reading; return whether the crank was seen to jump just now.

        Parameters
        ----------
        position : float
            What the encoder says [rad].
        velocity : float or None
            The rate that it tells [rad/s].
        at : float
            When [s].

        """
        if not (isfinite(position) and abs(position) <= LARGEST):
            self.rejected += 1
            return False
        if not self.is_known:
            self._take(position, velocity, at)
            return False
        # An encoder that begins anew after a turn has not moved the crank.
        unwrapped = position + self._turns
        whole = round((unwrapped - self.position) / TURN) * TURN
        step = unwrapped - whole - self.position
        possible = 1.5 * self.max_rate * max(at - self.at, SHORTEST) + SLACK
        if abs(unwrapped - self.position) <= possible:
            whole, step = 0.0, unwrapped - self.position
        if abs(step) <= possible:
            self._doubted.clear()
            self._turns -= whole
            self._take(position + self._turns, velocity, at)
            return False
        return self._doubt(position, velocity, at, possible)

    def _doubt(self, position: float, velocity: float | None, at: float, possible: float) -> bool:
        """Wait whether an impossible angle is told again; if so, it is where the crank is."""
        if self._doubted and abs(position - self._doubted[-1]) > possible:
            self._doubted.clear()
        if not self._doubted:
            self.jumps += 1
        self._doubted.append(position)
        if len(self._doubted) < BELIEVED:
            return False
        self._doubted.clear()
        unwrapped = position + self._turns
        self._turns -= round((unwrapped - self.position) / TURN) * TURN
        self.jumped_by = position + self._turns - self.position
        self.believed += 1
        # No rate follows from a jump.
        self.at = nan
        self._take(position + self._turns, velocity, at)
        return True

    def _take(self, position: float, velocity: float | None, at: float) -> None:
        # What no crank can turn at, infinity included, is no rate; NaN compares with nothing.
        if velocity is not None and abs(velocity) <= FASTEST * self.max_rate:
            self.velocity = velocity
        elif at > self.at:
            self.velocity = (position - self.position) / (at - self.at)
        self.position, self.at = position, at
