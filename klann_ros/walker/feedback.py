"""Crank encoders: plausibility, position offsets, ages of messages, and delays in queues."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, InitVar
from math import inf, isfinite, nan, sqrt
from statistics import median

from klann_ros.kinematics.angles import TURN

# Angles beyond this are no crank's [rad].
MAX_ANGLE = 1e6
# A crank may be off by this beyond what its greatest rate would have turned it [rad], ...
POSITION_MARGIN = 0.1
# ... and the time between two messages is never taken as less [s]: stamps and transport jitter.
MIN_DT = 0.02
# Rates beyond this multiple of the crank's greatest rate are rejected.
MAX_RATE_RATIO = 10.0
# Consecutive readings that confirm a position offset.
CONFIRMATIONS = 5
# Gate of reported offsets, in standard deviations of the encoder's noise, ...
NOISE_GATE = 6.0
# ... of which the least is assumed to be this [rad].
MIN_NOISE = 0.002
# Readings from which the noise is learned before any offset is judged; its averaging window.
NOISE_READINGS = 50
# Rates between readings whose median predicts the next one.
RATE_READINGS = 5
# The prediction is that far behind a crank that accelerates [rad/s^2], ...
MAX_ACCELERATION = 30.0
# ... so that readings further apart predict nothing [s].
MAX_INTERVAL = 0.5
# Returns the time of a clock that never stands still [s].
SteadyClock = Callable[[], float]
# Time after a pause during which messages are compared with those before it [s].
DRAIN_TIME = 1.0
# A message that waited for less is current [s].
FRESH_DELAY = 0.05
# The usual age of messages grows by no more than this from one to the next [s].
AGE_STEP = 0.05


class Watchdog:
    """
    The time since the last message of an input.

    Parameters
    ----------
    steady : callable, optional
        Returns the time of a clock that always runs [s]; needed where the control clock may stand
        still, as simulated time does.

    """

    def __init__(self, steady: SteadyClock | None = None) -> None:
        self._steady = steady
        self.clear()

    def feed(self, now: float, age: float = 0.0) -> None:
        """Take a message of a given age [s] at the control clock's time `now` [s]."""
        self._at = now - age
        self._steady_at = self._steady() - age if self._steady else self._at

    def age(self, now: float) -> float:
        """Return the time since the last message, by the clock that measured more of it [s]."""
        age = now - self._at
        return max(age, self._steady() - self._steady_at) if self._steady else age

    def clear(self) -> None:
        """Forget the last message: the age is infinite."""
        self._at = self._steady_at = -inf

    def rewind(self, now: float) -> None:
        """Follow the control clock back to an earlier time."""
        self._at = min(self._at, now)


class Backlog:
    """
    The delay of messages that waited in a queue while the process was paused.

    Clocks of publishers differ from the receiver's by any offset, so a message's age counts only
    relative to that of the last message before the pause, and for `DRAIN_TIME` after it.
    """

    def __init__(self) -> None:
        self._usual_age = inf
        self._end = -inf

    def pause(self, now: float) -> None:
        """Expect delayed messages: the process was paused until now [s]."""
        self._end = now + DRAIN_TIME

    def delay(self, age: float | None, now: float) -> float:
        """Return the delay of a message of a given age (None: unknown), 0 if it is current [s]."""
        if age is None:
            return 0.0
        # Before the first message clocks are taken to be the same.
        delay = age - (self._usual_age if self._usual_age < inf else 0.0)
        if now < self._end and delay >= FRESH_DELAY:
            return delay
        self._usual_age, self._end = min(age, self._usual_age + AGE_STEP), -inf
        return 0.0


class OffsetDetector:
    """
    Position offsets: steps of an angle that neither its rate nor its noise explains.

    The rate is the median of the last rates between readings, so that a step does not explain
    itself. A step counts if it is still there after `CONFIRMATIONS` readings; a glitch is not.

    Attributes
    ----------
    noise : float
        Standard deviation of the readings about their prediction [rad].

    """

    def __init__(self) -> None:
        self._variance, self._count = 0.0, 0
        self.restart()

    @property
    def noise(self) -> float:
        """Return the standard deviation of the prediction [rad]."""
        return max(MIN_NOISE, sqrt(self._variance))

    def restart(self) -> None:
        """Forget the readings; the noise stays."""
        self._rates: deque[float] = deque(maxlen=RATE_READINGS)
        self._steps: list[float] = []
        self._offset = 0.0
        self._position = self._at = nan

    def read(self, position: float, at: float) -> float:
        """Take an angle [rad] at its time [s]; return the offset [rad] accepted with it, or 0."""
        dt, step = at - self._at, position - self._position
        # NaN compares with nothing.
        if not 0.0 < dt < MAX_INTERVAL:
            self.restart()
        self._position, self._at = position, at
        if not 0.0 < dt < MAX_INTERVAL or len(self._rates) < RATE_READINGS:
            if 0.0 < dt < MAX_INTERVAL:
                self._rates.append(step / dt)
            return 0.0
        predicted = median(self._rates) * dt
        tolerance = NOISE_GATE * self.noise + MAX_ACCELERATION * dt**2
        self._learn_noise(step - predicted, tolerance)
        # A crank may stop at any time.
        excess = step - max(min(0.0, predicted), min(max(0.0, predicted), step))
        is_step = abs(excess) > tolerance and self._count > NOISE_READINGS
        if is_step:
            self._offset += step - predicted
        else:
            self._rates.append(step / dt)
            if not self._steps:
                return 0.0
        self._steps.append(step - predicted if is_step else excess)
        if len(self._steps) < CONFIRMATIONS:
            return 0.0
        # What follows a step confirms it; its own excess is acceleration.
        is_confirmed, offset = abs(sum(self._steps)) > tolerance, self._offset
        self._steps.clear()
        self._offset = 0.0
        return offset if is_confirmed else 0.0

    def _learn_noise(self, innovation: float, limit: float) -> None:
        self._count += 1
        share = 1.0 / min(self._count, NOISE_READINGS)
        square = innovation**2
        if self._count > NOISE_READINGS:
            # A step is not noise, though it may be the first sign of more noise.
            square = min(square, limit**2)
        self._variance += share * (square - self._variance)


