"""
Joint reactions: what balances every body by Newton and Euler, at many crank angles at once.

A pin carries a force on each of its bodies, all together none; a line a force square to it and a
moment; the crank is driven by a torque. For a linkage with one crank these are as many numbers as
the bodies have equations.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from klann_ros.kinematics.linkage.dyads import cross
from klann_ros.kinematics.linkage.structure import FIXED, GROUND
import numpy as np
from numpy.typing import NDArray

from .masses import BodyMass
from .motion import Complex, Motion

Array = NDArray[np.float64]


class Reactions(NamedTuple):
    """
    What the joints of a linkage carry, shape (k,) each, in the linkage's plane.

    Attributes
    ----------
    torque : numpy.ndarray
        At the crank [N m].
    pins : dict of (str, str) to numpy.ndarray of complex
        The force of a pin, by its point, on a body, by its angle, or on 'ground': x + i y [N].
    lines : dict of str to (numpy.ndarray, numpy.ndarray)
        Of each body that slides the force on it square to its line, positive to the line's left
        [N], and the moment on it about its first point [N m].

    """

    torque: Array
    pins: dict[tuple[str, str], Complex]
    lines: dict[str, tuple[Array, Array]]


def reactions(
    moving: Motion,
    bodies: Sequence[BodyMass],
    rates: tuple[Array, Array],
    gravity: complex,
    forces: Sequence[tuple[str, Any]],
) -> Reactions:
    """
    Return what the joints carry.

    `rates` are the crank's rate and its change [rad/s, rad/s^2], one or one for each angle;
    `forces` act on points [N].
    """
    structure = moving.linkage.structure
    count, n = moving.alphas.size, len(bodies)
    centres = [moving.fixed_to(j, body.centre) for j, body in enumerate(bodies)]
    right = np.zeros((count, 3 * n))
    for j, (body, (_, c_1, c_2)) in enumerate(zip(bodies, centres, strict=True)):
        moved = c_2 * rates[0] ** 2 + c_1 * rates[1]
        turned = moving.turning_2[j] * rates[0] ** 2 + moving.turning_1[j] * rates[1]
        force = body.mass * (moved - gravity)
        right[:, 3 * j], right[:, 3 * j + 1] = force.real, force.imag
        right[:, 3 * j + 2] = body.inertia * turned
    for point, force in forces:
        j = structure.first_owner(point)
        arm = moving.point(point)[0] - centres[j][0]
        given = force + np.zeros(count, dtype=np.complex128)
        right[:, 3 * j] -= given.real
        right[:, 3 * j + 1] -= given.imag
        right[:, 3 * j + 2] -= cross(arm, given)
    system = _System(moving, [c for c, _, _ in centres])
    return system.solved(right)


class _System:
    """The columns of the equations: one for each number that a joint carries."""

    def __init__(self, moving: Motion, centres: Sequence[Complex]) -> None:
        structure = moving.linkage.structure
        self._moving, self._centres = moving, centres
        self._pins = [
            (point, first, j)
            for point, (first, *others) in structure.owners.items()
            for j in others
        ]
        self._slides = sorted(structure.line_of)

    def solved(self, right: Array) -> Reactions:
        """Return what balances the equations' right-hand sides."""
        structure = self._moving.linkage.structure
        count, size = right.shape
        columns = self._columns(count)
        matrix = np.stack(columns, axis=2)
        gone = np.asarray(np.isnan(matrix).any(axis=(1, 2)) | np.isnan(right).any(axis=1))
        matrix[gone] = np.eye(size)
        right = np.where(gone[:, None], np.nan, right)
        found = np.linalg.solve(matrix, right[..., None])[..., 0].T
        names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
        pins: dict[tuple[str, str], Complex] = {}
        for k, (point, first, j) in enumerate(self._pins):
            force = found[1 + 2 * k] + 1j * found[2 + 2 * k]
            pins[point, names[j]] = force
            own = point, names[first]
            pins[own] = pins.get(own, 0.0) - force
        start = 1 + 2 * len(self._pins)
        lines = {
            names[j]: (found[start + 2 * k], found[start + 1 + 2 * k])
            for k, j in enumerate(self._slides)
        }
        return Reactions(found[0], pins, lines)

    def _columns(self, count: int) -> list[Array]:
        size = 3 * len(self._centres)
        zero = np.zeros(count, dtype=np.complex128)
        columns = [np.zeros((count, size))]
        columns[0][:, 2] = 1.0
        for point, first, j in self._pins:
            at = self._moving.point(point)[0]
            for way in (1.0 + 0j, 1j):
                column = np.zeros((count, size))
                self._add(column, j, at, zero + way)
                self._add(column, first, at, zero - way)
                columns.append(column)
        structure = self._moving.linkage.structure
        for j in self._slides:
            at = self._moving.point(structure.bodies[j].points[0])[0]
            along = self._moving.linkage.line(self._moving.u, j) + zero
            on = structure.along[j]
            square, moment = np.zeros((count, size)), np.zeros((count, size))
            self._add(square, j, at, 1j * along)
            moment[:, 3 * j + 2] = 1.0
            if on is not None and on != FIXED:
                self._add(square, on, at, -1j * along)
                moment[:, 3 * on + 2] = -1.0
            columns += [square, moment]
        return columns

    def _add(self, column: Array, j: int, at: Complex, force: Complex) -> None:
        """Add a force on a body at a place."""
        if j == FIXED:
            return
        column[:, 3 * j] += force.real
        column[:, 3 * j + 1] += force.imag
        column[:, 3 * j + 2] += cross(at - self._centres[j], force)
