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

    `torque` is that at the crank [N m]. `pins` has the force of a pin, by its point, on a body, by
    its angle, or on 'ground': x + i y [N]. `lines` has the normal force on each sliding body,
    positive to its line's left, and the moment on it about its first point [N, N m].
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
    pinned = [
        (point, first, j) for point, (first, *others) in structure.owners.items() for j in others
    ]
    sliding = sorted(structure.line_of)
    columns = _columns(moving, [centre for centre, _, _ in centres], pinned, sliding)
    matrix = np.stack(columns, axis=2)
    singular = np.asarray(np.isnan(matrix).any(axis=(1, 2)) | np.isnan(right).any(axis=1))
    matrix[singular] = np.eye(3 * n)
    right = np.where(singular[:, None], np.nan, right)
    torque, *found = np.linalg.solve(matrix, right[..., None])[..., 0].T
    pairs = list(zip(found[::2], found[1::2], strict=True))
    names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
    pins: dict[tuple[str, str], ComplexArray] = {}
    for (point, first, j), (x, y) in zip(pinned, pairs, strict=False):
        pins[point, names[j]] = x + 1j * y
        own = point, names[first]
        pins[own] = pins.get(own, 0.0) - pins[point, names[j]]
    first_line = len(pinned)
    lines = zip(sliding, pairs[first_line:], strict=True)
    return Reactions(torque, pins, {names[j]: pair for j, pair in lines})


def _columns(
    moving: BodyMotion,
    centres: Sequence[ComplexArray],
    pinned: Sequence[tuple[str, int, int]],
    sliding: Sequence[int],
) -> list[FloatArray]:
    """Return the equations' columns: the torque's, and two for each pin and each line."""
    structure = moving.linkage.structure
    zero = np.zeros(moving.alphas.size, dtype=np.complex128)
    torque = np.zeros((zero.size, 3 * len(centres)))
    torque[:, 2] = 1.0
    columns = [torque]

    def add(column: FloatArray, j: int, at: ComplexArray, force: ComplexArray) -> None:
        """Add a force on a body at a place."""
        if j != FIXED:
            column[:, 3 * j] += force.real
            column[:, 3 * j + 1] += force.imag
            column[:, 3 * j + 2] += cross(at - centres[j], force)

    for point, first, j in pinned:
        at = moving.point(point)[0]
        for direction in (1.0 + 0j, 1j):
            columns.append(np.zeros_like(torque))
            add(columns[-1], j, at, zero + direction)
            add(columns[-1], first, at, zero - direction)
    for j in sliding:
        at = moving.point(structure.bodies[j].points[0])[0]
        normal = 1j * moving.linkage.line(moving.u, j) + zero
        columns += [np.zeros_like(torque), np.zeros_like(torque)]
        for body, sign in ((j, 1.0), (structure.along[j], -1.0)):
            if body is not None and body != FIXED:
                add(columns[-2], body, at, sign * normal)
                columns[-1][:, 3 * body + 2] = sign
    return columns
