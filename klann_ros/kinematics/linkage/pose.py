"""A solved pose of a linkage, its motion, and the geometric method that places it."""

from cmath import rect
from collections.abc import Sequence
from math import hypot, nan
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import ComplexArray, FloatArray, plane_vectors
import numpy as np

from . import joints
from .change_points import InterpolatedPose
from .linkage import Linkage
from .structure import Structure


def closed_form_vectors(
    linkage: Linkage, alpha: float, signs: Sequence[int] | None = None
) -> list[complex]:
    """
    Return the bodies' vectors at a path angle [rad]; an UnreachableError or LoopsOpenError.

    `signs` are those of the blocks; by default those of the branch, on which a pose near a change
    point is interpolated.
    """
    senses = linkage.structure.senses
    if signs is None:
        interpolated = linkage.interpolated(alpha)
        if interpolated is not None:
            return _interpolated_vectors(linkage, alpha, interpolated)
        signs = linkage.signs(alpha)
    u = [rect(1.0, senses[0] * alpha), *[0j] * (len(senses) - 1)]
    prefix: list[complex] = []
    for block, sign in zip(linkage.blocks, signs, strict=True):
        if block.is_dyad:
            a, b = block.unknowns
            u[a], u[b] = block.place(u, alpha, sign)
            continue
        prefix = prefix or _branch_vectors(linkage, alpha)
        for j in block.unknowns:
            u[j] = prefix[j]
    return u


def _branch_vectors(linkage: Linkage, alpha: float) -> list[complex]:
    """Return the vectors of the bodies up to the last coupled loops; of others a unit vector."""
    x = [0.0] * len(linkage.structure.bodies)
    for j, coordinate in zip(
        linkage.prefix_bodies, (alpha, *linkage.branch.x(alpha)), strict=True
    ):
        x[j] = coordinate
    return list(map(complex, joints.body_vectors(linkage.structure, x)))


def initial_guess(linkage: Linkage, alpha: float) -> tuple[float, ...]:
    """Return the other coordinates at a crank angle; see `closed_form_vectors`."""
    return _other_coordinates(linkage.structure, closed_form_vectors(linkage, alpha))


def _other_coordinates(structure: Structure, u: Sequence[complex]) -> tuple[float, ...]:
    """Return the coordinates of all bodies but the crank."""
    return tuple(float(joints.coordinate(structure, u, j)) for j in range(1, len(u)))


Vector = tuple[float, float]


class PoseEntry:
    """A name for one number of a pose or a motion: which of `x` or `joints` it is."""

    def __init__(self, field: str, place: int) -> None:
        self._field = field
        self._place = place

    def __get__(self, owner: Any, _: Any = None) -> float:
        number: float = getattr(owner, self._field)[self._place]
        return number


class LinkagePose(NamedTuple):
    """
    A solved pose: immutable, and cheap enough to be made a thousand times a second.

    Attributes
    ----------
    alpha : float
        Crank angle as given, not wrapped [rad].
    x : tuple of float
        The other coordinates, in the order of the linkage's `joint_names`: angles in (-pi, pi]
        [rad], and distances of what slides [m].
    h : tuple of float
        The foot (x, y) [m].
    iterations : int
        Newton iterations, the last of which only confirms; 0 for the closed form.
    residual : float
        Euclidean norm of f at this pose [m]: the closure error.
    coefficients : tuple of float
        Kinematic coefficients dx/dalpha [1, m/rad]; NaN at a singular pose.
    sines : tuple of float
        `|sin|` of each dyad's transmission angle: 1 transmits best, 0 is singular. Of coupled
        loops their normalised determinant: see `Block`.
    linkage : Linkage
        The linkage.
    turns : int
        Whole turns between the crank angle and the path angle, modulo the period of the branch:
        0 but for a linkage with change points that is not back after a turn.

    """

    alpha: float
    x: tuple[float, ...]
    h: Vector
    iterations: int
    residual: float
    coefficients: tuple[float, ...]
    sines: tuple[float, ...]
    linkage: Linkage
    turns: int = 0

    def __repr__(self) -> str:
        return _format(self, self.linkage)

    def _repr_svg_(self) -> str:
        from klann_ros.kinematics.svg import pose_svg  # noqa: PLC0415 - only notebooks draw

        return pose_svg(self)

    @property
    def crank_angle(self) -> float:
        """Return the crank's angle as given, whatever the linkage calls it [rad]."""
        # By its place: a four-bar's course has an alpha of its own.
        return self[0]

    @property
    def joints(self) -> tuple[float, ...]:
        """Return every coordinate, the crank's first [rad, m]."""
        return (self[0], *self.x)

    @property
    def points(self) -> FloatArray:
        """Return the points in the structure's order, shape (p, 2) [m]; made at each use."""
        return self.linkage.points(self[0], self.x)

    @property
    def vectors(self) -> ComplexArray:
        """Return u_j of every body, shape (n,): see `Linkage.vectors`."""
        return self.linkage.vectors(self[0], self.x)

    @property
    def transmission_angles(self) -> tuple[float, ...]:
        """
        Return the angle between the links of each dyad, in [0, pi] [rad].

        pi/2 transmits best; at 0 and pi the dyad is folded or stretched out, and singular. Of
        coupled loops it is asin of their `sines`.
        """
        u = self.vectors
        return tuple(float(block.transmission_angle(u)) for block in self.linkage.blocks)

    @property
    def clearances(self) -> tuple[float, ...]:
        """
        Return the clearance of each dyad's ends within its reach [m].

        Of coupled loops it is the least singular value of their part of Phi [m/rad].
        """
        u = self.vectors
        return tuple(float(block.clearance(u)) for block in self.linkage.blocks)

    @property
    def distance_to_singularity(self) -> float:
        """Return the least clearance, the error of a pivot that jams the linkage [m]."""
        return min(self.clearances)

    @property
    def condition(self) -> float:
        """Condition number of Phi in the 2-norm: the amplification of a residual."""
        return float(np.linalg.cond(self.linkage.phi(self[0], self.x)))


