"""
A contact-aided invariant extended Kalman filter, as the state of the art for legged robots.

R. Hartley, M. Ghaffari, R. M. Eustice, J. W. Grizzle, Contact-aided invariant extended Kalman
filtering for robot state estimation, The International Journal of Robotics Research 39 (2020).
World-centric, right-invariant error: the state is the element (R, v, p, d_1 ... d_n) of
SE_(n+2)(3) and the biases of gyro and accelerometer; d_i are the contact points of the standing
feet, which are constant but for noise.
"""

from math import atan2

from klann_ros.dynamics import GRAVITY
from klann_ros.gait import Feet
from klann_ros.gait.stance import Support, support
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .odometry_baselines import Sample

G = np.array([0.0, 0.0, -GRAVITY])
# Standard deviations: gyro [rad/s], accelerometer [m/s^2], slip of a contact [m/s], kinematics of
# a contact [m], random walks of the biases, start of rotation, velocity and biases. The slip is
# the best of 0.01, 0.03, 0.1, 0.3 and 1 on two of the robots.
GYRO = 0.005
ACCELEROMETER = 0.03
CONTACT = 0.3
KINEMATICS = 0.001
GYRO_WALK = 1e-5
ACCELEROMETER_WALK = 1e-4
START_ROTATION = 0.01
START_VELOCITY = 0.05
START_GYRO = 0.005
START_ACCELEROMETER = 0.3


def skew(vector: FloatArray) -> FloatArray:
    """Return the matrix of the cross product."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def exp_so3(vector: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the exponential of a rotation vector, and its left Jacobian."""
    angle = float(np.linalg.norm(vector))
    k = skew(vector)
    if angle < 1e-8:
        return np.eye(3) + k, np.eye(3) + k / 2.0
    a = np.sin(angle) / angle
    b = (1.0 - np.cos(angle)) / angle**2
    return np.eye(3) + a * k + b * k @ k, np.eye(3) + b * k + (1.0 - a) / angle**2 * k @ k


def _block(k: int) -> slice:
    """Return the place of a vector in the error: v, p, contacts."""
    return slice(3 + 3 * k, 6 + 3 * k)


