"""The error state of the odometry, its covariance, and the errors of its contact model."""

from collections.abc import Sequence

from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .settings import OdometryNoise

# The yaw and the gyro's bias; the gyro's bias; the accelerometer's biases.
GYRO_STATES, GYRO_BIAS, ACCELEROMETER_BIAS = slice(2, 7, 4), 6, slice(7, 9)


class FilterState:
    """
    The mean and the covariance of x, y, yaw, velocity, yaw rate and biases; units as in odometry.

    Attributes
    ----------
    mean : numpy.ndarray, shape (9,)
        The state.
    covariance : numpy.ndarray, shape (9, 9)
        Its covariance.

    """

    def __init__(self, noise: OdometryNoise) -> None:
        self.mean = np.zeros(9)
        deviations = [0.0] * 6 + [noise.gyro_bias] + [noise.accelerometer_bias] * 2
        self.covariance = np.diag(np.square(deviations))

    def set_pose(self, pose: Sequence[float], covariance: FloatArray) -> None:
        """Go on at x, y and yaw, whose errors are independent of the others."""
        self.mean[:3] = pose
        self.covariance[:3] = self.covariance[:, :3] = 0.0
        self.covariance[:3, :3] = covariance

    def propagate(self, first: int, row: Sequence[complex], yaw: Sequence[float]) -> None:
        """Propagate the covariance: three rows of the Jacobian, the first two as x + jy."""
        # `dot` takes half the time of @ on matrices this small.
        p, f, rows = self.covariance, np.zeros((3, 9)), slice(first, first + 3)
        both = np.array(row, dtype=np.complex128)
        f[0, : len(row)], f[1, : len(row)], f[2, : len(yaw)] = both.real, both.imag, yaw
        changed = f.dot(p)
        changed[:, rows] = changed.dot(f.T)
        p[rows], p[:, rows] = changed, changed.T

    def measure(self, index: int, measured: float, variance: float) -> None:
        """Update by a measurement of one component."""
        column = self.covariance[:, index].copy()
        gain = column / (column[index] + variance)
        self.covariance -= gain[:, None] * column
        self.mean += gain * (measured - self.mean[index])

    def forget_accelerometer(self, deviation: float) -> None:
        """Restart the biases of the accelerometer at 0 with a standard deviation [m/s^2]."""
        self.mean[ACCELEROMETER_BIAS] = 0.0
        p = self.covariance
        p[ACCELEROMETER_BIAS] = p[:, ACCELEROMETER_BIAS] = 0.0
        p[7, 7] = p[8, 8] = deviation**2


class ContactErrors:
    """
    The pose by the errors c_1 ... c_5 of the contact model, for sigma points of each.

    `scale` is that of the errors that the slip causes; see the top of odometry.py.
    """

    def __init__(self, noise: OdometryNoise) -> None:
        n = noise
        errors = n.advance_error, n.slip_error, n.slip_error, n.slip_yaw_error, n.contact_error
        # With nine of them the standard deviations in a circle change by 3 % at most.
        points, weights = np.polynomial.hermite_e.hermegauss(5)
        self._errors = np.outer(errors, points)
        self._weights = np.tile(weights / weights.sum(), len(errors))
        # Yaw by each point [rad], and its place from the state's [m].
        self._turned = np.zeros(self._errors.shape)
        self._moved = 0j * self._turned
        self._directions = np.exp(1j * self._turned)
        self.scale = 1.0

    def move(
        self,
        along: complex,
        motion: complex,
        effects: Sequence[complex],
        turns: Sequence[float],
        dt: float,
    ) -> None:
        """
        Move the points for a time [s]; base_link points `along` and has the velocity `motion`.

        `effects` [m/s] and `turns` [rad/s] are those of errors of 1; a gyro leaves none of the
        latter.
        """
        by_point = motion + np.array(effects)[:, None] * self._errors
        self._moved += along * dt * (self._directions * by_point - motion)
        if turns:
            self._turned += np.array(turns)[:, None] * self._errors * dt
            self._directions = np.exp(1j * self._turned)

    def covariance(self) -> FloatArray:
        """Return that of x, y and yaw."""
        away = np.array([self._moved.real, self._moved.imag, self._turned]).reshape(3, -1)
        covariance: FloatArray = (self._weights * away).dot(away.T)
        return covariance
