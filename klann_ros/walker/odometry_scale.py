"""Odometry in the scale of a tape measure: factors for its speed and its yaw rate."""

from cmath import rect

from klann_ros.gait.stance import Triple
from klann_ros.kinematics.angles import wrap
import numpy as np

from .odometry import OdometryEstimate


class OdometryScale:
    """
    Scale estimates by constant factors, which a calibration gives.

    The path is that of the scaled velocities. Its covariance is that of the estimate, scaled and
    turned by the difference of the headings: exact for an `angular` factor of 1, and for a
    straight path.

    Parameters
    ----------
    linear, angular : float
        True speed by the estimated one, and true yaw rate by the estimated one.

    """

    def __init__(self, linear: float = 1.0, angular: float = 1.0) -> None:
        self._linear, self._angular = linear, angular
        self.set_pose(0.0, 0.0, 0.0)

    def set_pose(self, x: float, y: float, yaw: float) -> None:
        """Go on at a pose [m, rad], at which the estimate goes on as well."""
        self._estimated = self._scaled = (complex(x, y), yaw)

    def scaled(self, estimate: OdometryEstimate) -> OdometryEstimate:
        """Return the next estimate, scaled."""
        if self._linear == self._angular == 1.0:
            return estimate
        place_before, yaw_before = self._estimated
        place, yaw = self._scaled
        self._estimated = complex(estimate.x, estimate.y), estimate.yaw
        turned = wrap(estimate.yaw - yaw_before)
        moved = (self._estimated[0] - place_before) * rect(1.0, -yaw_before - turned / 2.0)
        middle = yaw + self._angular * turned / 2.0
        place += self._linear * moved * rect(1.0, middle)
        yaw = wrap(yaw + self._angular * turned)
        self._scaled = place, yaw
        x_variance, y_variance, yaw_variance = estimate.rate_variances
        return estimate._replace(
            x=place.real,
            y=place.imag,
            yaw=yaw,
            linear=(self._linear * estimate.linear[0], self._linear * estimate.linear[1]),
            angular=self._angular * estimate.angular,
            covariance=self._covariance(estimate.covariance, yaw - estimate.yaw),
            rate_variances=(
                self._linear**2 * x_variance,
                self._linear**2 * y_variance,
                self._angular**2 * yaw_variance,
            ),
        )

    def _covariance(
        self, covariance: tuple[Triple, Triple, Triple], turned: float
    ) -> tuple[Triple, Triple, Triple]:
        turn = rect(self._linear, turned)
        scale = np.array(
            [[turn.real, -turn.imag, 0.0], [turn.imag, turn.real, 0.0], [0.0, 0.0, self._angular]]
        )
        x_row, y_row, yaw_row = (scale @ covariance @ scale.T).tolist()
        return tuple(x_row), tuple(y_row), tuple(yaw_row)
