"""
State estimation of a walker: where it is, from its cranks, its feet and, if there is one, an IMU.

An error-state Kalman filter (J. Sola, Quaternion kinematics for the error-state Kalman filter,
2017, reduced to the plane). The state is

    x, y, psi            pose of base_link in odom,
    v_x, v_y, w          velocity of base_link over ground, in its level frame,
    b_w, b_x, b_y        biases of the gyro's yaw rate and of the level acceleration.

Prediction over a time t, with the measured velocity change dv [m/s] and rotation dpsi [rad]:

    (x, y)' = (x, y) + R(psi) v t,   psi' = psi + w t,
    v' = R(-w t) v + dv - b t,       w = dpsi / t - b_w.

Without an accelerometer dv is that of the momentum of the centre of mass on the slope, without a
gyro w stays, and friction may change both within the step: the variance of v grows by mu g / K,
with K [s/m^2] the weight of slip below.

Measurement: each standing foot i, at p_i [m] with the velocity q_i [m/s] in the body, has the slip
s_i = q_i + v + w J p_i (J turns by 90 deg), of which |s_i| has a Laplace distribution with the
weight K t l_i, l_i being its share of the load: dry friction is its likelihood, and the update is
the minimum of dissipation and prior (`stance.minimize_slip`), an iterated Kalman update.

With an accelerometer friction is balanced as measured: less the acceleration, and the slope, the
median of the slip is zero. The prior is then so narrow that noise of the q_i, which encoders and
attitude give to all feet alike, would decide the signs of the slip of feet that stick, and those
that slide would displace the velocity by that noise. So its variance n^2 / t is part of the
prior of the slip, v + noise, and the gain is that of v alone. The covariance after it is that of
a Laplace approximation: the Hessian of the dissipation is zero along the slip of a foot, so feet
that slide against each other leave the velocity along their slip to the accelerometer.

The errors of the contact model are alike from step to step, so they do not average out. They are
consider parameters c_1 ... c_5 (S. F. Schmidt, Application of state-space methods to navigation
problems, 1966): constants that are never estimated, but that the covariance of the pose contains,

    v + c_1 v + (c_2, c_3) s + c_5 e   and   w + c_4 s / reach + c_5 e_w

being the velocity and the yaw rate, with the load-weighted slip s [m/s] and the differences
e [m/s], e_w [rad/s] between the motion of least squares of the slip and the estimate, which are
large where much depends on the friction law and the loads. In circles they turn the heading by
more than a radian, where the pose is not linear in them any more: so the pose is followed for
sigma points of each (S. J. Julier, J. K. Uhlmann, Unscented filtering and nonlinear estimation,
2004). With a gyro c_2, c_3 and c_5 are scaled by 0.5 (by 0.025 with an accelerometer as well),
and c_4 is not used.

A body that may rest on several facets of its feet rests on the one that a measured attitude shows.
Where it still contradicts them (a body that rocks, jumps or stands on others), K is divided by the
normalised square of that innovation.

With a gyro the yaw and its bias are consider parameters of the slip's update: errors of the
contact model last, so they would be learned as drift.

At standstill the rotation and the acceleration are zero, which measures the biases. The slope
is a running mean of the measured attitude less that of the body on its feet: the Kalman filter of
a constant which nothing else depends on.
"""

from cmath import rect
from collections.abc import Sequence
from math import exp, hypot, nan, sin, sqrt
from operator import mul
from typing import NamedTuple

from klann_ros.dynamics import GRAVITY
from klann_ros.gait import Feet, stance
from klann_ros.gait.stance import Facet, Point, Support, Triple
from klann_ros.kinematics.angles import wrap
import numpy as np

from .imu import ImuIncrement, ImuPreintegration, ImuReading, StandstillCalibration
from .settings import OdometryNoise

# The yaw and the gyro's bias; the accelerometer's biases.
GYRO_STATES, ACCEL_BIAS = slice(2, 7, 4), slice(7, 9)
# The places of a symmetric matrix in `stance.Symmetric`.
_SQUARE = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
Attitude = tuple[float, float]


class OdometryEstimate(NamedTuple):
    """
    Pose and velocity of a walker, in a frame that begins on the ground below its start.

    x, y, z are base_link's origin [m]; roll, pitch, yaw are as in REP 103 [rad]; `linear` is the
    velocity over ground, forwards and to the left [m/s], and `angular` the yaw rate [rad/s];
    `covariance` is that of x, y and yaw, and `rate_variances` are of the velocity and yaw rate.
    """

    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    linear: tuple[float, float]
    angular: float
    covariance: tuple[Triple, Triple, Triple]
    rate_variances: Triple


