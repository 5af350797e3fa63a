"""Measurements of a leg: points, angles and distances, each with the crank angle at its time."""

from cmath import phase
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeAlias

from klann_ros.kinematics import body_points, Linkage
from klann_ros.kinematics.arrays import FloatArray, with_short_repr
from klann_ros.sanitize.text import did_you_mean, printable
import numpy as np

from .crank import CrankSpline

Kind: TypeAlias = Literal['point', 'angle', 'distance']
# Smallest number that is no measurement [s, rad, m]: squares of those below can be summed.
MAX_NUMBER = 1e20


class MeasurementError(ValueError):
    """Measurements that no calibration can use; the text says why."""


@with_short_repr
@dataclass(frozen=True, eq=False)
class CrankSamples:
    """The crank joint's position over time, shape (n,)."""

    times: FloatArray  # rising stamps [s]
    positions: FloatArray  # any number of turns [rad]

    @classmethod
    def of(cls, times: FloatArray, positions: FloatArray) -> 'CrankSamples':
        """Return samples in the order of time, each stamp once, without NaN, unwrapped."""
        times, columns = _cleaned(times, positions[:, None])
        return cls(times, np.unwrap(columns[:, 0]))

    @cached_property
    def motion(self) -> CrankSpline:
        """Return the motion between the samples."""
        return CrankSpline(self.times, self.positions)

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions [rad] and rates [rad/s], shape (n,); NaN in gaps and beyond."""
        is_known = self.motion.knows(times)
        angles: FloatArray = np.full((2, len(times)), np.nan)
        if is_known.any():
            angles[:, is_known] = self.motion.at(times[is_known])
        return angles[0], angles[1]


@with_short_repr
@dataclass(frozen=True, eq=False)
class MeasuredSeries:
    """
    Samples of one measured quantity: a point, an angle or a distance.

    `name` is a point, a body's angle or distance, or the distance of two points: 'H', 'theta',
    'A-H'. At the stamps `times`, shape (n,) [s], `values` are positions in the leg's plane or the
    camera's, shape (n, 2) [m], angles [rad] or distances [m], shape (n, 1); `crank` and `rate` are
    those of the crank joint, shape (n,) [rad, rad/s], by the samples `encoder`. `noise` is the
    standard deviation of each number, if it is known [m, rad], `source` such as a topic, and
    `skipped` the number of samples left out: not finite, repeated, or without a crank angle.
    """

    kind: Kind
    name: str
    times: FloatArray
    values: FloatArray
    crank: FloatArray
    rate: FloatArray
    encoder: CrankSamples
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
        crank,
        noise=noise,
        source=source,
        skipped=len(times) - int(np.count_nonzero(is_paired)),
    )


def crank_points(linkage: Linkage) -> dict[str, float]:
    """Return the angles of the crank's points from the crank [rad], the farthest first."""
    crank = linkage.structure.crank
    places = body_points(linkage.structure, linkage.bars)
    names = () if crank.clockwise else crank.points[1:]
    farthest_first = sorted(names, key=lambda name: -abs(places[0, name]))
    return {name: phase(places[0, name]) for name in farthest_first}


class TrackedCrank(CrankSamples):
    """The crank's angles by a tracked point of it, at the times of the frames alone."""

    @classmethod
    def by_point(cls, angle: float, times: FloatArray, values: FloatArray) -> 'TrackedCrank':
        """Return the crank's angles by a point at an angle from it [rad], shape (n, 2)."""
        stamps, places = _cleaned(times, values)
        columns = np.column_stack([2.0 * places, np.ones(len(places))])
        squares = (places**2).sum(axis=1)
        arms = (places - np.linalg.lstsq(columns, squares, rcond=None)[0][:2]) @ (1.0, 1j)
        return cls(stamps, np.unwrap(np.angle(arms)) - angle)

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions [rad], NaN between the frames, and rates, which are not known, of 0."""
        _, rows, frames = np.intersect1d(times, self.times, return_indices=True)
        angles = np.full(len(times), np.nan)
        angles[rows] = self.positions[frames]
        return angles, 0.0 * angles


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


def scaled(series: MeasuredSeries, scale: float) -> MeasuredSeries:
    """Return a series of points in units of `scale`; others as they are."""
    if series.kind != 'point':
        return series
    noise = series.noise and series.noise / scale
    return replace(series, values=series.values / scale, noise=noise)


def _cleaned(times: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return possible samples in the order of time; of a repeated stamp the first."""
    # Not where one is NaN.
    is_possible = (np.abs(times) < MAX_NUMBER) & (np.abs(values) < MAX_NUMBER).all(axis=1)
    stamps, first = np.unique(times[is_possible], return_index=True)
    return stamps, values[is_possible][first]
