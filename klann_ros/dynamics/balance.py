"""
Joint reactions by the Newton-Euler equations of every body, at many crank angles at once.

A pin carries a force on each of its bodies, their sum 0; a sliding joint a normal force and a
moment; a torque drives the crank. For a linkage with one crank the unknowns are as many as the
equations.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from klann_ros.kinematics import cross, FIXED, GROUND, wrapped
from klann_ros.kinematics.arrays import ComplexArray, FloatArray, with_short_repr
import numpy as np

from .masses import BodyMass
from .motion import BodyMotion

# Beside a change point forces are rounding [rad].
CHANGE_POINT_RADIUS = 1e-7


@with_short_repr
class Reactions(NamedTuple):
    """
    Joint reactions of a linkage, shape (k,) each, in the linkage's plane.

    `torque` acts at the crank [N m]. `pins` has the force of a pin, by its point, on a body, by
    its angle, or on 'ground': x + i y [N]. `lines` has the normal force on each sliding body,
    positive to its line's left, and the moment on it about its first point [N, N m].
    """

    torque: FloatArray
    pins: dict[tuple[str, str], ComplexArray]
    lines: dict[str, tuple[FloatArray, FloatArray]]


def reactions(  # noqa: PLR0917 - the terms of the equations
    moving: BodyMotion,
    bodies: Sequence[BodyMass],
    rates: Sequence[FloatArray],
    gravity: complex,
    forces: Sequence[tuple[str, Any]],
    moments: Sequence[tuple[int, Any]],
) -> Reactions:
    """
    Return the joint reactions.

    `rates` are the crank's rate and acceleration [rad/s, rad/s^2], one or one for each angle;
    `forces` act on points [N], `moments` on bodies by their indices [N m].
    """
    structure = moving.linkage.structure
    angle_count = moving.alphas.size
    equation_count = 3 * len(bodies)
    rate, rate_change = rates
    centres = []
    inertia_forces = np.zeros((angle_count, len(bodies), 3))
    for j, body in enumerate(bodies):
        centre, c_1, c_2 = moving.fixed_to(j, body.centre)
        centres.append(centre)
        acceleration = c_2 * rate**2 + c_1 * rate_change
        angular = moving.rotation_2[j] * rate**2 + moving.rotation_1[j] * rate_change
        force = body.mass * (acceleration - gravity)
        inertia_forces[:, j] = np.stack([force.real, force.imag, body.inertia * angular], axis=1)
    for point, force in forces:
        j = structure.first_owner(point)
        inertia_forces[:, j] -= _wrench(moving.point(point)[0] - centres[j], force)
    for j, moment in moments:
        inertia_forces[:, j, 2] -= moment
    pinned = []
    for point, (first, *later) in structure.owners.items():
        pinned += [(point, first, j) for j in later]
    sliding = [(along, j) for j, along in enumerate(structure.along) if along is not None]
    matrix = np.stack(_columns(moving, centres, pinned, sliding), axis=2)
    right_side = inertia_forces.reshape(angle_count, equation_count)
    is_singular = np.asarray(np.isnan(matrix).any(axis=(1, 2)) | np.isnan(right_side).any(axis=1))
    for change_point in moving.linkage.change_points.points:
        # There the links are in line, and leave their forces undetermined.
        is_singular |= np.abs(wrapped(moving.alphas - change_point.beta)) <= CHANGE_POINT_RADIUS
    matrix[is_singular] = np.eye(equation_count)
    right_side[is_singular] = np.nan
    torque, *joint_loads = np.linalg.solve(matrix, right_side[..., None])[..., 0].T
    # Two loads of each pin, then two of each line.
    load_pairs = iter(zip(joint_loads[::2], joint_loads[1::2], strict=True))
    names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
    pins: dict[tuple[str, str], ComplexArray] = {}
    for (point, first, j), (x, y) in zip(pinned, load_pairs, strict=False):
        pins[point, names[j]] = x + 1j * y
        first_pin = point, names[first]
        pins[first_pin] = pins.get(first_pin, 0.0) - pins[point, names[j]]
    lines = {}
    for (_, j), line_loads in zip(sliding, load_pairs, strict=True):
        lines[names[j]] = line_loads
    return Reactions(torque, pins, lines)


def _columns(
    moving: BodyMotion,
    centres: Sequence[ComplexArray],
    pinned: Sequence[tuple[str, int, int]],
    sliding: Sequence[tuple[int, int]],
) -> list[FloatArray]:
    """Return the equations' columns: one of the torque, and two of each pin and each line."""
    angle_count = moving.alphas.size
    columns: list[FloatArray] = []

    def add(first: int, j: int, place: Any, force: Any, moment: float = 0.0) -> None:
        """Add a force at a place and a moment on a body, and the opposite on the first."""
        column = np.zeros((angle_count, len(centres), 3))
        for body, sign in ((first, -1.0), (j, 1.0)):
            if body != FIXED:
                column[:, body] += sign * _wrench(place - centres[body], force, moment)
        columns.append(column.reshape(angle_count, 3 * len(centres)))

    add(FIXED, 0, centres[0], 0j, 1.0)
    for point, first, j in pinned:
        pin, _, _ = moving.point(point)
        add(first, j, pin, 1.0 + 0j)
        add(first, j, pin, 1j)
    for along, j in sliding:
        start, _, _ = moving.point(moving.linkage.structure.bodies[j].points[0])
        add(along, j, start, 1j * moving.linkage.line(moving.u, j))
        add(along, j, start, 0j, 1.0)
    return columns


def _wrench(arm: ComplexArray, force: Any, moment: float = 0.0) -> FloatArray:
    """Return forces along x and y and the moment about a centre, shape (k, 3)."""
    forces = force + np.zeros_like(arm)
    return np.stack([forces.real, forces.imag, cross(arm, forces) + moment], axis=1)
