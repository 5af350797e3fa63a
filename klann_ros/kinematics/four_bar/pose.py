"""A solved pose of the four-bar linkage."""

from math import dist, hypot, nan, sin
from typing import NamedTuple

from klann_ros.kinematics.angles import crank_angle, wrap
import numpy as np
from numpy.typing import NDArray

from . import closed_form, equations
from .geometry import FourBarGeometry

# The kinematic coefficients of a singular pose.
NO_COEFFICIENTS = (nan, nan)


class FourBarPose(NamedTuple):
    """
    A solved pose: immutable, and cheap enough to be made a thousand times a second.

    Attributes
    ----------
    theta2 : float
        Crank angle as given, not wrapped [rad].
    theta3, theta4 : float
        Angles of coupler and rocker, counter-clockwise from the ground, in (-pi, pi] [rad].
    iterations : int
        Newton iterations spent, the last of which only confirms; 0 for the closed form.
    residual : float
        Euclidean norm of f at this pose [m]: by how much the loop does not close.
    coefficients : tuple of float
        Kinematic coefficients d(theta3, theta4)/d(theta2); NaN at a singular pose.
    geometry : FourBarGeometry
        The linkage.

    """

    theta2: float
    theta3: float
    theta4: float
    iterations: int
    residual: float
    coefficients: tuple[float, float]
    geometry: FourBarGeometry

    @property
    def x(self) -> tuple[float, float]:
        """Return the state vector (theta3, theta4) [rad]."""
        return self[1:3]

    @property
    def alpha(self) -> float:
        """Return the driving angle, theta2, by the name that all mechanisms share [rad]."""
        return self.theta2

    def ahead(self, step: float) -> tuple[float, float]:
        """Return theta3, theta4 a step of the crank [rad] further on, to first order [rad]."""
        _, theta3, theta4, _, _, (theta3_1, theta4_1), _ = self
        return theta3 + step * theta3_1, theta4 + step * theta4_1

    @property
    def points(self) -> NDArray[np.float64]:
        """Return the points O2, A, B, O4, shape (4, 2) [m]; computed at each use."""
        return equations.points(self.geometry, self.theta2, self.x)

    @property
    def transmission_angle(self) -> float:
        """
        Return the angle between coupler and rocker, in [0, pi] [rad].

        pi/2 transmits best; at 0 and pi they are folded or stretched out, and it is singular.
        """
        return abs(wrap(self.theta4 - self.theta3))

    @property
    def transmission_angles(self) -> tuple[float]:
        """Return the transmission angle of the linkage's one dyad [rad]."""
        return (self.transmission_angle,)

    @property
    def condition(self) -> float:
        """Condition number of Phi in the 2-norm: how much Newton amplifies a residual."""
        return float(np.linalg.cond(equations.phi(self.geometry, self.x)))

    @property
    def z(self) -> float:
        """Return the course's Z, the length of the diagonal A O4 [m]."""
        return dist(closed_form.crank_pin(self.geometry, self.theta2), (self.geometry.ground, 0.0))

    @property
    def clearance(self) -> float:
        """Return the distance of Z from | L3 - L4 | and L3 + L4, where it is singular [m]."""
        return closed_form.clearance(self.geometry, self.theta2)

    def coupler_point(self, u: float, v: float) -> tuple[float, float]:
        """
        Return a point that is fixed to the coupler.

        Parameters
        ----------
        u, v : float
            Its place on the coupler [m]: u from A along AB, v to the left of it.

        Returns
        -------
        tuple of float
            (x, y) [m].

        """
        a_x, a_y = closed_form.crank_pin(self.geometry, self.theta2)
        x, y = equations.turned(u, v, self.theta3)
        return a_x + x, a_y + y


def closed_form_pose(geometry: FourBarGeometry, theta2: float) -> FourBarPose:
    """
    Return the pose at a crank angle by the geometric method.

    Parameters
    ----------
    geometry : FourBarGeometry
        The linkage.
    theta2 : float
        Crank angle, any number of turns [rad].

    Raises
    ------
    CrankAngleError
        `theta2` is not finite, or beyond +-1e6 rad.
    UnreachableError
        Coupler and rocker do not meet at this crank angle.

    """
    theta2 = crank_angle(theta2)
    theta3, theta4 = closed_form.angles(geometry, theta2)
    residual = hypot(*equations.f(geometry, theta2, (theta3, theta4)))
    coefficients = _coefficients(geometry, theta2, theta3, theta4)
    return FourBarPose(theta2, wrap(theta3), wrap(theta4), 0, residual, coefficients, geometry)


def _coefficients(
    geometry: FourBarGeometry, theta2: float, theta3: float, theta4: float
) -> tuple[float, float]:
    """
    Solve Phi dx/dtheta2 = -df/dtheta2; NaN where Phi is singular but for rounding.

        dtheta3/dtheta2 = L2 sin(theta2 - theta4) / (L3 sin(theta4 - theta3))
        dtheta4/dtheta2 = L2 sin(theta2 - theta3) / (L4 sin(theta4 - theta3))
    """
    sine = sin(theta4 - theta3)
    if abs(sine) <= equations.singular_sine(geometry):
        return NO_COEFFICIENTS
    return (
        geometry.crank * sin(theta2 - theta4) / (geometry.coupler * sine),
        geometry.crank * sin(theta2 - theta3) / (geometry.rocker * sine),
    )
