"""Crank encoders: plausibility, position offsets, ages of messages, and delays in queues."""

from collections import deque
from collections.abc import Callable
from math import inf, isfinite, nan, sqrt
from statistics import median
from typing import ClassVar

from klann_ros.kinematics.angles import DEGREES, RPM, TURN

# Rates from angles are means over this time at least [s]: over less, noise of the encoders is
# motion at standstill, and readings in a bunch, stamped on arrival, are leaps.
RATE_INTERVAL = 0.045
# Returns the time of a clock that never stands still [s].
SteadyClock = Callable[[], float]


class Watchdog:
    """
    The age of an input's last message, and the delay of those that waited in a queue.

    It runs on the steady clock as well, where there is one: the control clock may stand still, as
    simulated time does. Clocks of publishers differ from the receiver's by any offset, so the age
    that a message has by these counts only relative to that of the last message before the process
    was paused, and for messages that were sent before the end of the pause.
    """

    def __init__(self, steady: SteadyClock | None = None) -> None:
        self._steady = steady
        self._usual_age, self._resumed = inf, -inf
        self.clear()

    def clear(self) -> None:
        """Forget the last message: the age is infinite."""
        self._at = self._steady_at = -inf

    def feed(self, now: float, delay: float = 0.0) -> None:
        """Take a message with a delay [s] at the control clock's time `now` [s]."""
        self._at = now - delay
        self._steady_at = self._steady_time(now) - delay

    def age(self, now: float) -> float:
        """Return the time since the last message, by the clock that measured more of it [s]."""
        # The control clock may go back, as that of a simulation which restarts.
        self._at = min(self._at, now)
        return max(now - self._at, self._steady_time(now) - self._steady_at)

    def _steady_time(self, now: float) -> float:
        return self._steady() if self._steady else now

    def pause(self, now: float) -> None:
        """Expect delayed messages: the process was paused until now [s]."""
        self._resumed = self._steady_time(now)

    def delay(self, transport_age: float | None, now: float) -> float:
        """Return the delay of a message [s], 0 if it is current or its age is unknown (None)."""
        if transport_age is None:
            return 0.0
        # Before the first message clocks are taken to be the same.
        delay = transport_age - (self._usual_age if self._usual_age < inf else 0.0)
        # Jitter of the transport; the usual age grows by no more from message to message. A queue
        # is drained within a second, unless a clock was set during the pause.
        jitter, resumed = 0.05, self._steady_time(now) - self._resumed
        if resumed < 1.0 and delay >= max(jitter, resumed):
            return delay
        self._usual_age = min(transport_age, self._usual_age + jitter)
        self._resumed = -inf
        return 0.0


