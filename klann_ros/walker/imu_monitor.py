"""Whether an IMU can be used: readings that repeat, and a yaw rate that the feet contradict."""

from collections.abc import Sequence
from enum import Enum
from math import exp

from .imu import ImuReading
from .settings import OdometryNoise


class ImuState(Enum):
    """How an IMU is used, in the words of the diagnostics."""

    NONE = 'none'
    USED = 'used'
    FROZEN = 'frozen'
    CONTRADICTED = 'contradicted by the feet'


class ImuMonitor:
    """
    Watch an IMU while it is used, and while it is not.

    It is frozen where its stamps repeat, or its readings while the cranks move. Its yaw rate is
    compared with that of the feet by least squares of their slip, over `yaw_window`: the turn of
    the feet is uncertain by a part of their slip, and where they slide by as much as it is.

    Attributes
    ----------
    state : ImuState
        NONE before the first reading.

    """

    def __init__(self, noise: OdometryNoise) -> None:
        self._noise = noise
        self.state = ImuState.NONE
        self._last: ImuReading | None = None
        # Time for which stamps, and readings but for their stamps, have repeated [s]; and whether
        # there was a repetition: while a queue is drained many cranks' readings follow on one.
        self._stamp_time = 0.0
        self._content_time = 0.0
        self._has_old_stamp = False
        self._has_old_content = False
        # The cranks when the readings began to repeat [rad].
        self._cranks: Sequence[float] = ()
        # Turn of the feet, of the gyro less that of the feet, and slip at the reach [rad].
        self._feet_turn = 0.0
        self._excess = 0.0
        self._slip = 0.0
        # Time for which it has to be right before it is used again [s].
        self._wait = 0.0

    def read(self, reading: ImuReading) -> None:
        """Take a reading."""
        last, self._last = self._last, reading
        if self.state is ImuState.NONE:
            self.state = ImuState.USED
        self._has_old_stamp = last is not None and reading.at == last.at
        if not self._has_old_stamp:
            self._stamp_time = 0.0
        self._has_old_content = last is not None and reading._replace(at=last.at) == last
        if not self._has_old_content:
            self._content_time = 0.0
            self._cranks = ()

    def compare(self, feet_turn: float, gyro_turn: float, slip: float, seconds: float) -> None:
        """Take turns of a time [rad], and the slip of the feet by their reach [rad]."""
        decay = exp(-seconds / self._noise.yaw_window)
        self._feet_turn = decay * self._feet_turn + feet_turn
        excess = decay * self._excess + gyro_turn - feet_turn
        # A gyro in other units is right again some time.
        most = 2.0 * self._noise.max_straight_turn
        self._excess = max(-most, min(most, excess))
        self._slip = decay * self._slip + slip

    def update(self, cranks: Sequence[float], seconds: float) -> ImuState:
        """Return the state after a time [s] at angles of the cranks [rad]."""
        if self.state is ImuState.NONE:
            return self.state
        n = self._noise
        self._stamp_time += seconds
        self._content_time += seconds
        self._cranks = self._cranks or list(cranks)
        problem = self._problem(cranks)
        if problem:
            self.state = problem
            self._wait = n.imu_recovery_time
        elif self.state is ImuState.FROZEN or abs(self._feet_turn) > n.yaw_gate:
            # A turn shows that the gyro is right again; going straight shows nothing.
            self._wait -= seconds
        if self._wait <= 0.0:
            self.state = ImuState.USED
        return self.state

    def _problem(self, cranks: Sequence[float]) -> ImuState | None:
        n = self._noise
        moved = max(abs(a - b) for a, b in zip(cranks, self._cranks, strict=True))
        stamp_repeats = self._has_old_stamp and self._stamp_time > n.max_repetition
        content_repeats = self._has_old_content and self._content_time > n.max_repetition
        if stamp_repeats or (content_repeats and moved > n.stationary_angle):
            return ImuState.FROZEN
        gate = n.yaw_gate + n.yaw_slip_gate * self._slip + abs(self._feet_turn)
        if abs(self._feet_turn) < n.yaw_gate:
            # An obstacle may turn a body whose feet go straight on.
            gate = max(gate, n.max_straight_turn)
        return ImuState.CONTRADICTED if abs(self._excess) > gate else None
