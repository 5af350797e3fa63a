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
from klann_ros.gait import Feet, FootMotion, stance, Support, Symmetric, Triple
from klann_ros.kinematics.arrays import FloatArray

from .accelerometer import (
    AccelerometerMonitor,
    AccelerometerState,
    GyroCalibration,
    StandstillDetector,
)
from .crank_motion import CrankFilter, StanceEstimator
from .filter_state import (
    BIAS_X,
    BIAS_Y,
    ContactErrors,
    FilterState,
    GYRO_BIAS,
    POSE,
    VELOCITY,
    VX,
    VY,
    YAW,
    YAW_RATE,
)
from .imu import ImuIncrement, ImuReading
from .imu_monitor import IMU_PROBLEMS, ImuInput
from .settings import OdometryNoise

# Variance of a yaw rate that is known [rad^2/s^2].
KNOWN_YAW_VARIANCE = 1e-18
# Largest number of integration steps between two readings.
MAX_STEPS = 500


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


class StepMeasurement(NamedTuple):
    """Measurements of an IMU over an integration step; None without one."""

    # Change of the velocity, with the bias of the accelerometer [m/s].
    velocity_change: complex | None = None
    # Without the bias of the gyro [rad/s].
    yaw_rate: float | None = None


UNMEASURED = StepMeasurement()


