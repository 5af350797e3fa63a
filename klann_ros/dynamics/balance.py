"""
Joint reactions by the Newton-Euler equations of every body, at many crank angles at once.

A pin carries a force on each of its bodies, their sum 0; a sliding joint a normal force and a
moment; a torque drives the crank. For a linkage with one crank the unknowns are as many as the
equations.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from klann_ros.kinematics import cross, FIXED, GROUND
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
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
    right = np.zeros((count, n, 3))
    for j, (body, (_, c_1, c_2)) in enumerate(zip(bodies, centres, strict=True)):
        acceleration = c_2 * rates[0] ** 2 + c_1 * rates[1]
        angular = moving.rotation_2[j] * rates[0] ** 2 + moving.rotation_1[j] * rates[1]
        force = body.mass * (acceleration - gravity)
        right[:, j] = np.stack([force.real, force.imag, body.inertia * angular], axis=1)
    for point, force in forces:
        j = structure.first_owner(point)
        right[:, j] -= _wrench(moving.point(point)[0] - centres[j][0], force)
    pinned = [
        (point, first, j) for point, (first, *others) in structure.owners.items() for j in others
    ]
    sliding = [(along, j) for j, along in enumerate(structure.along) if along is not None]
    columns = _columns(moving, [centre for centre, _, _ in centres], pinned, sliding)
    matrix, known = np.stack(columns, axis=2), right.reshape(count, 3 * n)
    singular = np.asarray(np.isnan(matrix).any(axis=(1, 2)) | np.isnan(known).any(axis=1))
    matrix[singular] = np.eye(3 * n)
    known[singular] = np.nan
    torque, *found = np.linalg.solve(matrix, known[..., None])[..., 0].T
    # Those of the pins, then those of the lines.
    pairs = iter(zip(found[::2], found[1::2], strict=True))
    names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
    pins: dict[tuple[str, str], ComplexArray] = {}
    for (point, first, j), (x, y) in zip(pinned, pairs, strict=False):
        pins[point, names[j]] = x + 1j * y
        own = point, names[first]
        pins[own] = pins.get(own, 0.0) - pins[point, names[j]]
    lines = {names[j]: pair for (_, j), pair in zip(sliding, pairs, strict=True)}
    return Reactions(torque, pins, lines)


def _columns(
    moving: BodyMotion,
    centres: Sequence[ComplexArray],
    pinned: Sequence[tuple[str, int, int]],
    sliding: Sequence[tuple[int, int]],
) -> list[FloatArray]:
    """Return the equations' columns: the torque's, and two for each pin and each line."""
    count, structure = moving.alphas.size, moving.linkage.structure
    columns: list[FloatArray] = []

    def add(first: int, j: int, at: Any, force: Any, moment: float = 0.0) -> None:
        """Add a force at a place and a moment on a body, and the opposite on the first."""
        column = np.zeros((count, len(centres), 3))
        for body, sign in ((first, -1.0), (j, 1.0)):
            if body != FIXED:
                column[:, body] += sign * _wrench(at - centres[body], force, moment)
        columns.append(column.reshape(count, -1))

    add(FIXED, 0, centres[0], 0j, 1.0)
    for point, first, j in pinned:
        at = moving.point(point)[0]
        add(first, j, at, 1.0 + 0j)
        add(first, j, at, 1j)
    for along, j in sliding:
        at = moving.point(structure.bodies[j].points[0])[0]
        add(along, j, at, 1j * moving.linkage.line(moving.u, j))
        add(along, j, at, 0j, 1.0)
    return columns


def _wrench(arm: ComplexArray, force: Any, moment: float = 0.0) -> FloatArray:
    """Return forces along x and y and the moment about a centre, shape (k, 3)."""
    given = force + np.zeros_like(arm)
    return np.stack([given.real, given.imag, cross(arm, given) + moment], axis=1)