class Odometry:
    """
    Estimate the motion of a walker.

    `support` is that of the feet which carry it: None before the first angles, and where its
    centre of mass is not above its feet. `travelled` and `slid` are the distances that it moved,
    and that its feet slid [m]; `support_violation` is the part of the last 10 s in which the
    measured attitude is that of a body on feet that cannot carry it.

    Parameters
    ----------
    feet : Feet
        The walker's.
    noise : OdometryNoise, optional
        Uncertainties.

    """

    def __init__(self, feet: Feet, noise: OdometryNoise | None = None) -> None:
        self.noise = n = noise or OdometryNoise()
        self._feet = feet
        self.support: Support | None = None
        self.calibration = StandstillCalibration(n)
        self.travelled = self.slid = 0.0
        self._imu, self._heading_variance = ImuPreintegration(self.noise), 0.0
        self._cranks: list[float] | None = None
        self._rates: list[float] = []
        self._state = np.zeros(9)
        deviations = [0.0] * 6 + [n.gyro_bias] + [n.accelerometer_bias] * 2
        self._covariance = np.diag(np.square(deviations))
        # Sigma points of the consider parameters, and the pose by each, from the state on.
        errors = n.advance_error, n.slip_error, n.slip_error, n.slip_yaw_error, n.contact_error
        # With nine of them the standard deviations in a circle change by 3 % at most.
        points, weights = np.polynomial.hermite_e.hermegauss(5)
        self._errors = np.outer(errors, points)
        self._weights = np.tile(weights / weights.sum(), len(errors))
        self._turned = np.zeros(self._errors.shape)
        self._moved, self._directions = 0j * self._turned, np.exp(1j * self._turned)
        self._attitude: Attitude | None = None
        self._slope, self._slope_time, self._tilt_square = 0j, 0.0, 0.0
        self._roughness = 0.0
        # Weight of the contact model: less where the measured attitude contradicts its feet.
        self._contact_weight = 1.0
        # Mean size of the measured horizontal acceleration [m/s^2].
        self._shaking = 0.0
        self.support_violation, self._next_check = 0.0, 0.0
        # Of the centre of mass above the ground [m].
        self._height = 0.0
        self._scale, self._innovation_square = 1.0, 0.0
        self._pose: stance.StancePose | None = None
        self._stop()

    def _stop(self) -> None:
        """Forget the velocity."""
        self._state[3:6] = self._slip = 0.0
        # Of the centre of mass: its velocity in base_link, over ground, and its acceleration.
        self._centre_velocity: complex | None = None
        self._velocity: complex | None = None
        self._acceleration = 0j
        # Measured: the change of the velocity, and the yaw rate.
        self._push: complex | None = None
        self._yaw_rate: float | None = None
        self._innovation = self._friction_share = 0j

    @property
    def gyro_bias(self) -> float:
        """Return the drift of the heading [rad/s]."""
        return float(self._state[6])

    @property
    def innovation(self) -> float:
        """Return the friction that the measured motion needs in the mean, by the largest."""
        return abs(self._innovation)

    @property
    def tilt_innovation(self) -> float:
        """Return the root mean square of the attitude's normalised innovation; 1 is usual."""
        return sqrt(self._tilt_square)

    @property
    def accelerometer_state(self) -> str:
        """Return the state of the accelerometer."""
        return self.calibration.state if self._imu.has_accelerometer else 'none'

    def imu(self, reading: ImuReading, variance: float = 0.0) -> None:
        """Take a reading of an IMU; it measures the rotation from now on, until `forget_imu`."""
        if self._imu.last is None:
            self.calibration.restart()
        self._heading_variance = variance or self.noise.heading_error**2
        self._imu.read(reading)

    def forget_imu(self) -> None:
        """Go on without the IMU."""
        self._imu, self._heading_variance = ImuPreintegration(self.noise), 0.0
        self._slope, self._slope_time = 0j, 0.0

    def jump(self) -> None:
        """Take the next angles as a new start: encoders jumped, the robot did not move."""
        self._cranks = self._pose = None

    def update(
        self, cranks: Sequence[float], rates: Sequence[float], seconds: float = 0.0
    ) -> OdometryEstimate:
        """
        Return the estimate after a reading of the cranks.

        `cranks` are their angles [rad], `rates` theirs [rad/s], and `seconds` is the time since
        the last reading; if it is 0, that of the angles at these rates.
        """
        before = list(cranks) if self._cranks is None else self._cranks
        self._cranks = angles = self._filtered(before, cranks, rates, seconds)
        turned = [is_ - was for is_, was in zip(angles, before, strict=True)]
        n = self.noise
        steps = min(500, 1 + int(max(map(abs, turned)) / n.longest_step))
        if seconds <= 0.0:
            along = sum(map(mul, turned, rates))
            squares = sum(map(mul, rates, rates))
            seconds = along / squares if along > 0.0 else n.max_step_time * steps
        taken = self._imu.take(seconds)
        if taken is not None:
            self._calibrate(taken, rates, seconds)
            self._check_shaking(taken, seconds)
        for k in range(1, steps + 1):
            at = [was + k / steps * by for was, by in zip(before, turned, strict=True)]
            self._follow(at, taken, seconds / steps, 1.0 / steps)
        return self._estimate()

    def _filtered(
        self, before: list[float], cranks: Sequence[float], rates: Sequence[float], seconds: float
    ) -> list[float]:
        """Return the angles without most noise of the encoders, which would be slip of feet."""
        last, self._rates = self._rates or rates, list(rates)
        both = zip(before, last, rates, cranks, strict=True)
        away = [was + (p + q) / 2.0 * seconds - is_ for was, p, q, is_ in both]
        n = self.noise
        if not 0.0 < seconds < n.max_step_time or max(map(abs, away)) >= n.encoder_gate:
            return list(cranks)
        share = exp(-seconds / n.encoder_filter_time)
        return [is_ + share * by for is_, by in zip(cranks, away, strict=True)]

    def _calibrate(self, taken: ImuIncrement, rates: Sequence[float], seconds: float) -> None:
        """Update the biases at standstill: neither rotation nor acceleration."""
        # After the filter of heading and gyro.
        heading = 0.0
        if self._imu.last and self._imu.last.yaw is not None:
            share = self._imu.period / (2.0 * self.noise.orientation_filter_time)
            heading = self._heading_variance * share
        measured = self.calibration.update(taken, self._cranks or (), rates, seconds, heading)
        if measured is None:
            return
        rate, variance = measured
        if variance:
            self._update_bias(6, rate, variance)
        if taken.delta_velocity is not None and taken.span:
            variance = self.noise.accelerometer_noise**2 / taken.span
            for k in (0, 1):
                self._update_bias(7 + k, taken.delta_velocity[k] / taken.span, variance)

    def _update_bias(self, index: int, measured: float, variance: float) -> None:
        column = self._covariance[:, index].copy()
        gain = column / (column[index] + variance)
        self._covariance -= gain[:, None] * column
        self._state += gain * (measured - self._state[index])

    def _follow(
        self, angles: Sequence[float], taken: ImuIncrement | None, dt: float, part: float
    ) -> None:
        """Predict and update over a step, a part of the interval, to new angles of the cranks."""
        feet, rolled, centre = self._feet.at(angles).tolist()
        over = self._zero_moment_point(centre)
        measured, facet = taken.attitude if taken else None, self.support and self.support.facet
        level = self._above_slope(measured) if measured and self._slope_is_known else None
        tolerance = 3.0 * self.noise.tilt_error
        self.support = rest = stance.support(feet, over, facet, level, tolerance)
        before, self._pose = self._pose, None
        if rest is None:
            self._stop()
            return
        self._update_attitude(rest, measured, dt)
        if measured:
            self._check_support(feet, over, rest.facet, measured, dt)
        self._pose = pose = stance.stance_pose(feet, rolled, rest, self._attitude, centre)
        if before is None:
            return
        if dt >= self.noise.max_step_time:
            self._stop()
        push = None
        self._yaw_rate = taken.turn * part / dt - self.gyro_bias if taken else None
        if taken and taken.delta_velocity is not None and self.calibration.is_usable:
            push = part * complex(*taken.delta_velocity[:2])
        self._predict((pose.centre - before.centre) / dt, push, dt)
        # The acceleration of the body shifts the load between the feet.
        self._height = rest.height_of(centre)
        (nx, ny, nz), height = rest.normal, rest.height
        heights = [max(0.0, nx * x + ny * y + nz * z + height) for x, y, z in feet]
        acts = stance.zero_moment_point(pose.centre, self._height, self._acceleration)
        loads = stance.spring_loads(pose.flat, heights, acts)
        both = zip(before.flat, pose.flat, loads, strict=True)
        standing = [stance.foot_motion(p, q, load, dt) for p, q, load in both if load > 0.0]
        self._update(standing, dt)
        self._move(standing, dt)

    def _zero_moment_point(self, centre: Point) -> Point:
        """Return the centre of mass, shifted by the slope and an acceleration that is measured."""
        acceleration = -self._slope if self._push is None else self._acceleration - self._slope
        over = stance.zero_moment_point(complex(*centre[:2]), self._height, acceleration)
        return over.real, over.imag, centre[2]

    def _update_attitude(self, rest: Support, measured: Attitude | None, dt: float) -> None:
        """Set roll and pitch to those of the IMU, or to what the body tips to; learn the slope."""
        n = self.noise
        if measured is None:
            share = 1.0 - exp(-dt / n.tilt_time)
            roll, pitch = self._attitude or (rest.roll, rest.pitch)
            self._attitude = (
                roll + share * (rest.roll - roll), pitch + share * (rest.pitch - pitch)
            )  # fmt: skip
            return
        self._attitude = measured
        self._slope_time += dt
        roll, pitch = measured[0] - rest.roll, measured[1] - rest.pitch
        away, variance = complex(pitch, -roll) - self._slope / GRAVITY, n.tilt_error**2
        square = abs(away) ** 2 / (2.0 * variance)
        latest = min(1.0, dt / n.slope_time)
        self._tilt_square += latest * (square - self._tilt_square)
        self._roughness += latest * (min(square, n.tipping_innovation**2) - self._roughness)
        share = min(1.0, dt / min(self._slope_time, n.slope_time)) if dt else 1.0
        # A body that rocks, jumps or stands on other feet measures no slope.
        self._contact_weight = 1.0 / max(1.0, square)
        if self._slope_is_known:
            share *= self._contact_weight
        self._slope += share * (GRAVITY * complex(sin(pitch), -sin(roll)) - self._slope)

    @property
    def _slope_is_known(self) -> bool:
        """Return whether it is known well enough to contradict the feet."""
        return self._slope_time >= self.noise.slope_time / 4.0

    def _above_slope(self, attitude: Attitude) -> Attitude:
        """Return roll and pitch above the ground."""
        return attitude[0] + self._slope.imag / GRAVITY, attitude[1] - self._slope.real / GRAVITY

    def _check_support(
        self, feet: Sequence[Point], over: Point, facet: Facet, measured: Attitude, dt: float
    ) -> None:
        """Learn for which part of the time it lies on feet that cannot carry it."""
        self._next_check -= dt
        if self._next_check > 0.0 or not self._slope_is_known:
            return
        self._next_check = period = 0.1
        level = self._above_slope(measured)
        is_off = stance.outside_feet(feet, over, level, facet) > self.noise.max_outside
        share = period / self.noise.slope_time
        self.support_violation += share * (is_off - self.support_violation)

    def _predict(self, moves: complex, push: complex | None, dt: float) -> None:
        """Predict the velocity; the centre of mass has the velocity `moves` in base_link."""
        n, p = self.noise, self._covariance
        vx, vy, w, _, bx, by = self._state[3:].tolist()
        w = w if self._yaw_rate is None else self._yaw_rate
        if push is None:
            # The centre of mass keeps its velocity over ground.
            last = moves if self._centre_velocity is None else self._centre_velocity
            change = self._slope * dt - moves + last
        else:
            # From the middle of the last step to that of this one: velocities are means of steps.
            last = push if self._push is None else self._push
            change = (last + push) / 2.0 - complex(bx, by) * dt
            # The force that friction balances, by the greatest friction.
            share = (self._slope - change / dt) / (n.friction * GRAVITY)
            self._friction_share = share / max(1.0, abs(share))
        self._push, self._centre_velocity = push, moves
        motion = complex(vx, vy)
        turns, bias = rect(1.0, -w * dt), 0.0 if push is None else -dt
        predicted = motion * turns + change
        self._state[3:6] = predicted.real, predicted.imag, w
        row = [0, 0, 0, turns, 1j * turns, -1j * motion * dt, 0, bias, 1j * bias]
        # With a gyro the error of the yaw rate is that of the bias.
        yaw = [0, 0, 0, 0, 0, 1] if self._yaw_rate is None else [0, 0, 0, 0, 0, 0, -1]
        # Without an accelerometer friction may change the velocity within the step.
        noise = n.friction * GRAVITY / n.friction_information
        spread = noise if push is None else n.accelerometer_noise**2 * dt
        self._propagate(3, row, yaw)
        p[3, 3] += spread
        p[4, 4] += spread
        if push is not None:
            p[7, 7] += n.accelerometer_drift**2 * dt
            p[8, 8] += n.accelerometer_drift**2 * dt
        if self._yaw_rate is None:
            p[5, 5] += noise / self._feet.gyration**2
        else:
            p[6, 6] += n.gyro_drift**2 * dt
            if self._imu.last and self._imu.last.yaw is None:
                p[2, 2] += n.gyro_noise**2 * dt

    def _propagate(self, first: int, row: Sequence[complex], yaw: Sequence[float]) -> None:
        """Propagate the covariance: three rows of the Jacobian, the first two as x + jy."""
        # `dot` takes half the time of @ on matrices this small.
        p, f, rows = self._covariance, np.zeros((3, 9)), slice(first, first + 3)
        both = np.array(row, dtype=np.complex128)
        f[0, : len(row)], f[1, : len(row)], f[2, : len(yaw)] = both.real, both.imag, yaw
        changed = f.dot(p)
        changed[:, rows] = changed.dot(f.T)
        p[rows], p[:, rows] = changed, changed.T

    def _update(self, standing: Sequence[stance.FootMotion], dt: float) -> None:
        """Update by the slip of the feet, whose likelihood is dry friction."""
        self._slip = 0.0
        if not standing:
            return
        p, size = self._covariance, 3 if self._yaw_rate is None else 2
        seen, weight = slice(3, 3 + size), self.noise.friction_information * dt
        (a, b, c), (_, d, e), (_, _, f) = p[3:6, 3:6].tolist()
        if size == 2:
            c, e, f = 0.0, 0.0, 1e-18
        held, force = weight, 0j
        # With an accelerometer, which measures the motion without the feet.
        if self._push is not None:
            noise = self.noise.foot_velocity_noise**2 / dt
            a, d, f = a + noise, d + noise, f + noise / self._feet.reach**2
            held *= self._contact_weight
            force = held * self._friction_share
        covariance = a, b, c, d, e, f
        information = stance.inverse(covariance)
        vx, vy, w = self._state[3:6].tolist()
        prior = stance.MotionPrior(complex(vx, vy), w, information, force)
        feet = [stance.FootMotion(moves, arm, held * load) for moves, arm, load in standing]
        creep = self.noise.stiction_speed
        found = stance.minimize_slip(feet, creep, prior)
        posterior = found.covariance
        if self._push is not None:
            after = stance.dissipation_hessian(feet, found, creep, information)
            posterior = stance.inverse(after)
        by = np.array((found.motion.real - vx, found.motion.imag - vy, found.yaw - w)[:size])
        all_three = np.array((covariance, information, posterior))
        predicted, inverse_prior, updated = all_three[:, _SQUARE[:size, :size]]
        gain = p[:, seen].dot(inverse_prior)
        saved = self._state[GYRO_STATES].copy(), p[GYRO_STATES, GYRO_STATES].copy()
        p -= gain.dot(predicted - updated).dot(gain.T)
        self._state += gain.dot(by)
        if size == 2:
            self._state[GYRO_STATES], p[GYRO_STATES, GYRO_STATES] = saved
        self._slip = found.slid / held
        if self._push is not None:
            self._adapt(complex(*inverse_prior.dot(by)[:2]) / weight, dt)

    def _adapt(self, force: complex, dt: float) -> None:
        """Learn how hard friction corrects the accelerometer; reject it if that is too much."""
        n = self.noise
        self._innovation += (1.0 - exp(-dt / n.innovation_time)) * (force - self._innovation)
        square = self.innovation**2 - self._innovation_square
        self._innovation_square += min(1.0, dt / n.slope_time) * square
        if self.innovation > n.innovation_gate:
            self._reject_accelerometer()

    def _check_shaking(self, taken: ImuIncrement, seconds: float) -> None:
        """Reject an accelerometer that measures for a second what no feet can do."""
        if taken.delta_velocity is None or not taken.span or not self.calibration.is_usable:
            return
        size = hypot(*taken.delta_velocity[:2]) / taken.span
        share = min(1.0, seconds / self.noise.innovation_time)
        self._shaking += share * (size - self._shaking)
        if self._shaking > GRAVITY:
            self._reject_accelerometer()

    def _reject_accelerometer(self) -> None:
        self.calibration.reject()
        self._innovation, self._shaking = 0j, 0.0
        self._state[ACCEL_BIAS] = 0.0
        p = self._covariance
        p[ACCEL_BIAS] = p[:, ACCEL_BIAS] = 0.0
        p[7, 7] = p[8, 8] = self.noise.accelerometer_bias**2

    def _move(self, standing: Sequence[stance.FootMotion], dt: float) -> None:
        """Move the pose by the velocity, and its covariance by the errors of the contact model."""
        n = self.noise
        _, _, yaw, vx, vy, w = self._state[:6].tolist()
        motion, along = complex(vx, vy), rect(1.0, yaw + w * dt / 2.0)
        step = along * motion * dt
        self._state[:2] += step.real, step.imag
        self._state[2] = wrap(yaw + w * dt)
        self.travelled += abs(step)
        self.slid += self._slip * dt
        # The acceleration of the centre of mass shifts the load.
        velocity = motion + (self._centre_velocity or 0j)
        last = velocity if self._velocity is None else self._velocity
        acceleration = (velocity - last) / dt + 1j * w * velocity
        self._velocity = velocity
        share = 1.0 - exp(-dt / n.load_shift_time)
        self._acceleration += share * (acceleration - self._acceleration)
        self._slope *= rect(1.0, -w * dt)
        scale, doubt, has_gyro = 1.0, 1.0, self._yaw_rate is not None
        if self._push is not None:
            # Adaptive errors (R. K. Mehra, Approaches to adaptive filtering, IEEE Trans. Automatic
            # Control 17, 1972): by the square of what attitude and accelerometer contradict.
            rough, shaken = self._roughness / n.usual_tilt**2, self._innovation_square
            doubt = max(1.0, rough, shaken / n.usual_innovation**2)
            scale = n.slip_scale_with_accelerometer * doubt
        elif has_gyro:
            scale = n.slip_scale_with_gyro
        self._scale = scale
        least, turn = stance.least_squares(standing, self._yaw_rate) if standing else (motion, w)
        side, yaw_row = along * dt, [0, 0, 1, 0, 0, dt]
        self._propagate(0, [1, 1j, 1j * step, side, 1j * side, 0.5j * step * dt], yaw_row)
        # The pose by the errors of the contact model.
        slip, contact = scale * self._slip, scale * (least - motion)
        effects = np.array((doubt * motion, slip, 1j * slip, 0.0, contact))
        moves = self._directions * (motion + effects[:, None] * self._errors) - motion
        self._moved += along * dt * moves
        if not has_gyro:
            turns = np.array((0.0, 0.0, 0.0, slip / self._feet.reach, turn - w))
            self._turned += turns[:, None] * self._errors * dt
            self._directions = np.exp(1j * self._turned)

    def _estimate(self) -> OdometryEstimate:
        rest, reading, n = self.support, self._imu.last, self.noise
        px, py, yaw, vx, vy, angular = self._state[:6].tolist()
        away = np.array([self._moved.real, self._moved.imag, self._turned]).reshape(3, -1)
        p = (self._covariance[:3, :3] + (self._weights * away).dot(away.T)).tolist()
        p[2][2] += self._heading_variance
        roll, pitch = (rest.roll, rest.pitch) if rest else (0.0, 0.0)
        var_x, var_y, var_w = (float(self._covariance[k, k]) for k in (3, 4, 5))
        slip, reach = self._scale * self._slip, self._feet.reach
        rocks = n.rocking_error * hypot(vx, vy, angular * reach)
        rocks *= 1.0 if self._push is None else self._scale
        common = (n.slip_error * slip) ** 2 + rocks * rocks
        if reading is None:
            var_w += (n.slip_yaw_error * slip / reach) ** 2 + (rocks / 2.0 / reach) ** 2
        else:
            # That of one reading.
            angular = reading.yaw_rate - self.gyro_bias
            var_w += n.gyro_noise**2 / self._imu.period if self._imu.period else 0.0
            roll, pitch = reading.attitude or (roll, pitch)
        return OdometryEstimate(
            px, py, rest.height if rest else nan, roll, pitch, yaw, (vx, vy), angular,
            (tuple(p[0]), tuple(p[1]), tuple(p[2])),
            (
                var_x + (n.advance_error * vx) ** 2 + common,
                var_y + (n.advance_error * vy) ** 2 + common,
                var_w,
            ),
        )  # fmt: skip
