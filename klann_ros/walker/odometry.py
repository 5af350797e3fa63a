"""
Where a walker is, from the angles of its cranks; its yaw from an IMU where there is one.

From pose to pose the body moves as `momentum` says. What that is wrong by is mostly the same
from step to step: friction is not quite Coulomb's, feet are worn, floors give way. So the errors
are modelled as unknown constants with standard deviations s,

    forwards = s_1 x advance + s_2 x slid q,
    sidewards = s_3 x slid q,
    yaw = s_4 x slid q / reach,

q being the part that the feet slid of what they slid and the body moved together,

and their effect on the pose is summed up along the path. Feet that slide more are trusted less by
themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, exp, hypot, inf, nan, pi, sin
from operator import mul
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN

from .accelerometer import Accelerometer
from .feet import Feet
from .imu import ImuReading, Triple
from .momentum import ImuIncrement, MAX_STEP_TIME, Momentum
from .slip import BodyStep, Flat, Standing, standing
from .slope import Slope
from .support import Support, support

# Largest crank angle of an integration step [rad], and the largest number of steps.
LONGEST_STEP, MAX_STEPS = 0.05, 500
# Scale of the slip uncertainty with a gyro, and with an accelerometer as well.
SLIP_SCALE_WITH_GYRO, SLIP_SCALE_WITH_ACCEL = 0.5, 0.3
# Time constant of the complementary filter between gyro and orientation [s].
COMPLEMENTARY_FILTER_TIME = 0.5
# Time constant of tipping onto other feet without an IMU [s].
TILT_TIME_CONSTANT = 0.03
# Time constant of the filter between crank rates and encoders [s], ...
ENCODER_FILTER_TIME = 0.1
# ... and the gate of its innovation [rad].
ENCODER_GATE = 0.1
# Standstill: cranks and body turn slower than this [rad/s].
STATIONARY_RATE = 0.1
# A larger normalised innovation rejects the accelerometer; healthy ones reach 0.1.
INNOVATION_GATE = 0.25


@dataclass(frozen=True)
class Errors:
    """
    How far odometry may be off: standard deviations, from simulated walks (benchmarks/walk.py).

    Attributes
    ----------
    advance : float
        Of the way forwards, by that.
    slid, sidewards, yaw : float
        Forwards, sidewards, and yaw at the reach of the feet, by how far the feet slid and by the
        part of all motion that this was.
    imu_yaw : float
        Of a yaw from an IMU whose message tells none [rad].
    height, tilt : float
        Of what the body stands like [m, rad].

    """

    advance: float = 0.015
    slid: float = 0.12
    sidewards: float = 0.12
    yaw: float = 0.34
    imu_yaw: float = 0.005
    height: float = 0.01
    tilt: float = 0.02


class Odometer(NamedTuple):
    """
    Where a walker is, in a frame that begins on the ground below where it began.

    Attributes
    ----------
    x, y, z : float
        base_link's origin [m].
    roll, pitch, yaw : float
        As in REP 103 [rad].
    linear : (float, float)
        Its velocity over ground, forwards and to the left [m/s].
    angular : float
        Its yaw rate [rad/s].
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
    linear: tuple[float, float]
    angular: float
    covariance: tuple[Triple, Triple, Triple]
    rate_variances: Triple


