"""Poses that a bar takes in a turn, some of them exactly: motion generation."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from klann_ros.kinematics import Structure
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import BoolArray, ComplexArray, FloatArray
import numpy as np

from .space import RequirementsError, Units

# Greatest error of exact poses relative to the leg's size, and that of candidates to be refined.
EXACT_ERROR, EXACT_IN_SEARCH = 1e-6, 0.05


@dataclass(frozen=True, eq=False)
class PoseTarget:
    """
    Poses of the bar from `start` to `point`; without names that of the foot.

    The distance d from a pose is that of the point and, at the length l of the bar, of its angle:
    d^2 = |p - p_i|^2 + (2 l sin((theta - theta_i) / 2))^2. All arrays have the shape (k,).
    """

    start: str
    point: str
    # Places of the point [m] and angles of the bar [rad]; NaN for any.
    points: ComplexArray
    angles: FloatArray
    # Crank angles from that of the first pose [rad]; NaN for the nearest.
    cranks: FloatArray
    # Whether each pose is to be met exactly.
    is_exact: BoolArray

    @property
    def is_timed(self) -> bool:
        """Return whether the crank angles between the poses are prescribed."""
        return bool(np.isfinite(self.cranks).all())

    def bar(self, structure: Structure) -> list[int]:
        """Return the indices of both ends of the bar; a RequirementsError if there is none."""
        for body in structure.bodies:
            for bar in body.rigid:
                if not self.point and bar.end == structure.foot:
                    return [structure.points.index(name) for name in (bar.start, bar.end)]
            ends = {name for bar in body.rigid for name in (bar.start, bar.end)}
            if {self.start, self.point} <= ends:
                return [structure.points.index(name) for name in (self.start, self.point)]
        bars = ', '.join(f'{bar.start}-{bar.end}' for _, bar in structure.bars)
        raise RequirementsError(f'poses: no body has from and point; the bars are {bars}')

    def misses(self, structure: Structure, points: Any) -> ComplexArray:
        """Return both parts of the distances, points of shape (..., k, p, 2) [m]."""
        start, end = np.moveaxis(points[..., self.bar(structure), :] @ (1.0, 1j), -1, 0)
        bar = end - start
        # A pose without a point, or without an angle, has no such part.
        shift = np.where(np.isnan(self.points), 0.0, end - self.points)
        turned = bar - np.abs(bar) * np.exp(1j * np.nan_to_num(self.angles))
        return np.stack([shift, np.where(np.isnan(self.angles), 0.0, turned)], axis=-1)

    def locate(self, structure: Structure, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """
        Return the crank angles nearest to the poses, and the distances [m].

        Of n linkages at g equal steps of the crank, points of shape (n, g, p, 2); shapes (n, k).
        """
        misses = self.misses(structure, points[:, :, None])
        step_count = misses.shape[1]
        places = np.nan_to_num(self.cranks) * (step_count / TURN)
        if self.is_timed:
            first = places.astype(int)
            rows = (np.arange(step_count)[:, None] + first) % step_count
            columns = np.arange(len(first))
            start = misses[:, rows, columns]
            end = misses[:, (rows + 1) % step_count, columns]
            misses = start + (places - first)[:, None] * (end - start)
        steps = np.roll(misses, -1, axis=1) - misses
        # With timing one place in the turn for all poses.
        joint = partial(np.sum, axis=-1, keepdims=True) if self.is_timed else np.asarray
        slopes = joint((np.conj(steps) * misses).real.sum(axis=-1))
        with np.errstate(all='ignore'):
            along = np.clip(-slopes / joint(_squares(steps)), 0.0, 1.0)
        squares = _squares(misses + along[..., None] * steps)
        nearest = joint(squares).argmin(axis=1)[:, None]
        places = (nearest + np.take_along_axis(along, nearest, 1))[:, 0] + places
        nearest = np.broadcast_to(nearest, (len(points), 1, len(self.points)))
        distances = np.sqrt(np.take_along_axis(squares, nearest, 1)[:, 0])
        return places * (TURN / step_count), distances

    def figures(self, structure: Structure, points: FloatArray) -> dict[str, FloatArray]:
        """Return the figures of n linkages, points as of `locate`, shapes (n,)."""
        distances = self.locate(structure, points)[1]
        exact = distances[:, self.is_exact].max(axis=1, initial=0.0)
        size = np.ptp(points, axis=(1, 2)).max(axis=1)
        return {'pose_error': np.sqrt((distances**2).mean(axis=1)), 'exact_error': exact / size}


def poses_from(content: Mapping[str, Any], units: Units) -> PoseTarget:
    """Return the poses of the key `poses`; a RequirementsError if one of them is incomplete."""
    table = np.full((len(content['at']), 4), np.nan)
    for n, pose in enumerate(content['at']):
        if ('x' in pose) != ('y' in pose) or not {'x', 'angle'} & pose.keys():
            raise RequirementsError(f'poses.at: pose {n + 1} must have x and y, an angle, or both')
        table[n] = [pose.get(name, np.nan) for name in ('x', 'y', 'angle', 'crank')]
    x, y, angles, cranks = table.T
    if np.isnan(cranks).any() and not np.isnan(cranks).all():
        raise RequirementsError('poses.at: either all poses have a crank angle, or none')
    return PoseTarget(
        start=content.get('from', ''),
        point=content.get('point', ''),
        points=units.size('m') * (x + 1j * y),
        angles=units.size('rad') * angles,
        cranks=units.size('rad') * (cranks - cranks[0]) % TURN,
        is_exact=np.array([pose.get('exact', False) for pose in content['at']]),
    )


def _squares(parts: ComplexArray) -> FloatArray:
    """Return the squares of distances, of which the last axis has the parts."""
    return np.asarray((np.abs(parts) ** 2).sum(axis=-1))
