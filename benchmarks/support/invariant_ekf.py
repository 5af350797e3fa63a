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
GYRO, ACCELEROMETER, CONTACT, KINEMATICS = 0.005, 0.03, 0.3, 0.001
GYRO_WALK, ACCELEROMETER_WALK = 1e-5, 1e-4
START_ROTATION, START_VELOCITY, START_GYRO, START_ACCELEROMETER = 0.01, 0.05, 0.005, 0.3


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
    a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2
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
        self._feet, self._contact = feet, contact
        self._rotation: FloatArray | None = None
        # v, p and the contacts, one row each.
        self._vectors = np.zeros((2, 3))
        self._contacts: list[int] = []
        self._gyro_bias, self._accel_bias = np.zeros(3), np.zeros(3)
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
        c, s = np.cos(self._start_yaw), np.sin(self._start_yaw)
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
        placed, _, centre = self._feet.at(sample.cranks).tolist()
        self._support = support(placed, centre, self._support and self._support.facet)
        standing = list(self._support.feet) if self._support else []
        self._drop([i for i in self._contacts if i not in standing])
        self._correct(np.array(placed))
        self._add([i for i in standing if i not in self._contacts], np.array(placed))

    def _propagate(self, gyro: FloatArray, force: FloatArray, dt: float) -> None:
        r = self._rotation
        if r is None:
            return
        n = len(self._p)
        rate, push = gyro - self._gyro_bias, force - self._accel_bias
        a = np.zeros((n, n))
        a[3:6, :3] = skew(G)
        a[6:9, 3:6] = np.eye(3)
        bg, ba = slice(n - 6, n - 3), slice(n - 3, n)
        a[:3, bg] = -r
        for k, vector in enumerate(self._vectors):
            a[_block(k), bg] = -skew(vector) @ r
        a[3:6, ba] = -r
        phi = np.eye(n) + a * dt + a @ a * (dt * dt / 2.0)
        adjoint = np.eye(n)
        adjoint[:3, :3] = r
        for k, vector in enumerate(self._vectors):
            rows = _block(k)
            adjoint[rows, :3], adjoint[rows, rows] = skew(vector) @ r, r
        noise = [GYRO**2] * 3 + [ACCELEROMETER**2] * 3 + [0.0] * 3
        noise += [self._contact**2] * (3 * len(self._contacts))
        noise += [GYRO_WALK**2] * 3 + [ACCELEROMETER_WALK**2] * 3
        g = phi @ adjoint
        # Densities at the rate of the sensors, of which each reading is independent.
        self._p = phi @ self._p @ phi.T + g @ np.diag(noise) @ g.T * dt * dt
        at = r @ push + G
        self._vectors[1] += self._vectors[0] * dt + at * (dt * dt / 2.0)
        self._vectors[0] += at * dt
        self._rotation = r @ exp_so3(rate * dt)[0]

    def _correct(self, placed: FloatArray) -> None:
        r, count = self._rotation, len(self._contacts)
        if r is None or not count:
            return
        n = len(self._p)
        h, innovation = np.zeros((3 * count, n)), np.zeros(3 * count)
        for k, foot in enumerate(self._contacts):
            rows = slice(3 * k, 3 * k + 3)
            h[rows, 6:9] = -np.eye(3)
            h[rows, _block(2 + k)] = np.eye(3)
            innovation[rows] = r @ placed[foot] - (self._vectors[2 + k] - self._vectors[1])
        noise = KINEMATICS**2 * np.eye(3 * count)
        gain = self._p @ h.T @ np.linalg.inv(h @ self._p @ h.T + noise)
        by = gain @ innovation
        part = np.eye(n) - gain @ h
        self._p = part @ self._p @ part.T + gain @ noise @ gain.T
        turn, left = exp_so3(by[:3])
        self._rotation = turn @ r
        self._vectors = self._vectors @ turn.T + by[slice(3, n - 6)].reshape(-1, 3) @ left.T
        self._gyro_bias = self._gyro_bias + by[slice(n - 6, n - 3)]
        self._accel_bias = self._accel_bias + by[slice(n - 3, n)]

    def _drop(self, gone: list[int]) -> None:
        for foot in gone:
            k = self._contacts.index(foot)
            self._contacts.pop(k)
            self._vectors = np.delete(self._vectors, 2 + k, axis=0)
            rows = [9 + 3 * k, 10 + 3 * k, 11 + 3 * k]
            self._p = np.delete(np.delete(self._p, rows, axis=0), rows, axis=1)

    def _add(self, new: list[int], placed: FloatArray) -> None:
        r = self._rotation
        if r is None:
            return
        for foot in new:
            at = 9 + 3 * len(self._contacts)
            n = len(self._p)
            # The error of a new contact is that of the position, and of the kinematics.
            grow = np.zeros((n + 3, n))
            grow[:at, :at], grow[slice(at + 3, None), at:] = np.eye(at), np.eye(n - at)
            grow[slice(at, at + 3), 6:9] = np.eye(3)
            self._p = grow @ self._p @ grow.T
            rows = slice(at, at + 3)
            self._p[rows, rows] += KINEMATICS**2 * np.eye(3)
            self._vectors = np.vstack([self._vectors, self._vectors[1] + r @ placed[foot]])
            self._contacts.append(foot)