class Odometry:
    """
    Estimate the motion of a walker on its feet.

    `slid` is the distance that they slid [m], `noise` are the uncertainties.
    """

    def __init__(self, feet: Feet, noise: OdometryNoise | None = None) -> None:
        self.noise = noise = noise or OdometryNoise()
        self.state = FilterState(noise)
        self.contact_errors = ContactErrors(noise)
        self.cranks = CrankFilter(noise)
        self.stance = StanceEstimator(feet, noise)
        self.imu_input = ImuInput(noise)
        self.accelerometer = AccelerometerMonitor(noise)
        self.standstill = StandstillDetector(noise)
        self.gyro = GyroCalibration(noise)
        self.slid = 0.0
        self._stop()

    def _stop(self) -> None:
        """Forget the velocity."""
        self.state.mean[VELOCITY] = 0.0
        self.stance.centre.stop()
        self.accelerometer.stop()
        # Mean slip of the feet [m/s].
        self._slip = 0.0
        # Of the last step.
        self._measured = UNMEASURED

    @property
    def support(self) -> Support | None:
        """Return the feet that carry it; None where its centre of mass is not above them."""
        return self.stance.support

    @property
    def travelled(self) -> float:
        """Return the distance that it moved [m]."""
        return self.state.travelled

    @property
    def gyro_bias(self) -> float:
        """Return the drift of the heading [rad/s]."""
        return self.state.gyro_bias

    @property
    def accelerometer_state(self) -> AccelerometerState:
        """Return the state of the accelerometer."""
        has_one = self.imu_input.readings.velocity.is_available
        return self.accelerometer.state if has_one else AccelerometerState.NONE

    @property
    def support_problem(self) -> str:
        """Return that it falls, '' if it does not."""
        return '' if self.support else 'its centre of mass is not above its feet'

    @property
    def problem(self) -> str:
        """Return what contradicts its feet or its IMU, '' if nothing does."""
        noise, stance_estimate, imu = self.noise, self.stance, self.imu_input
        violation = stance_estimate.support_check.violation
        if violation > noise.max_support_violation:
            feet = f'it stands on feet that cannot carry it {violation:.0%} of the time'
            return f'{feet}: check body_centre'
        if stance_estimate.slope.innovation > noise.max_tilt_innovation:
            return 'its attitude is not that of a body on its feet: check body_centre and IMU'
        if imu.monitor.state in IMU_PROBLEMS:
            return f'{IMU_PROBLEMS[imu.monitor.state]}; odom goes on without the IMU'
        if self.accelerometer_state is AccelerometerState.NOT_BELIEVED:
            return 'its accelerometer is not believed: check its units and axes, or the feet slip'
        if not self.gyro.is_steady:
            return 'the heading of its IMU turns while it stands: check the IMU, or gyro_bias'
        return ''

    def figures(self, *, has_imu: bool) -> dict[str, str]:
        """Return the figures of the odometry for diagnostics, by name."""
        accelerometer = self.accelerometer_state if has_imu else AccelerometerState.NONE
        return {
            'accelerometer': accelerometer.value,
            'velocity_innovation': f'{self.accelerometer.innovation:.3f}',
            'tilt_innovation': f'{self.stance.slope.innovation:.3f}',
            'support_violation': f'{self.stance.support_check.violation:.3f}',
            'gyro_bias': f'{self.gyro_bias:.5f}',
        }

    def imu(self, reading: ImuReading, variance: float = 0.0) -> None:
        """Take a reading of an IMU; it measures the rotation from now on, until `forget_imu`."""
        if self.imu_input.readings.last is None:
            self.standstill.restart()
        self.imu_input.read(reading, variance)

    def forget_imu(self) -> None:
        """Go on without the IMU."""
        self.imu_input.forget()
        self.stance.slope.forget()

    def set_pose(self, pose: Sequence[float], covariance: FloatArray) -> None:
        """Go on at x, y [m] and yaw [rad]; the estimates of velocity and biases stay."""
        self.state.set_pose(pose, covariance)
        self.contact_errors = ContactErrors(self.noise)

    def jump(self) -> None:
        """Take the next angles as a new start: encoders jumped, the robot did not move."""
        self.cranks.angles = None
        self.stance.pose = None

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
        turns = [after - angle for angle, after in zip(before, angles, strict=True)]
        steps = min(MAX_STEPS, 1 + int(max(map(abs, turns)) / self.noise.longest_step))
        if seconds <= 0.0:
            dot_product = sum(map(mul, turns, rates))
            square = sum(map(mul, rates, rates))
            is_forwards = dot_product > 0.0
            seconds = dot_product / square if is_forwards else self.noise.max_step_time * steps
        increment = self._take_imu(cranks, rates, seconds, is_commanded=is_commanded)
        if increment is not None:
            stands = self.standstill.update(
                cranks, rates, increment.body_rate, seconds, is_commanded=is_commanded
            )
            if stands:
                self._calibrate(increment, seconds)
            else:
                self.gyro.restart()
            self.accelerometer.elapse(seconds)
            if self.accelerometer.is_shaken(increment, seconds) and self._has_accelerometer:
                self._reject_accelerometer()
        for step in range(1, steps + 1):
            share = step / steps
            step_angles = [angle + share * turn for angle, turn in zip(before, turns, strict=True)]
            self._step(step_angles, increment, seconds / steps, 1.0 / steps)
        return self._estimate()

    def _take_imu(
        self,
        cranks: Sequence[float],
        rates: Sequence[float],
        seconds: float,
        *,
        is_commanded: bool,
    ) -> ImuIncrement | None:
        """Return what the IMU measured since the last reading of the cranks, if it is used."""
        was_used = self.imu_input.is_used
        is_moving = is_commanded or max(map(abs, rates)) > self.noise.stationary_rate
        increment = self.imu_input.take(cranks, seconds, self.gyro_bias, is_moving=is_moving)
        if self.imu_input.is_used is not was_used:
            if was_used:
                # The feet go on with a yaw rate of their own.
                self.state.mean[YAW_RATE] = self.imu_input.feet_yaw_rate
            self.stance.slope.forget()
            self.standstill.restart()
        return increment

    @property
    def _has_accelerometer(self) -> bool:
        return self.accelerometer.state is AccelerometerState.USED

    def _calibrate(self, increment: ImuIncrement, seconds: float) -> None:
        """Update the biases at standstill: neither rotation nor acceleration."""
        self.accelerometer.rest(increment)
        # The filter of heading and gyro settles first.
        if self.standstill.time >= self.noise.settling_time:
            drift = self.gyro.update(
                increment,
                seconds,
                self.imu_input.readings.filtered_heading_variance,
                is_confirmed=self.standstill.is_confirmed,
            )
            if drift is not None:
                self._learn_gyro_bias(*drift)
        if increment.delta_velocity is not None and increment.span:
            variance = self.noise.accelerometer_noise**2 / increment.span
            x, y, _ = increment.delta_velocity
            self.state.measure(BIAS_X, x / increment.span, variance)
            self.state.measure(BIAS_Y, y / increment.span, variance)

    def _learn_gyro_bias(self, rate: float, variance: float) -> None:
        innovation_variance = float(self.state.covariance[GYRO_BIAS, GYRO_BIAS]) + variance
        innovation = abs(rate - self.gyro_bias) / sqrt(innovation_variance)
        self.gyro.is_steady = innovation <= self.noise.bias_gate
        if self.gyro.is_steady:
            self.state.measure(GYRO_BIAS, rate, variance)
        else:
            self.standstill.restart()
            self.gyro.restart()

    def _step(
        self, angles: Sequence[float], increment: ImuIncrement | None, dt: float, share: float
    ) -> None:
        """Predict and update over a share of the interval, to new angles of the cranks."""
        displacement = self.stance.update(
            angles,
            increment and increment.attitude,
            dt,
            is_acceleration_measured=self._measured.velocity_change is not None,
        )
        if self.support is None:
            self._stop()
        if displacement is None:
            return
        if dt >= self.noise.max_step_time:
            self._stop()
        last_change = self._measured.velocity_change
        self._measured = self._step_measurement(increment, dt, share)
        friction_share = self._predict(displacement / dt, last_change, dt)
        standing = self.stance.standing_feet(dt)
        self._correct(standing, friction_share, dt)
        if standing and self.imu_input.readings.last is not None:
            _, feet_yaw_rate = stance.least_squares(standing)
            slip_angle = self._slip * dt / self.stance.feet.reach
            self.imu_input.add_feet_motion(feet_yaw_rate * dt, slip_angle)
        self._move(standing, dt)

    def _step_measurement(
        self, increment: ImuIncrement | None, dt: float, share: float
    ) -> StepMeasurement:
        if increment is None:
            return UNMEASURED
        yaw_rate = increment.turn * share / dt - self.gyro_bias
        if increment.delta_velocity is None or not self._has_accelerometer:
            return StepMeasurement(None, yaw_rate)
        return StepMeasurement(share * complex(*increment.delta_velocity[:2]), yaw_rate)

    def _predict(
        self, centre_velocity: complex, last_change: complex | None, dt: float
    ) -> complex:
        """
        Predict the velocity; return the friction that balances the measured one, by the largest.

        `centre_velocity` is the velocity of the centre of mass in base_link, and `last_change` the
        measured change of velocity of the step before [m/s].
        """
        noise, measured = self.noise, self._measured
        centre, slope = self.stance.centre, self.stance.slope
        friction_share = 0j
        # Without an accelerometer friction may change the velocity within the step.
        friction_variance = noise.friction * GRAVITY / noise.friction_information
        # Growth of the variances, by component.
        growths = dict[int, float]()
        if measured.velocity_change is None:
            # The centre of mass keeps its velocity over ground.
            last_velocity = centre_velocity if centre.velocity is None else centre.velocity
            change = slope.acceleration * dt - centre_velocity + last_velocity
            growths[VX] = growths[VY] = friction_variance
        else:
            # From the middle of the last step to that of this one: velocities are means of steps.
            last = measured.velocity_change if last_change is None else last_change
            bias = self.state.accelerometer_bias
            change = (last + measured.velocity_change) / 2.0 - bias * dt
            # The force that friction balances, by the greatest friction.
            friction_share = (slope.acceleration - change / dt) / (noise.friction * GRAVITY)
            friction_share /= max(1.0, abs(friction_share))
            noise_factor = self.accelerometer.noise_factor
            growths[VX] = growths[VY] = noise_factor * noise.accelerometer_noise**2 * dt
            growths[BIAS_X] = growths[BIAS_Y] = noise.accelerometer_drift**2 * dt
        centre.velocity = centre_velocity
        if measured.yaw_rate is None:
            growths[YAW_RATE] = friction_variance / self.stance.feet.gyration**2
        else:
            growths[GYRO_BIAS] = noise.gyro_drift**2 * dt
            reading = self.imu_input.readings.last
            if reading is not None and reading.yaw is None:
                growths[YAW] = noise.gyro_noise**2 * dt
        has_accelerometer = measured.velocity_change is not None
        self.state.predict(
            change, measured.yaw_rate, dt, growths, has_accelerometer=has_accelerometer
        )
        return friction_share

    def _correct(self, standing: Sequence[FootMotion], friction_share: complex, dt: float) -> None:
        """Correct the velocity by the slip of the feet, whose likelihood is dry friction."""
        self._slip = 0.0
        if not standing:
            return
        noise, state, weight = self.noise, self.state, self.noise.friction_information * dt
        has_accelerometer = self._measured.velocity_change is not None
        covariance = self._velocity_covariance(dt)
        slip_weight = weight
        force = 0j
        if has_accelerometer:
            slip_weight *= self.stance.slope.contact_weight
            force = slip_weight * friction_share
        information = stance.inverse(covariance)
        vx, vy, yaw_rate = state.mean[VELOCITY].tolist()
        prior = stance.MotionPrior(complex(vx, vy), yaw_rate, information, force)
        feet = [FootMotion(motion, arm, slip_weight * load) for motion, arm, load in standing]
        step = stance.minimize_slip(feet, noise.stiction_speed, prior)
        posterior = step.covariance
        if has_accelerometer:
            hessian = stance.dissipation_hessian(feet, step, noise.stiction_speed, information)
            posterior = stance.inverse(hessian)
        self._slip = step.slid / slip_weight
        correction = step.motion.real - vx, step.motion.imag - vy, step.yaw - yaw_rate
        state.correct_velocity(
            correction,
            information,
            [before - after for before, after in zip(covariance, posterior, strict=True)],
            with_yaw_rate=self._measured.yaw_rate is None,
        )
        if has_accelerometer:
            force_x, force_y, _ = stance.product(information, correction)
            if self.accelerometer.is_contradicted(complex(force_x, force_y) / weight, dt):
                self._reject_accelerometer()

    def _velocity_covariance(self, dt: float) -> Symmetric:
        """Return the covariance of velocity and yaw rate before the slip is taken into account."""
        (xx, xy, x_yaw), (_, yy, y_yaw), (_, _, yaw) = self.state.covariance[
            VELOCITY, VELOCITY
        ].tolist()
        if self._measured.yaw_rate is not None:
            x_yaw = y_yaw = 0.0
            yaw = KNOWN_YAW_VARIANCE
        if self._measured.velocity_change is not None:
            # The accelerometer measures the motion without the feet, whose noise counts then.
            feet_variance = self.noise.foot_velocity_noise**2 / dt
            xx += feet_variance
            yy += feet_variance
            yaw += feet_variance / self.stance.feet.reach**2
        return xx, xy, x_yaw, yy, y_yaw, yaw

    def _reject_accelerometer(self) -> None:
        self.accelerometer.reject(is_at_rest=self.standstill.time > 0.0)
        self.state.forget_accelerometer(self.noise.accelerometer_bias)

    def _move(self, standing: Sequence[FootMotion], dt: float) -> None:
        """Move the pose by the velocity, and its covariance by the errors of the contact model."""
        noise, measured, slope = self.noise, self._measured, self.stance.slope
        vx, vy, yaw_rate = self.state.mean[VELOCITY].tolist()
        velocity = complex(vx, vy)
        direction = self.state.move(dt)
        self.slid += self._slip * dt
        # The acceleration of the centre of mass shifts the load.
        self.stance.centre.accelerate(velocity, yaw_rate, dt)
        slope.turn(rect(1.0, -yaw_rate * dt))
        scale = doubt = 1.0
        creep = 0.0
        if measured.velocity_change is not None:
            # Adaptive errors (R. K. Mehra, Approaches to adaptive filtering, IEEE Trans. Automatic
            # Control 17, 1972): by the square of what attitude and accelerometer contradict.
            tilt_doubt = slope.roughness / noise.usual_tilt**2
            force_doubt = self.accelerometer.innovation_square / noise.usual_innovation**2
            doubt = max(1.0, tilt_doubt, force_doubt)
            scale = noise.slip_scale_with_accelerometer * doubt
            creep = noise.creep_error * min(self._slip, noise.stiction_speed) / noise.slip_error
        elif measured.yaw_rate is not None:
            scale = noise.slip_scale_with_gyro
        self.contact_errors.scale = scale
        least_squares_velocity, least_squares_yaw_rate = velocity, yaw_rate
        if standing:
            least_squares_velocity, least_squares_yaw_rate = stance.least_squares(
                standing, measured.yaw_rate
            )
        slip = scale * self._slip
        velocity_errors = (
            doubt * velocity,
            slip + creep,
            1j * (slip + creep),
            0.0,
            scale * (least_squares_velocity - velocity),
        )
        yaw_rate_errors: tuple[float, ...] = ()
        if measured.yaw_rate is None:
            yaw_rate_difference = least_squares_yaw_rate - yaw_rate
            yaw_rate_errors = 0.0, 0.0, 0.0, slip / self.stance.feet.reach, yaw_rate_difference
        self.contact_errors.move(direction, velocity, velocity_errors, yaw_rate_errors, dt)

    def _estimate(self) -> OdometryEstimate:
        support, imu = self.support, self.imu_input
        x, y, yaw, vx, vy, yaw_rate = self.state.mean[:6].tolist()
        covariance = self.state.covariance[POSE, POSE] + self.contact_errors.covariance()
        x_row, y_row, yaw_row = covariance.tolist()
        roll, pitch = (support.roll, support.pitch) if support else (0.0, 0.0)
        if imu.is_used and imu.readings.last:
            reading = imu.readings.last
            yaw_row[2] += imu.readings.heading_variance
            yaw_rate = reading.yaw_rate - self.gyro_bias
            roll, pitch = reading.attitude or (roll, pitch)
        return OdometryEstimate(
            x, y, support.height if support else nan, roll, pitch, yaw, (vx, vy), yaw_rate,
            (tuple(x_row), tuple(y_row), tuple(yaw_row)), self._rate_variances(),
        )  # fmt: skip

    def _rate_variances(self) -> Triple:
        """Return the variances of the velocity [m^2/s^2] and the yaw rate [rad^2/s^2]."""
        noise, imu, reach = self.noise, self.imu_input, self.stance.feet.reach
        vx, vy, yaw_rate = self.state.mean[VELOCITY].tolist()
        x_variance, y_variance, yaw_variance = self.state.covariance.diagonal()[VELOCITY].tolist()
        slip = self.contact_errors.scale * self._slip
        # Rocking of the body at an instant [m/s].
        rocking = noise.rocking_error * hypot(vx, vy, yaw_rate * reach)
        if self._measured.velocity_change is not None:
            rocking *= self.contact_errors.scale
        common = (noise.slip_error * slip) ** 2 + rocking * rocking
        if not imu.is_used or imu.readings.last is None:
            slip_yaw_rate = noise.slip_yaw_error * slip / reach
            yaw_variance += slip_yaw_rate**2 + (rocking / 2.0 / reach) ** 2
        elif imu.readings.velocity.period:
            # The variance of one reading.
            yaw_variance += noise.gyro_noise**2 / imu.readings.velocity.period
        return (
            x_variance + (noise.advance_error * vx) ** 2 + common,
            y_variance + (noise.advance_error * vy) ** 2 + common,
            yaw_variance,
        )
