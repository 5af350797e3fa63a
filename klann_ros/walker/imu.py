"""
Measurements of an IMU between two readings of the cranks: attitude, heading, velocity change.

Attitude and heading are those of the orientation in the long run and those of the gyro from
reading to reading (a complementary filter), because noise of the orientation would show up as
slip of the feet.
"""

from math import atan2, cos, hypot, sin, tan
from typing import NamedTuple

from klann_ros.dynamics import GRAVITY
from klann_ros.gait import gravity_aligned, Triple
from klann_ros.kinematics.angles import wrap, yaw_of

from .settings import OdometryNoise


class ImuReading(NamedTuple):
    """
    A reading of an IMU in the origin of base_link.

    `yaw` [rad] is None without an orientation, as is the `attitude`: roll and pitch [rad], with
    their derivatives [rad/s]. `yaw_rate` is that about the vertical [rad/s], `at` a time [s], and
    `force` the specific force in base_link [m/s^2]: 9.8 upwards at rest, as in REP 145.
    """

    yaw: float | None
    yaw_rate: float
    at: float
    attitude: tuple[float, float] | None = None
    attitude_rates: tuple[float, float] = (0.0, 0.0)
    force: Triple | None = None


def imu_reading(
    orientation: tuple[float, float, float, float] | None,
    angular: Triple,
    at: float,
    force: Triple | None = None,
) -> ImuReading:
    """
    Return the reading of an IMU whose axes are those of base_link.

    `orientation` is a quaternion x, y, z, w; `angular` velocity [rad/s] and specific `force`
    [m/s^2] are those in base_link, `at` a time [s].
    """
    if orientation is None:
        return ImuReading(None, angular[2], at, force=force)
    x, y, z, w = orientation
    # The vertical in base_link; any norm.
    up_x = 2.0 * (x * z - w * y)
    up_y = 2.0 * (y * z + w * x)
    up_z = w * w - x * x - y * y + z * z
    roll = atan2(up_y, up_z)
    pitch = atan2(-up_x, hypot(up_y, up_z))
    rate_x, rate_y, rate_z = angular
    # About the vertical of a body that is not rolled, and about its y axis.
    turning = sin(roll) * rate_y + cos(roll) * rate_z
    pitch_rate = cos(roll) * rate_y - sin(roll) * rate_z
    yaw_rate = cos(pitch) * turning - sin(pitch) * rate_x
    attitude_rates = rate_x + tan(pitch) * turning, pitch_rate
    return ImuReading(yaw_of(x, y, z, w), yaw_rate, at, (roll, pitch), attitude_rates, force)


class ImuIncrement(NamedTuple):
    """Measurements of an IMU over an interval."""

    # Change of the heading, and roll and pitch at the end [rad].
    turn: float
    attitude: tuple[float, float] | None
    # Integral of the specific force less gravity, in the level frame of base_link [m/s]; None
    # where readings are missing or invalid. And the time that these readings cover [s].
    delta_velocity: Triple | None
    span: float
    # Largest component of the last angular velocity [rad/s].
    body_rate: float


class OrientationFilter:
    """
    The complementary filter of heading and attitude.

    `attitude` is roll and pitch [rad], None without an orientation.
    """

    def __init__(self, time_constant: float) -> None:
        self._time_constant = time_constant
        self.attitude: tuple[float, float] | None = None
        # The filtered yaw of the readings [rad].
        self._heading: float | None = None
        # Number of readings.
        self._count = 0

    def update(self, last: ImuReading, reading: ImuReading) -> float:
        """Take the next reading; return the change of the heading since the last one [rad]."""
        self._count += 1
        dt = max(0.0, reading.at - last.at)
        # The mean of the first readings, then a mean over the time constant.
        gain = min(1.0, max(dt / self._time_constant, 1.0 / self._count))
        # After a longer gap the rates are unknown.
        covered_time = dt if dt < self._time_constant else 0.0
        turn = (reading.yaw_rate + last.yaw_rate) / 2.0 * covered_time
        if reading.yaw is not None:
            heading = reading.yaw if self._heading is None else self._heading + turn
            correction = gain * wrap(reading.yaw - heading)
            turn += correction
            self._heading = heading + correction
        if reading.attitude is None:
            self.attitude = None
            return turn
        attitude = list(self.attitude or reading.attitude)
        for axis, measured in enumerate(reading.attitude):
            rate = (last.attitude_rates[axis] + reading.attitude_rates[axis]) / 2.0
            predicted = attitude[axis] + rate * covered_time
            attitude[axis] = predicted + gain * (measured - predicted)
        self.attitude = attitude[0], attitude[1]
        return turn


