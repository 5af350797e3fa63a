"""The motion of every body at many crank angles: vectors and their first two derivatives."""

from typing import Any, NamedTuple

from klann_ros.kinematics import (
    as_linkage,
    body_vectors,
    differences,
    Linkage,
    linkage_poses,
    real_array,
    SAME_ANGLE,
    solve_rates,
    vector_velocity,
    velocity_product,
)
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
import numpy as np
from numpy.typing import ArrayLike


class BodyMotion(NamedTuple):
    """
    Poses of n bodies at k crank angles, and their derivatives by the crank angle.

    Missing and singular poses are NaN.
    """

    linkage: Linkage
    # The crank angles, shape (k,) [rad].
    alphas: FloatArray
    # The bodies' vectors and their derivatives, shape (n, k): see `kinematics.linkage.joints`.
    u: ComplexArray
    u_1: ComplexArray
    u_2: ComplexArray
    # Derivatives of the bodies' rotation, counter-clockwise, shape (n, k) [rad/rad, rad/rad^2].
    rotation_1: FloatArray
    rotation_2: FloatArray

    def point(self, name: str) -> tuple[Any, Any, Any]:
        """Return a point and its derivatives, shape (k,) each [m]."""
        index = self.linkage.structure.points.index(name)
        terms, constant = self.linkage.point_rows[index]

        def weighted_sum(vectors: ComplexArray) -> Any:
            total = np.zeros(self.alphas.size) + 0j
            for j, weight in terms.items():
                total = total + weight * vectors[j]
            return total

        return weighted_sum(self.u) + constant, weighted_sum(self.u_1), weighted_sum(self.u_2)

    def fixed_to(self, j: int, place: complex) -> tuple[Any, Any, Any]:
        """Return a point fixed to a body, (x, y) from its first point, and its derivatives."""
        structure = self.linkage.structure
        p, p_1, p_2 = self.point(structure.bodies[j].points[0])
        frame = structure.frames[j]
        if frame < 0:
            return p + place, p_1, p_2
        return (
            p + place * self.u[frame],
            p_1 + place * self.u_1[frame],
            p_2 + place * self.u_2[frame],
        )


def body_motion(linkage: Linkage, alphas: ArrayLike) -> BodyMotion:
    """
    Return the motion at crank angles, shape (k,) [rad].

    A TypeError for no linkage, and a ValueError for no angles or more than one axis of them.
    """
    linkage = as_linkage(linkage)
    angles = np.atleast_1d(np.asarray(real_array('alphas', alphas), dtype=np.float64))
    if angles.ndim != 1:
        raise ValueError(f'alphas is refused: its shape must be (k,), not {angles.shape}')
    poses: Any = linkage_poses(linkage, angles, angles=True)
    return body_motion_at(linkage, angles + 0.0 * poses.h[:, 0], poses.angles.T)


def body_motion_at(linkage: Linkage, angles: FloatArray, x: FloatArray) -> BodyMotion:
    """Return the motion through poses, by all coordinates, shapes (k,) and (n - 1, k)."""
    structure = linkage.structure
    u = np.array(body_vectors(structure, [angles, *x]))
    blocks = [block.closing(u) for block in linkage.blocks]
    x_1, u_1 = solve_rates(structure, u, blocks, 1.0)
    bent = velocity_product(structure, u, x_1)
    x_2, u_2 = solve_rates(structure, u, blocks, 0.0, bent=bent)
    if linkage.change_points:
        rates = np.array(x_1), np.array(x_2)
        _through_change_points(linkage, angles, x, rates)
        x_1, x_2 = map(list, rates)
        bent = velocity_product(structure, u, x_1)
        for j in range(len(u)):
            u_1[j] = vector_velocity(structure, u, x_1, j)
            u_2[j] = bent[j] + vector_velocity(structure, u, x_2, j)
    senses = np.array(structure.senses)[:, None]
    frames = np.array(structure.frames)
    # The ground does not rotate.
    rotation = [
        np.where(frames[:, None] < 0, 0.0, (senses * np.array(rate))[frames]) + 0.0 * angles
        for rate in (x_1, x_2)
    ]
    return BodyMotion(linkage, angles, u, np.array(u_1), np.array(u_2), *rotation)


def _through_change_points(
    linkage: Linkage, angles: FloatArray, x: FloatArray, rates: tuple[FloatArray, FloatArray]
) -> None:
    """Replace dx and d2x by the crank angle near change points by those of the path of x."""
    points = linkage.change_points
    # At a change point the poses of several turns meet: that of the given angle comes last.
    for turn in reversed(range(points.period)):
        for near, pose in points.interpolated_poses(angles + turn * TURN):
            is_on_path = (np.abs(differences(linkage, x[:, near].T, pose.x)) < SAME_ANGLE).all(1)
            indices = np.flatnonzero(near)[is_on_path]
            for derivatives, interpolation in zip(rates, (pose.x_1, pose.x_2), strict=True):
                derivatives[1:, indices] = interpolation[is_on_path].T
