"""
Joint reactions by the Newton-Euler equations of every body, at many crank angles at once.

A pin carries a force on each of its bodies, their sum 0; a sliding joint a normal force and a
moment; a torque drives the crank. For a linkage with one crank the unknowns are as many as the
equations.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import ComplexArray, FloatArray
from klann_ros.kinematics.linkage.dyads import cross
from klann_ros.kinematics.linkage.structure import FIXED, GROUND
import numpy as np

from .masses import BodyMass
from .motion import BodyMotion


class Reactions(NamedTuple):
    """
    Joint reactions of a linkage, shape (k,) each, in the linkage's plane.

    Attributes
    ----------
    torque : numpy.ndarray
        At the crank [N m].
    pins : dict of (str, str) to numpy.ndarray of complex
        The force of a pin, by its point, on a body, by its angle, or on 'ground': x + i y [N].
    lines : dict of str to (numpy.ndarray, numpy.ndarray)
        The normal force on each sliding body, positive to its line's left, and the moment on it
        about its first point [N, N m].

    """

    torque: FloatArray
    pins: dict[tuple[str, str], ComplexArray]
    lines: dict[str, tuple[FloatArray, FloatArray]]


def reactions(
    moving: BodyMotion,
    bodies: Sequence[BodyMass],
    rates: tuple[FloatArray, FloatArray],
    gravity: complex,
    forces: Sequence[tuple[str, Any]],
) -> Reactions:
    """
    Return the joint reactions.

    `rates` are the crank's rate and acceleration [rad/s, rad/s^2], one or one for each angle;
    `forces` act on points [N].
    """
    structure, count, n = moving.linkage.structure, moving.alphas.size, len(bodies)
    centres = [moving.fixed_to(j, body.centre) for j, body in enumerate(bodies)]
    right = np.zeros((count, 3 * n))
    for j, (body, (_, c_1, c_2)) in enumerate(zip(bodies, centres, strict=True)):
        acceleration = c_2 * rates[0] ** 2 + c_1 * rates[1]
        angular = moving.rotation_2[j] * rates[0] ** 2 + moving.rotation_1[j] * rates[1]
        force = body.mass * (acceleration - gravity)
        right[:, 3 * j], right[:, 3 * j + 1] = force.real, force.imag
        right[:, 3 * j + 2] = body.inertia * angular
    for point, force in forces:
        j = structure.first_owner(point)
        arm = moving.point(point)[0] - centres[j][0]
        given = force + np.zeros(count, dtype=np.complex128)
        right[:, 3 * j] -= given.real
        right[:, 3 * j + 1] -= given.imag
        right[:, 3 * j + 2] -= cross(arm, given)
    return _System(moving, [c for c, _, _ in centres]).solve(right)


class _System:
    """The linear equations, a column for each component of a reaction."""

    def __init__(self, moving: BodyMotion, centres: Sequence[ComplexArray]) -> None:
        structure = moving.linkage.structure
        self._moving, self._centres = moving, centres
        self._pins = [
            (point, first, j)
            for point, (first, *others) in structure.owners.items()
            for j in others
        ]
        self._slides = sorted(structure.line_of)

    def solve(self, right: FloatArray) -> Reactions:
        """Return the reactions for right-hand sides, shape (k, 3 n)."""
        structure = self._moving.linkage.structure
        count, size = right.shape
        columns = self._columns(count)
        matrix = np.stack(columns, axis=2)
        singular = np.asarray(np.isnan(matrix).any(axis=(1, 2)) | np.isnan(right).any(axis=1))
        matrix[singular] = np.eye(size)
        right = np.where(singular[:, None], np.nan, right)
        found = np.linalg.solve(matrix, right[..., None])[..., 0].T
        names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
        pins: dict[tuple[str, str], ComplexArray] = {}
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

    def _columns(self, count: int) -> list[FloatArray]:
        size = 3 * len(self._centres)
        zero = np.zeros(count, dtype=np.complex128)
        columns = [np.zeros((count, size))]
        columns[0][:, 2] = 1.0
        for point, first, j in self._pins:
            at = self._moving.point(point)[0]
            for direction in (1.0 + 0j, 1j):
                column = np.zeros((count, size))
                self._add(column, j, at, zero + direction)
                self._add(column, first, at, zero - direction)
                columns.append(column)
        structure = self._moving.linkage.structure
        for j in self._slides:
            at = self._moving.point(structure.bodies[j].points[0])[0]
            along = self._moving.linkage.line(self._moving.u, j) + zero
            on = structure.along[j]
            normal, moment = np.zeros((count, size)), np.zeros((count, size))
            self._add(normal, j, at, 1j * along)
            moment[:, 3 * j + 2] = 1.0
            if on is not None and on != FIXED:
                self._add(normal, on, at, -1j * along)
                moment[:, 3 * on + 2] = -1.0
            columns += [normal, moment]
        return columns

    def _add(self, column: FloatArray, j: int, at: ComplexArray, force: ComplexArray) -> None:
        """Add a force on a body at a place."""
        if j == FIXED:
            return
        column[:, 3 * j] += force.real
        column[:, 3 * j + 1] += force.imag
        column[:, 3 * j + 2] += cross(at - self._centres[j], force)
