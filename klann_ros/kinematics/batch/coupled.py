"""Coupled loops in bulk: Newton-Raphson for many crank angles at once, along the branch."""

from typing import Any

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.kinematics.arrays import AnyArray, BoolArray, ComplexArray, FloatArray
from klann_ros.kinematics.errors import GeometryError
from klann_ros.kinematics.linkage import joints
from klann_ros.kinematics.linkage.blocks import Block
from klann_ros.kinematics.linkage.linkage import Linkage
from klann_ros.kinematics.linkage.step import TRUSTED
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np

from .derivative import rates
from .results import LinkagePoses, open_loops, Reason, store, unreachable

ITERATIONS = 10
TOLERANCE = 1e-12


def place(variants: Variants, rows: slice, alphas: AnyArray, results: LinkagePoses) -> None:
    """Compute and store the poses of one of the variants: these rows are one."""
    i = rows.start
    try:
        linkage = variants[i] if len(variants) > 1 else variants.base
        branch = linkage.branch if not variants.refused[i] else None
    except GeometryError:
        branch = None
    if branch is not None:
        _Solution(linkage, np.asarray(alphas, dtype=np.float64)).store(results)
        return
    results.reason[...] = Reason.REFUSED
    for array in results.arrays().values():
        array[...] = np.nan


class _Solution:
    """The unit vectors of all bodies at many crank angles, block by block."""

    def __init__(self, linkage: Linkage, alphas: FloatArray) -> None:
        self._linkage, self._alphas = linkage, alphas
        self._structure = linkage.structure
        senses = linkage.structure.senses
        self._u: ComplexArray = np.full((len(senses), alphas.size), np.nan + 0j)
        self._u[0] = np.exp(1j * senses[0] * alphas)
        self._reason = np.zeros(alphas.size, dtype=np.uint8)
        self._reason[~(np.abs(alphas) <= MAX_CRANK_ANGLE)] = Reason.CRANK_ANGLE
        guesses: FloatArray | None = None
        for block, sign in zip(linkage.blocks, linkage.assembly, strict=True):
            if block.is_dyad:
                self._place_dyad(block, sign)
                continue
            if guesses is None:
                guesses = linkage.branch.guesses(alphas)
            heads = [linkage.head_bodies.index(j) - 1 for j in block.unknowns]
            self._place_loops(block, guesses[heads])

    def store(self, results: LinkagePoses) -> None:
        """Store what is wanted."""
        linkage, u = self._linkage, self._u
        u[:, self._reason != 0] = np.nan
        results.reason[0] = self._reason
        x_1, u_1 = rates(linkage, u) if results.h_1 is not None else (u[:0], u[:0])

        def point(vectors: ComplexArray, which: int, *, moved: bool) -> ComplexArray:
            terms, constant = linkage.point_rows[which]
            start: ComplexArray = np.full(
                u.shape[1], 0.0 if moved else constant, dtype=np.complex128
            )
            return sum((w * vectors[j] for j, w in terms.items()), start)

        def transmission_angle(k: int) -> Any:
            return linkage.blocks[k].transmission_angle(u)

        store(results, linkage.structure, (u, x_1, u_1), point, transmission_angle)

    def _open(self, block: Block) -> ComplexArray:
        """Return by how much each loop of a block is open, its own bodies left out."""
        others = (
            sum((w * self._u[j] for j, w in terms.items() if j not in block.unknowns), constant)
            for terms, constant in block.rows
        )
        return np.array([each + np.zeros(self._alphas.size) for each in others])

    def _place_dyad(self, block: Block, sign: int) -> None:
        (a, b), way, placing = block.unknowns, -self._open(block)[0], block.placing
        self._u[a], self._u[b] = placing.place(self._u, way, sign)
        gone = np.isnan(self._u[a]) | np.isnan(self._u[b])
        reasons = (unreachable(block.number, far=far) for far in (True, False))
        self._fail(gone, np.where(placing.is_far(way), *reasons))

    def _place_loops(self, block: Block, guesses: FloatArray) -> None:
        """Refine guesses of the angles, shape (number of unknowns, k)."""
        linkage, own = self._linkage, list(block.unknowns)
        turning = [not linkage.structure.bodies[j].slides for j in own]
        sizes = np.where(turning, 1.0, linkage.size)[:, None]
        x = guesses.copy()
        settled = np.zeros(self._alphas.size, dtype=bool)
        for _ in range(ITERATIONS):
            self._move(block, x)
            gaps = self._gaps(block)
            settled |= np.abs(gaps).max(axis=0) <= block.rounding
            if (settled | np.isnan(x).any(axis=0)).all():
                break
            matrix = block.jacobian(self._u)
            matrix[settled | ~np.isfinite(matrix).all(axis=(1, 2))] = np.eye(len(own))
            right = np.stack([gaps.real, gaps.imag], axis=1).reshape(len(own), -1).T[..., None]
            turns = np.linalg.solve(matrix, -right)[..., 0].T
            x = np.where(settled, x, x + turns)
            settled |= np.abs(turns / sizes).max(axis=0) <= TOLERANCE
        lost = ~(settled & (np.abs((x - guesses) / sizes).max(axis=0) <= TRUSTED))
        self._fail(lost, open_loops(block.number))
        self._move(block, x)

    def _move(self, block: Block, x: FloatArray) -> None:
        """Take coordinates of a block's bodies, shape (number of unknowns, k)."""
        # What turns first: what slides is turned by it.
        slides = [self._structure.bodies[j].slides for j in block.unknowns]
        for _, j, line in sorted(zip(slides, block.unknowns, range(len(x)), strict=True)):
            self._u[j] = joints.vector(self._structure, self._u, j, x[line])

    def _gaps(self, block: Block) -> ComplexArray:
        """Return by how much each loop of a block is open."""
        gaps = (sum((w * self._u[j] for j, w in terms.items()), c) for terms, c in block.rows)
        return np.array([*gaps])

    def _fail(self, which: BoolArray, reason: Any) -> None:
        """Note why the poses are not there that were not given up before."""
        new = which & (self._reason == 0)
        self._reason[new] = np.broadcast_to(reason, new.shape)[new]
