"""
Odometry as others would compute it, for the comparison with walker_node's.

Each baseline takes the same feet and sensors, and the same rule of which feet stand (`support`).
"""

from cmath import rect
from collections.abc import Sequence
from math import cos, pi, sin
from typing import NamedTuple

from klann_ros.gait import Feet
from klann_ros.gait.stance import (
    foot_motion,
    least_squares,
    stance_pose,
    StancePose,
    support,
)
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.walker import ImuReading
import numpy as np

Triple = tuple[float, float, float]


class Sample(NamedTuple):
    """
    The readings of all sensors at one time.

    Attributes
    ----------
    cranks, rates : list of float
        [rad], [rad/s].
    imu : ImuReading
        The IMU in base_link.
    orientation : 4 floats
        Quaternion x, y, z, w of the IMU.
    gyro, force : 3 floats
        [rad/s], [m/s^2].
    is_still : bool
        Whether the robot has not been commanded yet.

    """

    cranks: list[float]
    rates: list[float]
    imu: ImuReading
    orientation: list[float]
    gyro: Triple
    force: Triple
    is_still: bool


class NoSlip:
    """
    Dead reckoning by the least squares of standing feet, as if none slipped.

    Parameters
    ----------
    feet : Feet
        The walker's.
    with_gyro : bool
        Whether the yaw is the integral of the gyro, less its mean at standstill.

    """

    def __init__(self, feet: Feet, *, with_gyro: bool) -> None:
        self._feet = feet
        self._with_gyro = with_gyro
        self.pose = [0.0, 0.0, 0.0]
        self._last: StancePose | None = None
        # Mean yaw rate of the gyro at standstill [rad/s], and the number of its samples.
        self._bias = 0.0
        self._count = 0

    def update(self, sample: Sample, dt: float) -> None:
        """Take the next sample."""
        if sample.is_still:
            self._count += 1
            self._bias += (sample.imu.yaw_rate - self._bias) / self._count
        positions, rolled, centre = self._feet.at(sample.cranks).tolist()
        last = self._last
        stance_support = support(positions, centre, last and last.support.facet)
        stance = stance_support and stance_pose(positions, rolled, stance_support)
        self._last = stance
        if last is None or stance is None or dt == 0.0:
            return
        standing = {*last.support.feet} & {*stance.support.feet} or {*stance.support.feet}
        motions = [foot_motion(last.flat[i], stance.flat[i], 1.0) for i in standing]
        turn = (sample.imu.yaw_rate - self._bias) * dt if self._with_gyro else None
        motion, yaw = least_squares(motions, turn)
        step = motion * rect(1.0, self.pose[2] + yaw / 2.0)
        self.pose[0] += step.real
        self.pose[1] += step.imag
        self.pose[2] += yaw


class RobotLocalization:
    """
    The filter of robot_localization's ekf_node with `two_d_mode`: twist of odom, yaw rate of imu.

    State x, y, yaw, vx, vy, vyaw, ax, ay; prediction, Jacobian and default noises as in its
    src/ekf.cpp and src/ros_filter.cpp (T. Moore, D. Stouch, A generalized extended Kalman filter
    implementation for the Robot Operating System, 2014).
    """

    PROCESS_NOISE = (0.05, 0.05, 0.06, 0.025, 0.025, 0.02, 0.01, 0.01)

    def __init__(self) -> None:
        self._state = np.zeros(8)
        self._p = 1e-9 * np.eye(8)

    @property
    def pose(self) -> list[float]:
        """Return x, y and yaw."""
        pose: list[float] = self._state[:3].tolist()
        return pose

    @property
    def covariance(self) -> FloatArray:
        """Return the covariance of x, y and yaw."""
        return self._p[:3, :3]

    def predict(self, dt: float) -> None:
        """Predict over a time [s]."""
        _, _, yaw, vx, vy, w, ax, ay = self._state
        c = cos(yaw)
        s = sin(yaw)
        half = dt * dt / 2.0
        step_x = vx * dt + ax * half
        step_y = vy * dt + ay * half
        f = np.eye(8)
        f[:2, 2] = (-s * step_x - c * step_y, c * step_x - s * step_y)
        f[:2, 3:5] = ((c * dt, -s * dt), (s * dt, c * dt))
        f[:2, 6:] = ((c * half, -s * half), (s * half, c * half))
        f[2, 5] = f[3, 6] = f[4, 7] = dt
        self._state[0] += c * step_x - s * step_y
        self._state[1] += s * step_x + c * step_y
        self._state[2] = (yaw + w * dt + pi) % (2.0 * pi) - pi
        self._state[3:5] += self._state[6:] * dt
        self._p = f @ self._p @ f.T + dt * np.diag(self.PROCESS_NOISE)

    def measure(self, indices: Sequence[int], z: Sequence[float], r: Sequence[float]) -> None:
        """Update by measurements z of components of the state, with variances r."""
        h = np.eye(8)[list(indices)]
        noise = np.diag(r)
        gain = self._p @ h.T @ np.linalg.inv(h @ self._p @ h.T + noise)
        self._state = self._state + gain @ (np.array(z) - self._state[list(indices)])
        correction = np.eye(8) - gain @ h
        self._p = correction @ self._p @ correction.T + gain @ noise @ gain.T