class OffsetDetector:
    """
    Position offsets: steps of an angle that neither its rate nor its noise explains.

    The rate is the median of the last rates between readings, so that a step does not explain
    itself. A step counts if it is still there after `confirmations` readings; a glitch is not.
    """

    confirmations = 5
    # Gate of reported offsets, in standard deviations of the encoder's noise, of which the least
    # is assumed to be this [rad]; readings from which it is learned before any is judged.
    gate = 6.0
    least_noise = 0.002
    noise_readings = 50
    # Rates between readings whose median predicts the next one; the prediction is that far behind
    # a crank that accelerates [rad/s^2], and readings further apart predict nothing [s].
    rate_readings = 5
    max_acceleration = 30.0
    max_interval = 0.5

    def __init__(self) -> None:
        self._variance, self._count = 0.0, 0
        self.restart()

    @property
    def noise(self) -> float:
        """Return the standard deviation of the readings about their prediction [rad]."""
        return max(self.least_noise, sqrt(self._variance))

    def restart(self) -> None:
        """Forget the readings; the noise stays."""
        self._rates: deque[float] = deque(maxlen=self.rate_readings)
        self._steps: list[float] = []
        self._offset = 0.0
        self._position = self._at = nan

    def read(self, position: float, at: float, arrival_interval: float = 0.0) -> float:
        """
        Take an angle [rad] at its time [s]; return the offset [rad] accepted with it, or 0.

        `arrival_interval` is the time since the last one arrived [s]: a late reading may be
        younger than its stamp, as that of a broadcaster which stamps its cycle.
        """
        dt, step = at - self._at, position - self._position
        # NaN compares with nothing.
        is_next = 0.0 < dt < self.max_interval
        if not is_next:
            self.restart()
        self._position, self._at = position, at
        if len(self._rates) < self.rate_readings:
            if is_next:
                self._rates.append(step / dt)
            return 0.0
        predicted = median(self._rates) * dt
        tolerance = self.gate * self.noise + self.max_acceleration * dt**2
        self._learn_noise(step - predicted, tolerance)
        # A crank may stop at any time, and a late reading is of a later time.
        furthest = median(self._rates) * max(dt, min(arrival_interval, self.max_interval))
        excess = step - max(min(0.0, furthest), min(max(0.0, furthest), step))
        is_step = abs(excess) > tolerance and self._count > self.noise_readings
        if is_step:
            self._offset += step - predicted
        else:
            self._rates.append(step / dt)
            if not self._steps:
                return 0.0
        self._steps.append(step - predicted if is_step else excess)
        if len(self._steps) < self.confirmations:
            return 0.0
        # What follows a step confirms it; its own excess is acceleration.
        offset = self._offset if abs(sum(self._steps)) > tolerance else 0.0
        self._steps, self._offset = [], 0.0
        return offset

    def _learn_noise(self, innovation: float, limit: float) -> None:
        self._count += 1
        if self._count > self.noise_readings:
            # A step is not noise, though it may be the first sign of more noise.
            innovation = min(abs(innovation), limit)
        self._variance += (innovation**2 - self._variance) / min(self._count, self.noise_readings)


class UnitCheck:
    """
    Compare the angles of an encoder with its velocities, which may have other units.

    `suspicion` names the unit, '' without one.
    """

    # Angle by integral of velocity, of common mistakes.
    mistakes: ClassVar = {
        DEGREES: 'its angles may be in degrees',
        1.0 / DEGREES: 'its velocities may be in deg/s',
        1.0 / RPM: 'its velocities may be in rpm',
        1.0 / TURN: 'its angles may be in turns',
        TURN: 'its velocities may be in turns/s',
    }
    # The ratio is the median over this number of intervals [s] in which it turns [rad], and may be
    # off by this factor.
    intervals, interval, least_path, tolerance = 5, 0.25, 0.02, 1.2

    def __init__(self, joint: str) -> None:
        self._joint, self.suspicion = joint, ''
        self._ratios: deque[float] = deque(maxlen=self.intervals)
        # Angle [rad] and time [s] at the beginning of the interval, time of the last reading, and
        # path by the velocities since [rad].
        self._position, self._begin, self._time, self._path = nan, nan, nan, 0.0

    def read(self, position: float, velocity: float | None, time: float) -> None:
        """Take a reading as it is in the message, at a time [s]."""
        if velocity is None:
            return
        # NaN compares with nothing.
        if not 0.0 <= time - self._begin < 2.0 * self.interval:
            self._position, self._begin, self._time, self._path = position, time, time, 0.0
            return
        self._path += velocity * (time - self._time)
        self._time = time
        if time - self._begin < self.interval:
            return
        moved = abs(position - self._position)
        if abs(self._path) > self.least_path:
            self._ratios.append(moved / abs(self._path))
        self._position, self._begin, self._path = position, time, 0.0
        if len(self._ratios) < self.intervals:
            return
        ratio = median(self._ratios)
        for mistake, text in self.mistakes.items():
            if mistake < self.tolerance * ratio and ratio < self.tolerance * mistake:
                turns = f'{self._joint} moves {ratio:.2g} times as far as its velocity says'
                self.suspicion = f'{turns}: {text}'
        if 0.5 < ratio < 2.0:
            self.suspicion = ''


