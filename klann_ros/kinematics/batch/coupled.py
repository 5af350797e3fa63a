"""Coupled loops in bulk: Newton-Raphson and velocities at many crank angles at once."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from klann_ros.kinematics.angles import MAX_CRANK_ANGLE
from klann_ros.kinematics.arrays import AnyArray, BoolArray, ComplexArray, FloatArray
from klann_ros.kinematics.errors import GeometryError
from klann_ros.kinematics.linkage import joints
from klann_ros.kinematics.linkage.blocks import Block
from klann_ros.kinematics.linkage.linkage import Linkage
from klann_ros.kinematics.linkage.step import MAX_BRANCH_JUMP
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np

from .gradients import store_gradients
from .results import LinkagePoses, open_loops, Reason, store, unreachable

MAX_ITERATIONS = 10
STEP_TOLERANCE = 1e-12


def fill_coupled(variants: Variants, rows: slice, alphas: AnyArray, results: LinkagePoses) -> None:
    """Compute and store the poses of one of the variants: `rows` has length 1."""
    i = rows.start
    try:
        linkage = variants[i] if len(variants) > 1 else variants.base
        branch = linkage.branch if not variants.error_codes[i] else None
    except GeometryError:
        branch = None
    if branch is not None:
        _Solution(linkage, np.asarray(alphas, dtype=np.float64)).store(results)
        return
    results.reason[...] = Reason.REFUSED
    for array in results.arrays().values():
        array[...] = np.nan


class _Solution:
    """The vectors of all bodies at many crank angles, solved block by block."""

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
            heads = [linkage.prefix_bodies.index(j) - 1 for j in block.unknowns]
            self._place_loops(block, guesses[heads])

    def store(self, results: LinkagePoses) -> None:
        """Store the requested results."""
        linkage, u = self._linkage, self._u
        u[:, self._reason != 0] = np.nan
        results.reason[0] = self._reason
        needs_rates = results.h_1 is not None or results.h_gradient is not None
        blocks = [*closing_blocks(linkage, u)] if needs_rates else []
        x_1: list[Any] = []
        u_1: list[Any] = []
        if needs_rates:
            x_1, u_1 = joints.solve_rates(linkage.structure, [*u], blocks, 1.0)
            singular = np.isnan(np.sum(x_1, axis=0))
            for each in (*x_1, *u_1):
                each[singular] = np.nan

        def point(vectors: ComplexArray, which: int, *, moved: bool) -> ComplexArray:
            terms, constant = linkage.point_rows[which]
            start: ComplexArray = np.full(
                u.shape[1], 0.0 if moved else constant, dtype=np.complex128
            )
            return sum((w * vectors[j] for j, w in terms.items()), start)

        def transmission_angle(k: int) -> Any:
            return linkage.blocks[k].transmission_angle(u)

        store(results, linkage.structure, (u, x_1, u_1), point, transmission_angle)
        vectors = linkage.pivots, linkage.bars
        store_gradients(results, linkage.structure, ([*u], x_1, u_1), blocks, vectors)

    def _others(self, block: Block) -> ComplexArray:
        """Return the closure error of each loop of a block, without its own bodies."""
        others = (
            sum((w * self._u[j] for j, w in terms.items() if j not in block.unknowns), constant)
            for terms, constant in block.rows
        )
        return np.array([each + np.zeros(self._alphas.size) for each in others])

    def _place_dyad(self, block: Block, sign: int) -> None:
        (a, b), vector, dyad = block.unknowns, -self._others(block)[0], block.dyad_solver
        self._u[a], self._u[b] = dyad.place(self._u, vector, sign)
        gone = np.isnan(self._u[a]) | np.isnan(self._u[b])
        reasons = (unreachable(block.number, far=far) for far in (True, False))
        self._fail(gone, np.where(dyad.is_too_far(vector), *reasons))

    def _place_loops(self, block: Block, guesses: FloatArray) -> None:
        """Refine guesses of the angles, shape (number of unknowns, k)."""
        linkage, own = self._linkage, list(block.unknowns)
        rotates = [not linkage.structure.bodies[j].slides for j in own]
        sizes = np.where(rotates, 1.0, linkage.size)[:, None]
        x = guesses.copy()
        converged = np.zeros(self._alphas.size, dtype=bool)
        for _ in range(MAX_ITERATIONS):
            self._move(block, x)
            errors = self._errors(block)
            converged |= np.abs(errors).max(axis=0) <= block.rounding
            if (converged | np.isnan(x).any(axis=0)).all():
                break
            matrix = block.jacobian(self._u)
            matrix[converged | ~np.isfinite(matrix).all(axis=(1, 2))] = np.eye(len(own))
            right = np.stack([errors.real, errors.imag], axis=1).reshape(len(own), -1).T[..., None]
            turns = np.linalg.solve(matrix, -right)[..., 0].T
            x = np.where(converged, x, x + turns)
            converged |= np.abs(turns / sizes).max(axis=0) <= STEP_TOLERANCE
        lost = ~(converged & (np.abs((x - guesses) / sizes).max(axis=0) <= MAX_BRANCH_JUMP))
        self._fail(lost, open_loops(block.number))
        self._move(block, x)

    def _move(self, block: Block, x: FloatArray) -> None:
        """Set the coordinates of a block's bodies, shape (number of unknowns, k)."""
        # Rotating bodies first: they orient the sliding ones.
        slides = [self._structure.bodies[j].slides for j in block.unknowns]
        for _, j, line in sorted(zip(slides, block.unknowns, range(len(x)), strict=True)):
            self._u[j] = joints.body_vector(self._structure, self._u, j, x[line])

    def _errors(self, block: Block) -> ComplexArray:
        """Return the closure error of each loop of a block."""
        errors = (sum((w * self._u[j] for j, w in terms.items()), c) for terms, c in block.rows)
        return np.array([*errors])

    def _fail(self, which: BoolArray, reason: Any) -> None:
        """Store the reason of poses that have failed now."""
        new = which & (self._reason == 0)
        self._reason[new] = np.broadcast_to(reason, new.shape)[new]


def closing_blocks(linkage: Linkage, u: ComplexArray) -> Iterator[joints.Closing]:
    """
    Yield the bodies of each block, and a function that closes its loops, at many poses.

    The function takes du of all bodies, and further openings of its loops; it returns the changes
    of the block's coordinates that close them, shape (number of unknowns, k).
    """
    for block in linkage.blocks:
        matrix = block.jacobian(u)
        singular = ~(np.abs(block.sine(u)) > block.singular_sine)
        singular |= ~np.isfinite(matrix).all(axis=(1, 2))
        matrix[singular] = np.eye(matrix.shape[-1])
        yield list(block.unknowns), partial(_close, block.rows, matrix, singular)


def _close(
    rows: Sequence[Any],
    matrix: FloatArray,
    singular: BoolArray,
    du: Any,
    further: Sequence[Any] = (),
) -> FloatArray:
    opened = np.array([sum((w * du[j] for j, w in t.items()), 0j * du[0]) for t, _ in rows])
    if len(further):
        opened += np.array(further)
    right = np.stack([opened.real, opened.imag], axis=1).reshape(-1, len(singular)).T
    singular = singular | ~np.isfinite(right).all(axis=1)
    changes: FloatArray = np.full(right.T.shape, np.nan)
    regular = ~singular
    changes[:, regular] = np.linalg.solve(matrix[regular], -right[regular, :, None])[..., 0].T
    return changes
