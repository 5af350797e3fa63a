"""Crank encoders: plausibility, position offsets, ages of messages, and delays in queues."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isfinite, nan, sqrt
from statistics import median
from typing import ClassVar, NamedTuple

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
        # Usual age by the clocks of publisher and receiver, and steady time of the last pause [s].
        self._usual_age = inf
        self._resumed = -inf
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
        jitter = 0.05
        since_pause = self._steady_time(now) - self._resumed
        if since_pause < 1.0 and delay >= max(jitter, since_pause):
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
    # Gate of reported offsets, in standard deviations of the encoder's noise, of which at least
    # this is assumed [rad]; readings from which it is learned before any is judged.
    gate = 6.0
    min_noise = 0.002
    noise_readings = 50
    # Rates between readings whose median predicts the next one; the prediction is that far behind
    # a crank that accelerates [rad/s^2], and readings further apart predict nothing [s].
    rate_readings = 5
    max_acceleration = 30.0
    max_interval = 0.5

    def __init__(self) -> None:
        # Variance of the noise [rad^2], and the number of readings from which it is learned.
        self._variance = 0.0
        self._count = 0
        self.restart()

    @property
    def noise(self) -> float:
        """Return the standard deviation of the readings about their prediction [rad]."""
        return max(self.min_noise, sqrt(self._variance))

    def restart(self) -> None:
        """Forget the readings; the noise stays."""
        self._rates: deque[float] = deque(maxlen=self.rate_readings)
        # Excess of the readings since the first step, and the sum of the steps [rad].
        self._excesses: list[float] = []
        self._offset = 0.0
        # Angle [rad] and time [s] of the last reading.
        self._position = nan
        self._time = nan

    def read(self, position: float, time: float, arrival_interval: float = 0.0) -> float:
        """
        Take an angle [rad] at its time [s]; return the offset [rad] accepted with it, or 0.

        `arrival_interval` is the time since the last one arrived [s]: a late reading may be
        younger than its stamp, as one of a broadcaster which stamps its cycle.
        """
        dt = time - self._time
        step = position - self._position
        # NaN compares with nothing.
        is_next = 0.0 < dt < self.max_interval
        if not is_next:
            self.restart()
        self._position = position
        self._time = time
        if len(self._rates) < self.rate_readings:
            if is_next:
                self._rates.append(step / dt)
            return 0.0
        rate = median(self._rates)
        innovation = step - rate * dt
        tolerance = self.gate * self.noise + self.max_acceleration * dt**2
        self._learn_noise(innovation, tolerance)
        # A crank may stop at any time, and a late reading is of a later time.
        furthest = rate * max(dt, min(arrival_interval, self.max_interval))
        excess = step - max(min(0.0, furthest), min(max(0.0, furthest), step))
        is_step = abs(excess) > tolerance and self._count > self.noise_readings
        if is_step:
            self._offset += innovation
        else:
            self._rates.append(step / dt)
            if not self._excesses:
                return 0.0
        self._excesses.append(innovation if is_step else excess)
        if len(self._excesses) < self.confirmations:
            return 0.0
        # What follows a step confirms it; its own excess is acceleration.
        offset = self._offset if abs(sum(self._excesses)) > tolerance else 0.0
        self._excesses = []
        self._offset = 0.0
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
    intervals, interval, min_path, tolerance = 5, 0.25, 0.02, 1.2

    def __init__(self, joint: str) -> None:
        self._joint = joint
        self.suspicion = ''
        self._ratios: deque[float] = deque(maxlen=self.intervals)
        self._begin_interval(nan, nan)

    def _begin_interval(self, position: float, time: float) -> None:
        # Angle [rad] and time [s] at the beginning of the interval.
        self._position = position
        self._begin = time
        # Time of the last reading [s], and path by the velocities since the beginning [rad].
        self._time = time
        self._path = 0.0

    def read(self, position: float, velocity: float | None, time: float) -> None:
        """Take a reading as it is in the message, at a time [s]."""
        if velocity is None:
            return
        # NaN compares with nothing.
        if not 0.0 <= time - self._begin < 2.0 * self.interval:
            self._begin_interval(position, time)
            return
        self._path += velocity * (time - self._time)
        self._time = time
        if time - self._begin < self.interval:
            return
        distance = abs(position - self._position)
        if abs(self._path) > self.min_path:
            self._ratios.append(distance / abs(self._path))
        self._begin_interval(position, time)
        if len(self._ratios) < self.intervals:
            return
        ratio = median(self._ratios)
        for mistake, text in self.mistakes.items():
            if mistake < self.tolerance * ratio and ratio < self.tolerance * mistake:
                self.suspicion = (
                    f'{self._joint} moves {ratio:.2g} times as far as its velocity says: {text}'
                )
        if 0.5 < ratio < 2.0:
            self.suspicion = ''


class JumpFilter:
    """
    Steps of a crank by its encoder, which may restart after a turn, or jump.

    `turns` is what whole turns add to the encoder's angle [rad]; `jumps` and `accepted` count the
    implausible steps, and those that later readings confirmed.
    """

    confirmations = OffsetDetector.confirmations

    def __init__(self) -> None:
        self.turns = 0.0
        self.jumps = 0
        self.accepted = 0
        self._outliers: list[float] = []

    def step(self, position: float, last: float, max_step: float) -> float | None:
        """Return the step to an angle [rad]; None while it is held back as implausible."""
        unwrapped = position + self.turns
        step = unwrapped - last
        if abs(step) > max_step:
            # An encoder that restarts after a turn has not moved the crank.
            whole_turns = round(step / TURN) * TURN
            step = unwrapped - whole_turns - last
            if abs(step) > max_step:
                if not self._is_confirmed(position, max_step):
                    return None
                self.accepted += 1
            self.turns -= whole_turns
        self._outliers.clear()
        return step

    def _is_confirmed(self, position: float, max_step: float) -> bool:
        """Hold an implausible angle back; return whether enough readings confirm it."""
        if self._outliers and abs(position - self._outliers[-1]) > max_step:
            self._outliers.clear()
        if not self._outliers:
            self.jumps += 1
        self._outliers.append(position)
        return len(self._outliers) >= self.confirmations


class AngleRate:
    """The mean rate of a crank from angle to angle, over RATE_INTERVAL or more."""

    def __init__(self) -> None:
        # Angle [rad] and time [s] at the beginning of the interval.
        self._first = nan
        self._begin = nan

    def restart(self) -> None:
        """Begin with the next angle."""
        self._begin = nan

    def read(self, position: float, time: float) -> float | None:
        """Take an angle [rad] at a time [s]; return the rate [rad/s] at the end of an interval."""
        passed = time - self._begin
        # NaN compares with nothing.
        if 0.0 <= passed < RATE_INTERVAL:
            return None
        rate = (position - self._first) / passed if passed >= RATE_INTERVAL else None
        self._first = position
        self._begin = time
        return rate


class ReadingTimes(NamedTuple):
    """Times of a reading [s]."""

    # Of the measurement, by any clock.
    at: float = nan
    # Of its arrival by the control clock.
    received: float = nan
    # For which it waited while the process was paused.
    delay: float = 0.0


@dataclass
class ReadingCounts:
    """Counts of the readings of a crank."""

    # Readings that were no angles, and accepted position offsets.
    rejected: int = 0
    offsets: int = 0
    # The sum of the accepted offsets [rad].
    offset_sum: float = 0.0
    # Messages since the last reading that had the stamp of that reading.
    repeats: int = 0


class CrankFeedback:
    """The state of the crank of a joint by its encoder, up to `max_rate` [rad/s]."""

    def __init__(self, joint: str, max_rate: float, steady: SteadyClock | None = None) -> None:
        self.joint = joint
        self.max_rate = max_rate
        # The last accepted angle, without the encoder's whole turns [rad]; NaN before the first.
        self.position = nan
        # Its rate in the message, or else from angle to angle [rad/s].
        self.velocity = 0.0
        # The times of that reading; rejected and repeated readings, and position offsets.
        self.times = ReadingTimes()
        self.counts = ReadingCounts()
        self.watchdog = Watchdog(steady)
        self.detector = OffsetDetector()
        self.jump_filter = JumpFilter()
        self.units = UnitCheck(joint)
        self._rate = AngleRate()

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
        self._rate.restart()
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
            self.counts.rejected += 1
            return 0.0
        last = self.times
        if at is not None and at == last.at:
            # A driver that repeats its last message has measured nothing.
            self.counts.repeats += 1
            return 0.0
        self.counts.repeats = 0
        at = now if at is None else at
        self.units.read(position, velocity, at)
        times = ReadingTimes(at, now, self.watchdog.delay(age, now))
        offset = 0.0
        if self.is_known:
            max_step = self._max_step(times)
            step = self.jump_filter.step(position, self.position, max_step)
            if step is None:
                return 0.0
            if abs(step) > max_step:
                predicted = self.velocity * (at - last.at)
                offset = step - predicted if abs(predicted) < max_step else step
                # No rate follows from a jump.
                self._rate.restart()
                self.detector.restart()
        position += self.jump_filter.turns
        rate = self._rate.read(position, at)
        if velocity is not None and abs(velocity) <= 10.0 * self.max_rate:
            self.velocity = velocity
        elif rate is not None:
            self.velocity = rate
        self.position = position
        self.times = times
        self.watchdog.feed(now, times.delay)
        offset = offset or self.detector.read(position, at, now - last.received)
        self.counts.offsets += offset != 0.0
        self.counts.offset_sum += offset
        return offset

    def _max_step(self, times: ReadingTimes) -> float:
        """Return the largest plausible step of the angle since the last reading [rad]."""
        # While a queue is drained, readings arrive faster than they were sent.
        # Stamps and transport jitter: no time is less than 20 ms, and 0.1 rad are allowed.
        last = self.times
        elapsed = max(times.received - last.received, last.delay - times.delay, 0.02)
        return 1.5 * self.max_rate * elapsed + 0.1

    def figures(self, now: float) -> dict[str, str]:
        """Return its figures by name."""
        return {
            f'{self.joint} velocity': f'{self.velocity:.4f}',
            f'{self.joint} silent': f'{self.age(now):.2f}',
            f'{self.joint} rejected': str(self.counts.rejected),
            f'{self.joint} jumps': str(self.jump_filter.jumps),
            f'{self.joint} offsets': str(self.counts.offsets),
            f'{self.joint} offset_sum': f'{self.counts.offset_sum:.4f}',
            f'{self.joint} encoder_noise': f'{self.detector.noise:.5f}',
        }
