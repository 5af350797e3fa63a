"""The error state of the odometry, its covariance, and the errors of its contact model."""

from cmath import rect
from collections.abc import Mapping, Sequence

from klann_ros.gait import Symmetric, Triple
from klann_ros.kinematics.angles import wrap
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .settings import OdometryNoise

# Indices of the components; of x, y and yaw; of velocity and yaw rate; of the biases in x and y.
_, _, YAW, VX, VY, YAW_RATE, GYRO_BIAS, BIAS_X, BIAS_Y = range(9)
POSE, VELOCITY, ACCELEROMETER_BIAS = slice(0, 3), slice(3, 6), slice(7, 9)
# The yaw and the gyro's bias.
GYRO_STATES = slice(2, 7, 4)


class FilterState:
    """
    The mean and the covariance of x, y, yaw, velocity, yaw rate and biases; units as in odometry.

    The heading and the biases of gyro and accelerometer are here alone.
    """

    def __init__(self, noise: OdometryNoise) -> None:
        self.mean = np.zeros(9)
        deviations = [0.0] * 6 + [noise.gyro_bias] + [noise.accelerometer_bias] * 2
        self.covariance = np.diag(np.square(deviations))
        # The distance that base_link moved [m].
        self.travelled = 0.0

    @property
    def gyro_bias(self) -> float:
        """Return the drift of the heading [rad/s]."""
        return float(self.mean[GYRO_BIAS])

    @property
    def accelerometer_bias(self) -> complex:
        """Return the biases of the level acceleration [m/s^2]."""
        x, y = self.mean[ACCELEROMETER_BIAS].tolist()
        return complex(x, y)

    def set_pose(self, pose: Sequence[float], covariance: FloatArray) -> None:
        """Go on at x, y and yaw, whose errors are independent of the others."""
        self.mean[POSE] = pose
        self.covariance[POSE] = self.covariance[:, POSE] = 0.0
        self.covariance[POSE, POSE] = covariance

    def predict(
        self,
        velocity_change: complex,
        yaw_rate: float | None,
        dt: float,
        variance_growths: Mapping[int, float],
        *,
        has_accelerometer: bool,
    ) -> None:
        """
        Predict the velocity after a step of a time [s].

        `velocity_change` is in the directions after the step [m/s], with the biases of an
        accelerometer if there is one; `yaw_rate` is that of a gyro without its bias, None without
        one [rad/s]; `variance_growths` are those of components, by their indices.
        """
        vx, vy, last_yaw_rate = self.mean[VELOCITY].tolist()
        velocity = complex(vx, vy)
        new_yaw_rate = last_yaw_rate if yaw_rate is None else yaw_rate
        rotation = rect(1.0, -new_yaw_rate * dt)
        predicted = velocity * rotation + velocity_change
        self.mean[VELOCITY] = predicted.real, predicted.imag, new_yaw_rate
        by_bias = -dt if has_accelerometer else 0.0
        by_yaw_rate = -1j * velocity * dt
        velocity_row = [0, 0, 0, rotation, 1j * rotation, by_yaw_rate, 0, by_bias, 1j * by_bias]
        # With a gyro the error of the yaw rate is that of the bias.
        yaw_rate_row = [0, 0, 0, 0, 0, 1] if yaw_rate is None else [0, 0, 0, 0, 0, 0, -1]
        self._propagate(VELOCITY, velocity_row, yaw_rate_row)
        for index, growth in variance_growths.items():
            self.covariance[index, index] += growth

    def move(self, dt: float) -> complex:
        """Move the pose by the velocity; return the mean direction of base_link, of length 1."""
        _, _, yaw, vx, vy, yaw_rate = self.mean[:6].tolist()
        direction = rect(1.0, yaw + yaw_rate * dt / 2.0)
        step = direction * complex(vx, vy) * dt
        self.mean[:2] += step.real, step.imag
        self.mean[YAW] = wrap(yaw + yaw_rate * dt)
        self.travelled += abs(step)
        by_velocity = direction * dt
        by_yaw_rate = 0.5j * step * dt
        place_row = [1, 1j, 1j * step, by_velocity, 1j * by_velocity, by_yaw_rate]
        self._propagate(POSE, place_row, [0, 0, 1, 0, 0, dt])
        return direction

    def _propagate(
        self, rows: slice, plane_row: Sequence[complex], yaw_row: Sequence[float]
    ) -> None:
        """Propagate the covariance: three rows of the Jacobian, the first two as x + jy."""
        # `dot` takes half the time of @ on matrices this small.
        p = self.covariance
        jacobian = np.zeros((3, 9))
        plane = np.array(plane_row, dtype=np.complex128)
        jacobian[0, : len(plane_row)] = plane.real
        jacobian[1, : len(plane_row)] = plane.imag
        jacobian[2, : len(yaw_row)] = yaw_row
        changed = jacobian.dot(p)
        changed[:, rows] = changed.dot(jacobian.T)
        p[rows] = changed
        p[:, rows] = changed.T

    def correct_velocity(
        self,
        correction: Triple,
        information: Symmetric,
        decrease: Sequence[float],
        *,
        with_yaw_rate: bool,
    ) -> None:
        """
        Correct v_x, v_y and w; without w the yaw and the gyro's bias stay as they are.

        `information` is the inverse of their covariance, which decreases by `decrease`.
        """
        p, size = self.covariance, 3 if with_yaw_rate else 2
        gain = p[:, slice(VX, VX + size)].dot(_matrix(information, size))
        gyro_mean = self.mean[GYRO_STATES].copy()
        gyro_covariance = p[GYRO_STATES, GYRO_STATES].copy()
        p -= gain.dot(_matrix(decrease, size)).dot(gain.T)
        self.mean += gain.dot(correction[:size])
        if not with_yaw_rate:
            self.mean[GYRO_STATES] = gyro_mean
            p[GYRO_STATES, GYRO_STATES] = gyro_covariance

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
        p[BIAS_X, BIAS_X] = p[BIAS_Y, BIAS_Y] = deviation**2