class CrankFeedback:
    """The state of the crank of a joint, with a greatest rate [rad/s], by its encoder."""

    def __init__(self, joint: str, max_rate: float, steady: SteadyClock | None = None) -> None:
        self.joint, self.max_rate = joint, max_rate
        # The last accepted angle, without the encoder's whole turns [rad]; NaN before the first.
        # And the rate in the message, or else from angle to angle [rad/s].
        self.position, self.velocity = nan, 0.0
        # Time of that reading, of its arrival by the control clock, and for which it waited while
        # the process was paused [s].
        self.at, self.received, self.delay = nan, nan, 0.0
        # Readings that were no angles; implausible steps, those accepted, and position offsets.
        self.rejected = self.jumps = self.accepted_jumps = self.offsets = 0
        # Messages since the last reading that had the stamp of that reading.
        self.repeats = 0
        # The sum of the accepted offsets [rad].
        self.offset_sum = 0.0
        self.watchdog, self.detector = Watchdog(steady), OffsetDetector()
        self.units = UnitCheck(joint)
        self._turns, self._outliers = 0.0, list[float]()
        # Angle and time from which its rate is computed.
        self._from = self._since = nan

    @property
    def is_known(self) -> bool:
        """Return whether there was a reading."""
        return isfinite(self.position)

    def age(self, now: float) -> float:
        """Return the age of the last reading [s]; infinite before the first."""
        return self.watchdog.age(now)

    def shift(self, offset: float) -> None:
        """Add an offset to the angle, whose zero has changed [rad]."""
        self.position += offset
        self._since = nan
        self.detector.restart()

    def read(
        self,
        position: float,
        velocity: float | None,
        now: float,
        *,
        at: float | None = None,
        age: float | None = None,
    ) -> float:
        """
        Take angle [rad] and rate [rad/s]; return the position offset accepted with them, or 0.

        They arrive at `now` by the control clock; `at` is their own time by any clock, and `age`
        that by the clocks of publisher and receiver, which may differ [s].
        """
        # NaN compares with nothing; larger angles are no crank's.
        if not abs(position) <= 1e6:
            self.rejected += 1
            return 0.0
        if at is not None and at == self.at:
            # A driver that repeats its last message has measured nothing.
            self.repeats += 1
            return 0.0
        self.repeats = 0
        self.units.read(position, velocity, now if at is None else at)
        delay = self.watchdog.delay(age, now)
        at = now if at is None else at
        offset = 0.0
        if self.is_known:
            # An encoder that restarts after a turn has not moved the crank.
            unwrapped = position + self._turns
            whole = round((unwrapped - self.position) / TURN) * TURN
            # While a queue is drained, readings arrive faster than they were sent.
            # Stamps and transport jitter: no time is less than 20 ms, and 0.1 rad are allowed.
            elapsed = max(now - self.received, self.delay - delay, 0.02)
            possible = 1.5 * self.max_rate * elapsed + 0.1
            if abs(unwrapped - self.position) <= possible:
                whole = 0.0
            step = unwrapped - whole - self.position
            if abs(step) > possible and not self._is_confirmed(position, possible):
                return 0.0
            self._outliers.clear()
            self._turns -= whole
            if abs(step) > possible:
                turned = self.velocity * (at - self.at)
                offset = step - turned if abs(turned) < possible else step
                # No rate follows from a jump.
                self._since = nan
                self.accepted_jumps += 1
                self.detector.restart()
        position += self._turns
        passed = at - self._since
        if velocity is not None and abs(velocity) <= 10.0 * self.max_rate:
            self.velocity = velocity
        elif passed >= RATE_INTERVAL:
            self.velocity = (position - self._from) / passed
        # NaN compares with nothing.
        if not 0.0 <= passed < RATE_INTERVAL:
            self._from, self._since = position, at
        arrival_interval = now - self.received
        self.position, self.at, self.received, self.delay = position, at, now, delay
        self.watchdog.feed(now, delay)
        offset = offset or self.detector.read(position, at, arrival_interval)
        self.offsets += offset != 0.0
        self.offset_sum += offset
        return offset

    def _is_confirmed(self, position: float, possible: float) -> bool:
        """Hold an implausible angle back; return whether enough readings confirm it."""
        if self._outliers and abs(position - self._outliers[-1]) > possible:
            self._outliers.clear()
        if not self._outliers:
            self.jumps += 1
        self._outliers.append(position)
        return len(self._outliers) >= self.detector.confirmations
