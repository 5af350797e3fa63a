"""
Which crank's zero is wrong, by the tilt of the body while it walks.

For each crank and some offsets of its zero, the attitude that follows from the feet is compared
with the measured one. The mean difference is the slope of the ground. The offset with the least
variance is reported if without an offset the variance is several times larger.
"""

from collections.abc import Sequence
from itertools import combinations
from math import degrees, isnan, radians
from typing import NamedTuple

from klann_ros.gait import Feet
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
import numpy as np

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
# Tolerances of rounding: relative area of a vertical facet; load shares and positions [m].
FLAT, ROUNDING = 1e-9, 1e-12


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
        # The offsets of all cranks in each of these cases, the one without offset first [rad].
        self._offsets = np.zeros((1 + len(self._with), len(feet.joints)))
        for case, (crank, offset) in enumerate(self._with, start=1):
            self._offsets[case, crank] = offset

    def update(self, cranks: Sequence[float], attitude: tuple[float, float]) -> None:
        """Take angles of the cranks, and roll and pitch of the body [rad]."""
        last = self._sampled
        if last and max(abs(a - b) for a, b in zip(cranks, last, strict=True)) < INTERVAL:
            return
        self._sampled = cranks
        self._count += 1
        feet, _, centres = self._feet.at(np.array(cranks) - self._offsets)
        measured = complex(*attitude)
        nearest = _nearest_attitudes(feet, centres, measured).tolist()
        for differences, expected in zip(
            (self._without, *self._with.values()), nearest, strict=True
        ):
            if not isnan(expected.real):
                differences.add(expected - measured)
        last_cause, self._cause = self._cause, self._find_cause()
        is_same = bool(self._cause and last_cause and last_cause.joint == self._cause.joint)
        self._confirmations = self._confirmations + 1 if is_same else 0

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


def _nearest_attitudes(feet: FloatArray, centres: FloatArray, measured: complex) -> ComplexArray:
    """
    Return how bodies rest on their feet: roll + j pitch [rad], NaN where they do not.

    Of several facets of the feet of a body the one nearest to the measured attitude counts. This
    is `stance.support` for many bodies at once: feet (k, n, 3) and centres of mass (k, 3) [m].
    """
    facets = list(combinations(range(feet.shape[1]), 3))
    a, b, c = np.moveaxis(feet[:, facets], 2, 0)
    u, v = b - a, c - a
    normals = np.cross(u, v)
    nz = normals[..., 2]
    is_facet = np.abs(nz) > FLAT * (u[..., :2] ** 2 + v[..., :2] ** 2).sum(axis=-1)
    with np.errstate(divide='ignore', invalid='ignore'):
        upwards = normals / np.copysign(np.linalg.norm(normals, axis=-1), nz)[..., None]
        from_corner = centres[:, None] - a
        above = (from_corner * upwards).sum(axis=-1, keepdims=True)
        px, py, _ = np.moveaxis(from_corner - above * upwards, -1, 0)
        shares_b = (px * v[..., 1] - py * v[..., 0]) / nz
        shares_c = (py * u[..., 0] - px * u[..., 1]) / nz
    shares = np.minimum(np.minimum(shares_b, shares_c), 1.0 - shares_b - shares_c)
    lowest = np.einsum('kni,kfi->kfn', feet, upwards).min(axis=-1) - (a * upwards).sum(axis=-1)
    is_support = is_facet & (shares >= -ROUNDING) & (lowest >= -ROUNDING)
    rolls = np.arctan2(upwards[..., 1], upwards[..., 2])
    pitches = -np.arcsin(upwards[..., 0])
    attitudes = np.where(is_support, rolls + 1j * pitches, np.nan)
    distances = np.where(is_support, np.abs(attitudes - measured), np.inf)
    nearest: ComplexArray = np.take_along_axis(
        attitudes, distances.argmin(axis=1, keepdims=True), axis=1
    )
    return nearest[:, 0]
