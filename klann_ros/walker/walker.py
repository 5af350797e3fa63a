"""A walker as its node has it: controller, odometry, and the diagnostics of both."""

from collections.abc import Collection, Mapping
from math import cos, inf, isfinite, nan, radians, sin

from klann_ros.gait import Steering, Triple, Twist2D
from klann_ros.kinematics.angles import wrap

from .accelerometer import AccelerometerState
from .control_laws import CrankCommand
from .controller import STANDS, WalkController
from .drives import CrankDrives
from .faults import DiagnosticLevel
from .feedback import SteadyClock, Watchdog
from .imu import ImuReading
from .imu_monitor import ImuState
from .load import LoadMonitor
from .monitors import BodyMonitor
from .odometry import Odometry, OdometryEstimate
from .odometry_scale import OdometryScale
from .settings import ControllerSettings, OdometryNoise
from .zero_check import ZeroCheck

# Messages that are lost while a queue is drained take no longer; and readings whose stamps advance
# by less than the second are taken with the next, for the third at most [s].
MAX_LOSS, MIN_STEP, MAX_WAIT = 1.0, 0.005, 0.1
# Where the odometry begins: x, y [m], yaw [rad], and their covariance.
_ORIGIN = (0.0, 0.0, 0.0)
_CERTAIN = (_ORIGIN, _ORIGIN, _ORIGIN)
# Greatest tilt at which a body stands on its feet [rad].
MAX_WALKING_TILT = radians(60.0)