class VelocityIntegral:
    """The integral of the specific force less gravity, in the level frame of base_link."""

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        # Whether a reading had a specific force that could be used.
        self.is_available = False
        # Usual time between readings [s].
        self.period = 0.0
        # Time without a reading [s].
        self._silent_time = 0.0
        self.clear()
        self._is_complete = False

    def clear(self) -> None:
        """Begin the next interval."""
        # The time that the integral covers [s].
        self.span = 0.0
        self._velocity: Triple = (0.0, 0.0, 0.0)
        # Whether no reading is missing or invalid.
        self._is_complete = True

    def read(self, last: ImuReading, reading: ImuReading) -> None:
        """Integrate from reading to reading."""
        noise, dt, force = self._noise, reading.at - last.at, reading.force
        if not (
            force
            and last.attitude
            and reading.attitude
            and 0.0 < dt < noise.max_reading_gap
            # NaN compares with nothing.
            and all(abs(component) * dt < noise.max_impulse for component in force)
        ):
            self._is_complete = False
            return
        self.is_available = True
        self._is_complete &= dt <= noise.dropout_ratio * (self.period or dt)
        self.period += 0.05 * (dt - self.period) if self.period else dt
        roll = (last.attitude[0] + reading.attitude[0]) / 2.0
        pitch = (last.attitude[1] + reading.attitude[1]) / 2.0
        (level,) = gravity_aligned([force], roll, pitch)
        x, y, z = force
        up = -sin(pitch) * x + cos(pitch) * (sin(roll) * y + cos(roll) * z) - GRAVITY
        vx, vy, vz = self._velocity
        self._velocity = vx + level.real * dt, vy + level.imag * dt, vz + up * dt
        self.span += dt

    def take(self, seconds: float) -> Triple | None:
        """Return it over an interval [m/s]; None where readings are missing or invalid."""
        self._silent_time = 0.0 if self.span else self._silent_time + seconds
        is_valid = self._is_complete and self._silent_time <= self._noise.max_reading_gap
        return self._velocity if is_valid else None


class ImuPreintegration:
    """Accumulate readings of an IMU from one reading of the cranks to the next."""

    def __init__(self, noise: OdometryNoise) -> None:
        self._filter_time = noise.orientation_filter_time
        self.last: ImuReading | None = None
        # Variance of the yaw in its messages [rad^2].
        self.heading_variance = 0.0
        self.velocity = VelocityIntegral(noise)
        self._orientation = OrientationFilter(noise.orientation_filter_time)
        # Change of the heading since the last reading of the cranks [rad].
        self._turn = 0.0

    @property
    def filtered_heading_variance(self) -> float:
        """Return the variance of the heading after the filter [rad^2]; 0 without one."""
        if self.last is None or self.last.yaw is None:
            return 0.0
        return self.heading_variance * (self.velocity.period / (2.0 * self._filter_time))

    def read(self, reading: ImuReading) -> None:
        """Take a reading."""
        last = self.last or reading
        self.last = reading
        self._turn += self._orientation.update(last, reading)
        if reading.at != last.at:
            self.velocity.read(last, reading)

    def take(self, seconds: float) -> ImuIncrement | None:
        """Return the measurements since the last call, `seconds` ago; None without an IMU."""
        last = self.last
        if last is None:
            return None
        increment = ImuIncrement(
            self._turn,
            self._orientation.attitude,
            self.velocity.take(seconds),
            self.velocity.span,
            max(map(abs, (last.yaw_rate, *last.attitude_rates))),
        )
        self._turn = 0.0
        self.velocity.clear()
        return increment
