"""What an IMU says of how a body lies and turns."""

from math import atan2, hypot
from typing import NamedTuple

Triple = tuple[float, float, float]


class ImuReading(NamedTuple):
    """
    What an IMU on base_link says.

    Attributes
    ----------
    yaw : float or None
        [rad]; None without an orientation.
    yaw_rate : float
        About the vertical [rad/s].
    at : float
        When [s].
    roll, pitch : float or None
        [rad].
    roll_rate, pitch_rate : float
        What these change by [rad/s].
    force : (float, float, float) or None
        What its accelerometer feels, in base_link [m/s^2]: 9.8 upwards at rest, as in REP 145.

    """

    yaw: float | None
    yaw_rate: float
    at: float
    roll: float | None = None
    pitch: float | None = None
    roll_rate: float = 0.0
    pitch_rate: float = 0.0
    force: Triple | None = None


def imu_reading(
    orientation: tuple[float, float, float, float] | None,
    angular: Triple,
    at: float,
    force: Triple | None = None,
) -> ImuReading:
    """
    Return what an IMU says of a body whose base_link it is turned like.

    Parameters
    ----------
    orientation : (float, float, float, float), optional
        x, y, z, w.
    angular : (float, float, float)
        In base_link [rad/s].
    at : float
        When [s].
    force : (float, float, float), optional
        What its accelerometer feels, in base_link [m/s^2].

    """
    if orientation is None:
        return ImuReading(None, angular[2], at)
    x, y, z, w = orientation
    size = hypot(x, y, z, w)
    x, y, z, w = x / size, y / size, z / size, w / size
    # The last row of the rotation: what the body's axes rise by.
    up = (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
    yaw = atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    rate = sum(u * a for u, a in zip(up, angular, strict=True))
    level = hypot(up[1], up[2])
    roll, pitch = atan2(up[1], up[2]), atan2(-up[0], level)
    # Angular rates about the vertical and the horizontal axes.
    across = (up[2] * angular[1] - up[1] * angular[2]) / (level or 1.0)
    along = (up[1] * angular[1] + up[2] * angular[2]) / (level or 1.0)
    rolls = angular[0] - up[0] / (level or 1.0) * along
    return ImuReading(yaw, rate, at, roll, pitch, rolls, across, force)
