"""The velocity of a pose: the kinematic coefficients times the crank's rate."""

from math import cos, isnan, sin
from typing import NamedTuple

from klann_ros.kinematics import validation
from klann_ros.kinematics.errors import SingularPoseError
import numpy as np
from numpy.typing import NDArray

from .points_motion import velocities
from .pose import KlannPose


class KlannVelocity(NamedTuple):
    """
    The velocity of a pose.

    Attributes
    ----------
    alpha, gamma, beta, delta, theta : float
        Angular velocities, with the signs of the textbook's angles [rad/s].
    h : tuple of float
        Velocity of the foot H (x, y) [m/s].
    pose : KlannPose
        The pose that moves.

    """

    alpha: float
    gamma: float
    beta: float
    delta: float
    theta: float
    h: tuple[float, float]
    pose: KlannPose

    @property
    def joints(self) -> tuple[float, float, float, float, float]:
        """Return the angular velocities in the order of a pose's angles [rad/s]."""
        return self[:5]

    @property
    def points(self) -> NDArray[np.float64]:
        """Return the velocities of A to H, shape (8, 2) [m/s]; computed at each use."""
        return velocities(self.pose, self[:5])


def velocity(pose: KlannPose, alpha_rate: float) -> KlannVelocity:
    """
    Return the velocity of a pose for a crank rate.

    dx/dt = dx/dalpha * alpha_rate with the pose's kinematic coefficients; that of H follows from

        H = D + L_DC (cos beta, sin beta) + L_CG (cos(gamma - bend_C), -sin(gamma - bend_C))
              + L_GH (cos(theta + bend_G), -sin(theta + bend_G)).

    Parameters
    ----------
    pose : KlannPose
        A solved pose.
    alpha_rate : float
        Rate of the crank [rad/s].

    Raises
    ------
    SingularPoseError
        The pose has no velocity.
    ValueError
        The rate is not finite.

    """
    if isnan(pose.coefficients[0]):
        raise SingularPoseError(pose.alpha)
    validation.rate('alpha_rate', alpha_rate)
    gamma_1, beta_1, delta_1, theta_1 = (c * alpha_rate for c in pose.coefficients)
    g = pose.geometry
    bent_c, bent_g = pose.gamma - g.angle_bcg, pose.theta + g.angle_fgh
    dc, cg, gh = g.l_dc * beta_1, g.l_cg * gamma_1, g.l_gh * theta_1
    h_1 = (
        -dc * sin(pose.beta) - cg * sin(bent_c) - gh * sin(bent_g),
        dc * cos(pose.beta) - cg * cos(bent_c) - gh * cos(bent_g),
    )
    return KlannVelocity(alpha_rate, gamma_1, beta_1, delta_1, theta_1, h_1, pose)
