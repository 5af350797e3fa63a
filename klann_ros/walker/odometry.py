"""
State estimation of a walker: where it is, from its cranks, its feet and, if there is one, an IMU.

An error-state Kalman filter (J. Sola, Quaternion kinematics for the error-state Kalman filter,
2017, reduced to the plane). The state is

    x, y, psi            pose of base_link in odom,
    v_x, v_y, w          velocity of base_link over ground, in its level frame,
    b_w, b_x, b_y        biases of the gyro's yaw rate and of the level acceleration,
    c_1 ... c_5          errors of the contact model, constant along a walk.

Prediction over a time t, with the measured velocity change dv [m/s] and rotation dpsi [rad], the
load-weighted slip s [m/s], and e [m/s], e_w [rad/s], the differences between the motion of least
squares of the slip and the estimate:

    (x, y)' = (x, y) + R(psi) (v + c_1 v + (c_2, c_3) s + c_5 e) t,
    psi' = psi + (w + c_4 s / reach + c_5 e_w) t,
    v' = R(-w t) v + dv - b t,     w = dpsi / t - b_w.

Without an accelerometer dv is that of the momentum of the centre of mass on the slope, without a
gyro w stays, and friction may change both within the step: the variance of v grows by mu g / K,
with K [s/m^2] the weight of slip below.

Measurement: each standing foot i, at p_i [m] with the velocity q_i [m/s] in the body, has the slip
s_i = q_i + v + w J p_i (J turns by 90 deg), of which |s_i| has a Laplace distribution with the
weight K t l_i, l_i being its share of the load: dry friction is its likelihood, and the update is
the minimum of dissipation and prior (`stance.minimize_slip`), an iterated Kalman update. On a
slope, or where the body is accelerated, the median of the slip is not zero: friction balances
that force.

The errors of the contact model are alike from step to step, so they do not average out. They are
consider parameters (S. F. Schmidt, Application of state-space methods to navigation problems,
1966): never estimated, but correlated with the pose. e is large where much depends on the friction
law and the loads. With a gyro c_2, c_3 and c_5 are scaled by 0.5 (by 0.2 with an accelerometer as
well), and c_4 is not used.

At standstill the rotation and the acceleration are zero, which measures the biases. The slope
is a running mean of the measured attitude less that of the body on its feet: the Kalman filter of
a constant which nothing else depends on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, exp, hypot, nan, pi, sin, sqrt
from operator import mul
from typing import NamedTuple

from klann_ros.dynamics import GRAVITY
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .feet import Feet
from .imu import (
    COMPLEMENTARY_FILTER_TIME,
    ImuIncrement,
    ImuPreintegration,
    ImuReading,
    StandstillCalibration,
    Triple,
)
from .stance import (
    BodyStep,
    foot_motion,
    FootMotion,
    inverse,
    least_squares,
    low_pass,
    minimize_slip,
    MotionPrior,
    Point,
    rotate,
    spring_loads,
    stance_pose,
    StancePose,
    Support,
    support,
    Symmetric,
    Vec2,
)

# Information of friction on the velocity of the body: K [s/m^2]. It sets the scale of the
# covariance of the velocity: noise of 3 mm/s of a foot that sticks, in a step of 10 ms.
FRICTION_INFORMATION = 3e4
# Stiction speed: a foot that sticks creeps by less than this [m/s].
STICTION_SPEED = 0.002
# Largest crank angle of an integration step [rad], and the largest number of steps.
LONGEST_STEP, MAX_STEPS = 0.05, 500
# After a longer step, or one of an unknown time, the velocity is unknown [s].
MAX_STEP_TIME = 0.1
# Time constant of the complementary filter of crank angles and rates [s]; a larger difference
# between prediction and reading bypasses it [rad].
ENCODER_FILTER_TIME, ENCODER_GATE = 0.3, 0.1
# Time constants: tipping onto other feet without an IMU, the acceleration that shifts the load
# between the feet, the slope, and the mean innovation [s].
TILT_TIME, LOAD_SHIFT_TIME, SLOPE_TIME, INNOVATION_TIME = 0.03, 0.05, 10.0, 1.0
# Mean innovation that rejects the accelerometer, as a part of the largest friction; and its root
# mean square where the contact model holds, beyond which the errors of the model grow with it.
INNOVATION_GATE, USUAL_INNOVATION = 0.25, 0.03
# Slip errors with a gyro, and with an accelerometer as well, as parts of those without.
SLIP_SCALE_WITH_GYRO, SLIP_SCALE_WITH_ACCEL = 0.5, 0.2
# Without an accelerometer the body's rocking is unknown: error of the velocity at an instant as a
# part of it, as in benchmarks/odometry.py. The pose averages it.
ROCKING_ERROR = 0.4
STATES, ERRORS = 9, 5
ACCEL_BIAS = slice(7, 9)


@dataclass(frozen=True)
class OdometryNoise:
    """
    Uncertainties of the estimator: standard deviations and noise densities.

    Attributes
    ----------
    friction : float
        Friction coefficient of the feet, which is unknown: the default lies between wet tile and
        rubber on concrete.
    accelerometer_noise, gyro_noise : float
        Densities of white noise [m/s^2/sqrt(Hz)], [rad/s/sqrt(Hz)]; the former includes errors of
        the measured attitude and of scale.
    accelerometer_bias, gyro_bias : float
        Before the first standstill [m/s^2], [rad/s].
    accelerometer_drift, gyro_drift : float
        Random walks of the biases [m/s^2/sqrt(s)], [rad/s/sqrt(s)].
    standstill_yaw_rate : float
        Of the yaw at standstill, as feet creep on soft ground [rad/s].
    heading_error : float
        Of an IMU's yaw whose message gives no covariance [rad].
    advance_error : float
        Relative error of the advance.
    slip_error, slip_yaw_error : float
        Errors of the motion and of its rotation at the reach of the feet, relative to the slip.
    contact_error : float
        Error relative to the difference between least squares and the friction law.
    height_error, tilt_error : float
        Of the pose on its feet [m], [rad].

    """

    friction: float = 0.6
    accelerometer_noise: float = 0.005
    gyro_noise: float = 5e-4
    accelerometer_bias: float = 0.3
    gyro_bias: float = 0.005
    accelerometer_drift: float = 0.003
    gyro_drift: float = 2e-5
    standstill_yaw_rate: float = 0.001
    heading_error: float = 0.005
    advance_error: float = 0.01
    slip_error: float = 0.11
    slip_yaw_error: float = 0.085
    contact_error: float = 0.5
    height_error: float = 0.01
    tilt_error: float = 0.02


class OdometryEstimate(NamedTuple):
    """
    Pose and velocity of a walker, in a frame that begins on the ground below its start.

    Attributes
    ----------
    x, y, z : float
        base_link's origin [m].
    roll, pitch, yaw : float
        As in REP 103 [rad].
    linear : (float, float)
        Velocity over ground, forwards and to the left [m/s].
    angular : float
        Yaw rate [rad/s].
    covariance : 3 tuples of 3 floats
        Of x, y, yaw.
    rate_variances : (float, float, float)
        Of the velocity and the yaw rate.

    """

    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    linear: Vec2
    angular: float
    covariance: tuple[Triple, Triple, Triple]
    rate_variances: Triple


class Odometry:
    """
    Estimate the motion of a walker.

    Parameters
    ----------
    feet : Feet
        The walker's.
    noise : OdometryNoise, optional
        Uncertainties.

    Attributes
    ----------
    support : Support or None
        The feet that carry it; None before the first angles, and where its centre of mass is not
        above its feet.
    calibration : StandstillCalibration
        Of the IMU.
    gyro_bias : float
        Drift of the heading [rad/s].
    travelled, slid : float
        Distances that it moved, and that its feet slid [m].

    """

    def __init__(self, feet: Feet, noise: OdometryNoise | None = None) -> None:
        self.noise = noise or OdometryNoise()
        self._feet = feet
        self.support: Support | None = None
        self.calibration = StandstillCalibration(
            self.noise.gyro_noise, self.noise.standstill_yaw_rate
        )
        self.travelled = self.slid = 0.0
        self._imu = ImuPreintegration()
        self._heading_variance = 0.0
        self._x = self._y = self._yaw = 0.0
        self.gyro_bias = 0.0
        self._accel_bias: Vec2 = (0.0, 0.0)
        self._cranks: list[float] | None = None
        self._rates: list[float] = []
        n = self.noise
        deviations = [0.0] * 6 + [n.gyro_bias] + [n.accelerometer_bias] * 2 + [n.advance_error]
        deviations += [n.slip_error] * 2 + [n.slip_yaw_error, n.contact_error]
        self._covariance = np.diag(np.square(deviations))
        self._identity = np.eye(STATES + ERRORS)
        self._attitude: Vec2 | None = None
        self._slope: Vec2 = (0.0, 0.0)
        self._slope_time = 0.0
        self._tilt_square = 0.0
        # Of the centre of mass above the ground [m].
        self._height = 0.0
        self._scale = 1.0
        # Mean square of the innovation.
        self._innovation_square = 0.0
        self._pose: StancePose | None = None
        # Of the errors from the last update to the next.
        self._transition = self._identity.copy()
        self._stop()

    def _stop(self) -> None:
        """Forget the velocity."""
        self._step = BodyStep(0.0, 0.0, 0.0, 0.0)
        # Of the centre of mass: its velocity in base_link, over ground, and its acceleration.
        self._acceleration: Vec2 = (0.0, 0.0)
        self._centre_velocity: Vec2 | None = None
        self._velocity: Vec2 | None = None
        # Measured: the change of the velocity, and the yaw rate.
        self._push: Triple | None = None
        self._yaw_rate: float | None = None
        self._innovation: Vec2 = (0.0, 0.0)

    @property
    def innovation(self) -> float:
        """
        Return the normalised mean innovation of the velocity, from 0 to 1.

        It is the friction that the measured motion needs in the mean, as a part of the largest.
        """
        return hypot(*self._innovation)

    @property
    def tilt_innovation(self) -> float:
        """
        Return the normalised innovation of the attitude, a root mean square; 1 is usual.

        More means that it does not stand on the feet that its file says.
        """
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
        self._imu = ImuPreintegration()
        self._slope, self._slope_time, self._heading_variance = (0.0, 0.0), 0.0, 0.0

    def jump(self) -> None:
        """Take the next angles as a new start: encoders jumped, the robot did not move."""
        self._cranks = self._pose = None

    def update(
        self, cranks: Sequence[float], rates: Sequence[float], seconds: float = 0.0
    ) -> OdometryEstimate:
        """
        Return the estimate after a reading of the cranks.

        Parameters
        ----------
        cranks : sequence of float
            Their angles [rad].
        rates : sequence of float
            Their rates [rad/s].
        seconds : float
            Time since the last reading; if it is 0, that of the angles at these rates.

        """
        before = list(cranks) if self._cranks is None else self._cranks
        angles = self._filtered(before, cranks, rates, seconds)
        turned = [is_ - was for is_, was in zip(angles, before, strict=True)]
        steps = min(MAX_STEPS, 1 + int(max(map(abs, turned)) / LONGEST_STEP))
        self._cranks = angles
        if seconds <= 0.0:
            along = sum(map(mul, turned, rates))
            squares = sum(map(mul, rates, rates))
            seconds = along / squares if along > 0.0 else MAX_STEP_TIME * steps
        taken = self._imu.take(seconds)
        if taken is not None:
            self._calibrate(taken, rates, seconds)
            taken = taken.divided(steps)
        for k in range(1, steps + 1):
            at = [was + k / steps * by for was, by in zip(before, turned, strict=True)]
            self._follow(at, taken, seconds / steps)
        return self._estimate()

    def _filtered(
        self,
        before: Sequence[float],
        cranks: Sequence[float],
        rates: Sequence[float],
        seconds: float,
    ) -> list[float]:
        """Return the angles without most noise of the encoders, which would be slip of feet."""
        last, self._rates = self._rates or list(rates), list(rates)
        if not 0.0 < seconds < MAX_STEP_TIME:
            return list(cranks)
        mean = [(a + b) / 2.0 for a, b in zip(last, rates, strict=True)]
        both = zip(before, mean, cranks, strict=True)
        away = [was + rate * seconds - is_ for was, rate, is_ in both]
        if max(map(abs, away)) >= ENCODER_GATE:
            return list(cranks)
        share = exp(-seconds / ENCODER_FILTER_TIME)
        return [is_ + share * by for is_, by in zip(cranks, away, strict=True)]

    def _calibrate(self, taken: ImuIncrement, rates: Sequence[float], seconds: float) -> None:
        """Update the biases at standstill: neither rotation nor acceleration."""
        n, calibration = self.noise, self.calibration
        # After the filter of heading and gyro.
        heading = 0.0
        if self._imu.last and self._imu.last.yaw is not None:
            share = self._imu.period / (2.0 * COMPLEMENTARY_FILTER_TIME)
            heading = self._heading_variance * share
        measured = calibration.update(taken, self._cranks or (), rates, seconds, heading)
        if measured is None:
            return
        rate, variance = measured
        if variance:
            self._update_bias(6, rate - self.gyro_bias, variance)
        if taken.delta_velocity is not None and taken.span:
            for k in (0, 1):
                away = taken.delta_velocity[k] / taken.span - self._accel_bias[k]
                self._update_bias(7 + k, away, n.accelerometer_noise**2 / taken.span)

    def _update_bias(self, index: int, innovation: float, variance: float) -> None:
        column = self._covariance[:, index].copy()
        gain = column / (column[index] + variance)
        self._covariance -= gain[:, None] * column
        self._correct((gain * innovation).tolist())

    def _correct(self, by: Sequence[float]) -> None:
        """Add a correction to x, y, yaw and the biases."""
        self._x, self._y = self._x + by[0], self._y + by[1]
        self._yaw += by[2]
        self.gyro_bias += by[6]
        bx, by_ = self._accel_bias
        self._accel_bias = bx + by[7], by_ + by[8]

    def _follow(self, angles: Sequence[float], taken: ImuIncrement | None, dt: float) -> None:
        """Predict and update over a step to new angles of the cranks."""
        feet, rolled, centre = self._feet.pose(angles)
        # The feet that carry it are around the zero-moment point (M. Vukobratovic, 1972).
        (gx, gy), (cx, cy, cz) = self._slope, centre
        ax, ay = self._acceleration if self._push else (0.0, 0.0)
        leans = self._height / GRAVITY
        weight = cx + leans * (gx - ax), cy + leans * (gy - ay), cz
        self.support = support(feet, weight, self.support and self.support.facet)
        before = self._pose
        if self.support is None:
            self._pose = None
            self._stop()
            return
        self._update_attitude(self.support, taken.attitude if taken else None, dt)
        pose = stance_pose(feet, rolled, self.support, self._attitude, centre)
        self._pose = pose
        if before is None:
            return
        if dt >= MAX_STEP_TIME:
            self._stop()
        self._yaw_rate = taken.turn / dt - self.gyro_bias if taken else None
        push = taken.delta_velocity if taken and self.calibration.is_usable else None
        velocity = self._predict(before, pose, push, dt)
        standing = self._standing_feet(before, pose, feet, centre, dt)
        self._update(velocity, standing, dt)
        self._move(standing, dt)

    def _update_attitude(self, rest: Support, measured: Vec2 | None, dt: float) -> None:
        """Set roll and pitch to those of the IMU, or to what the body tips to; learn the slope."""
        if measured is None:
            lies = rest.roll, rest.pitch
            share = 1.0 - exp(-dt / TILT_TIME)
            self._attitude = low_pass(self._attitude, lies, share) if self._attitude else lies
            return
        self._attitude = measured
        self._slope_time += dt
        share = min(1.0, dt / min(self._slope_time, SLOPE_TIME)) if dt else 1.0
        roll, pitch = measured[0] - rest.roll, measured[1] - rest.pitch
        (gx, gy), variance = self._slope, 2.0 * self.noise.tilt_error**2
        squares = (pitch - gx / GRAVITY) ** 2 + (roll + gy / GRAVITY) ** 2
        self._tilt_square += dt / SLOPE_TIME * (squares / variance - self._tilt_square)
        self._slope = low_pass(self._slope, (GRAVITY * sin(pitch), -GRAVITY * sin(roll)), share)

    def _predict(
        self, before: StancePose, after: StancePose, push: Triple | None, dt: float
    ) -> Triple:
        """Predict velocity and covariance; return the velocity."""
        n, last, yaw_rate = self.noise, self._step, self._yaw_rate
        vx, vy = last.x, last.y
        w = last.yaw if yaw_rate is None else yaw_rate
        (px, py), (qx, qy) = before.centre, after.centre
        moves = (qx - px) / dt, (qy - py) / dt
        if push is None:
            # The centre of mass keeps its velocity over ground.
            (gx, gy), (mx, my) = self._slope, self._centre_velocity or moves
            ax, ay = gx * dt - moves[0] + mx, gy * dt - moves[1] + my
        else:
            # From the middle of the last step to that of this one: velocities are means of steps.
            last_push = self._push or push
            ax = (last_push[0] + push[0]) / 2.0 - self._accel_bias[0] * dt
            ay = (last_push[1] + push[1]) / 2.0 - self._accel_bias[1] * dt
        self._push = push
        self._centre_velocity = moves
        f = self._transition
        f[3, 4], f[4, 3], f[3, 5], f[4, 5] = w * dt, -w * dt, vy * dt, -vx * dt
        p = f @ self._covariance @ f.T
        # Without an accelerometer friction may change the velocity within the step.
        noise = n.friction * GRAVITY / FRICTION_INFORMATION
        spread = noise if push is None else n.accelerometer_noise**2 * dt
        p[3, 3] += spread
        p[4, 4] += spread
        if push is not None:
            p[7, 7] += n.accelerometer_drift**2 * dt
            p[8, 8] += n.accelerometer_drift**2 * dt
        if yaw_rate is None:
            p[5, 5] += noise / self._feet.gyration**2
        else:
            # Its error is that of the bias.
            p[5] = -p[6]
            p[:, 5] = -p[:, 6]
            p[5, 5] = p[6, 6]
            p[6, 6] += n.gyro_drift**2 * dt
            if self._imu.last and self._imu.last.yaw is None:
                p[2, 2] += n.gyro_noise**2 * dt
        self._covariance = p
        x, y = rotate((vx, vy), -w * dt)
        return x + ax, y + ay, w

    def _standing_feet(
        self,
        before: StancePose,
        after: StancePose,
        feet: Sequence[Point],
        centre: Point,
        dt: float,
    ) -> list[FootMotion]:
        """Return the feet that carry load, of which the acceleration shifts some."""
        (nx, ny, nz), height = after.support.normal, after.support.height
        heights = [max(0.0, nx * x + ny * y + nz * z + height) for x, y, z in feet]
        above = height + nx * centre[0] + ny * centre[1] + nz * centre[2]
        (ax, ay), (cx, cy) = self._acceleration, after.centre
        self._height = above
        over = cx - above / GRAVITY * ax, cy - above / GRAVITY * ay
        loads = spring_loads(after.flat, heights, over)
        both = zip(before.flat, after.flat, loads, strict=True)
        return [foot_motion(p, q, load, dt) for p, q, load in both if load > 0.0]

    def _update(self, velocity: Triple, standing: Sequence[FootMotion], dt: float) -> None:
        """Update by the slip of the feet, whose likelihood is dry friction."""
        if not standing:
            self._step = BodyStep(*velocity, 0.0)
            return
        p, size = self._covariance, 3 if self._yaw_rate is None else 2
        seen = slice(3, 3 + size)
        prior = p[seen, seen].tolist()
        if size == 3:
            (a, b, c), (_, d, e), (_, _, f) = prior
            information = inverse((a, b, c, d, e, f))
        else:
            (a, b), (_, d) = prior
            whole = a * d - b * b
            information = d / whole, -b / whole, 0.0, a / whole, 0.0, 0.0
        weight = FRICTION_INFORMATION * dt
        share = weight / (self.noise.friction * GRAVITY) if self._push else 0.0
        force = share * self._slope[0], share * self._slope[1]
        feet = [foot._replace(load=weight * foot.load) for foot in standing]
        motion = MotionPrior(velocity, information, force)
        found = minimize_slip(feet, STICTION_SPEED, motion, self._yaw_rate)
        by = np.subtract(found[:size], velocity[:size])
        inverse_prior = _square(information, size)
        gain = p[:, seen] @ inverse_prior
        p -= gain @ (p[seen, seen] - _square(found.covariance, size)) @ gain.T
        self._covariance = (p + p.T) / 2.0
        self._correct((gain @ by).tolist())
        self._step = found._replace(slid=found.slid / weight)
        if self._push:
            x, y = (inverse_prior @ by / weight).tolist()
            self._adapt((x, y), dt)

    def _adapt(self, force: Vec2, dt: float) -> None:
        """Learn how hard friction corrects the accelerometer; reject it if that is too much."""
        share = 1.0 - exp(-dt / INNOVATION_TIME)
        self._innovation = low_pass(self._innovation, force, share)
        square = self.innovation**2 - self._innovation_square
        self._innovation_square += dt / SLOPE_TIME * square
        if self.innovation > INNOVATION_GATE:
            self.calibration.reject()
            self._innovation, self._accel_bias = (0.0, 0.0), (0.0, 0.0)
            p = self._covariance
            p[ACCEL_BIAS] = p[:, ACCEL_BIAS] = 0.0
            p[7, 7] = p[8, 8] = self.noise.accelerometer_bias**2

    def _move(self, standing: Sequence[FootMotion], dt: float) -> None:
        """Move the pose, and prepare what the next prediction makes of its covariance."""
        step, w = self._step, self._step.yaw
        middle = self._yaw + w * dt / 2.0
        c, s = cos(middle), sin(middle)
        dx, dy = (c * step.x - s * step.y) * dt, (s * step.x + c * step.y) * dt
        self._x, self._y = self._x + dx, self._y + dy
        self._yaw = (self._yaw + w * dt + pi) % TURN - pi
        self.travelled += hypot(dx, dy)
        self.slid += step.slid * dt
        # The acceleration of the centre of mass shifts the load.
        mx, my = self._centre_velocity or (0.0, 0.0)
        vx, vy = velocity = step.x + mx, step.y + my
        last_x, last_y = self._velocity or velocity
        acceleration = (vx - last_x) / dt - w * vy, (vy - last_y) / dt + w * vx
        share = 1.0 - exp(-dt / LOAD_SHIFT_TIME)
        self._velocity = velocity
        self._acceleration = low_pass(self._acceleration, acceleration, share)
        self._slope = rotate(self._slope, -w * dt)
        scale, yaw_rate = 1.0, self._yaw_rate
        if yaw_rate is not None:
            scale = SLIP_SCALE_WITH_ACCEL if self._push else SLIP_SCALE_WITH_GYRO
        # Adaptive errors: what the accelerometer contradicts is worse by as much (R. K. Mehra,
        # Approaches to adaptive filtering, IEEE Transactions on Automatic Control 17, 1972).
        doubt = max(1.0, sqrt(self._innovation_square) / USUAL_INNOVATION)
        scale *= doubt
        ex = ey = ew = 0.0
        if standing:
            ex, ey, ew = least_squares(standing, yaw_rate)
            ex, ey, ew = scale * (ex - step.x) * dt, scale * (ey - step.y) * dt, (ew - w) * dt
        slip, self._scale = scale * step.slid * dt, scale
        f = self._identity.copy()
        f[0, 2:6] = -dy, c * dt, -s * dt, -dy * dt / 2.0
        f[1, 2:6] = dx, s * dt, c * dt, dx * dt / 2.0
        f[0, 9:14] = doubt * dx, c * slip, -s * slip, 0.0, c * ex - s * ey
        f[1, 9:14] = doubt * dy, s * slip, c * slip, 0.0, s * ex + c * ey
        f[2, 5] = dt
        if yaw_rate is None:
            f[2, 12], f[2, 13] = slip / self._feet.reach, ew
        if self._push:
            f[3, 7] = f[4, 8] = -dt
        self._transition = f

    def _estimate(self) -> OdometryEstimate:
        rest, reading, step, n = self.support, self._imu.last, self._step, self.noise
        x, y, yaw = self._covariance[:3, :3].tolist()
        yaw[2] += self._heading_variance
        roll, pitch = (rest.roll, rest.pitch) if rest else (0.0, 0.0)
        angular = step.yaw
        if reading is not None:
            angular = reading.yaw_rate - self.gyro_bias
            if reading.roll is not None and reading.pitch is not None:
                roll, pitch = reading.roll, reading.pitch
        vx, vy, w = np.diagonal(self._covariance)[3:6].tolist()
        slip, reach, rocks = self._scale * step.slid, self._feet.reach, 0.0
        if self._push is None:
            rocks = ROCKING_ERROR * hypot(step.x, step.y, step.yaw * reach)
        common = (n.slip_error * slip) ** 2 + rocks * rocks
        if reading is None:
            w += (n.slip_yaw_error * slip / reach) ** 2 + (rocks / 2.0 / reach) ** 2
        elif self._imu.period:
            # The yaw rate is that of one reading.
            w += n.gyro_noise**2 / self._imu.period
        return OdometryEstimate(
            self._x,
            self._y,
            rest.height if rest else nan,
            roll,
            pitch,
            self._yaw,
            (step.x, step.y),
            angular,
            (tuple(x), tuple(y), tuple(yaw)),
            (
                vx + (n.advance_error * step.x) ** 2 + common,
                vy + (n.advance_error * step.y) ** 2 + common,
                w,
            ),
        )


def _square(matrix: Symmetric, size: int) -> FloatArray:
    """Return the upper left part of a symmetric matrix."""
    a, b, c, d, e, f = matrix
    return np.array(((a, b, c), (b, d, e), (c, e, f)))[:size, :size]
