"""
The least clearance of every block over a whole turn of the crank, for many linkages at once.

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
from klann_ros.kinematics.linkage.reach import is_driven, reachable_arcs
from klann_ros.kinematics.linkage.variants import Variants
from klann_ros.kinematics.searches import minimum_near, parabola_peak
import numpy as np

from .blockwise import Blockwise
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
    Return the least distance of each block of each linkage from the limits of its reach.

    Shape (n, number of blocks) [m]; negative if the full turn is lost, and NaN for later blocks.
    For a dyad driven by the crank alone, |PQ| runs from | |c| - |W_0| | to |c| + |W_0|; for others
    it is sampled over the turn, and its minimum refined to rounding. Coupled loops have 1 if they
    close over the whole turn, else -1.
    """
    if not variants.base.is_dyadic:
        return np.array([[_turns(variants, i)] for i in range(len(variants))])
    slides = variants.base.structure.slides
    found = _SlidingClearances(variants) if slides else _Clearances(variants)
    clearances = np.full((len(variants), len(variants.base.blocks)), np.nan)
    closing = np.arange(len(variants))
    for k, block in enumerate(variants.base.blocks):
        if isinstance(found, _Clearances) and is_driven(block):
            least = found.driven(k)[closing]
        else:
            least = found.least(k, closing)
        clearances[closing, k] = np.where(np.isnan(least), -np.inf, least)
        closing = closing[least >= 0.0]
        if not len(closing):
            break
    return clearances


def driven_clearances(variants: Variants) -> FloatArray:
    """Return the least clearance of the dyads driven by the crank alone, shape (n,) [m]."""
    least = np.full(len(variants), np.inf)
    if variants.base.two_circles:
        found = _Clearances(variants)
        for k, block in enumerate(variants.base.blocks):
            if is_driven(block):
                least = np.fmin(least, found.driven(k))
    return least


def _turns(variants: Variants, i: int) -> float:
    try:
        return 1.0 if reachable_arcs(variants[i]) == [(0.0, TURN)] else -1.0
    except (GeometryError, KinematicsError):
        return -1.0


class _Clearances:
    """The clearances of pinned dyads, by the squared distances of their ends."""

    def __init__(self, variants: Variants) -> None:
        structure = variants.base.structure
        self._structure = structure
        self._terms = PathTerms(structure, *variants.vectors, variants.signs)
        self._count, self._program = len(variants), compile_program(structure, links=False)

    @cached_property
    def _constants(self) -> FloatArray:
        return constants(self._program, self._terms, self._count)

    def driven(self, k: int) -> FloatArray:
        """Return the least of a dyad driven by the crank alone, shape (n,) [m]."""
        (loop,) = self._structure.paths.rows[k]
        path = self._structure.paths.loops[loop]
        crank = np.abs(self._terms.body(path, 0))
        ground = np.abs(self._terms.fixed(path))
        r_a, r_b = (np.abs(link) for link in self._terms.links(k))
        least: FloatArray = np.minimum(
            r_a + r_b - (crank + ground), abs(crank - ground) - abs(r_a - r_b)
        )
        return least

    def least(self, k: int, which: IndexArray) -> FloatArray:
        """Return the least of any other dyad for some of the linkages, shape (n,) [m]."""
        names, parts = (self._program.distances[k],), _parts(which)
        kernel = NumpyKernel(self._program, names, SAMPLES_PER_TURN * max(map(len, parts)))
        return np.concatenate([self._least(k, kernel, part) for part in parts])

    def _least(self, k: int, kernel: NumpyKernel, part: IndexArray) -> FloatArray:
        # Samples start with the crank along the ground: they include the angles of least clearance
        # of the first dyad, where the other clearances are steepest.
        path = self._structure.paths.loops[0]
        with np.errstate(invalid='ignore', divide='ignore'):
            ground = -np.asarray(self._terms.fixed(path) / self._terms.body(path, 0))
        start = self._structure.senses[0] * np.angle(ground)[part, None]
        r_a, r_b = (np.abs(link)[part, None] for link in self._terms.links(k))
        own, folded, stretched = self._constants[:, part], abs(r_a - r_b), r_a + r_b

        def clearance(rows: Any, cos: FloatArray, sin: FloatArray) -> FloatArray:
            """Return the clearance, shape (n, number of angles); NaN if earlier dyads are open."""
            with np.errstate(all='ignore'):
                (distance,), _ = kernel.run(own[:, rows], slice(None), (cos, sin))
                distance = np.sqrt(distance)
            found: FloatArray = np.minimum(stretched[rows] - distance, distance - folded[rows])
            return found

        return _least_over_turn(clearance, start, stretched[:, 0])


class _SlidingClearances:
    """The clearances of dyads with sliding joints."""

    def __init__(self, variants: Variants) -> None:
        self._variants = variants

    def least(self, k: int, which: IndexArray) -> FloatArray:
        """Return the least of a dyad for some of the linkages, shape (n,) [m]."""
        return np.concatenate([np.empty(0), *(self._least(k, part) for part in _parts(which))])

    def _least(self, k: int, part: IndexArray) -> FloatArray:
        dyads = Blockwise(self._variants, part)
        if not dyads.blocks[k].two_branches:
            return np.full(len(part), np.inf)

        def clearance(rows: Any, cos: FloatArray, sin: FloatArray) -> FloatArray:
            """Return the clearance, shape (n, number of angles); NaN if earlier dyads are open."""
            some = dyads if isinstance(rows, slice) else Blockwise(self._variants, part[rows])
            with np.errstate(all='ignore'):
                found: FloatArray = some.blocks[k].clearance(some.place(np.arctan2(sin, cos), k))
            return found

        numbers = self._variants.numbers[:, part]
        return _least_over_turn(clearance, np.zeros((len(part), 1)), np.abs(numbers).max(axis=0))


def _parts(which: IndexArray) -> list[IndexArray]:
    """Return parts of some linkages that fit into the cache."""
    step = max(1, MAX_POSES // SAMPLES_PER_TURN)
    return [which[slice(n, n + step)] for n in range(0, len(which), step)]


def _least_over_turn(clearance: Clearance, start: FloatArray, sizes: FloatArray) -> FloatArray:
    """
    Return the least clearances over a turn from a start, shape (n, 1) [rad]; -inf if none.

    Their rounding is relative to `sizes`, shape (n,) [m].
    """

    def refined(rows: IndexArray, alphas: FloatArray) -> FloatArray:
        return clearance(rows, np.cos(alphas), np.sin(alphas))

    step = TURN / SAMPLES_PER_TURN
    # By angle addition, much faster than cosines and sines.
    crank = np.exp(1j * start) * np.exp(1j * step * np.arange(SAMPLES_PER_TURN))
    values = clearance(slice(None), crank.real, crank.imag)
    middle = start[:, 0] + step * _lowest(values)
    _, least = minimum_near(refined, middle, step, 2.0 * float_info.epsilon * sizes)
    least = np.fmin(least, np.fmin.reduce(values, axis=1))
    return np.where(np.isfinite(least), least, -np.inf)


def _lowest(values: FloatArray) -> IndexArray:
    """Return the sample nearest to the minimum, by a parabola through each three."""
    height = -np.where(np.isnan(values), np.inf, values)
    before, after = np.roll(height, 1, axis=1), np.roll(height, -1, axis=1)
    lowest: IndexArray = parabola_peak(before, height, after).argmax(axis=1)
    return lowest