class InvariantEkf:
    """
    Estimate pose and velocity of a walker.

    Parameters
    ----------
    feet : Feet
        The walker's.

    """

    def __init__(self, feet: Feet, contact: float = CONTACT) -> None:
        self._feet = feet
        self._contact = contact
        self._rotation: FloatArray | None = None
        # v, p and the contacts, one row each.
        self._vectors = np.zeros((2, 3))
        self._contacts: list[int] = []
        self._gyro_bias = np.zeros(3)
        self._accel_bias = np.zeros(3)
        # Rotation, v, p, contacts; biases last.
        deviations = [START_ROTATION] * 2 + [1e-6] + [START_VELOCITY] * 3 + [1e-6] * 3
        deviations += [START_GYRO] * 3 + [START_ACCELEROMETER] * 3
        self._p = np.diag(np.square(deviations))
        self._support: Support | None = None
        self._start_yaw = 0.0

    @property
    def pose(self) -> list[float]:
        """Return x, y and yaw."""
        r = np.eye(3) if self._rotation is None else self._rotation
        x, y, _ = self._vectors[1]
        c = np.cos(self._start_yaw)
        s = np.sin(self._start_yaw)
        return [c * x + s * y, c * y - s * x, atan2(r[1, 0], r[0, 0]) - self._start_yaw]

    @property
    def covariance(self) -> FloatArray:
        """Return the covariance of x, y and yaw."""
        # The right-invariant error of the position has the lever of the rotation.
        x, y, _ = self._vectors[1]
        j = np.zeros((3, len(self._p)))
        j[:2, 6:8] = np.eye(2)
        j[0, 2], j[1, 2], j[2, 2] = -y, x, 1.0
        return np.asarray(j @ self._p @ j.T)

    def update(self, sample: Sample, dt: float) -> None:
        """Take the next sample."""
        if self._rotation is None:
            x, y, z, w = sample.orientation
            self._rotation = np.array(
                [
                    [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
                ]
            )
            self._start_yaw = atan2(self._rotation[1, 0], self._rotation[0, 0])
        if dt > 0.0:
            self._propagate(np.array(sample.gyro), np.array(sample.force), dt)
        positions, _, centre = self._feet.at(sample.cranks).tolist()
        self._support = support(positions, centre, self._support and self._support.facet)
        standing = list(self._support.feet) if self._support else []
        for foot in [*self._contacts]:
            if foot not in standing:
                self._drop(foot)
        self._correct(np.array(positions))
        for foot in standing:
            if foot not in self._contacts:
                self._add(foot, np.array(positions[foot]))

    def _propagate(self, gyro: FloatArray, force: FloatArray, dt: float) -> None:
        r = self._rotation
        if r is None:
            return
        n = len(self._p)
        a = np.zeros((n, n))
        a[3:6, :3] = skew(G)
        a[6:9, 3:6] = np.eye(3)
        bg = slice(n - 6, n - 3)
        ba = slice(n - 3, n)
        a[:3, bg] = -r
        for k, vector in enumerate(self._vectors):
            a[_block(k), bg] = -skew(vector) @ r
        a[3:6, ba] = -r
        phi = np.eye(n) + a * dt + a @ a * (dt * dt / 2.0)
        adjoint = np.eye(n)
        adjoint[:3, :3] = r
        for k, vector in enumerate(self._vectors):
            block = _block(k)
            adjoint[block, :3] = skew(vector) @ r
            adjoint[block, block] = r
        noise = [GYRO**2] * 3 + [ACCELEROMETER**2] * 3 + [0.0] * 3
        noise += [self._contact**2] * (3 * len(self._contacts))
        noise += [GYRO_WALK**2] * 3 + [ACCELEROMETER_WALK**2] * 3
        g = phi @ adjoint
        # Densities at the rate of the sensors, of which each reading is independent.
        self._p = phi @ self._p @ phi.T + g @ np.diag(noise) @ g.T * dt * dt
        acceleration = r @ (force - self._accel_bias) + G
        self._vectors[1] += self._vectors[0] * dt + acceleration * (dt * dt / 2.0)
        self._vectors[0] += acceleration * dt
        self._rotation = r @ exp_so3((gyro - self._gyro_bias) * dt)[0]

    def _correct(self, positions: FloatArray) -> None:
        r = self._rotation
        count = len(self._contacts)
        if r is None or not count:
            return
        n = len(self._p)
        h = np.zeros((3 * count, n))
        innovation = np.zeros(3 * count)
        for k, foot in enumerate(self._contacts):
            block = slice(3 * k, 3 * k + 3)
            h[block, 6:9] = -np.eye(3)
            h[block, _block(2 + k)] = np.eye(3)
            innovation[block] = r @ positions[foot] - (self._vectors[2 + k] - self._vectors[1])
        noise = KINEMATICS**2 * np.eye(3 * count)
        gain = self._p @ h.T @ np.linalg.inv(h @ self._p @ h.T + noise)
        correction = gain @ innovation
        factor = np.eye(n) - gain @ h
        self._p = factor @ self._p @ factor.T + gain @ noise @ gain.T
        turn, left_jacobian = exp_so3(correction[:3])
        self._rotation = turn @ r
        shifts = correction[slice(3, n - 6)].reshape(-1, 3) @ left_jacobian.T
        self._vectors = self._vectors @ turn.T + shifts
        self._gyro_bias = self._gyro_bias + correction[slice(n - 6, n - 3)]
        self._accel_bias = self._accel_bias + correction[slice(n - 3, n)]

    def _drop(self, foot: int) -> None:
        """Remove the contact of a lifted foot from the state."""
        k = self._contacts.index(foot)
        self._contacts.pop(k)
        self._vectors = np.delete(self._vectors, 2 + k, axis=0)
        indices = [9 + 3 * k, 10 + 3 * k, 11 + 3 * k]
        self._p = np.delete(np.delete(self._p, indices, axis=0), indices, axis=1)

    def _add(self, foot: int, position: FloatArray) -> None:
        """Append the contact of a foot that stands now to the state."""
        r = self._rotation
        if r is None:
            return
        start = 9 + 3 * len(self._contacts)
        end = start + 3
        n = len(self._p)
        # The error of a new contact is the error of the position plus that of the kinematics.
        f = np.zeros((n + 3, n))
        f[:start, :start] = np.eye(start)
        f[start:end, 6:9] = np.eye(3)
        f[end:, start:] = np.eye(n - start)
        self._p = f @ self._p @ f.T
        self._p[start:end, start:end] += KINEMATICS**2 * np.eye(3)
        self._vectors = np.vstack([self._vectors, self._vectors[1] + r @ position])
        self._contacts.append(foot)
