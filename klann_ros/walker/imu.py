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
from klann_ros.kinematics.angles import wrap

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
    up = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z
    roll, pitch = atan2(up[1], up[2]), atan2(-up[0], hypot(up[1], up[2]))
    yaw = atan2(2.0 * (x * y + w * z), w * w + x * x - y * y - z * z)
    a, b, c = angular
    # About the vertical of a body that is not rolled, and about its y axis.
    turning, tilting = sin(roll) * b + cos(roll) * c, cos(roll) * b - sin(roll) * c
    rate = cos(pitch) * turning - sin(pitch) * a
    return ImuReading(yaw, rate, at, (roll, pitch), (a + tan(pitch) * turning, tilting), force)


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


class ImuPreintegration:
    """Accumulate readings of an IMU from one reading of the cranks to the next."""

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        self.last: ImuReading | None = None
        # Variance of the heading [rad^2].
        self.heading_variance = 0.0
        # Whether a reading had a specific force that could be used.
        self.has_accelerometer = False
        self._heading: float | None = None
        self._attitude: tuple[float, float] | None = None
        self._count = 0
        # Usual time between readings, and the time without one [s].
        self.period = self._silent = 0.0
        self._clear(is_complete=False)

    def _clear(self, *, is_complete: bool = True) -> None:
        self._turn = self._span = 0.0
        self._sum: Triple = (0.0, 0.0, 0.0)
        self._is_complete = is_complete

    def read(self, reading: ImuReading) -> None:
        """Take a reading."""
        last, self.last = self.last or reading, reading
        self._count += 1
        dt = max(0.0, reading.at - last.at)
        # The mean of the first readings, then a mean over the time constant.
        time = self._noise.orientation_filter_time
        share = min(1.0, max(dt / time, 1.0 / self._count))
        # After a longer gap the rates are unknown.
        known = dt if dt < time else 0.0
        turn = (reading.yaw_rate + last.yaw_rate) / 2.0 * known
        if reading.yaw is not None:
            heading = reading.yaw if self._heading is None else self._heading + turn
            correction = share * wrap(reading.yaw - heading)
            turn += correction
            self._heading = heading + correction
        self._turn += turn
        if reading.attitude is None:
            self._attitude = None
        else:
            before = self._attitude or reading.attitude
            rates = zip(before, last.attitude_rates, reading.attitude_rates, strict=True)
            moved = [angle + (p + q) / 2.0 * known for angle, p, q in rates]
            roll, pitch = (
                angle + share * (measured - angle)
                for angle, measured in zip(moved, reading.attitude, strict=True)
            )
            self._attitude = roll, pitch
        if reading.at != last.at:
            self._integrate_force(last, reading)

    def _integrate_force(self, last: ImuReading, reading: ImuReading) -> None:
        dt, force, noise = reading.at - last.at, reading.force, self._noise
        if not (
            force
            and last.attitude
            and reading.attitude
            and 0.0 < dt < noise.max_reading_gap
            # NaN compares with nothing.
            and all(abs(part) * dt < noise.max_impulse for part in force)
        ):
            self._is_complete = False
            return
        self.has_accelerometer = True
        self._is_complete &= dt <= noise.dropout_ratio * (self.period or dt)
        self.period += 0.05 * (dt - self.period) if self.period else dt
        roll, pitch = ((a + b) / 2.0 for a, b in zip(last.attitude, reading.attitude, strict=True))
        (level,) = gravity_aligned([force], roll, pitch)
        x, y, z = force
        up = -sin(pitch) * x + cos(pitch) * (sin(roll) * y + cos(roll) * z) - GRAVITY
        sx, sy, sz = self._sum
        self._sum = sx + level.real * dt, sy + level.imag * dt, sz + up * dt
        self._span += dt

    def take(self, seconds: float) -> ImuIncrement | None:
        """Return the measurements since the last call, `seconds` ago; None without an IMU."""
        last = self.last
        if last is None:
            return None
        self._silent = 0.0 if self._span else self._silent + seconds
        is_valid = self._is_complete and self._silent <= self._noise.max_reading_gap
        delta_velocity = self._sum if is_valid else None
        body_rate = max(map(abs, (last.yaw_rate, *last.attitude_rates)))
        taken = ImuIncrement(self._turn, self._attitude, delta_velocity, self._span, body_rate)
        self._clear()
        return taken
