"""A walker as its node has it: motors and encoders, controller, odometry, diagnostics."""

from cmath import rect
from collections.abc import Collection, Mapping
from dataclasses import replace
from math import cos, inf, isfinite, nan, radians, sin

from klann_ros.gait import Steering, Triple, Twist2D
from klann_ros.kinematics.angles import wrap
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import CrankDrive
import numpy as np

from .control_laws import CrankCommand
from .controller import STANDS, WalkController
from .faults import DiagnosticLevel
from .feedback import CrankFeedback, SteadyClock, Watchdog
from .imu import ImuReading
from .imu_monitor import ImuState
from .monitors import BodyMonitor, LoadMonitor
from .odometry import Odometry, OdometryEstimate
from .settings import ControllerSettings, OdometryNoise
from .zero_check import ZeroCheck

Readings = Mapping[str, tuple[float, float | None]]


class CrankDrives:
    """The encoders and motors of cranks, by their joints in the order of `Feet.joints`."""

    def __init__(self, drives: Mapping[str, CrankDrive]) -> None:
        self.drives = dict(drives)

    def measured(self, readings: Readings) -> Readings:
        """Return angles and rates of cranks by those of their encoders [rad, rad/s]."""
        measured = {}
        for joint, (position, velocity) in readings.items():
            measured[joint] = self.drives[joint].measured(position, velocity)
        return measured

    def commanded(self, command: CrankCommand) -> CrankCommand:
        """Return a command of cranks as one of their motors."""
        drives = self.drives.values()
        motors = [
            drive.commanded(angle, rate)
            for drive, angle, rate in zip(drives, command.position, command.velocity, strict=True)
        ]
        return CrankCommand(tuple(position for position, _ in motors), tuple(r for _, r in motors))

    @property
    def zeros(self) -> str:
        """Return the zeros as a robot file has them."""
        zeros = [f'{joint}: {{zero: {drive.zero:.4f}}}' for joint, drive in self.drives.items()]
        return f'cranks: {{{", ".join(zeros)}}}'

    def set_zero(self, crank: CrankFeedback) -> None:
        """Declare the present angle of a crank its zero."""
        drive = self.drives[crank.joint]
        zero = wrap(drive.zero + crank.position)
        crank.shift(drive.zero - zero)
        self.drives[crank.joint] = replace(drive, zero=zero)


class OdometryScale:
    """
    Scale estimates by constant factors, which a calibration gives.

    The path is that of the scaled velocities. Its covariance is that of the estimate, scaled and
    rotation by the difference of the headings: exact for an `angular` factor of 1.

    Parameters
    ----------
    linear, angular : float
        True speed by the estimated one, and true yaw rate by the estimated one.

    """

    def __init__(self, linear: float = 1.0, angular: float = 1.0) -> None:
        self._linear, self._angular = linear, angular
        self._factors = np.array([linear, linear, angular])
        self.set_pose(0.0, 0.0, 0.0)

    def set_pose(self, x: float, y: float, yaw: float) -> None:
        """Go on at a pose [m, rad], at which the estimate goes on as well."""
        self._estimated = self._scaled = (complex(x, y), yaw)

    def unscaled(self, covariance: tuple[Triple, Triple, Triple]) -> FloatArray:
        """Return the covariance of an estimate at a set pose by that of x, y and yaw."""
        return np.asarray(np.array(covariance) / np.outer(self._factors, self._factors))

    def scaled(self, estimate: OdometryEstimate) -> OdometryEstimate:
        """Return the next estimate, scaled."""
        if self._linear == self._angular == 1.0:
            return estimate
        place_before, yaw_before = self._estimated
        place, yaw = self._scaled
        self._estimated = complex(estimate.x, estimate.y), estimate.yaw
        rotation = wrap(estimate.yaw - yaw_before)
        displacement = (self._estimated[0] - place_before) * rect(
            1.0, -yaw_before - rotation / 2.0
        )
        place += self._linear * displacement * rect(1.0, yaw + self._angular * rotation / 2.0)
        yaw = wrap(yaw + self._angular * rotation)
        self._scaled = place, yaw
        c, s = cos(yaw - estimate.yaw), sin(yaw - estimate.yaw)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        covariance = turn @ estimate.covariance @ turn.T * np.outer(self._factors, self._factors)
        x_row, y_row, yaw_row = covariance.tolist()
        forwards, leftwards, angular = self._factors * (*estimate.linear, estimate.angular)
        x_variance, y_variance, yaw_variance = self._factors**2 * estimate.rate_variances
        return estimate._replace(
            x=place.real,
            y=place.imag,
            yaw=yaw,
            linear=(float(forwards), float(leftwards)),
            angular=float(angular),
            covariance=(tuple(x_row), tuple(y_row), tuple(yaw_row)),
            rate_variances=(float(x_variance), float(y_variance), float(yaw_variance)),
        )