@dataclass
class CrankFeedback:
    """
    The state of a crank by its encoder.

    Parameters
    ----------
    joint : str
        Its name.
    max_rate : float
        Its greatest rate [rad/s].
    steady : callable, optional
        Returns the time of a clock that always runs [s]; see `Watchdog`.

    Attributes
    ----------
    position : float
        The last accepted angle, without the encoder's whole turns [rad]; NaN before the first.
    velocity : float
        The rate in the message, or else from angle to angle [rad/s].
    at, received : float
        Time of the last accepted reading, and of its arrival by the control clock [s].
    delay : float
        Time for which that reading waited while the process was paused [s]; 0 if it is current.
    rejected, jumps, offsets : int
        Readings that were no angles; implausible steps; accepted position offsets.
    last_offset, offset_sum : float
        The last accepted offset, and the sum of all [rad].

    """

    joint: str
    max_rate: float
    steady: InitVar[SteadyClock | None] = None
    position: float = nan
    velocity: float = 0.0
    at: float = nan
    received: float = nan
    delay: float = 0.0
    rejected: int = 0
    jumps: int = 0
    accepted_jumps: int = 0
    offsets: int = 0
    last_offset: float = 0.0
    offset_sum: float = 0.0
    backlog: Backlog = field(default_factory=Backlog, repr=False)
    detector: OffsetDetector = field(default_factory=OffsetDetector, repr=False)
    _turns: float = field(default=0.0, repr=False)
    _outliers: list[float] = field(default_factory=list, repr=False)

    def __post_init__(self, steady: SteadyClock | None) -> None:
        """Connect the watchdog to its clock."""
        self.watchdog = Watchdog(steady)

    @property
    def is_known(self) -> bool:
        """Return whether there was a reading."""
        return isfinite(self.position)

    def age(self, now: float) -> float:
        """Return the age of the last reading [s]; infinite before the first."""
        return self.watchdog.age(now)

    def read(
        self,
        position: float,
        velocity: float | None,
        now: float,
        *,
        at: float | None = None,
        age: float | None = None,
    ) -> bool:
        """
        Take a reading; return whether a position offset was accepted with it.

        Parameters
        ----------
        position : float
            The encoder's angle [rad].
        velocity : float or None
            The rate in the message [rad/s].
        now : float
            Time of its arrival by the control clock [s].
        at : float, optional
            Its own time, by any clock [s].
        age : float, optional
            Its age by the clocks of publisher and receiver, which may differ [s].

        """
        if not (isfinite(position) and abs(position) <= MAX_ANGLE):
            self.rejected += 1
            return False
        delay = self.backlog.delay(age, now)
        times = now, now if at is None else at, delay
        if not self.is_known:
            self._accept(position, velocity, times)
            return False
        # An encoder that restarts after a turn has not moved the crank.
        unwrapped = position + self._turns
        whole = round((unwrapped - self.position) / TURN) * TURN
        step = unwrapped - whole - self.position
        # While a queue is drained, readings arrive faster than they were sent.
        elapsed = max(now - self.received, self.delay - delay, MIN_DT)
        possible = 1.5 * self.max_rate * elapsed + POSITION_MARGIN
        if abs(unwrapped - self.position) <= possible:
            whole, step = 0.0, unwrapped - self.position
        if abs(step) > possible and not self._is_confirmed(position, possible):
            return False
        offset = 0.0
        self._outliers.clear()
        self._turns -= whole
        if abs(step) > possible:
            turned = self.velocity * (times[1] - self.at)
            offset = step - turned if abs(turned) < possible else step
            # No rate follows from a jump.
            self.at = nan
            self.accepted_jumps += 1
            self.detector.restart()
        self._accept(position + self._turns, velocity, times)
        return self._add_offset(offset or self.detector.read(self.position, self.at))

    def _is_confirmed(self, position: float, possible: float) -> bool:
        """Hold an implausible angle back; return whether enough readings confirm it."""
        if self._outliers and abs(position - self._outliers[-1]) > possible:
            self._outliers.clear()
        if not self._outliers:
            self.jumps += 1
        self._outliers.append(position)
        return len(self._outliers) >= CONFIRMATIONS

    def _add_offset(self, offset: float) -> bool:
        if not offset:
            return False
        self.offsets += 1
        self.last_offset = offset
        self.offset_sum += offset
        return True

    def _accept(
        self, position: float, velocity: float | None, times: tuple[float, float, float]
    ) -> None:
        now, at, delay = times
        # NaN compares with nothing.
        if velocity is not None and abs(velocity) <= MAX_RATE_RATIO * self.max_rate:
            self.velocity = velocity
        elif at > self.at:
            self.velocity = (position - self.position) / (at - self.at)
        self.position, self.at, self.received, self.delay = position, at, now, delay
        self.watchdog.feed(now, delay)
