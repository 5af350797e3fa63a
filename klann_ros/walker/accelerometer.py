"""
How the velocity of a walker changes, from the accelerometer of an IMU.

What one feels is gravity_aligned by how the IMU says that it lies. An error of it, or of how it is
mounted, is a velocity that grows: it is learned while the walker rests, and until then nothing is
known.
"""

from math import cos, sin

from klann_ros.dynamics import GRAVITY

from .imu import ImuReading, Triple
from .slip import Flat
from .support import gravity_aligned

# A longer gap between readings invalidates the interval [s]; so does a gap longer than
# usual by this: what it span at each impact of a foot is lost with a message.
LONGEST, DROPOUT_RATIO = 0.03, 1.8
# Smoothing factor of the reading period.
PERIOD_SMOOTHING = 0.05
# Minimum and maximum calibration time at rest for the bias [s].
MIN_CALIBRATION_TIME, MAX_CALIBRATION_TIME = 0.5, 2.0
# A larger bias means other units or axes, or missing gravity [m/s^2].
MAX_BIAS = 1.0
# Larger impulses are rejected: the largest horizontal impact seen was a seventh of it [m/s].
MAX_IMPULSE = 1.0
# Time constant of the bias while walking: it drifts as it warms up [s].
BIAS_FILTER_TIME = 10.0


class Accelerometer:
    """Accelerometer bias estimation at standstill, and velocity increments since the last call."""

    def __init__(self) -> None:
        self._has = False
        # In base_link [m/s^2].
        self._bias: Triple = (0.0, 0.0, 0.0)
        self._rested, self._enough = 0.0, MIN_CALIBRATION_TIME
        self._usual = self._silent = 0.0
        self.miss()

    @property
    def _is_believed(self) -> bool:
        return self._rested >= self._enough and max(map(abs, self._bias)) < MAX_BIAS

    @property
    def state(self) -> str:
        """Return what becomes of it, in words."""
        if not self._has:
            return 'none'
        if self._is_believed:
            return 'used'
        wrong = self._enough > MIN_CALIBRATION_TIME or self._rested >= self._enough
        return 'not believed' if wrong else 'unknown until it rests'

    def miss(self) -> None:
        """Mark the interval as incomplete."""
        self._forget()
        self._missed = True

    def correct(self, corrected: Flat, seconds: float) -> None:
        """Learn of what friction corrects it by, level [m/s^2], for a time [s]."""
        (x, y, z), share = self._bias, seconds / BIAS_FILTER_TIME
        self._bias = x - share * corrected[0], y - share * corrected[1], z

    def reject(self) -> None:
        """Reject the bias and restart the calibration, for twice as long."""
        self._rested, self._enough = 0.0, 2.0 * self._enough

    def _forget(self) -> None:
        # Integral of the specific force without gravity: in base_link, and its horizontal part
        # without the bias [m/s].
        self._sum: Triple = (0.0, 0.0, 0.0)
        self._level: Flat = (0.0, 0.0)
        self._seconds, self._missed = 0.0, False

    def read(self, last: ImuReading, reading: ImuReading) -> None:
        """Take what it span from one reading to the next."""
        seconds = reading.at - last.at
        if seconds == 0.0:
            return
        if (
            reading.force is None
            or last.roll is None
            or last.pitch is None
            or reading.roll is None
            or reading.pitch is None
            or not 0.0 < seconds < LONGEST
            # NaN compares with nothing.
            or not all(abs(part) * seconds < MAX_IMPULSE for part in reading.force)
        ):
            self._missed = True
            return
        self._has = True
        self._missed |= seconds > DROPOUT_RATIO * (self._usual or seconds)
        self._usual += PERIOD_SMOOTHING * (seconds - self._usual) if self._usual else seconds
        roll, pitch = (last.roll + reading.roll) / 2.0, (last.pitch + reading.pitch) / 2.0
        x, y, z = reading.force
        x += GRAVITY * sin(pitch)
        y -= GRAVITY * sin(roll) * cos(pitch)
        z -= GRAVITY * cos(roll) * cos(pitch)
        sx, sy, sz = self._sum
        self._sum = sx + x * seconds, sy + y * seconds, sz + z * seconds
        ex, ey, ez = self._bias
        ((forwards, left),) = gravity_aligned([(x - ex, y - ey, z - ez)], roll, pitch)
        lx, ly = self._level
        self._level = lx + forwards * seconds, ly + left * seconds
        self._seconds += seconds

    def gained(self, seconds: float, *, rests: bool) -> Flat | None:
        """
        Return what the velocity of base_link has changed by since this was last asked.

        Parameters
        ----------
        seconds : float
            Since then.
        rests : bool
            Whether the walker does.

        Returns
        -------
        (float, float) or None
            In its level frame [m/s]; None where that is not known.

        """
        level, span, missed = self._level, self._seconds, self._missed
        self._silent = 0.0 if span else self._silent + seconds
        if span and rests:
            self._learn(span)
        self._forget()
        if missed or self._silent > LONGEST or not self._is_believed:
            return None
        return level

    def _learn(self, span: float) -> None:
        self._rested += span
        share = span / min(self._rested, MAX_CALIBRATION_TIME)
        (a, b, c), (x, y, z) = self._bias, self._sum
        self._bias = (
            a + share * (x / span - a),
            b + share * (y / span - b),
            c + share * (z / span - c),
        )
