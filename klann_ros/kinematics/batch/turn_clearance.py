"""
The least clearance of every block over a whole turn of the crank, for many linkages at once.

A linkage turns fully where none is negative. Those given need not close: so a number can be
changed until the crank turns no more.
"""

from sys import float_info
from typing import Any

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.errors import GeometryError, KinematicsError
from klann_ros.kinematics.linkage.reach import is_driven, reachable_arcs
from klann_ros.kinematics.linkage.variants import Variants
import numpy as np

from .numpy_kernel import NumpyKernel
from .program import Array, constants, Numbers, program
from .searches import Indices, least_near

# Crank angles of the search, an even number.
SAMPLES = 360
# So many poses are held at once: what the processor's own memory holds.
POSES_HELD = 1 << 15


def turn_clearances(variants: Variants) -> Array:
    """
    Return by how much each block of each linkage stays inside its reach over the turn, at least.

    Shape (n, number of blocks) [m]; negative where the full turn is lost, and NaN behind that. Of
    a dyad that the crank alone drives |PQ| runs from | |c| - |W_0| | to |c| + |W_0|; that of
    another one is sampled over the turn, and its least refined to rounding. Coupled loops only
    tell whether they close all round: 1 or -1.
    """
    if not variants.base.is_dyadic:
        return np.array([[_turns(variants, i)] for i in range(len(variants))])
    found = _Clearances(variants)
    clearances = np.full((len(variants), len(variants.base.blocks)), np.nan)
    closing = np.arange(len(variants))
    for k, block in enumerate(variants.base.blocks):
        least = found.driven(k)[closing] if is_driven(block) else found.least(k, closing)
        clearances[closing, k] = np.where(np.isnan(least), -np.inf, least)
        closing = closing[least >= 0.0]
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
        return 1.0 if reachable_arcs(variants[i]) == [(0.0, TURN)] else -1.0
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

    def least(self, k: int, which: Indices) -> Array:
        """Return the least of any other dyad for some of the linkages, shape (n,) [m]."""
        step = max(1, POSES_HELD // SAMPLES)
        parts = [which[first : first + step] for first in range(0, len(which), step)]
        names = self._program.distances[k : k + 1]
        kernel = NumpyKernel(self._program, names, SAMPLES * min(step, len(which)))
        return np.concatenate([np.empty(0), *(self._least(k, kernel, part) for part in parts)])

    def _least(self, k: int, kernel: NumpyKernel, part: Indices) -> Array:
        # From where the crank points along the ground on: so the angles at which the first dyad is
        # nearest to its limits, where the others' clearance is steepest, are among the samples.
        path = self._structure.paths.loops[0]
        with np.errstate(invalid='ignore', divide='ignore'):
            ground = -np.asarray(self._numbers.fixed(path) / self._numbers.body(path, 0))
        start = self._structure.senses[0] * np.angle(ground)[part, None]
        step = TURN / SAMPLES
        r_a, r_b = (np.abs(link)[part, None] for link in self._numbers.links(k))
        own, folded, stretched = self._constants[:, part], abs(r_a - r_b), r_a + r_b

        def clearance(rows: Any, cos: Array, sin: Array) -> Array:
            """Return it at crank angles, shape (n, number of angles); NaN behind others."""
            with np.errstate(all='ignore'):
                (distance,), _ = kernel.run(own[:, rows], slice(None), (cos, sin))
                distance = np.sqrt(distance)
            found: Array = np.minimum(stretched[rows] - distance, distance - folded[rows])
            return found

        def refined(rows: Indices, alphas: Array) -> Array:
            return clearance(rows, np.cos(alphas), np.sin(alphas))

        # Of the sum of two angles: many times as fast.
        turned = np.exp(1j * start) * np.exp(1j * step * np.arange(SAMPLES))
        values = clearance(slice(None), turned.real, turned.imag)
        middle = start[:, 0] + step * _lowest(values)
        rounding = 2.0 * float_info.epsilon * stretched[:, 0]
        _, least = least_near(refined, middle, step, rounding)
        least = np.fmin(least, np.fmin.reduce(values, axis=1))
        return np.where(np.isfinite(least), least, -np.inf)


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
