"""
Dyads of which some slide, for many linkages at many crank angles: the geometric method in bulk.

Here each dyad is placed by `linkage.dyads`, on arrays of complex numbers; where all dyads turn,
`program` does the same in a third of the time.
"""

from typing import Any

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.kinematics.arrays import AnyArray, ByteArray, FloatArray
from klann_ros.kinematics.linkage import joints, shape
from klann_ros.kinematics.linkage.dyads import Closing, closing, cross, Pair
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np

from .results import LinkagePoses, Reason, store, unreachable


class SlidingDyads:
    """
    Linkages of one structure whose blocks are all dyads.

    Parameters
    ----------
    variants : Variants
        The linkages.
    rows : slice or numpy.ndarray of int, optional
        Which of them; all where left out.

    """

    def __init__(self, variants: Variants, rows: Any = slice(None)) -> None:
        self.structure = structure = variants.base.structure
        count = len(variants)
        self._pivots, self._bars = (
            [np.broadcast_to(each, count)[rows, None] for each in some]
            for some in variants.vectors
        )
        self._signs = variants.signs[:, rows, None]
        self._loops = [self._row(structure.paths.loops[k]) for (k,) in structure.paths.rows]
        self.closings: list[Closing] = [
            closing(Pair(structure, (group[0], group[1]), terms, constant))
            for group, (terms, constant) in zip(structure.groups, self._loops, strict=True)
        ]

    def vectors(self, alphas: FloatArray, blocks: int | None = None) -> list[Any]:
        """Return u_j of every body that the first so many blocks place, shapes (n, k)."""
        u: list[Any] = [None] * len(self.structure.bodies)
        u[0] = np.exp(1j * self.structure.senses[0] * alphas)
        for k, group in enumerate(self.structure.groups[:blocks]):
            a, b = group
            u[a], u[b] = self.closings[k].place(u, self.way(k, u), self._signs[k])
        return u

    def way(self, k: int, u: list[Any]) -> Any:
        """Return what W_a u_a + W_b u_b of a dyad must be, by those before it [m]."""
        (terms, constant), own = self._loops[k], self.structure.groups[k]
        return -sum((w * u[j] for j, w in terms.items() if j not in own), constant)

    def derivatives(self, u: list[Any]) -> tuple[list[Any], list[Any]]:
        """Return dx/dalpha and du/dalpha of every body, shapes (n, k); NaN at singular poses."""
        structure, zero = self.structure, np.zeros(np.shape(u[-1]))
        x_1, u_1 = [zero] * len(u), [zero] * len(u)
        x_1[0] = zero + 1.0
        u_1[0] = joints.moved(structure, u, x_1, 0)
        for k, (a, b) in enumerate(structure.groups):
            terms, _ = self._loops[k]
            for j in (a, b):
                u_1[j] = zero + joints.carried(structure, u, x_1, j, (a, b))
            opened = sum(w * u_1[j] for j, w in terms.items())
            placing = self.closings[k]
            p, q = placing.pair.columns(u)
            determinant = cross(p, q)
            sine = determinant / placing.lengths(self.way(k, u))
            least = np.sqrt(placing.pair.rounding / placing.least_length)
            determinant = np.where(np.abs(sine) <= least, np.nan, determinant)
            x_1[a], x_1[b] = cross(q, opened) / determinant, cross(opened, p) / determinant
            for j in (a, b):
                u_1[j] = joints.moved(structure, u, x_1, j)
        return x_1, u_1

    def point(self, u: list[Any], which: int, *, moved: bool = False) -> Any:
        """Return where a point is, as a complex number [m]; of derivatives, how it moves."""
        terms, constant = self._row(self.structure.paths.points[which])
        start = np.zeros(np.shape(u[0]), dtype=np.complex128) + (0.0 if moved else constant)
        return sum((w * u[j] for j, w in terms.items()), start)

    def reasons(self, u: list[Any]) -> ByteArray:
        """Return why each pose is not there: the first dyad that does not close; 0 for none."""
        why: ByteArray = np.zeros(np.shape(u[-1]), dtype=np.uint8)
        for k, (a, b) in enumerate(self.structure.groups):
            gone = (np.isnan(u[a]) | np.isnan(u[b])) & (why == 0)
            far = gone & self.closings[k].is_far(self.way(k, u))
            why[gone] = unreachable(k + 1, far=False)
            why[far] = unreachable(k + 1, far=True)
        return why

    def _row(self, path: Any) -> tuple[dict[int, Any], Any]:
        return shape.row(self.structure, path, self._pivots, self._bars)


def place(variants: Variants, rows: slice, alphas: AnyArray, results: LinkagePoses) -> None:
    """Compute and store the poses of some of the variants."""
    dyads = SlidingDyads(variants, rows)
    angles = np.asarray(alphas, dtype=np.float64)[None, :]
    within = np.abs(angles) <= MAX_CRANK_ANGLE
    u = dyads.vectors(np.where(within, angles, np.nan))
    u = [np.broadcast_to(each, results.reason.shape) for each in u]
    why = dyads.reasons(u)
    why[np.broadcast_to(~within, why.shape)] = Reason.CRANK_ANGLE
    why[variants.refused[rows] != 0] = Reason.REFUSED
    results.reason[...] = why
    x_1, u_1 = dyads.derivatives(u) if results.h_1 is not None else ([], [])

    def transmission_angle(k: int) -> Any:
        outside = k + 1 in dyads.structure.outside
        return dyads.closings[k].transmission_angle(u, outside=outside)

    store(results, dyads.structure, (u, x_1, u_1), dyads.point, transmission_angle)
    gone = why != 0
    if gone.any():
        for array in results.arrays().values():
            array[gone] = np.nan
