"""Measurements of a leg: points, angles and distances, each with the crank angle at its time."""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, TypeAlias

from klann_ros.kinematics import Linkage
from klann_ros.kinematics.arrays import FloatArray, with_short_repr
from klann_ros.sanitize.text import did_you_mean, printable
import numpy as np

Kind: TypeAlias = Literal['point', 'angle', 'distance']
# A crank sample that is further away than this times the usual period is a gap.
MAX_GAP_PERIODS = 5.0
# Crank samples between which it is interpolated are at most this far apart [rad].
MAX_CRANK_STEP = 0.5


class MeasurementError(ValueError):
    """Measurements that no calibration can use; the text says why."""


@with_short_repr
class CrankSamples(NamedTuple):
    """The crank joint's position over time, shape (n,)."""

    times: FloatArray  # rising stamps [s]
    positions: FloatArray  # any number of turns [rad]

    @classmethod
    def of(cls, times: FloatArray, positions: FloatArray) -> 'CrankSamples':
        """Return samples in the order of time, each stamp once, without NaN, unwrapped."""
        times, columns = _cleaned(times, positions[:, None])
        return cls(times, np.unwrap(columns[:, 0]))

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions [rad] and rates [rad/s], shape (n,); NaN in gaps and beyond."""
        if len(self.times) < 2:
            return np.full(len(times), np.nan), np.full(len(times), np.nan)
        right = np.searchsorted(self.times, times).clip(1, len(self.times) - 1)
        t_0, t_1 = self.times[right - 1], self.times[right]
        x_0, x_1 = self.positions[right - 1], self.positions[right]
        max_gap = MAX_GAP_PERIODS * float(np.median(np.diff(self.times)))
        is_missing = (t_1 - t_0 > max_gap) | (np.abs(x_1 - x_0) > MAX_CRANK_STEP)
        # A period beyond the ends is extrapolated: cameras and encoders do not stop together.
        is_missing |= (times < t_0 - max_gap / 5.0) | (times > t_1 + max_gap / 5.0)
        positions = x_0 + (x_1 - x_0) / (t_1 - t_0) * (times - t_0)
        # Central differences: the rate at a sample, not before it.
        rates = np.interp(times, self.times, np.gradient(self.positions, self.times))
        return np.where(is_missing, np.nan, positions), np.where(is_missing, np.nan, rates)


@with_short_repr
@dataclass(frozen=True, eq=False)
class MeasuredSeries:
    """
    Samples of one measured quantity: a point, an angle or a distance.

    `name` is a point, a body's angle or distance, or the distance of two points: 'H', 'theta',
    'A-H'. At the stamps `times`, shape (n,) [s], `values` are positions in the leg's plane or the
    camera's, shape (n, 2) [m], angles [rad] or distances [m], shape (n, 1); `crank` and `rate` are
    those of the crank joint, shape (n,) [rad, rad/s]. `noise` is the standard deviation of each
    number, if it is known [m, rad], `source` such as a topic, and `skipped` the number of samples
    that were left out: not finite, repeated, or without a crank angle.
    """

    kind: Kind
    name: str
    times: FloatArray
    values: FloatArray
    crank: FloatArray
    rate: FloatArray
    noise: float | None = None
    source: str = ''
    skipped: int = 0

    @property
    def title(self) -> str:
        """Return its name for users, such as 'point H'."""
        return f'{self.kind} {self.name}'


def series_of(
    kind: Kind,
    name: str,
    times: FloatArray,
    values: FloatArray,
    crank: CrankSamples,
    *,
    noise: float | None = None,
    source: str = '',
) -> MeasuredSeries:
    """
    Return samples paired with the crank angle by their stamps; those without one are skipped.

    The others are the attributes of `MeasuredSeries`; stamps of one clock, in any order.
    """
    stamps, numbers = _cleaned(times, values)
    positions, rates = crank.at(stamps)
    is_paired = np.isfinite(positions)
    return MeasuredSeries(
        kind,
        name,
        stamps[is_paired],
        numbers[is_paired],
        positions[is_paired],
        rates[is_paired],
        noise=noise,
        source=source,
        skipped=len(times) - int(np.count_nonzero(is_paired)),
    )


def moving_points(linkage: Linkage) -> list[str]:
    """Return the points that are no pivots."""
    return [point for point in linkage.structure.points if point not in linkage.structure.pivots]


def kind_of(linkage: Linkage, name: str) -> Kind:
    """Return the kind of a measured quantity by its name; raise a MeasurementError for none."""
    structure = linkage.structure
    points = structure.points
    angles = structure.angles[1:]
    if name in points:
        return 'point'
    if name in angles:
        return 'distance' if structure.bodies[structure.angles.index(name)].slides else 'angle'
    first, _, second = name.partition('-')
    if first != second and {first, second} <= {*points}:
        return 'distance'
    hint = did_you_mean(name, (*points, *angles))
    raise MeasurementError(
        f'{printable(name)} is no point and no angle of the leg: the points are '
        f'{", ".join(points)}, the angles {", ".join(angles)}{hint}'
    )


def subset(series: MeasuredSeries, count: int) -> MeasuredSeries:
    """Return at most `count` samples of a series, evenly spread."""
    if len(series.times) <= count:
        return series
    chosen = np.unique(np.linspace(0, len(series.times) - 1, count).astype(int))
    return replace(
        series,
        times=series.times[chosen],
        values=series.values[chosen],
        crank=series.crank[chosen],
        rate=series.rate[chosen],
    )


def _cleaned(times: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return finite samples in the order of time; of a repeated stamp the first."""
    finite = np.isfinite(times) & np.isfinite(values).all(axis=1)
    stamps, first = np.unique(times[finite], return_index=True)
    return stamps, values[finite][first]
