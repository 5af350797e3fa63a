"""A walker as its node has it: controller and odometry, and what is to be told of both."""

from collections.abc import Mapping
from math import nan

from .controller import Level, Settings, WalkController
from .imu import ImuReading
from .odometry import Errors, Odometer, Odometry
from .steering import Steering


class Walker:
    """
    Control a walker, and follow where it goes.

    Parameters
    ----------
    steering : Steering
        What its cranks make of it.
    settings : Settings, optional
        How it is controlled.
    errors : Errors, optional
        How far its odometry may be off.
    imu_timeout : float
        For how long an IMU may be silent before its yaw is that of the feet again [s].

    Attributes
    ----------
    feet : Feet
        Its feet.
    controller : WalkController
        What turns its cranks.
    odometry : Odometry
        What follows them.

    """

    def __init__(
        self,
        steering: Steering,
        settings: Settings | None = None,
        errors: Errors | None = None,
        *,
        imu_timeout: float = 0.5,
    ) -> None:
        self.feet = steering.feet
        self.controller = WalkController(steering, settings or Settings())
        self.odometry = Odometry(self.feet, errors)
        self._imu_timeout = imu_timeout
        self._imu_at: float | None = None
        self._jumps = 0
        self._at: float | None = None

    def imu(self, reading: ImuReading, now: float, variance: float = 0.0) -> None:
        """Take what an IMU on base_link says."""
        self._imu_at = now
        self.odometry.imu(reading, variance)

    def feedback(
        self,
        readings: Mapping[str, tuple[float, float | None]],
        now: float,
        at: float | None = None,
    ) -> Odometer | None:
        """
        Take angles and rates of cranks; return where it is, None while one is unknown.

        `at` is when they were so, where that is told; it may be of another clock [s].
        """
        controller = self.controller
        controller.feedback(readings, now)
        cranks = controller.cranks
        if not all(crank.is_known for crank in cranks):
            return None
        if self._imu_at is not None and now - self._imu_at > self._imu_timeout:
            self.odometry.forget_imu()
            self._imu_at = None
        jumps = sum(crank.believed for crank in cranks)
        if jumps != self._jumps:
            self._jumps = jumps
            self.odometry.jump()
        # What comes late, or all at once, was so at its own time.
        at = now if at is None else at
        seconds = 0.0 if self._at is None else at - self._at
        self._at = at
        return self.odometry.update(controller.positions, controller.velocities, seconds)

    def verdict(self, now: float) -> tuple[Level, str]:
        """Return how it is, and the most important thing to say."""
        level, text = self.controller.verdict(now)
        known = all(crank.is_known for crank in self.controller.cranks)
        if level == Level.OK and known and self.odometry.rest is None:
            return Level.WARN, f'{text}; its centre of mass is not above its feet'
        return level, text

    def values(self, now: float) -> dict[str, str]:
        """Return its figures, by what they are called."""
        controller, rest = self.controller, self.odometry.rest
        lock = controller.lock
        found: dict[str, str] = {}
        for k, crank in enumerate(controller.cranks):
            found[f'{crank.joint} phase_error'] = f'{lock.errors[k]:.5f}'
            found[f'{crank.joint} off_gait'] = f'{lock.phases()[k]:.4f}'
            found[f'{crank.joint} velocity'] = f'{crank.velocity:.4f}'
            found[f'{crank.joint} silent'] = f'{crank.age(now):.2f}'
            found[f'{crank.joint} rejected'] = str(crank.rejected)
            found[f'{crank.joint} jumps'] = str(crank.jumps)
        names = [leg.name for leg in self.feet.robot.legs]
        found['supporting_feet'] = ' '.join(names[i] for i in rest.feet) if rest else ''
        found['static_margin'] = f'{rest.margin if rest else nan:.4f}'
        found['linear'] = f'{controller.motion.linear:.4f}'
        found['angular'] = f'{controller.motion.angular:.4f}'
        found['pace'] = f'{lock.pace:.3f}'
        found['limits_hit'] = ' '.join(controller.limits_hit)
        found['cmd_vel_rejected'] = str(controller.rejected)
        found['cmd_vel_late'] = str(controller.late)
        found['cmd_vel_refused'] = str(controller.refused)
        found['travelled'] = f'{self.odometry.travelled:.3f}'
        has_imu = self._imu_at is not None
        found['imu'] = 'used' if has_imu else 'none'
        found['accelerometer'] = self.odometry.accelerometer.state if has_imu else 'none'
        return found
