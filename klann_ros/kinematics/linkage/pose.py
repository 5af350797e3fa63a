"""A solved pose of a linkage."""

from math import hypot
from typing import NamedTuple

from klann_ros.kinematics.angles import wrap
import numpy as np
from numpy.typing import NDArray

from .configuration import Configuration
from .linkage import Linkage
from .rates import rates

Array = NDArray[np.float64]


class LinkagePose(NamedTuple):
    """
    A solved pose: immutable.

    Attributes
    ----------
    alpha : float
        Crank angle as given, not wrapped [rad].
    x : tuple of float
        The other angles, in the order of the linkage's `joint_names`, in (-pi, pi] [rad].
    h : tuple of float
        The foot (x, y) [m].
    iterations : int
        The most Newton iterations that a block took, the last of which only confirms.
    residual : float
        Euclidean norm of f at this pose [m]: by how much the loops do not close.
    coefficients : tuple of float
        Kinematic coefficients dx/dalpha; NaN at a singular pose.
    linkage : Linkage
        What it is a pose of.

    """

    alpha: float
    x: tuple[float, ...]
    h: tuple[float, float]
    iterations: int
    residual: float
    coefficients: tuple[float, ...]
    linkage: Linkage

    @property
    def joints(self) -> tuple[float, ...]:
        """Return every angle, the crank's first [rad]."""
        return (self.alpha, *self.x)

    @property
    def points(self) -> Array:
        """Return the points in the order of the description's, shape (p, 2) [m]."""
        return self.linkage.points(self.alpha, self.x)

    @property
    def unit_vectors(self) -> list[complex]:
        """Return u_j = exp(i s_j phi_j) of every body."""
        return Configuration(self.linkage.senses, self.joints).u

    @property
    def sines(self) -> tuple[float, ...]:
        """Return |sin| of the angle between the links of each dyad; 0 is singular."""
        u = self.unit_vectors
        return tuple(abs(block.sine(u)) for block in self.linkage.blocks)

    @property
    def transmission_angles(self) -> tuple[float, ...]:
        """
        Return the angle between the links of each dyad at their joint, in [0, pi] [rad].

        pi/2 transmits best; at 0 and pi the dyad is folded or stretched out, and singular. Of
        coupled loops it is the angle whose sine is theirs.
        """
        u = self.unit_vectors
        return tuple(block.transmission_angle(u) for block in self.linkage.blocks)

    @property
    def clearances(self) -> tuple[float, ...]:
        """
        Return how far each dyad's ends are inside its reach [m].

        Of coupled loops it is the least singular value of their block [m/rad].
        """
        u = self.unit_vectors
        return tuple(block.clearance(u) for block in self.linkage.blocks)

    @property
    def distance_to_singularity(self) -> float:
        """Return the least clearance [m]."""
        return min(self.clearances)

    @property
    def condition(self) -> float:
        """Condition number of Phi in the 2-norm: how much Newton amplifies a residual."""
        return float(np.linalg.cond(self.linkage.phi(self.alpha, self.x)))

    def ahead(self, step: float) -> tuple[float, ...]:
        """Return the angles x a step of the crank [rad] further on, to first order."""
        return tuple(x + step * x_1 for x, x_1 in zip(self.x, self.coefficients, strict=True))


def made_pose(linkage: Linkage, configuration: Configuration, iterations: int) -> LinkagePose:
    """Return the pose of a configuration that is solved."""
    angles, u = configuration.angles, configuration.u
    foot = linkage.foot_constant
    for j, w in linkage.foot_terms:
        foot += w * u[j]
    gaps = [abs(gap) for block in linkage.blocks for gap in np.atleast_1d(block.gap(u)).tolist()]
    return LinkagePose(
        angles[0],
        tuple(map(wrap, angles[1:])),
        (foot.real, foot.imag),
        iterations,
        hypot(*gaps),
        tuple(rates(linkage, u)[1:]),
        linkage,
    )