def _matrix(symmetric: Sequence[float], size: int) -> FloatArray:
    """Return the first rows and columns of a `stance.Symmetric`."""
    a, b, c, d, e, f = symmetric
    rows = ((a, b), (b, d)) if size == 2 else ((a, b, c), (b, d, e), (c, e, f))
    return np.array(rows)


class ContactErrors:
    """
    The pose by the errors c_1 ... c_5 of the contact model, for sigma points of each.

    `scale` is the factor of the errors that the slip causes; see the top of odometry.py.
    """

    def __init__(self, noise: OdometryNoise) -> None:
        deviations = (
            noise.advance_error,
            noise.slip_error,
            noise.slip_error,
            noise.slip_yaw_error,
            noise.contact_error,
        )
        # With nine of them the standard deviations in a circle change by 3 % at most.
        points, weights = np.polynomial.hermite_e.hermegauss(5)
        self._c = np.outer(deviations, points)
        self._weights = np.tile(weights / weights.sum(), len(deviations))
        # Pose of each point relative to that of the state: yaw [rad], direction, offset [m].
        self._yaws = np.zeros(self._c.shape)
        self._directions = np.exp(1j * self._yaws)
        self._offsets = 0j * self._yaws
        self.scale = 1.0

    def move(
        self,
        direction: complex,
        velocity: complex,
        velocity_errors: Sequence[complex],
        yaw_rate_errors: Sequence[float],
        dt: float,
    ) -> None:
        """
        Move the sigma points for a time `dt` [s].

        `direction` is the state's heading as a unit vector, `velocity` that of base_link in its
        own frame [m/s]. `velocity_errors` [m/s] and `yaw_rate_errors` [rad/s] are their changes
        by c_1 ... c_5 = 1; a gyro leaves none of the latter.
        """
        velocities = velocity + np.array(velocity_errors)[:, None] * self._c
        # What a point moves more than the state, in the world's frame.
        self._offsets += direction * dt * (self._directions * velocities - velocity)
        if yaw_rate_errors:
            self._yaws += np.array(yaw_rate_errors)[:, None] * self._c * dt
            self._directions = np.exp(1j * self._yaws)

    def covariance(self) -> FloatArray:
        """Return the covariance of x, y and yaw."""
        errors = np.array([self._offsets.real, self._offsets.imag, self._yaws]).reshape(3, -1)
        return np.asarray((self._weights * errors).dot(errors.T))