IMU_PROBLEMS = {
    ImuState.FROZEN: 'its IMU repeats the same reading',
    ImuState.CONTRADICTED: (
        'its IMU and its feet measure contrary yaw rates: check the axes, signs and units (rad/s)'
    ),
}


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
        self._at: float | None = None
        self._arrived = 0.0
        self._estimate: OdometryEstimate | None = None

    def set_zero(self, joints: Collection[str] = ()) -> str:
        """
        Declare the angles of cranks their zeros, of all without joints, while it stands.

        Returns why it does not, '' if it does.
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
        at = now if at is None else at
        seconds = 0.0 if self._at is None else at - self._at
        passed = now - self._arrived
        if seconds > passed + MAX_LOSS:
            # A clock that is set moves nothing.
            seconds = 0.0
        elif self._estimate and seconds < MIN_STEP and abs(passed) < MAX_WAIT:
            # A driver sends readings in bunches: by their stamps the cranks would leap.
            return self._estimate
        self._at, self._arrived = at, now
        # One without valid readings stands, as all are stopped then.
        timeout = controller.settings.feedback_timeout
        rates = [0.0 if each.age(now) > timeout else each.velocity for each in controller.cranks]
        estimate = self.odometry.update(
            controller.positions, rates, seconds, is_commanded=controller.motion != STANDS
        )
        found = self._scale.scaled(estimate)
        if self._attitude is not None:
            self.zero_check.update(controller.positions, self._attitude)
        if self._estimate is not None and seconds > 0.0:
            controller.measured(_mean_motion(self._estimate, found, seconds), seconds)
        self._estimate = found
        return found

    def follow_command(self, command: CrankCommand | None, now: float) -> OdometryEstimate | None:
        """Take a command as obeyed, without encoders; without one the cranks are at 0."""
        joints = self.feet.joints
        zeros = (0.0,) * len(joints)
        angles, rates = command or (zeros, zeros)
        return self.feedback(dict(zip(joints, zip(angles, rates, strict=True), strict=True)), now)

    def verdict(self, now: float) -> tuple[DiagnosticLevel, str]:
        """Return the level, and the most important message."""
        level, text = self.controller.verdict(now)
        odometry, problem = self.odometry, ''
        offset = self.zero_check.offset
        if self.controller.is_known and odometry.support is None:
            problem = 'its centre of mass is not above its feet'
        elif offset is not None:
            problem = offset.text
        elif odometry.stance.support_check.violation > odometry.noise.max_support_violation:
            share = f'{odometry.stance.support_check.violation:.0%} of the time'
            problem = f'it stands on feet that cannot carry it {share}: check body_centre'
        elif odometry.stance.slope.innovation > odometry.noise.max_tilt_innovation:
            problem = 'its attitude is not that of a body on its feet: check body_centre and IMU'
        elif odometry.imu_input.monitor.state in IMU_PROBLEMS:
            problem = (
                f'{IMU_PROBLEMS[odometry.imu_input.monitor.state]}; odom goes on without the IMU'
            )
        elif odometry.accelerometer_state is AccelerometerState.NOT_BELIEVED:
            problem = (
                'its accelerometer is not believed: check its units and axes, or the feet slip'
            )
        elif not odometry.gyro.is_steady:
            problem = 'the heading of its IMU turns while it stands: check the IMU, or gyro_bias'
        if level == DiagnosticLevel.OK and problem:
            return DiagnosticLevel.WARN, f'{text}; {problem}'
        return level, text

    def values(self, now: float) -> dict[str, str]:
        """Return its figures by name."""
        controller, odometry = self.controller, self.odometry
        lock, rest = controller.lock, odometry.support
        found: dict[str, str] = {}
        for crank, error, phase in zip(controller.cranks, lock.errors, lock.phases(), strict=True):
            joint = crank.joint
            found |= {
                f'{joint} phase_error': f'{error:.5f}',
                f'{joint} off_gait': f'{phase:.4f}',
                f'{joint} velocity': f'{crank.velocity:.4f}',
                f'{joint} silent': f'{crank.age(now):.2f}',
                f'{joint} rejected': str(crank.rejected),
                f'{joint} jumps': str(crank.jumps),
                f'{joint} offsets': str(crank.offsets),
                f'{joint} offset_sum': f'{crank.offset_sum:.4f}',
                f'{joint} encoder_noise': f'{crank.detector.noise:.5f}',
            }
        for joint, load in self._loads.items():
            if isfinite(load.effort):
                found[f'{joint} effort'] = f'{load.effort:.3f}'
        names = [leg.name for leg in self.feet.robot.legs]
        has_imu = self._imu_age.age(now) <= self._imu_timeout
        accelerometer = odometry.accelerometer_state if has_imu else AccelerometerState.NONE
        fault = controller.latch.fault
        offset = self.zero_check.offset
        return found | {
            'fault': fault.kind.name if fault else '',
            'zero_offset': offset.text if offset else '',
            'supporting_feet': ' '.join(names[i] for i in rest.feet) if rest else '',
            'static_margin': f'{rest.margin if rest else nan:.4f}',
            'linear': f'{controller.motion.linear:.4f}',
            'angular': f'{controller.motion.angular:.4f}',
            'rate_scale': f'{lock.rate_scale:.3f}',
            'feedback_delay': f'{lock.delay:.3f}',
            'pauses': str(controller.loop.pauses),
            'limits_hit': ' '.join(controller.limits_hit),
            'cmd_vel_rejected': str(controller.rejected),
            'cmd_vel_late': str(controller.late),
            'cmd_vel_refused': str(controller.refused),
            'travelled': f'{odometry.travelled:.3f}',
            'imu': (odometry.imu_input.monitor.state if has_imu else ImuState.NONE).value,
            'tilt': f'{self._body.tilt:.3f}',
            'accelerometer': accelerometer.value,
            'velocity_innovation': f'{odometry.accelerometer.innovation:.3f}',
            'tilt_innovation': f'{odometry.stance.slope.innovation:.3f}',
            'support_violation': f'{odometry.stance.support_check.violation:.3f}',
            'gyro_bias': f'{odometry.gyro_bias:.5f}',
        }


def _mean_motion(before: OdometryEstimate, after: OdometryEstimate, seconds: float) -> Twist2D:
    """Return the mean motion from pose to pose: velocities at instants would miss impacts."""
    turned = wrap(after.yaw - before.yaw)
    middle = before.yaw + turned / 2.0
    dx, dy = after.x - before.x, after.y - before.y
    forwards = dx * cos(middle) + dy * sin(middle)
    return Twist2D(forwards / seconds, turned / seconds)