class Odometry:
    """
    Follow the cranks of a walker.

    Parameters
    ----------
    feet : Feet
        The walker's.
    errors : Errors, optional
        How far it may be off.

    Attributes
    ----------
    rest : Support or None
        On which feet it stands; None before the first angles, and where it does not rest.
    accelerometer : Accelerometer
        The IMU's.
    travelled, slid : float
        How far it went, and how far its feet slid [m].

    """

    def __init__(self, feet: Feet, errors: Errors | None = None) -> None:
        errors = errors or Errors()
        self._feet, self.errors = feet, errors
        self.rest: Support | None = None
        self.travelled = self.slid = 0.0
        self._x = self._y = self._yaw = 0.0
        self._cranks: list[float] | None = None
        self._pose: Standing | None = None
        # How x and y follow the unknown constants, and how yaw follows the last of them.
        self._x_follows = self._y_follows = (0.0, 0.0, 0.0, 0.0)
        self._yaw_follows = 0.0
        self._imu: ImuReading | None = None
        self._turned = 0.0
        self._heading: float | None = None
        self._imu_variance: float | None = None
        # Attitude of the body by the IMU: roll and pitch [rad].
        self._attitude_imu: tuple[float, float] | None = None
        self._attitude: tuple[float, float] | None = None
        self._momentum = Momentum(feet.gyration)
        self._slope = Slope()
        self.accelerometer = Accelerometer()

    def imu(self, reading: ImuReading, variance: float = 0.0) -> None:
        """Take what an IMU says; it turns the body from now on, until `forget_imu`."""
        last, self._imu = self._imu, reading
        self._imu_variance = variance or self.errors.imu_yaw**2
        if last is None:
            self._turned, self._heading = 0.0, reading.yaw
            self._lean(reading, reading, 0.0)
            return
        # Orientation noise would show up as foot slip: from reading to
        # reading the gyro counts, and the orientation in the long run.
        dt = max(0.0, reading.at - last.at)
        self.accelerometer.read(last, reading)
        # Over a longer silence a rate tells nothing.
        turned = (
            (reading.yaw_rate + last.yaw_rate) / 2.0 * dt
            if dt < COMPLEMENTARY_FILTER_TIME
            else 0.0
        )
        if reading.yaw is not None:
            heading = reading.yaw if self._heading is None else self._heading + turned
            away = (reading.yaw - heading + pi) % TURN - pi
            turned += min(1.0, dt / COMPLEMENTARY_FILTER_TIME) * away
            self._heading = heading + min(1.0, dt / COMPLEMENTARY_FILTER_TIME) * away
        self._turned += turned
        self._lean(last, reading, dt)

    def _lean(self, last: ImuReading, reading: ImuReading, dt: float) -> None:
        """Update the attitude by an IMU reading."""
        if reading.roll is None or reading.pitch is None:
            self._attitude_imu = None
            return
        roll, pitch = self._attitude_imu or (reading.roll, reading.pitch)
        if dt < COMPLEMENTARY_FILTER_TIME:
            roll += (reading.roll_rate + last.roll_rate) / 2.0 * dt
            pitch += (reading.pitch_rate + last.pitch_rate) / 2.0 * dt
        share = min(1.0, dt / COMPLEMENTARY_FILTER_TIME)
        over = (reading.roll - roll + pi) % TURN - pi
        self._attitude_imu = roll + share * over, pitch + share * (reading.pitch - pitch)

    def forget_imu(self) -> None:
        """Turn by the feet from now on."""
        self._imu, self._turned, self._imu_variance, self._attitude_imu = None, 0.0, None, None
        self.accelerometer.miss()
        self._slope = Slope()

    def jump(self) -> None:
        """Take the next angles as where the cranks are, not as a way."""
        self._cranks = self._pose = None

    def update(
        self, cranks: Sequence[float], rates: Sequence[float], seconds: float = 0.0
    ) -> Odometer:
        """
        Follow the cranks.

        If the joints are unchanged, only the IMU moves the estimate.

        Parameters
        ----------
        cranks : sequence of float
            Their angles [rad].
        rates : sequence of float
            The rates that they have there [rad/s].
        seconds : float
            Since the last; if it is not given, by angles and rates.

        """
        angles = list(cranks)
        before = angles if self._cranks is None else self._cranks
        # Encoder noise would show up as foot velocity.
        both = zip(before, rates, angles, strict=True)
        away = [was + rate * seconds - is_ for was, rate, is_ in both]
        if 0.0 < seconds < ENCODER_FILTER_TIME and all(abs(each) < ENCODER_GATE for each in away):
            share = exp(-seconds / ENCODER_FILTER_TIME)
            angles = [is_ + share * each for is_, each in zip(angles, away, strict=True)]
        turned = [is_ - was for is_, was in zip(angles, before, strict=True)]
        steps = min(MAX_STEPS, 1 + int(max(map(abs, turned)) / LONGEST_STEP))
        yaw = self._turned / steps if self._imu is not None else None
        self._turned = 0.0
        self._cranks = angles
        if seconds > 0.0:
            seconds = seconds / steps
        else:
            along = sum(map(mul, turned, rates)) / steps
            seconds = along / sum(map(mul, rates, rates)) if along > 0.0 else inf
        push = self._delta_velocity(rates, seconds * steps)
        each = push and (push[0] / steps, push[1] / steps)
        last = BodyStep(0.0, 0.0, 0.0, 0.0)
        for k in range(1, steps + 1):
            share = k / steps
            at = [was + share * by for was, by in zip(before, turned, strict=True)]
            last = self._follow(at, yaw, seconds, each)
        if push is not None:
            self._judge(seconds * steps)
        return self._estimate(last, seconds)

    def _judge(self, seconds: float) -> None:
        """Have the accelerometer learn of what friction corrects it by."""
        self.accelerometer.correct(self._momentum.corrected, seconds)
        if self._momentum.strain > INNOVATION_GATE:
            self.accelerometer.reject()
            self._momentum.relax()

    def _delta_velocity(self, rates: Sequence[float], seconds: float) -> Flat | None:
        """Return what the velocity has changed by, if that is felt [m/s]."""
        if self._imu is None:
            return None
        turns = self._imu.yaw_rate, self._imu.roll_rate, self._imu.pitch_rate
        rests = all(abs(rate) < STATIONARY_RATE for rate in (*rates, *turns))
        return self.accelerometer.gained(seconds, rests=rests)

    def _follow(
        self, angles: Sequence[float], yaw: float | None, seconds: float, push: Flat | None
    ) -> BodyStep:
        feet, rolled, centre = self._feet.pose(angles)
        last, self.rest = self.rest, support(feet, centre, self.rest and self.rest.triple)
        before = self._pose
        if self.rest is None:
            self._pose = None
            self._momentum.stop()
            return BodyStep(0.0, 0.0, 0.0, 0.0)
        attitude = self._lying(self.rest, seconds)
        if self._attitude_imu is not None:
            roll, pitch = attitude[0] - self.rest.roll, attitude[1] - self.rest.pitch
            self._slope.learn(roll, pitch, min(seconds, MAX_STEP_TIME))
        self._pose = standing(feet, rolled, self.rest, attitude, centre)
        if before is None or last is None:
            self._momentum.stop()
            return BodyStep(0.0, 0.0, 0.0, 0.0)
        height = self.rest.height + sum(map(mul, self.rest.normal, centre))
        measured = ImuIncrement(yaw, self._slope.pull, push)
        step = self._momentum.step(before, self._pose, height, seconds, measured)
        self._slope.turn(step.yaw)
        self._add(step, measured=yaw is not None, has_accelerometer=push is not None)
        return step

    def _lying(self, rest: Support, seconds: float) -> tuple[float, float]:
        """Return roll and pitch: those of an IMU, or else what they tip to on other feet."""
        if self._attitude_imu is not None:
            self._attitude = self._attitude_imu
        elif self._attitude is None:
            self._attitude = rest.roll, rest.pitch
        else:
            roll, pitch = self._attitude
            share = 1.0 - exp(-seconds / TILT_TIME_CONSTANT)
            self._attitude = (
                roll + share * (rest.roll - roll),
                pitch + share * (rest.pitch - pitch),
            )
        return self._attitude

    def _add(self, step: BodyStep, *, measured: bool, has_accelerometer: bool) -> None:
        middle = self._yaw + step.yaw / 2.0
        c, s = cos(middle), sin(middle)
        dx, dy = c * step.x - s * step.y, s * step.x + c * step.y
        self._x, self._y = self._x + dx, self._y + dy
        self._yaw = (self._yaw + step.yaw + pi) % TURN - pi
        self.travelled += hypot(dx, dy)
        self.slid += step.slid
        # The more of its way it slides, the less is known of how: on the spot least of all.
        whole = hypot(step.x, step.y) + step.slid
        known = (
            SLIP_SCALE_WITH_ACCEL
            if has_accelerometer
            else SLIP_SCALE_WITH_GYRO
            if measured
            else 1.0
        )
        slid = step.slid * known * (step.slid / whole if whole else 0.0)
        turn = 0.0 if measured else slid / self._feet.reach
        # What a wrong yaw makes of the step, and what the step itself may be off by. In plain
        # numbers: of so few each call of arrays would cost as much as all of them.
        heading = self._yaw_follows
        own, slides, aside, turns = self._x_follows
        self._x_follows = (
            own + c * step.x,
            slides + c * slid,
            aside - s * slid,
            turns - dy * heading,
        )
        own, slides, aside, turns = self._y_follows
        self._y_follows = (
            own + s * step.x,
            slides + s * slid,
            aside + c * slid,
            turns + dx * heading,
        )
        self._yaw_follows = heading + turn

    def _covariance(self) -> tuple[Triple, Triple, Triple]:
        errors = self.errors
        spread = errors.advance, errors.slid, errors.sidewards, errors.yaw
        x = tuple(map(mul, self._x_follows, spread))
        y = tuple(map(mul, self._y_follows, spread))
        yaw = self._yaw_follows * errors.yaw
        xx, xy, yy = sum(map(mul, x, x)), sum(map(mul, x, y)), sum(map(mul, y, y))
        own = yaw * yaw + (self._imu_variance or 0.0)
        return (xx, xy, x[3] * yaw), (xy, yy, y[3] * yaw), (x[3] * yaw, y[3] * yaw, own)

    def _estimate(self, step: BodyStep, seconds: float) -> Odometer:
        rest, imu, errors = self.rest, self._imu, self.errors
        linear = (step.x / seconds, step.y / seconds)
        slides = step.slid / seconds
        angular = step.yaw / seconds if imu is None else imu.yaw_rate
        a, b, d = (
            hypot(errors.advance * linear[0], errors.slid * slides, 0.01),
            hypot(errors.sidewards * slides, 0.01),
            0.02 if imu is not None else hypot(errors.yaw * slides / self._feet.reach, 0.01),
        )
        roll, pitch = (rest.roll, rest.pitch) if rest else (0.0, 0.0)
        if imu is not None and imu.roll is not None and imu.pitch is not None:
            roll, pitch = imu.roll, imu.pitch
        return Odometer(
            self._x,
            self._y,
            rest.height if rest else nan,
            roll,
            pitch,
            self._yaw,
            linear,
            angular,
            self._covariance(),
            (a * a, b * b, d * d),
        )
