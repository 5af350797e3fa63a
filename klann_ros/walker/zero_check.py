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
OFFSETS = tuple(0.1 * tenths for tenths in range(-6, 7) if tenths)
# A sample is taken where a crank has turned by this angle [rad].
INTERVAL = 0.3
# Samples that are remembered, that are needed, and over which the same crank is the cause.
MEMORY, MIN_SAMPLES, CONFIRMATIONS = 60, 30, 32
# Variance without an offset, by that with one: 3.2 to 17 for offsets of 0.3 rad in MuJoCo, 2 to 5
# for 0.1 rad straight on. Where the body tips otherwise than was computed, as on slopes in curves,
# a ratio of 3 is chance; there the variance with any offset is large [rad^2].
GATE, NOISE, MAX_VARIANCE = 2.5, radians(0.3) ** 2, radians(0.8) ** 2
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
        self._count = 0
        self._mean = 0j
        self._square = 0.0

    def add(self, difference: complex) -> None:
        self._count += 1
        gain = 1.0 / min(self._count, MEMORY)
        self._mean += gain * (difference - self._mean)
        self._square += gain * (abs(difference) ** 2 - self._square)

    @property
    def variance(self) -> float:
        return self._square - abs(self._mean) ** 2


class ZeroCheck:
    """Compare measured attitudes of a walker with those for wrong zeros of its cranks."""

    def __init__(self, feet: Feet) -> None:
        self._feet = feet
        # The cranks at the last sample [rad], and the number of samples.
        self._sampled: Sequence[float] | None = None
        self._count = 0
        # The last cause, and its samples without another one in between.
        self._cause: ZeroOffset | None = None
        self._confirmations = 0
        # Differences without an offset, and by the index of a crank and its offset [rad].
        self._without = _Differences()
        cranks = range(len(feet.joints))
        self._with = {(crank, offset): _Differences() for crank in cranks for offset in OFFSETS}

    def update(self, cranks: Sequence[float], attitude: tuple[float, float]) -> None:
        """Take angles of the cranks, and roll and pitch of the body [rad]."""
        last = self._sampled
        if last and max(abs(a - b) for a, b in zip(cranks, last, strict=True)) < INTERVAL:
            return
        self._sampled = cranks
        self._count += 1
        self._compare(self._without, cranks, attitude)
        for (crank, offset), differences in self._with.items():
            angles = [*cranks]
            angles[crank] -= offset
            self._compare(differences, angles, attitude)
        last_cause, self._cause = self._cause, self._find_cause()
        is_same = bool(self._cause and last_cause and last_cause.joint == self._cause.joint)
        self._confirmations = self._confirmations + 1 if is_same else 0

    def _compare(
        self, differences: _Differences, cranks: Sequence[float], attitude: tuple[float, float]
    ) -> None:
        feet, _, centre = self._feet.at(cranks).tolist()
        support = stance.support(feet, centre, None, attitude, TOLERANCE)
        if support is not None:
            differences.add(complex(support.roll - attitude[0], support.pitch - attitude[1]))

    @property
    def offset(self) -> ZeroOffset | None:
        """Return the offset that explains the tilt of the body, None without a significant one."""
        return self._cause if self._confirmations >= CONFIRMATIONS else None

    @property
    def problem(self) -> str:
        """Return the offset in words, '' without one."""
        return self.offset.text if self.offset else ''

    def _find_cause(self) -> ZeroOffset | None:
        variances = {key: differences.variance for key, differences in self._with.items()}
        crank, angle = min(variances, key=variances.__getitem__)
        variance, without = variances[crank, angle], self._without.variance
        is_significant = variance < MAX_VARIANCE and without > max(NOISE, GATE * variance)
        if self._count < MIN_SAMPLES or not is_significant:
            return None
        return ZeroOffset(self._feet.joints[crank], angle)