# Messages that are lost while a queue is drained take no longer; and readings whose stamps advance
# by less than the second are taken with the next, for the third at most [s].
MAX_LOSS, MIN_STEP, MAX_WAIT = 1.0, 0.005, 0.1
# Where the odometry begins: x, y [m], yaw [rad], and their covariance.
_ORIGIN = (0.0, 0.0, 0.0)
_CERTAIN = (_ORIGIN, _ORIGIN, _ORIGIN)
# Greatest tilt at which a body stands on its feet [rad].
MAX_WALKING_TILT = radians(60.0)


class ReadingClock:
    """The times of the readings that move the estimate."""

    def __init__(self) -> None:
        # Of the last reading: its own time, and the control clock's [s].
        self._at: float | None = None
        self._arrived = 0.0

    def step(self, at: float, now: float, *, is_first: bool) -> float | None:
        """Return the time since the last reading [s]; None if it is taken with the next."""
        seconds = 0.0 if self._at is None else at - self._at
        passed = now - self._arrived
        if seconds > passed + MAX_LOSS:
            # A clock that is set moves nothing.
            seconds = 0.0
        elif not is_first and seconds < MIN_STEP and abs(passed) < MAX_WAIT:
            # A driver sends readings in bunches: by their stamps the cranks would leap.
            return None
        self._at = at
        self._arrived = now
        return seconds


