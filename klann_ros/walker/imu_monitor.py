"""Whether an IMU can be used: readings that repeat, and a yaw rate that the feet contradict."""

from collections.abc import Sequence
from enum import Enum
from math import exp

from .imu import ImuIncrement, ImuPreintegration, ImuReading
from .settings import OdometryNoise


class ImuState(Enum):
    """How an IMU is used, in the words of the diagnostics."""

    NONE = 'none'
    USED = 'used'
    FROZEN = 'frozen'
    CONTRADICTED = 'contradicted by the feet'


IMU_PROBLEMS = {
    ImuState.FROZEN: 'its IMU repeats the same reading',
    ImuState.CONTRADICTED: (
        'its IMU and its feet measure contrary yaw rates: check the axes, signs and units (rad/s)'
    ),
}


class Repetition:
    """Tells for which time stamps or readings have repeated."""

    def __init__(self) -> None:
        self._time = 0.0
        # While a queue is drained many readings of the cranks follow on one: that is none.
        self._is_repeated = False

    def read(self, *, is_same: bool) -> None:
        """Take a stamp or reading that is the same as the last one, or another one."""
        self._is_repeated = is_same
        if not is_same:
            self._time = 0.0

    def lasts(self, seconds: float, max_time: float) -> bool:
        """Return after some more seconds whether it has repeated for longer [s]."""
        self._time += seconds
        return self._is_repeated and self._time > max_time


class ImuMonitor:
    """
    Watch an IMU while it is used, and while it is not.

    It is frozen where its stamps repeat, or its readings while the cranks move. Its yaw rate is
    compared with that of the feet by least squares of their slip, over `yaw_window`: the turn of
    the feet is uncertain by a part of their slip, and where they slide by as much as it is.
    """

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        self.state = ImuState.NONE
        self._last: ImuReading | None = None
        self._stamp_repetition = Repetition()
        # Of readings but for their stamps.
        self._content_repetition = Repetition()
        # The cranks when the readings began to repeat [rad].
        self._cranks: Sequence[float] = ()
        # Turn of the feet, of the gyro less that of the feet, and slip at the reach [rad].
        self._feet_turn = 0.0
        self._excess_turn = 0.0
        self._slip_angle = 0.0
        # Time for which it has to be right before it is used again [s].
        self._wait = 0.0

    def read(self, reading: ImuReading) -> None:
        """Take a reading."""
        last, self._last = self._last, reading
        if self.state is ImuState.NONE:
            self.state = ImuState.USED
        is_old_stamp = last is not None and reading.at == last.at
        self._stamp_repetition.read(is_same=is_old_stamp)
        is_old_content = last is not None and reading._replace(at=last.at) == last
        self._content_repetition.read(is_same=is_old_content)
        if not is_old_content:
            self._cranks = ()

    def compare(
        self, feet_turn: float, gyro_turn: float, slip_angle: float, seconds: float
    ) -> None:
        """Take turns of a time [rad], and the slip of the feet by their reach [rad]."""
        decay = exp(-seconds / self._noise.yaw_window)
        self._feet_turn = decay * self._feet_turn + feet_turn
        excess_turn = decay * self._excess_turn + gyro_turn - feet_turn
        # A gyro in other units is right again some time.
        max_excess = 2.0 * self._noise.max_straight_turn
        self._excess_turn = max(-max_excess, min(max_excess, excess_turn))
        self._slip_angle = decay * self._slip_angle + slip_angle

    def update(self, cranks: Sequence[float], seconds: float) -> ImuState:
        """Return the state after a time [s] at angles of the cranks [rad]."""
        if self.state is ImuState.NONE:
            return self.state
        problem = self._problem(cranks, seconds)
        if problem:
            self.state = problem
            self._wait = self._noise.imu_recovery_time
        elif self.state is ImuState.FROZEN or abs(self._feet_turn) > self._noise.yaw_gate:
            # A turn shows that the gyro is right again; going straight shows nothing.
            self._wait -= seconds
        if self._wait <= 0.0:
            self.state = ImuState.USED
        return self.state

    def _problem(self, cranks: Sequence[float], seconds: float) -> ImuState | None:
        n = self._noise
        self._cranks = self._cranks or list(cranks)
        displacement = max(
            abs(angle - first) for angle, first in zip(cranks, self._cranks, strict=True)
        )
        stamp_repeats = self._stamp_repetition.lasts(seconds, n.max_repetition)
        content_repeats = self._content_repetition.lasts(seconds, n.max_repetition)
        if stamp_repeats or (content_repeats and displacement > n.stationary_angle):
            return ImuState.FROZEN
        gate = n.yaw_gate + n.yaw_slip_gate * self._slip_angle + abs(self._feet_turn)
        if abs(self._feet_turn) < n.yaw_gate:
            # An obstacle may turn a body whose feet go straight on.
            gate = max(gate, n.max_straight_turn)
        return ImuState.CONTRADICTED if abs(self._excess_turn) > gate else None


class ImuInput:
    """The IMU of the odometry, as long as its monitor lets it be used."""

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        self.monitor = ImuMonitor(noise)
        # Its readings, also while it is not used.
        self.readings = ImuPreintegration(noise)
        # Turn of the feet since the last reading of the cranks, and slip by the reach [rad].
        self._feet_turn = 0.0
        self._slip_angle = 0.0
        # Mean yaw rate of the feet in the last interval, by least squares of their slip [rad/s].
        self.feet_yaw_rate = 0.0

    @property
    def is_used(self) -> bool:
        """Return whether it is used."""
        return self.monitor.state is ImuState.USED

    def forget(self) -> None:
        """Go on without it."""
        self.monitor = ImuMonitor(self._noise)
        self.readings = ImuPreintegration(self._noise)

    def read(self, reading: ImuReading, variance: float) -> None:
        """Take a reading, and the variance of its yaw, 0 if unknown [rad^2]."""
        self.monitor.read(reading)
        self.readings.heading_variance = variance or self._noise.heading_error**2
        self.readings.read(reading)

    def add_feet_motion(self, turn: float, slip_angle: float) -> None:
        """Take the turn of the feet in a step, and their slip by the reach [rad]."""
        self._feet_turn += turn
        self._slip_angle += slip_angle

    def take(
        self, cranks: Sequence[float], seconds: float, gyro_bias: float, *, is_moving: bool
    ) -> ImuIncrement | None:
        """Return what it measured since the last reading of the cranks, None if it is not used."""
        increment = self.readings.take(seconds)
        if increment is None:
            return None
        if is_moving:
            gyro_turn = increment.turn - gyro_bias * seconds
            self.monitor.compare(self._feet_turn, gyro_turn, self._slip_angle, seconds)
        self.feet_yaw_rate = self._feet_turn / seconds
        self._feet_turn = 0.0
        self._slip_angle = 0.0
        was_used = self.is_used
        self.monitor.update(cranks, seconds)
        if self.is_used and not was_used:
            # What it did meanwhile is no turn of the body.
            self.readings = ImuPreintegration(self._noise)
        return increment if was_used and self.is_used else None
