"""The acceleration of a pose: the kinematic coefficients of second order."""

from typing import NamedTuple

from klann_ros.kinematics import validation
import numpy as np
from numpy.typing import NDArray

from . import equations
from .points_motion import accelerations, turning_acceleration
from .pose import KlannPose
from .velocity import KlannVelocity, velocity


class KlannAcceleration(NamedTuple):
    """
    The acceleration of a pose.

    Attributes
    ----------
    alpha, gamma, beta, delta, theta : float
        Angular accelerations, with the signs of the textbook's angles [rad/s^2].
    h : tuple of float
        Acceleration of the foot H (x, y) [m/s^2].
    velocity : KlannVelocity
        The velocity that goes with it.

    """

    alpha: float
    gamma: float
    beta: float
    delta: float
    theta: float
    h: tuple[float, float]
    velocity: KlannVelocity

    @property
    def points(self) -> NDArray[np.float64]:
        """Return the accelerations of A to H, shape (8, 2) [m/s^2]; computed at each use."""
        return accelerations(self.velocity.pose, self.velocity[:5], self[:5])


def second_coefficients(pose: KlannPose) -> tuple[float, float, float, float]:
    """
    Return the second derivatives of gamma, beta, delta, theta after alpha.

    Phi dx/dalpha + df/dalpha = 0, differentiated after alpha once more:

        Phi d2x/dalpha2 = -f_2,    f_2 = d2f/dalpha2 with all angles' rates held.

    Raises
    ------
    numpy.linalg.LinAlgError
        Phi cannot be inverted; a pose that has coefficients is no such pose.

    """
    geometry, x = pose.geometry, pose.x
    f_2 = equations.f_2(geometry, pose.alpha, x, pose.coefficients)
    gamma, beta, delta, theta = np.linalg.solve(equations.phi(geometry, x), -f_2).tolist()
    return gamma, beta, delta, theta


def acceleration(
    pose: KlannPose, alpha_rate: float, alpha_acceleration: float
) -> KlannAcceleration:
    """
    Return the acceleration of a pose for a crank rate and its change.

    d2x/dt2 = d2x/dalpha2 alpha_rate^2 + dx/dalpha alpha_acceleration; that of H is the sum of
    those of DC, CG and GH, each L (phi'' (-sin phi, cos phi) - phi'^2 (cos phi, sin phi)).

    Parameters
    ----------
    pose : KlannPose
        A solved pose.
    alpha_rate : float
        Rate of the crank [rad/s].
    alpha_acceleration : float
        Change of the crank's rate [rad/s^2].

    Raises
    ------
    SingularPoseError
        The pose has no velocity.
    ValueError
        The rate or its change is not finite.

    """
    moving = velocity(pose, alpha_rate)
    validation.rate('alpha_acceleration', alpha_acceleration)
    gamma_2, beta_2, delta_2, theta_2 = (
        second * alpha_rate * alpha_rate + first * alpha_acceleration
        for first, second in zip(pose.coefficients, second_coefficients(pose), strict=True)
    )
    g = pose.geometry
    bent_c, bent_g = pose.gamma - g.angle_bcg, pose.theta + g.angle_fgh
    parts = (
        turning_acceleration(g.l_dc, pose.beta, moving.beta, beta_2),
        turning_acceleration(g.l_cg, -bent_c, -moving.gamma, -gamma_2),
        turning_acceleration(g.l_gh, -bent_g, -moving.theta, -theta_2),
    )
    h_2 = sum(x for x, _ in parts), sum(y for _, y in parts)
    return KlannAcceleration(alpha_acceleration, gamma_2, beta_2, delta_2, theta_2, h_2, moving)