class Walker:
    """
    Control a walker, and follow where it goes.

    Angles and rates are those of cranks; `drives` converts those of their encoders and motors.

    Parameters
    ----------
    steering : Steering
        Maps body motion to crank rates.
    settings : ControllerSettings, optional
        Of its `controller`, which turns its cranks.
    noise : OdometryNoise, optional
        Of its `odometry`, which follows them.
    scale : OdometryScale, optional
        Factors of its speed and yaw rate, by a calibration.
    imu_timeout : float
        Maximum age of IMU readings [s]; older ones are ignored.
    steady : callable, optional
        Returns the time of a clock that always runs [s]; see `WalkController`.

    """

    def __init__(
        self,
        steering: Steering,
        settings: ControllerSettings | None = None,
        noise: OdometryNoise | None = None,
        *,
        scale: OdometryScale | None = None,
        imu_timeout: float = 0.5,
        steady: SteadyClock | None = None,
    ) -> None:
        self.feet = steering.feet
        self.controller = WalkController(steering, settings or ControllerSettings(), steady)
        self.odometry = Odometry(self.feet, noise)
        self._scale = scale or OdometryScale()
        self.drives = CrankDrives(self.feet.robot.drives)
        self._loads = {joint: LoadMonitor(joint) for joint in self.feet.joints}
        self.zero_check = ZeroCheck(self.feet)
        # The last measured roll and pitch [rad]; None without an orientation.
        self._attitude: tuple[float, float] | None = None
        self._imu_timeout = imu_timeout
        self._imu_age = Watchdog(steady)
        self._body = BodyMonitor()
        self._clock = ReadingClock()
        self._estimate: OdometryEstimate | None = None

    def set_zero(self, joints: Collection[str] = ()) -> str:
        """
        Declare the present angles of some cranks their zeros, by default of all cranks.

        Returns the reason for a refusal, such as a walker that moves; '' if it is done.
        """
        controller = self.controller
        creep = controller.settings.creep_rate
        if not controller.is_known:
            return 'not all cranks have given feedback'
        if controller.motion != STANDS or any(abs(c.velocity) > creep for c in controller.cranks):
            return 'it moves'
        for crank in controller.cranks:
            if crank.joint in joints or not joints:
                self.drives.set_zero(crank)
        controller.lock.reset(controller.positions)
        for monitor in controller.monitors:
            monitor.restart()
        self.odometry.jump()
        self.zero_check = ZeroCheck(self.feet)
        return ''

    def set_pose(
        self, pose: Triple = _ORIGIN, covariance: tuple[Triple, Triple, Triple] = _CERTAIN
    ) -> None:
        """Go on at x, y [m] and yaw [rad] in odom, with their covariance."""
        x, y, yaw = pose
        self.odometry.set_pose(pose, self._scale.unscaled(covariance))
        self._scale.set_pose(x, y, yaw)
        if self._estimate is not None:
            # No motion is measured from the pose before to this one.
            self._estimate = self._estimate._replace(x=x, y=y, yaw=yaw, covariance=covariance)

    def take_efforts(self, efforts: Mapping[str, float | None], now: float) -> None:
        """Take the efforts of cranks by their joints [N m]; None is unknown."""
        for joint, effort in efforts.items():
            if effort is None:
                continue
            fault = self._loads[joint].read(effort, now, self.controller.settings.max_effort)
            if fault is not None:
                self.controller.latch.trip(fault)

    def imu(self, reading: ImuReading, now: float, variance: float = 0.0) -> None:
        """Take a reading of an IMU on base_link."""
        self.controller.keep_alive(now)
        fault = self._body.update(reading, now, self.controller.settings.max_tilt)
        if fault:
            self.controller.latch.trip(fault)
        # The attitude of a body that lies on its side or head says nothing about its feet.
        if self._body.tilt < MAX_WALKING_TILT:
            self._imu_age.feed(now)
            self._attitude = reading.attitude
            self.odometry.imu(reading, variance)

    def feedback(
        self,
        readings: Mapping[str, tuple[float, float | None]],
        now: float,
        at: float | None = None,
        transport_age: float | None = None,
    ) -> OdometryEstimate | None:
        """
        Take angles and rates of cranks; return where it is, None while one is unknown.

        `at` is their own time by any clock [s], and `transport_age` their age by the middleware's
        time of sending: see `WalkController.command`.
        """
        controller = self.controller
        if controller.feedback(readings, now, at, transport_age):
            self.odometry.jump()
        if not controller.is_known:
            return None
        if self._imu_timeout < self._imu_age.age(now) < inf:
            self.odometry.forget_imu()
            self._attitude = None
            self._imu_age.clear()
        # What comes late, or all at once, was so at its own time.
        seconds = self._clock.step(now if at is None else at, now, is_first=not self._estimate)
        last = self._estimate
        if seconds is None:
            return last
        # A crank without valid readings stands, as all are stopped then.
        timeout = controller.settings.feedback_timeout
        rates = [
            0.0 if crank.age(now) > timeout else crank.velocity for crank in controller.cranks
        ]
        is_commanded = controller.motion != STANDS
        estimate = self.odometry.update(
            controller.positions, rates, seconds, is_commanded=is_commanded
        )
        estimate = self._scale.scaled(estimate)
        if self._attitude is not None:
            self.zero_check.update(controller.positions, self._attitude)
        if last is not None and seconds > 0.0:
            controller.measure_motion(_mean_motion(last, estimate, seconds), seconds)
        self._estimate = estimate
        return estimate

    def follow_command(self, command: CrankCommand | None, now: float) -> OdometryEstimate | None:
        """Take a command as obeyed, without encoders; without one the cranks are at 0."""
        joints = self.feet.joints
        zeros = (0.0,) * len(joints)
        angles, rates = command or (zeros, zeros)
        return self.feedback(dict(zip(joints, zip(angles, rates, strict=True), strict=True)), now)

    def verdict(self, now: float) -> tuple[DiagnosticLevel, str]:
        """Return the level, and the most important message."""
        level, text = self.controller.verdict(now)
        odometry = self.odometry
        problem = odometry.support_problem or self.zero_check.problem or odometry.problem
        if level == DiagnosticLevel.OK and problem:
            return DiagnosticLevel.WARN, f'{text}; {problem}'
        return level, text

    def values(self, now: float) -> dict[str, str]:
        """Return the figures of the walker for diagnostics, by name."""
        efforts = dict[str, str]()
        for joint, load in self._loads.items():
            if isfinite(load.effort):
                efforts[f'{joint} effort'] = f'{load.effort:.3f}'
        support, fault = self.odometry.support, self.controller.latch.fault
        feet = [self.feet.robot.legs[foot].name for foot in support.feet] if support else []
        has_imu = self._imu_age.age(now) <= self._imu_timeout
        return {
            **self.controller.crank_figures(now),
            **efforts,
            'fault': fault.kind.name if fault else '',
            'zero_offset': self.zero_check.problem,
            'supporting_feet': ' '.join(feet),
            'static_margin': f'{support.margin if support else nan:.4f}',
            **self.controller.figures,
            'travelled': f'{self.odometry.travelled:.3f}',
            'imu': (self.odometry.imu_input.monitor.state if has_imu else ImuState.NONE).value,
            'tilt': f'{self._body.tilt:.3f}',
            **self.odometry.figures(has_imu=has_imu),
        }


def _mean_motion(last: OdometryEstimate, estimate: OdometryEstimate, seconds: float) -> Twist2D:
    """Return the mean motion from pose to pose: velocities at instants would miss impacts."""
    rotation = wrap(estimate.yaw - last.yaw)
    middle = last.yaw + rotation / 2.0
    dx, dy = estimate.x - last.x, estimate.y - last.y
    forwards = dx * cos(middle) + dy * sin(middle)
    return Twist2D(forwards / seconds, rotation / seconds)
