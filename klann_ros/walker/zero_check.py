"""
Which crank's zero is wrong, by the tilt of the body while it walks.

For each crank and some offsets of its zero, the attitude that follows from the feet is compared
with the measured one. The mean difference is the slope of the ground. The offset with the least
variance is reported if without an offset the variance is several times larger.
"""

from collections.abc import Sequence
from math import degrees, radians
from typing import NamedTuple

from klann_ros.gait import Feet, stance

# Offsets that are compared, apart from none [rad].
OFFSETS = tuple(0.1 * k for k in range(-6, 7) if k)
# A sample is taken where a crank has turned by this angle [rad].
INTERVAL = 0.3
# Samples that are remembered, that are needed, and over which the same crank is the cause.
MEMORY, LEAST_SAMPLES, CONFIRMATIONS = 60, 30, 32
# Variance without an offset, by that with one: 3.2 to 17 for offsets of 0.3 rad in MuJoCo, 2 to 5
# for 0.1 rad straight on. Where the body tips otherwise than was computed, as on slopes in curves,
# a ratio of 3 is chance; there the variance with any offset is large [rad^2].
GATE, NOISE, LARGE = 2.5, radians(0.3) ** 2, radians(0.8) ** 2
# Where an attitude contradicts a support by more, the feet that carry the body are others [rad].
TOLERANCE = 0.035


class ZeroOffset(NamedTuple):
    """An angle that the encoder of a joint shows too much [rad]."""

    joint: str
    angle: float

    @property
    def text(self) -> str:
        """Return it in words."""
        size = f'{self.angle:+.1f} rad ({degrees(self.angle):+.0f} deg)'
        return f'the zero of {self.joint} is wrong by about {size}: add that to its zero'


class _Differences:
    """The variance of differences of attitudes, roll + j pitch [rad], of the last samples."""

    def __init__(self) -> None:
        self._count, self._mean, self._square = 0, 0j, 0.0

    def add(self, difference: complex) -> None:
        self._count += 1
        share = 1.0 / min(self._count, MEMORY)
        self._mean += share * (difference - self._mean)
        self._square += share * (abs(difference) ** 2 - self._square)

    @property
    def variance(self) -> float:
        return self._square - abs(self._mean) ** 2


class ZeroCheck:
    """Compare measured attitudes of a walker with those for wrong zeros of its cranks."""

    def __init__(self, feet: Feet) -> None:
        self._feet = feet
        self._sampled: Sequence[float] | None = None
        self._count = 0
        # The last cause, and its samples without another one in between.
        self._cause: ZeroOffset | None = None
        self._confirmations = 0
        self._without = _Differences()
        cranks = range(len(feet.joints))
        self._with = {(k, offset): _Differences() for k in cranks for offset in OFFSETS}

    def update(self, cranks: Sequence[float], attitude: tuple[float, float]) -> None:
        """Take angles of the cranks, and roll and pitch of the body [rad]."""
        last = self._sampled or [-INTERVAL - crank for crank in cranks]
        if all(abs(angle - before) < INTERVAL for angle, before in zip(cranks, last, strict=True)):
            return
        self._sampled = cranks
        self._count += 1
        self._compare(self._without, cranks, attitude)
        for (k, offset), differences in self._with.items():
            angles = [*cranks]
            angles[k] -= offset
            self._compare(differences, angles, attitude)
        before, self._cause = self._cause, self._find_cause()
        joint = self._cause and self._cause.joint
        is_same = before is not None and before.joint == joint
        self._confirmations = self._confirmations + 1 if is_same else 0

    def _compare(
        self, differences: _Differences, cranks: Sequence[float], attitude: tuple[float, float]
    ) -> None:
        feet, _, centre = self._feet.at(cranks).tolist()
        rest = stance.support(feet, centre, None, attitude, TOLERANCE)
        if rest is not None:
            differences.add(complex(rest.roll - attitude[0], rest.pitch - attitude[1]))

    @property
    def offset(self) -> ZeroOffset | None:
        """Return the offset that explains the tilt of the body, None without a significant one."""
        return self._cause if self._confirmations >= CONFIRMATIONS else None

    def _find_cause(self) -> ZeroOffset | None:
        variances = {key: differences.variance for key, differences in self._with.items()}
        crank, angle = min(variances, key=variances.__getitem__)
        least, without = variances[crank, angle], self._without.variance
        is_shown = least < LARGE and without > max(NOISE, GATE * least)
        if self._count < LEAST_SAMPLES or not is_shown:
            return None
        return ZeroOffset(self._feet.joints[crank], angle)
