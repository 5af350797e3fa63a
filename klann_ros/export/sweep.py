"""
Plates in motion: whether two of them, or a plate and a pin, come near at any crank angle.

Distances are sampled over the crank angle. Between two samples a distance changes by at most the
ways of both parts, which a bound allows for: what may collide counts as a collision.
"""

from klann_ros.kinematics import Linkage, linkage_poses
from klann_ros.kinematics.linkage.structure import FIXED
import numpy as np
from numpy.typing import NDArray

from .plates import ExportError, Plate
from .travel import crank_angles

# Between moving parts [m], in addition to their widths.
CLEARANCE = 0.5e-3
# Crank angles of a turn, or of an arc.
SWEEP_SAMPLES = 3601
Complex = NDArray[np.complex128]
Array = NDArray[np.float64]
# The centre lines of a part at all crank angles, shape (k,) for both ends, and its half width.
Swept = tuple[list[tuple[Complex, Complex]], float]


class SweptMotion:
    """
    Where a leg's plates are over all crank angles.

    `bound` is by how much a distance may be less than both samples beside it [m], at most.
    """

    def __init__(self, linkage: Linkage) -> None:
        structure = linkage.structure
        alphas = crank_angles(linkage, SWEEP_SAMPLES)
        found = linkage_poses(linkage, alphas, points=True)
        if found.points is None:
            raise AssertionError('points are requested')
        points = found.points[..., 0] + 1j * found.points[..., 1]
        is_known = np.asarray(np.isfinite(points).all(axis=1))
        if not is_known.any():
            raise ExportError('the crank reaches no angle: nothing moves')
        self._steps = is_known[1:] & is_known[:-1]
        # Nothing moves across the gap between two arcs.
        last = SWEEP_SAMPLES - 1
        self._steps[last::SWEEP_SAMPLES] = False
        # A pose to draw.
        self.shown = int(np.flatnonzero(is_known)[is_known.sum() // 6])
        index = {name: k for k, name in enumerate(structure.points)}
        zero = np.zeros(alphas.size, np.complex128)
        self._frames = {FIXED: (zero, zero + 1.0)}
        turned = {FIXED: zero + 1.0}
        for j, body in enumerate(structure.bodies):
            if not body.slides:
                first = body.bars[0]
                way = points[:, index[first.end]] - points[:, index[first.start]]
                turned[j] = way / np.abs(way)
        for j, body in enumerate(structure.bodies):
            start = points[:, index[body.points[0]]]
            self._frames[j] = start, turned[structure.frames[j]]
        self.bound = 0.0
        self.crank = structure.crank.points[0]

    def place(self, plate: Plate, at: complex) -> Complex:
        """Return where a place of a plate is, shape (k,) [m]."""
        origin, turn = self._frames[plate.body]
        return np.asarray(origin + at * turn)

    def swept(self, plate: Plate) -> Swept:
        """Return the links of a plate over all crank angles."""
        links = [(self.place(plate, a), self.place(plate, b)) for a, b in plate.links]
        return links, plate.width / 2.0

    def pin(self, plate: Plate, at: complex, radius: float) -> Swept:
        """Return a shaft over all crank angles."""
        place = self.place(plate, at)
        return [(place, place)], radius

    def collide(self, one: Swept, other: Swept) -> bool:
        """Return whether two parts come nearer than the clearance, or may between samples."""
        least = one[1] + other[1] + CLEARANCE
        return any(self._least(a, b) < least for a in one[0] for b in other[0])

    def _least(self, one: tuple[Complex, Complex], other: tuple[Complex, Complex]) -> float:
        """Return a lower bound of the distance of two segments over all crank angles [m]."""
        moved_one, moved_other = (
            np.max([np.abs(np.diff(end)) for end in segment], axis=0) for segment in (one, other)
        )
        moved = moved_one + moved_other
        far = distances(one, other)
        least = (far[1:] + far[:-1] - moved) / 2.0
        self.bound = max(self.bound, float(np.max(moved[self._steps])) / 2.0)
        return float(least[self._steps].min())


def distances(one: tuple[Complex, Complex], other: tuple[Complex, Complex]) -> Array:
    """Return the distances of two segments at many poses, shape (k,)."""
    a, b, apart = one[1] - one[0], other[1] - other[0], other[0] - one[0]
    across = _cross(a, b)
    with np.errstate(divide='ignore', invalid='ignore'):
        s, t = _cross(apart, b) / across, _cross(apart, a) / across
    crossing = (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    ends = [_from_segment(end, other) for end in one] + [_from_segment(end, one) for end in other]
    return np.where(crossing, 0.0, np.min(ends, axis=0))


def _from_segment(at: Complex, segment: tuple[Complex, Complex]) -> Array:
    along = segment[1] - segment[0]
    size = np.abs(along) ** 2
    part = ((at - segment[0]) * along.conj()).real / np.where(size > 0.0, size, 1.0)
    return np.asarray(np.abs(at - segment[0] - np.clip(part, 0.0, 1.0) * along))


def _cross(a: Complex, b: Complex) -> Array:
    return np.asarray((a.conj() * b).imag)
