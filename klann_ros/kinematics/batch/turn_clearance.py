"""
The least clearance of every block over a whole turn of the crank, for many linkages at once.

A linkage turns fully where none is negative. Those given need not close: so a number can be
changed until the crank turns no more.
"""

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.errors import GeometryError, KinematicsError
from klann_ros.kinematics.linkage.reach import is_driven, reachable_arcs
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np
from numpy.typing import NDArray

from .numpy_kernel import NumpyKernel
from .program import Array, constants, Numbers, program

# Crank angles of the search, an even number; then each round looks 8 times closer at the least.
SAMPLES, ZOOM, ROUNDS = 360, 17, 8
# So many poses are held at once.
POSES_HELD = 1_000_000

Indices = NDArray[np.intp]


def turn_clearances(variants: Variants) -> Array:
    """
    Return by how much each block of each linkage stays inside its reach over the turn, at least.

    Shape (n, number of blocks) [m]; negative where the full turn is lost, and then those behind it
    mean nothing. Of a dyad that the crank alone drives |PQ| runs from | |c| - |W_0| | to |c| +
    |W_0|; that of another one is sampled over the turn, and its least refined to rounding. Coupled
    loops only tell whether they close all round: 0 or -1.
    """
    if not variants.base.is_dyadic:
        return np.array([[_turns(variants, i)] for i in range(len(variants))])
    found = _Clearances(variants)
    each = [
        found.driven(k) if is_driven(block) else found.least(k)
        for k, block in enumerate(variants.base.blocks)
    ]
    clearances = np.stack(each, axis=1)
    clearances[np.isnan(clearances)] = -np.inf
    return clearances


def driven_clearances(variants: Variants) -> Array:
    """Return the least clearance of the dyads that the crank alone drives, shape (n,) [m]."""
    least = np.full(len(variants), np.inf)
    if variants.base.is_dyadic:
        found = _Clearances(variants)
        for k, block in enumerate(variants.base.blocks):
            if is_driven(block):
                least = np.fmin(least, found.driven(k))
    return least


def _turns(variants: Variants, i: int) -> float:
    try:
        return 0.0 if reachable_arcs(variants[i]) == [(0.0, TURN)] else -1.0
    except (GeometryError, KinematicsError):
        return -1.0


class _Clearances:
    """The clearances of dyads, from the squares of the distances of their ends."""

    def __init__(self, variants: Variants) -> None:
        structure = variants.base.structure
        self._structure = structure
        self._numbers = Numbers(structure, *variants.vectors, variants.signs)
        self._program = program(structure, links=False)
        self._constants = constants(self._program, self._numbers, len(variants))

    def driven(self, k: int) -> Array:
        """Return the least of a dyad that the crank alone drives, shape (n,) [m]."""
        (loop,) = self._structure.paths.rows[k]
        path = self._structure.paths.loops[loop]
        crank = np.abs(self._numbers.body(path, 0))
        ground = np.abs(self._numbers.fixed(path))
        r_a, r_b = (np.abs(link) for link in self._numbers.links(k))
        least: Array = np.minimum(
            r_a + r_b - (crank + ground), abs(crank - ground) - abs(r_a - r_b)
        )
        return least

    def least(self, k: int) -> Array:
        """Return the least of any other dyad, shape (n,) [m]."""
        step = max(1, POSES_HELD // SAMPLES)
        legs = self._constants.shape[1]
        parts = [slice(first, first + step) for first in range(0, legs, step)]
        return np.concatenate([self._least(k, part) for part in parts])

    def _least(self, k: int, part: slice) -> Array:
        # From where the crank points along the ground on: so the angles at which the first dyad is
        # nearest to its limits, where the others' clearance is steepest, are among the samples.
        path = self._structure.paths.loops[0]
        ground = -np.asarray(self._numbers.fixed(path) / self._numbers.body(path, 0))
        start = self._structure.senses[0] * np.angle(ground)[part, None]
        step = TURN / SAMPLES
        values = self._at(k, part, start + step * np.arange(SAMPLES))
        middle = start + step * _lowest(values)[:, None]
        least: Array = np.fmin.reduce(values, axis=1)
        around = np.linspace(-1.0, 1.0, ZOOM)
        for _ in range(ROUNDS):
            angles = middle + step * around
            values = self._at(k, part, angles)
            least = np.fmin(least, np.fmin.reduce(values, axis=1))
            place = np.where(np.isnan(values), np.inf, values).argmin(axis=1)
            middle = np.take_along_axis(angles, place[:, None], axis=1)
            step *= around[1] - around[0]
        return least

    def _at(self, k: int, part: slice, alphas: Array) -> Array:
        """Return the clearance at crank angles, shape (n, number of angles); NaN behind others."""
        name = self._program.distances[k]
        kernel = NumpyKernel(self._program, (name,), alphas.size)
        with np.errstate(all='ignore'):
            (distance,), _ = kernel.run(self._constants, part, (np.cos(alphas), np.sin(alphas)))
            distance = np.sqrt(distance)
        r_a, r_b = (np.abs(link)[part, None] for link in self._numbers.links(k))
        clearance: Array = np.minimum(r_a + r_b - distance, distance - abs(r_a - r_b))
        return clearance


def _lowest(values: Array) -> Indices:
    """Return beside which sample of a turn the least is, by the parabola through each three."""
    values = np.where(np.isnan(values), np.inf, values)
    before, after = np.roll(values, 1, axis=1), np.roll(values, -1, axis=1)
    with np.errstate(invalid='ignore'):
        bend = before - 2.0 * values + after
        dips = (values <= before) & (values <= after) & (bend > 0.0) & np.isfinite(bend)
        deeper = (after - before) ** 2 / (8.0 * np.where(dips, bend, np.inf))
    lowest: Indices = (values - np.where(dips, deeper, 0.0)).argmin(axis=1)
    return lowest