class LinkageMotion(NamedTuple):
    """
    The velocity, or the acceleration, of a pose.

    `joints` has the derivative of every coordinate, the crank's first [rad/s, m/s] or [rad/s^2,
    m/s^2], `h` that of the foot (x, y) [m/s] or [m/s^2]. `velocity` is the one that goes with an
    acceleration, or None.
    """

    joints: tuple[float, ...]
    h: Vector
    pose: LinkagePose
    velocity: 'LinkageMotion | None' = None

    def __repr__(self) -> str:
        return _format(self, self.pose.linkage)

    @property
    def vectors(self) -> ComplexArray:
        """Return the derivative of the bodies' vectors, shape (n,): see `joints`."""
        structure = self.pose.linkage.structure
        u = self.pose.vectors
        derivative: ComplexArray = joints.vector_jacobian(structure, u) @ np.array(self.joints)
        if self.velocity is not None:
            derivative += joints.velocity_product(structure, u, self.velocity.joints)
        return derivative

    @property
    def points(self) -> FloatArray:
        """Return the derivative of every point, shape (p, 2) [m/s, m/s^2]; made at each use."""
        return plane_vectors(self.pose.linkage.point_equations[0] @ self.vectors)


def _format(state: LinkagePose | LinkageMotion, linkage: Linkage) -> str:
    """Return a pose or a motion as its joints by name and its foot, to 7 digits."""
    names = linkage.joint_names
    numbers = [f'{name}={number:.7g}' for name, number in zip(names, state.joints, strict=True)]
    x, y = state.h
    return f'{type(state).__name__}({", ".join(numbers)}, h=({x:.7g}, {y:.7g}))'


def closed_pose(linkage: Linkage, u: Sequence[complex], alpha: float) -> LinkagePose:
    """Return the pose of body vectors from the geometric method."""
    structure = linkage.structure
    x = _other_coordinates(structure, u)
    terms, constant = linkage.point_rows[linkage.foot]
    foot = joints.vector_sum(terms, u, constant)
    sines = []
    residual = 0.0
    is_singular = False
    for block in linkage.blocks:
        sine = float(abs(block.sine(u)))
        sines.append(sine)
        residual = hypot(residual, *map(abs, block.openings(u)))
        is_singular |= not sine > block.singular_sine
    rates = (nan,) * len(x)
    if not is_singular:
        # Phi dx/dalpha = -df/dalpha
        x_1 = np.linalg.solve(linkage.phi(alpha, x), -linkage.f_alpha(alpha, x))
        rates = tuple(x_1.tolist())
    h = (foot.real, foot.imag)
    return LinkagePose(alpha, x, h, 0, residual, rates, tuple(sines), linkage)


def path_pose(linkage: Linkage, alpha: float, turns: int = 0) -> LinkagePose:
    """Return the pose at a crank angle by the geometric method, some turns along its path."""
    beta = alpha + turns * TURN
    interpolated = linkage.interpolated(beta)
    if interpolated is None:
        u = closed_form_vectors(linkage, beta, linkage.signs(beta))
        return closed_pose(linkage, u, alpha)._replace(turns=turns)
    pose = closed_pose(linkage, _interpolated_vectors(linkage, beta, interpolated), alpha)
    return pose._replace(coefficients=tuple(interpolated.x_1.tolist()), turns=turns)


def _interpolated_vectors(
    linkage: Linkage, beta: float, interpolated: InterpolatedPose
) -> list[complex]:
    """Return the bodies' vectors of a pose near a change point, at its path angle [rad]."""
    x = [beta, *interpolated.x.tolist()]
    return list(map(complex, joints.body_vectors(linkage.structure, x)))
