"""Odometry in the scale of a tape measure: factors for its speed and its yaw rate."""

from cmath import rect
from math import cos, sin

from klann_ros.gait import Triple
from klann_ros.kinematics.angles import wrap
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .odometry import OdometryEstimate


class OdometryScale:
    """
    Scale estimates by constant factors, which a calibration gives.

    The path is that of the scaled velocities. Its covariance is that of the estimate, scaled and
    rotation by the difference of the headings: exact for an `angular` factor of 1.

    Parameters
    ----------
    linear, angular : float
        True speed by the estimated one, and true yaw rate by the estimated one.

    """

    def __init__(self, linear: float = 1.0, angular: float = 1.0) -> None:
        self._linear, self._angular = linear, angular
        self._factors = np.array([linear, linear, angular])
        self.set_pose(0.0, 0.0, 0.0)

    def set_pose(self, x: float, y: float, yaw: float) -> None:
        """Go on at a pose [m, rad], at which the estimate goes on as well."""
        self._estimated = self._scaled = (complex(x, y), yaw)

    def unscaled(self, covariance: tuple[Triple, Triple, Triple]) -> FloatArray:
        """Return the covariance of an estimate at a set pose by that of x, y and yaw."""
        unscaled: FloatArray = np.array(covariance) / np.outer(self._factors, self._factors)
        return unscaled

    def scaled(self, estimate: OdometryEstimate) -> OdometryEstimate:
        """Return the next estimate, scaled."""
        if self._linear == self._angular == 1.0:
            return estimate
        place_before, yaw_before = self._estimated
        place, yaw = self._scaled
        self._estimated = complex(estimate.x, estimate.y), estimate.yaw
        rotation = wrap(estimate.yaw - yaw_before)
        displacement = (self._estimated[0] - place_before) * rect(
            1.0, -yaw_before - rotation / 2.0
        )
        place += self._linear * displacement * rect(1.0, yaw + self._angular * rotation / 2.0)
        yaw = wrap(yaw + self._angular * rotation)
        self._scaled = place, yaw
        c, s = cos(yaw - estimate.yaw), sin(yaw - estimate.yaw)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        covariance = turn @ estimate.covariance @ turn.T * np.outer(self._factors, self._factors)
        x_row, y_row, yaw_row = covariance.tolist()
        forwards, leftwards, angular = self._factors * (*estimate.linear, estimate.angular)
        x_variance, y_variance, yaw_variance = self._factors**2 * estimate.rate_variances
        return estimate._replace(
            x=place.real,
            y=place.imag,
            yaw=yaw,
            linear=(float(forwards), float(leftwards)),
            angular=float(angular),
            covariance=(tuple(x_row), tuple(y_row), tuple(yaw_row)),
            rate_variances=(float(x_variance), float(y_variance), float(yaw_variance)),
        )
