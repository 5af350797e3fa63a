"""
The smallest clearance of every block over a whole turn of the crank, for many linkages at once.

A crank turns fully if no clearance is negative. The linkages need not close, so a dimension can be
changed until the full turn is lost.
"""

from collections.abc import Callable
from functools import cached_property
from sys import float_info
from typing import Any

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, IndexArray
from klann_ros.kinematics.errors import GeometryError, KinematicsError
from klann_ros.kinematics.linkage.reach import reachable_arcs
from klann_ros.kinematics.linkage.variants import Variants
from klann_ros.kinematics.searches import minimum_near, parabola_peak
import numpy as np

from .blockwise import Blockwise, changing_linkages
from .kernels import NumpyKernel
from .program import compile_program, constants, PathTerms

# Clearances [m] of linkages by their rows, and by the crank's cosines and sines, shape (n, k).
Clearance = Callable[[Any, FloatArray, FloatArray], FloatArray]
# Crank angles of the search, an even number.
SAMPLES_PER_TURN = 360
# Poses in memory at once: the size of a processor's cache.
MAX_POSES = 1 << 15


def turn_clearances(variants: Variants) -> FloatArray:
    """
    Return the smallest distance of each block of each linkage from the limits of its reach.

    Shape (n, number of blocks) [m]; negative if the full turn is lost, and NaN for later blocks.
    For a dyad driven by the crank alone, |PQ| runs from | |c| - |W_0| | to |c| + |W_0|; for others
    it is sampled over the turn, and its minimum refined to rounding. Coupled loops have 1 if they
    close over the whole turn, else -1.
    """
    if not variants.base.is_dyadic:
        signs = [_signed_turn(variants, i) for i in range(len(variants))]
        return np.array(signs)[:, None]
    changing = changing_linkages(variants)
    slides = variants.base.structure.slides
    search = _SlidingClearances(variants) if slides else _PinnedClearances(variants)
    clearances = np.full((len(variants), len(variants.base.blocks)), np.nan)
    closing = np.arange(len(variants))
    for k, block in enumerate(Blockwise(variants).blocks):
        if block.is_driven:
            smallest = np.minimum(*block.driven_clearances)[closing, 0]
        else:
            smallest = search.smallest(k, closing)
        clearances[closing, k] = np.where(np.isnan(smallest), -np.inf, smallest)
        closing = closing[smallest >= 0.0]
        if not len(closing):
            break
    for i, linkage in changing.items():
        # Signs change along the path.
        clearances[i] = linkage.change_points.clearances
    return clearances


def driven_clearances(variants: Variants) -> FloatArray:
    """Return the smallest clearance of the dyads driven by the crank alone, shape (n,) [m]."""
    smallest = np.full(len(variants), np.inf)
    if variants.base.two_circles:
        for block in Blockwise(variants).blocks:
            if block.is_driven:
                smallest = np.fmin(smallest, np.minimum(*block.driven_clearances)[:, 0])
    return smallest


def _signed_turn(variants: Variants, i: int) -> float:
    """Return 1 for a linkage of coupled loops whose crank turns fully, else -1."""
    try:
        return 1.0 if reachable_arcs(variants[i]) == [(0.0, TURN)] else -1.0
    except (GeometryError, KinematicsError):
        return -1.0


