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
2004). With a gyro c_2, c_3 and c_5 are scaled by 0.5 (by 0.025 with an accelerometer as well,
but feet that stick may creep alike for long), and c_4 is not used.

A body that may rest on several facets of its feet rests on the one that a measured attitude shows.
Where it still contradicts them (a body that rocks, jumps or stands on others), K is divided by the
normalised square of that innovation.

With a gyro the yaw and its bias are consider parameters of the slip's update: errors of the
contact model last, so they would be learned as drift.

At standstill the rotation and the acceleration are zero, which measures the biases. The variance
of the accelerometer's noise is that with which friction has to correct it as usual. The slope
is a running mean of the measured attitude less that of the body on its feet: the Kalman filter of
a constant which nothing else depends on.
"""

from cmath import rect
from collections.abc import Sequence
from math import hypot, nan, sqrt
from operator import mul
from typing import NamedTuple

from klann_ros.dynamics import GRAVITY
from klann_ros.gait import Feet, Point, stance, Support, Triple
from klann_ros.kinematics.angles import wrap
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .accelerometer import AccelerometerMonitor, AccelerometerState
from .crank_motion import CentreMotion, CrankFilter
from .filter_state import ContactErrors, FilterState, GYRO_BIAS, GYRO_STATES
from .imu import ImuIncrement, ImuPreintegration, ImuReading
from .imu_monitor import ImuMonitor, ImuState
from .settings import OdometryNoise
from .slope import SlopeEstimator, SupportCheck
from .standstill import GyroCalibration, StandstillDetector

# Variance of a yaw rate that is known [rad^2/s^2].
KNOWN_YAW_VARIANCE = 1e-18


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
    and that its feet slid [m].

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
        self.travelled = 0.0
        self.slid = 0.0
        self.state = FilterState(n)
        self.contact_errors = ContactErrors(n)
        self.slope = SlopeEstimator(n)
        self.support_check = SupportCheck(n)
        self.standstill = StandstillDetector(n)
        self.gyro = GyroCalibration(n)
        self.accelerometer = AccelerometerMonitor(n)
        self.cranks = CrankFilter(n)
        self.centre = CentreMotion(n)
        self.imu_monitor = ImuMonitor(n)
        self._imu = ImuPreintegration(n)
        self._pose: stance.StancePose | None = None
        # Turn of the feet by least squares since the last reading, and their slip by the reach
        # [rad].
        self._feet_turn = 0.0, 0.0
        self._stop()

    def _stop(self) -> None:
        """Forget the velocity."""
        self.state.mean[3:6] = 0.0
        self.centre.stop()
        self.accelerometer.stop()
        # Mean slip of the feet [m/s].
        self._slip = 0.0
        # Measured change of the velocity [m/s], and the yaw rate [rad/s].
        self._push: complex | None = None
        self._yaw_rate: float | None = None

    @property
    def gyro_bias(self) -> float:
        """Return the drift of the heading [rad/s]."""
        return float(self.state.mean[GYRO_BIAS])

    @property
    def accelerometer_state(self) -> AccelerometerState:
        """Return the state of the accelerometer."""
        has_one = self._imu.has_accelerometer
        return self.accelerometer.state if has_one else AccelerometerState.NONE

    def imu(self, reading: ImuReading, variance: float = 0.0) -> None:
        """Take a reading of an IMU; it measures the rotation from now on, until `forget_imu`."""
        if self._imu.last is None:
            self.standstill.restart()
        self.imu_monitor.read(reading)
        self._imu.heading_variance = variance or self.noise.heading_error**2
        self._imu.read(reading)

    def forget_imu(self) -> None:
        """Go on without the IMU."""
        self.imu_monitor = ImuMonitor(self.noise)
        self._restart_imu()

    def _restart_imu(self) -> None:
        self._imu = ImuPreintegration(self.noise)
        self.slope.forget()

    def set_pose(self, pose: Sequence[float], covariance: FloatArray) -> None:
        """Go on at x, y [m] and yaw [rad]; what is known of velocity and biases stays."""
        self.state.set_pose(pose, covariance)
        self.contact_errors = ContactErrors(self.noise)

    def jump(self) -> None:
        """Take the next angles as a new start: encoders jumped, the robot did not move."""
        self.cranks.angles = self._pose = None

    def update(
        self,
        cranks: Sequence[float],
        rates: Sequence[float],
        seconds: float = 0.0,
        *,
        is_commanded: bool = False,
    ) -> OdometryEstimate:
        """
        Return the estimate after a reading of the cranks.

        `cranks` are their angles [rad], `rates` theirs [rad/s], and `seconds` is the time since
        the last reading; if it is 0, that of the angles at these rates. While a motion is
        commanded it does not stand, however slow its cranks are.
        """
        before, angles = self.cranks.read(cranks, rates, seconds)
        turned = [is_ - was for is_, was in zip(angles, before, strict=True)]
        n = self.noise
        steps = min(500, 1 + int(max(map(abs, turned)) / n.longest_step))
        if seconds <= 0.0:
            along = sum(map(mul, turned, rates))
            squares = sum(map(mul, rates, rates))
            seconds = along / squares if along > 0.0 else n.max_step_time * steps
        is_moving = is_commanded or max(map(abs, rates)) > n.stationary_rate
        taken = self._taken(cranks, seconds, is_moving=is_moving)
        if taken is not None:
            stands = self.standstill.update(
                cranks, rates, taken.body_rate, seconds, is_commanded=is_commanded
            )
            if stands:
                self._calibrate(taken, seconds)
            else:
                self.gyro.restart()
            self.accelerometer.elapse(seconds)
            if self.accelerometer.is_shaken(taken, seconds) and self._has_accelerometer:
                self._reject_accelerometer()
        for k in range(1, steps + 1):
            at = [was + k / steps * by for was, by in zip(before, turned, strict=True)]
            self._follow(at, taken, seconds / steps, 1.0 / steps)
        return self._estimate()

    def _taken(
        self, cranks: Sequence[float], seconds: float, *, is_moving: bool
    ) -> ImuIncrement | None:
        """Return what the IMU measured since the last reading of the cranks, if it is used."""
        taken = self._imu.take(seconds)
        if taken is None:
            return None
        feet_turn, slip = self._feet_turn
        self._feet_turn = 0.0, 0.0
        if is_moving:
            turn = taken.turn - self.gyro_bias * seconds
            self.imu_monitor.compare(feet_turn, turn, slip, seconds)
        was_used = self.imu_monitor.state is ImuState.USED
        is_used = self.imu_monitor.update(cranks, seconds) is ImuState.USED
        if was_used and is_used:
            return taken
        if is_used:
            # What it did meanwhile is no turn of the body.
            self._restart_imu()
        elif was_used:
            # The feet go on with a yaw rate of their own.
            self.state.mean[5] = feet_turn / seconds if seconds else 0.0
            self.slope.forget()
        self.standstill.restart()
        return None

    @property
    def _has_accelerometer(self) -> bool:
        return self.accelerometer.state is AccelerometerState.USED

    def _calibrate(self, taken: ImuIncrement, seconds: float) -> None:
        """Update the biases at standstill: neither rotation nor acceleration."""
        # After the filter of heading and gyro.
        heading = 0.0
        if self._imu.last and self._imu.last.yaw is not None:
            share = self._imu.period / (2.0 * self.noise.orientation_filter_time)
            heading = self._imu.heading_variance * share
        self.accelerometer.rest(taken)
        # The filter of heading and gyro settles first.
        if self.standstill.time >= self.noise.settling_time:
            confirmed = self.standstill.is_confirmed
            drift = self.gyro.update(taken, seconds, heading, is_confirmed=confirmed)
            if drift is not None:
                self._learn_gyro_bias(*drift)
        if taken.delta_velocity is not None and taken.span:
            variance = self.noise.accelerometer_noise**2 / taken.span
            for k in (0, 1):
                self.state.measure(7 + k, taken.delta_velocity[k] / taken.span, variance)

    def _learn_gyro_bias(self, rate: float, variance: float) -> None:
        spread = float(self.state.covariance[GYRO_BIAS, GYRO_BIAS]) + variance
        innovation = abs(rate - self.gyro_bias) / sqrt(spread)
        self.gyro.is_steady = innovation <= self.noise.bias_gate
        if self.gyro.is_steady:
            self.state.measure(GYRO_BIAS, rate, variance)
        else:
            self.standstill.restart()
            self.gyro.restart()

    def _follow(
        self, angles: Sequence[float], taken: ImuIncrement | None, dt: float, part: float
    ) -> None:
        """Predict and update over a step, a part of the interval, to new angles of the cranks."""
        feet, rolled, centre = self._feet.pose(angles)
        over = self._zero_moment_point(centre)
        measured, facet = taken.attitude if taken else None, self.support and self.support.facet
        level = self.slope.above(measured) if measured and self.slope.is_known else None
        tolerance = 3.0 * self.noise.tilt_error
        self.support = rest = stance.support(feet, over, facet, level, tolerance)
        before, self._pose = self._pose, None
        if rest is None:
            self._stop()
            return
        self.slope.update(rest, measured, dt)
        if measured and self.slope.is_known:
            self.support_check.update(feet, over, rest.facet, self.slope.above(measured), dt)
        self._pose = pose = stance.stance_pose(feet, rolled, rest, self.slope.attitude, centre)
        if before is None:
            return
        if dt >= self.noise.max_step_time:
            self._stop()
        push = None
        self._yaw_rate = taken.turn * part / dt - self.gyro_bias if taken else None
        if taken and taken.delta_velocity is not None and self._has_accelerometer:
            push = part * complex(*taken.delta_velocity[:2])
        friction_share = self._predict((pose.centre - before.centre) / dt, push, dt)
        # The acceleration of the body shifts the load between the feet.
        self.centre.height = rest.height_of(centre)
        (nx, ny, nz), height = rest.normal, rest.height
        heights = [max(0.0, nx * x + ny * y + nz * z + height) for x, y, z in feet]
        acts = stance.zero_moment_point(pose.centre, self.centre.height, self.centre.acceleration)
        loads = stance.spring_loads(pose.flat, heights, acts)
        both = zip(before.flat, pose.flat, loads, strict=True)
        standing = [stance.foot_motion(p, q, load, dt) for p, q, load in both if load > 0.0]
        self._update(standing, friction_share, dt)
        if standing and self._imu.last is not None:
            _, rate = stance.least_squares(standing)
            turn, slip = self._feet_turn
            self._feet_turn = turn + rate * dt, slip + self._slip * dt / self._feet.reach
        self._move(standing, dt)

    def _zero_moment_point(self, centre: Point) -> Point:
        """Return the centre of mass, shifted by the slope and an acceleration that is measured."""
        acceleration = -self.slope.acceleration
        if self._push is not None:
            acceleration += self.centre.acceleration
        over = stance.zero_moment_point(complex(*centre[:2]), self.centre.height, acceleration)
        return over.real, over.imag, centre[2]

    def _predict(self, moves: complex, push: complex | None, dt: float) -> complex:
        """
        Predict the velocity; return the friction that balances the measured one, by the largest.

        The centre of mass has the velocity `moves` in base_link [m/s].
        """
        n, p = self.noise, self.state.covariance
        vx, vy, w, _, bx, by = self.state.mean[3:].tolist()
        w = w if self._yaw_rate is None else self._yaw_rate
        share = 0j
        if push is None:
            # The centre of mass keeps its velocity over ground.
            last = moves if self.centre.velocity is None else self.centre.velocity
            change = self.slope.acceleration * dt - moves + last
        else:
            # From the middle of the last step to that of this one: velocities are means of steps.
            last = push if self._push is None else self._push
            change = (last + push) / 2.0 - complex(bx, by) * dt
            # The force that friction balances, by the greatest friction.
            share = (self.slope.acceleration - change / dt) / (n.friction * GRAVITY)
            share /= max(1.0, abs(share))
        self._push = push
        self.centre.velocity = moves
        motion = complex(vx, vy)
        turns, bias = rect(1.0, -w * dt), 0.0 if push is None else -dt
        predicted = motion * turns + change
        self.state.mean[3:6] = predicted.real, predicted.imag, w
        row = [0, 0, 0, turns, 1j * turns, -1j * motion * dt, 0, bias, 1j * bias]
        # With a gyro the error of the yaw rate is that of the bias.
        yaw = [0, 0, 0, 0, 0, 1] if self._yaw_rate is None else [0, 0, 0, 0, 0, 0, -1]
        # Without an accelerometer friction may change the velocity within the step.
        noise = n.friction * GRAVITY / n.friction_information
        spread = noise
        if push is not None:
            spread = self.accelerometer.noise_factor * n.accelerometer_noise**2 * dt
        self.state.propagate(3, row, yaw)
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
        return share

    def _update(
        self, standing: Sequence[stance.FootMotion], friction_share: complex, dt: float
    ) -> None:
        """Update by the slip of the feet, whose likelihood is dry friction."""
        self._slip = 0.0
        if not standing:
            return
        p, size = self.state.covariance, 3 if self._yaw_rate is None else 2
        seen, weight = slice(3, 3 + size), self.noise.friction_information * dt
        (a, b, c), (_, d, e), (_, _, f) = p[3:6, 3:6].tolist()
        if size == 2:
            c, e, f = 0.0, 0.0, KNOWN_YAW_VARIANCE
        held, force = weight, 0j
        # With an accelerometer, which measures the motion without the feet.
        if self._push is not None:
            noise = self.noise.foot_velocity_noise**2 / dt
            a, d, f = a + noise, d + noise, f + noise / self._feet.reach**2
            held *= self.slope.contact_weight
            force = held * friction_share
        covariance = a, b, c, d, e, f
        information = stance.inverse(covariance)
        vx, vy, w = self.state.mean[3:6].tolist()
        prior = stance.MotionPrior(complex(vx, vy), w, information, force)
        feet = [stance.FootMotion(moves, arm, held * load) for moves, arm, load in standing]
        creep = self.noise.stiction_speed
        found = stance.minimize_slip(feet, creep, prior)
        posterior = found.covariance
        if self._push is not None:
            after = stance.dissipation_hessian(feet, found, creep, information)
            posterior = stance.inverse(after)
        by = found.motion.real - vx, found.motion.imag - vy, found.yaw - w
        learned = [prior - after for prior, after in zip(covariance, posterior, strict=True)]
        gain = p[:, seen].dot(_square(information, size))
        saved = self.state.mean[GYRO_STATES].copy(), p[GYRO_STATES, GYRO_STATES].copy()
        p -= gain.dot(_square(learned, size)).dot(gain.T)
        self.state.mean += gain.dot(by[:size])
        if size == 2:
            self.state.mean[GYRO_STATES], p[GYRO_STATES, GYRO_STATES] = saved
        self._slip = found.slid / held
        if self._push is not None:
            a, b, c, d, e, _ = information
            x, y, turn = by
            friction = complex(a * x + b * y + c * turn, b * x + d * y + e * turn) / weight
            if self.accelerometer.is_contradicted(friction, dt):
                self._reject_accelerometer()

    def _reject_accelerometer(self) -> None:
        self.accelerometer.reject(is_at_rest=self.standstill.time > 0.0)
        self.state.forget_accelerometer(self.noise.accelerometer_bias)

    def _move(self, standing: Sequence[stance.FootMotion], dt: float) -> None:
        """Move the pose by the velocity, and its covariance by the errors of the contact model."""
        n, errors = self.noise, self.contact_errors
        _, _, yaw, vx, vy, w = self.state.mean[:6].tolist()
        motion, along = complex(vx, vy), rect(1.0, yaw + w * dt / 2.0)
        step = along * motion * dt
        self.state.mean[:2] += step.real, step.imag
        self.state.mean[2] = wrap(yaw + w * dt)
        self.travelled += abs(step)
        self.slid += self._slip * dt
        # The acceleration of the centre of mass shifts the load.
        self.centre.accelerate(motion, w, dt)
        self.slope.turn(rect(1.0, -w * dt))
        scale, doubt, creep, has_gyro = 1.0, 1.0, 0.0, self._yaw_rate is not None
        if self._push is not None:
            # Adaptive errors (R. K. Mehra, Approaches to adaptive filtering, IEEE Trans. Automatic
            # Control 17, 1972): by the square of what attitude and accelerometer contradict.
            rough = self.slope.roughness / n.usual_tilt**2
            shaken = self.accelerometer.innovation_square / n.usual_innovation**2
            doubt = max(1.0, rough, shaken)
            scale = n.slip_scale_with_accelerometer * doubt
            creep = n.creep_error * min(self._slip, n.stiction_speed) / n.slip_error
        elif has_gyro:
            scale = n.slip_scale_with_gyro
        errors.scale = scale
        least, turn = stance.least_squares(standing, self._yaw_rate) if standing else (motion, w)
        side, yaw_row = along * dt, [0, 0, 1, 0, 0, dt]
        self.state.propagate(0, [1, 1j, 1j * step, side, 1j * side, 0.5j * step * dt], yaw_row)
        # The pose by the errors of the contact model.
        slip, contact = scale * self._slip, scale * (least - motion)
        effects = doubt * motion, slip + creep, 1j * (slip + creep), 0.0, contact
        turns = () if has_gyro else (0.0, 0.0, 0.0, slip / self._feet.reach, turn - w)
        errors.move(along, motion, effects, turns, dt)

    def _estimate(self) -> OdometryEstimate:
        rest, n = self.support, self.noise
        reading = self._imu.last if self.imu_monitor.state is ImuState.USED else None
        px, py, yaw, vx, vy, angular = self.state.mean[:6].tolist()
        covariance = self.state.covariance
        p = (covariance[:3, :3] + self.contact_errors.covariance()).tolist()
        p[2][2] += self._imu.heading_variance if reading else 0.0
        roll, pitch = (rest.roll, rest.pitch) if rest else (0.0, 0.0)
        var_x, var_y, var_w = (float(covariance[k, k]) for k in (3, 4, 5))
        slip, reach = self.contact_errors.scale * self._slip, self._feet.reach
        rocks = n.rocking_error * hypot(vx, vy, angular * reach)
        rocks *= 1.0 if self._push is None else self.contact_errors.scale
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


def _square(matrix: Sequence[float], size: int) -> FloatArray:
    """Return the first rows and columns of a `stance.Symmetric`."""
    a, b, c, d, e, f = matrix
    rows = ((a, b), (b, d)) if size == 2 else ((a, b, c), (b, d, e), (c, e, f))
    return np.array(rows)
