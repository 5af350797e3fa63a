"""Forbidden areas: the clearance of bars and pivots from circles, half-planes and polygons."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from klann_ros.kinematics import Structure
from klann_ros.kinematics.arrays import BoolArray, FloatArray
import numpy as np

from .space import RequirementsError


class Area(NamedTuple):
    """
    An area: a circle about one corner, the left of the line of two corners, or a polygon.

    `corners` are complex [m]; only the pivots must stay out of it if `is_for_pivots`.
    """

    corners: Any
    radius: float
    is_for_pivots: bool

    def clearance(self, start: Any, end: Any) -> FloatArray:
        """Return the distance of bars from the area [m]; inside it minus the least way out."""
        if len(self.corners) == 1:
            return np.asarray(_distance(self.corners[0], start, end) - self.radius)
        if len(self.corners) == 2:
            first, second = self.corners
            return np.asarray(-np.maximum(_side(start, first, second), _side(end, first, second)))
        bars = start[..., None], end[..., None]
        edges = self.corners, np.roll(self.corners, -1)
        ends = np.array([_distance(bar_end, *edges).min(axis=-1) for bar_end in bars])
        is_inside = np.array([self._contains(bar_end) for bar_end in bars])
        sides = _side(self.corners, *bars)
        # A bar across the polygon is moved sideways, off its corners, or along itself.
        sideways = np.minimum(sides.max(axis=-1), -sides.min(axis=-1))
        is_across = sides * np.roll(sides, -1, axis=-1) < 0.0
        is_across &= _side(bars[0], *edges) * _side(bars[1], *edges) < 0.0
        outside = np.minimum(ends.min(axis=0), _distance(self.corners, *bars).min(axis=-1))
        clearance = np.where(
            is_across.any(axis=-1), -np.minimum(sideways, ends.min(axis=0)), outside
        )
        depth = np.where(is_inside, ends, 0.0).max(axis=0)
        return np.asarray(np.where(is_inside.any(axis=0), -depth, clearance))

    def _contains(self, z: Any) -> BoolArray:
        """Return whether points are in a polygon: a ray to the right crosses it an odd time."""
        a = self.corners
        b = np.roll(a, -1)
        is_crossed = (a.imag > z.imag) != (b.imag > z.imag)
        is_right = (_side(z, a, b) > 0.0) == (b.imag > a.imag)
        return np.asarray((is_crossed & is_right).sum(axis=-1) % 2 == 1)


def areas_from(contents: Iterable[Mapping[str, Any]], metre: float) -> tuple[Area, ...]:
    """Return the areas of the key `forbidden`; a RequirementsError if one has no size."""
    areas = []
    for number, content in enumerate(contents, start=1):
        kinds = [kind for kind in ('circle', 'half_plane', 'polygon') if kind in content]
        if len(kinds) != 1 or ('radius' in content) != (kinds == ['circle']):
            legal = 'one of circle with radius, half_plane and polygon'
            raise RequirementsError(f'forbidden: area {number} must be {legal}')
        corners = np.reshape(content[kinds[0]], (-1, 2)).astype(np.float64) @ (metre, metre * 1j)
        if len({*corners.tolist()}) < len(corners):
            raise RequirementsError(f'forbidden: two points of area {number} are one')
        if _crosses_itself(corners):
            raise RequirementsError(
                f'forbidden: the outline of area {number} crosses itself: order its points around '
                f'it, or divide it into several areas'
            )
        is_for_pivots = content.get('for', 'bars') == 'pivots'
        areas.append(Area(corners, metre * content.get('radius', 0.0), is_for_pivots))
    return tuple(areas)


def _crosses_itself(corners: Any) -> bool:
    """Return whether two edges of a polygon cross; edges that share a corner do not."""
    sides = _side(corners[:, None], corners, np.roll(corners, -1))
    is_across = sides * np.roll(sides, -1, axis=0) < 0.0
    return bool((is_across & is_across.T).any())


def area_clearance(
    areas: tuple[Area, ...], structure: Structure, points: FloatArray
) -> FloatArray:
    """Return the least clearance of linkages at each pose, points of shape (..., p, 2) [m]."""
    z = points @ (1.0, 1j)
    pivots = [structure.points.index(name) for name in structure.pivots]
    bars = []
    for body in structure.bodies:
        bars += [
            (structure.points.index(b.start), structure.points.index(b.end)) for b in body.rigid
        ]
    bars += [(pivot, pivot) for pivot in pivots]
    clearances = []
    for area in areas:
        starts, ends = (pivots, pivots) if area.is_for_pivots else np.transpose(bars)
        clearances.append(area.clearance(z[..., starts], z[..., ends]).min(axis=-1))
    return np.asarray(np.min(clearances, axis=0))


def _side(z: Any, start: Any, end: Any) -> Any:
    """Return how far points are to the left of lines [m]; 0 of a line that is a point."""
    line = end - start
    return (np.conj(line) * (z - start)).imag / np.where(line == 0.0, 1.0, np.abs(line))


def _distance(z: Any, start: Any, end: Any) -> Any:
    """Return the distance of points from segments [m]."""
    line = end - start
    square = np.abs(line) ** 2
    # A square that underflows is that of a point.
    share = (np.conj(line) * (z - start)).real / np.where(square == 0.0, 1.0, square)
    along = np.clip(share, 0.0, 1.0)
    return np.abs(z - start - along * line)