class _PinnedClearances:
    """The clearances of pinned dyads, by the squared distances of their ends."""

    def __init__(self, variants: Variants) -> None:
        structure = variants.base.structure
        self._structure = structure
        self._terms = PathTerms(structure, *variants.vectors, variants.signs)
        self._count = len(variants)
        self._program = compile_program(structure, links=False)

    @cached_property
    def _constants(self) -> FloatArray:
        return constants(self._program, self._terms, self._count)

    def smallest(self, k: int, indices: IndexArray) -> FloatArray:
        """Return the smallest clearance of a dyad, for some of the linkages, shape (n,) [m]."""
        distance = self._program.distances[k]
        cached = _cached_parts(indices)
        kernel = NumpyKernel(self._program, (distance,), SAMPLES_PER_TURN * max(map(len, cached)))
        return np.concatenate([self._smallest(k, kernel, part) for part in cached])

    def _smallest(self, k: int, kernel: NumpyKernel, indices: IndexArray) -> FloatArray:
        # Samples start with the crank along the ground: they include the angles of the smallest
        # clearance of the first dyad, where the other clearances are steepest.
        path = self._structure.paths.loops[0]
        with np.errstate(invalid='ignore', divide='ignore'):
            ground = -np.asarray(self._terms.fixed(path) / self._terms.body(path, 0))
        start = self._structure.senses[0] * np.angle(ground)[indices, None]
        r_a, r_b = self._terms.link_lengths(k)
        folded = abs(r_a - r_b)[indices, None]
        stretched = (r_a + r_b)[indices, None]
        linkage_constants = self._constants[:, indices]

        def clearance(rows: Any, cos: FloatArray, sin: FloatArray) -> FloatArray:
            """Return the clearance, shape (n, number of angles); NaN if earlier dyads are open."""
            with np.errstate(all='ignore'):
                row_constants = linkage_constants[:, rows]
                (squares,), _ = kernel.run(row_constants, slice(None), (cos, sin))
                distances = np.sqrt(squares)
            inside = stretched[rows] - distances
            return np.asarray(np.minimum(inside, distances - folded[rows]))

        return _smallest_over_turn(clearance, start, stretched[:, 0])


class _SlidingClearances:
    """The clearances of dyads with sliding joints."""

    def __init__(self, variants: Variants) -> None:
        self._variants = variants

    def smallest(self, k: int, indices: IndexArray) -> FloatArray:
        """Return the smallest clearance of a dyad, for some of the linkages, shape (n,) [m]."""
        clearances = [self._smallest(k, part) for part in _cached_parts(indices)]
        return np.concatenate([np.empty(0), *clearances])

    def _smallest(self, k: int, indices: IndexArray) -> FloatArray:
        dyads = Blockwise(self._variants, indices)
        if not dyads.blocks[k].two_branches:
            return np.full(len(indices), np.inf)

        def clearance(rows: Any, cos: FloatArray, sin: FloatArray) -> FloatArray:
            """Return the clearance, shape (n, number of angles); NaN if earlier dyads are open."""
            is_whole = isinstance(rows, slice)
            solver = dyads if is_whole else Blockwise(self._variants, indices[rows])
            with np.errstate(all='ignore'):
                u = solver.place(np.arctan2(sin, cos), k)
                return np.asarray(solver.blocks[k].clearance(u))

        sizes = np.abs(self._variants.numbers[:, indices]).max(axis=0)
        return _smallest_over_turn(clearance, np.zeros((len(indices), 1)), sizes)


def _cached_parts(indices: IndexArray) -> list[IndexArray]:
    """Return the indices of some linkages in parts that fit into the cache."""
    step = max(1, MAX_POSES // SAMPLES_PER_TURN)
    return [indices[slice(n, n + step)] for n in range(0, len(indices), step)]


def _smallest_over_turn(clearance: Clearance, start: FloatArray, sizes: FloatArray) -> FloatArray:
    """
    Return the smallest clearances over a turn from a start, shape (n, 1) [rad]; -inf if none.

    Their rounding is relative to `sizes`, shape (n,) [m].
    """

    def refined(rows: IndexArray, alphas: FloatArray) -> FloatArray:
        return clearance(rows, np.cos(alphas), np.sin(alphas))

    step = TURN / SAMPLES_PER_TURN
    # By angle addition, much faster than cosines and sines.
    crank = np.exp(1j * start) * np.exp(1j * step * np.arange(SAMPLES_PER_TURN))
    samples = clearance(slice(None), crank.real, crank.imag)
    middle = start[:, 0] + step * _lowest_sample(samples)
    _, smallest = minimum_near(refined, middle, step, 2.0 * float_info.epsilon * sizes)
    smallest = np.fmin(smallest, np.fmin.reduce(samples, axis=1))
    return np.where(np.isfinite(smallest), smallest, -np.inf)


def _lowest_sample(samples: FloatArray) -> IndexArray:
    """Return the index of the sample nearest to the minimum, by a parabola through each three."""
    height = -np.where(np.isnan(samples), np.inf, samples)
    left = np.roll(height, 1, axis=1)
    right = np.roll(height, -1, axis=1)
    lowest: IndexArray = parabola_peak(left, height, right).argmax(axis=1)
    return lowest
