"""Velocity and acceleration of a pose, from the same Jacobian as its position."""

from math import isnan
from typing import NamedTuple

from klann_ros.kinematics import validation
from klann_ros.kinematics.errors import SingularPoseError
import numpy as np
from numpy.typing import NDArray

from . import equations
from .equations import turned, Vector
from .pose import FourBarPose


class FourBarVelocity(NamedTuple):
    """
    The velocity of a pose.

    Attributes
    ----------
    theta2, theta3, theta4 : float
        Angular velocities, counter-clockwise [rad/s].
    pose : FourBarPose
        The pose they belong to.

    """

    theta2: float
    theta3: float
    theta4: float
    pose: FourBarPose

    @property
    def points(self) -> NDArray[np.float64]:
        """Return the velocities of O2, A, B, O4, shape (4, 2) [m/s]; computed at each use."""
        g, pose = self.pose.geometry, self.pose
        a = _velocity(turned(g.crank, 0.0, pose.theta2), self.theta2)
        b = _velocity(turned(g.rocker, 0.0, pose.theta4), self.theta4)
        return np.array([(0.0, 0.0), a, b, (0.0, 0.0)])

    def coupler_point(self, u: float, v: float) -> Vector:
        """Return the velocity (x, y) of the pose's coupler point at u, v [m/s]."""
        pose = self.pose
        a = _velocity(turned(pose.geometry.crank, 0.0, pose.theta2), self.theta2)
        p = _velocity(turned(u, v, pose.theta3), self.theta3)
        return a[0] + p[0], a[1] + p[1]


class FourBarAcceleration(NamedTuple):
    """
    The acceleration of a pose.

    Attributes
    ----------
    theta2, theta3, theta4 : float
        Angular accelerations, counter-clockwise [rad/s^2].
    velocity : FourBarVelocity
        The velocity that it goes with; it holds the pose.

    """

    theta2: float
    theta3: float
    theta4: float
    velocity: FourBarVelocity

    @property
    def points(self) -> NDArray[np.float64]:
        """Return the accelerations of O2, A, B, O4, shape (4, 2) [m/s^2]; computed at each use."""
        w, pose = self.velocity, self.velocity.pose
        g = pose.geometry
        a = _acceleration(turned(g.crank, 0.0, pose.theta2), w.theta2, self.theta2)
        b = _acceleration(turned(g.rocker, 0.0, pose.theta4), w.theta4, self.theta4)
        return np.array([(0.0, 0.0), a, b, (0.0, 0.0)])

    def coupler_point(self, u: float, v: float) -> Vector:
        """Return the acceleration (x, y) of the pose's coupler point at u, v [m/s^2]."""
        w, pose = self.velocity, self.velocity.pose
        crank = turned(pose.geometry.crank, 0.0, pose.theta2)
        a = _acceleration(crank, w.theta2, self.theta2)
        p = _acceleration(turned(u, v, pose.theta3), w.theta3, self.theta3)
        return a[0] + p[0], a[1] + p[1]


def velocity(pose: FourBarPose, rate: float) -> FourBarVelocity:
    """
    Return the velocity of a pose for a crank rate: the kinematic coefficients times the rate.

    Parameters
    ----------
    pose : FourBarPose
        A solved pose.
    rate : float
        Rate of the crank [rad/s].

    Raises
    ------
    SingularPoseError
        The pose has no velocity.
    ValueError
        The rate is not finite.

    """
    if isnan(pose.coefficients[0]):
        raise SingularPoseError(pose.theta2)
    validation.rate('rate', rate)
    theta3_1, theta4_1 = pose.coefficients
    return FourBarVelocity(float(rate), theta3_1 * rate, theta4_1 * rate, pose)


def acceleration(pose: FourBarPose, rate: float, acceleration: float) -> FourBarAcceleration:
    """
    Return the acceleration of a pose for a crank's rate and acceleration.

    f = 0 twice differentiated, with w2, w3, w4 the angular velocities and e(t) = (cos t, sin t):

        Phi d2x/dt2 = -df/dtheta2 a2 - (L2 w2^2 e(theta2) + L3 w3^2 e(theta3) - L4 w4^2 e(theta4))

    Parameters
    ----------
    pose : FourBarPose
        A solved pose.
    rate : float
        Rate of the crank [rad/s].
    acceleration : float
        Acceleration of the crank, a2 [rad/s^2].

    Raises
    ------
    SingularPoseError
        The pose has no velocity.
    ValueError
        The rate or the acceleration is not finite.

    """
    w = velocity(pose, rate)
    validation.rate('acceleration', acceleration)
    g = pose.geometry
    _, l_2, l_3, l_4 = g.lengths
    centripetal = (
        l_2 * w.theta2**2 * _e(pose.theta2)
        + l_3 * w.theta3**2 * _e(pose.theta3)
        - l_4 * w.theta4**2 * _e(pose.theta4)
    )
    right = -equations.f_theta2(g, pose.theta2) * acceleration - centripetal
    a3, a4 = np.linalg.solve(equations.phi(g, pose.x), right).tolist()
    return FourBarAcceleration(float(acceleration), a3, a4, w)


def _velocity(r: Vector, rate: float) -> Vector:
    """Return the velocity of the end of r, which turns about its origin."""
    return -rate * r[1], rate * r[0]


def _acceleration(r: Vector, rate: float, acceleration: float) -> Vector:
    """Return the acceleration of the end of r: tangential and centripetal."""
    return (
        -acceleration * r[1] - rate**2 * r[0],
        acceleration * r[0] - rate**2 * r[1],
    )


def _e(angle: float) -> NDArray[np.float64]:
    return np.array(turned(1.0, 0.0, angle))
