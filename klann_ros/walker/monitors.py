"""Monitors of a walker: cranks that follow their commands, their load, an upright body."""

from collections import deque
from math import acos, atan2, copysign, cos, degrees, hypot, inf, isfinite, nan, pi
from typing import NamedTuple

from klann_ros.dynamics import GRAVITY
from klann_ros.gait import Triple

from .faults import Fault, FaultKind
from .feedback import CrankFeedback
from .imu import ImuReading
from .low_pass import low_pass_gain

# Part of the commanded path that a crank moves at the least, in the window of the following error,
# and in one of half a turn; a healthy motor of an empty battery reaches half of its speed.
MIN_RATIO, MIN_SLIP_RATIO, SLIP_PATH = 0.1, 0.22, pi
# A crank whose path has this part of the commanded one, to the other side, turns the wrong way;
# and one whose velocities have the second says that it turns.
WRONG_WAY_RATIO, TURNING_RATIO = 0.2, 0.5
# A window has this number of an encoder's steps: a healthy crank then moves by one or more. Of an
# encoder that has not moved yet this step is assumed, that of 64 a turn [rad].
STEPS, COARSE_STEP = 3.5, 0.1
# Distance of the marks on the commanded path [rad].
MARK_DISTANCE = 0.002
# Readings that confirm a fault: more than those that confirm a position offset.
CONFIRMATIONS = 8
# A motor that reacts later, with a longer feedback_timeout, has a fault as well [s].
MAX_REACTION_TIME = 0.5
# An older reading shows nothing: its publisher may be paused, as a simulated motor is [s].
MAX_READING_AGE = 0.1
ADVICE = {
    FaultKind.WRONG_WAY: 'check the leads of its motor and the sign of its encoder',
    FaultKind.FROZEN: 'check its encoder',
    FaultKind.NOT_TURNING: 'it is blocked, or its motor or its encoder is not connected',
    FaultKind.SLIPPING: 'check its coupling, its load and its supply',
}
# A tilt that lasts for this time is no shock [s].
TILT_TIME = 0.2
# Time constant of the vertical by an accelerometer, which the feet shake [s].
VERTICAL_TIME = 0.5
# A mean specific force below this, over this time, is a free fall [m/s^2, s]: in 240 simulated
# walks (benchmarks/odometry.py) the least one was 7.4. A shock has no such limit: single readings
# of these walks reached 106.
FREE_FALL_FORCE, FREE_FALL_TIME = 3.0, 0.1


class PathMark(NamedTuple):
    """A point of the path of a crank, along the commanded sense."""

    # Of the control clock [s].
    time: float
    # The commanded path, the measured one, and that by the velocities of the feedback [rad].
    commanded: float
    measured: float
    by_velocity: float

    def since(self, first: 'PathMark') -> 'PathMark':
        """Return the paths since an earlier mark."""
        return PathMark(*(late - early for late, early in zip(self, first, strict=True)))


class PathWindow:
    """
    The last part of a commanded path, of a length [rad].

    The crank follows it if it moves by `min_ratio` of it.
    """

    def __init__(self, length: float, min_ratio: float) -> None:
        self.length, self.min_ratio = length, min_ratio
        self.marks: deque[PathMark] = deque()

    def add(self, mark: PathMark) -> None:
        """Take the next mark, and drop those that are not needed any more."""
        marks = self.marks
        marks.append(mark)
        while len(marks) > 1 and mark.commanded - marks[1].commanded >= self.length:
            marks.popleft()

    @property
    def commanded(self) -> float:
        """Return the commanded path that it contains [rad]."""
        return self.marks[-1].commanded - self.marks[0].commanded if self.marks else 0.0

    def is_followed(self, path: PathMark) -> bool:
        """Return whether a crank that is there has followed; yes while the path is too short."""
        commanded = self.commanded
        if commanded < self.length:
            return True
        return path.measured - self.marks[0].measured >= self.min_ratio * commanded


class EncoderSteps:
    """
    The last steps of an encoder that were not 0: no smaller than its resolution.

    `offset` is the sum of the accepted position offsets that are more than steps [rad].
    """

    def __init__(self) -> None:
        self.offset = 0.0
        self._steps = deque([COARSE_STEP], maxlen=3)
        # Time of the last reading [s], its angle, and the sum of all accepted offsets [rad].
        self._time = nan
        self._position = nan
        self._offset_sum = 0.0

    @property
    def largest(self) -> float:
        """Return the largest of them [rad]."""
        return max(self._steps)

    def read(self, crank: CrankFeedback) -> bool:
        """Take the last reading of a crank; return whether it is new."""
        if crank.times.at == self._time:
            return False
        offset = crank.counts.offset_sum - self._offset_sum
        self.offset += offset if abs(offset) > 2.0 * self.largest else 0.0
        step = abs(crank.position - self._position)
        # NaN compares with nothing; a rounding error is no step.
        if step > 1e-6:
            self._steps.append(step)
        self._time = crank.times.at
        self._position = crank.position
        self._offset_sum = crank.counts.offset_sum
        return True


class FollowingMonitor:
    """
    Compare the path of a crank with the path that its motor was commanded.

    C is the integral of the commanded rate, after all slowing down for cranks that lag; M is the
    displacement of the encoder without accepted offsets; both along the commanded sense. A motor
    that reaches the part f of its commanded rate, with a delay of T or less, has

        M(t) - M(s) >= f (C(t - T) - C(s))

    at all times s < t while that sense stays the same, however slow it is. So a motor that obeys
    never has a following error, and one that does not has it at any rate. The velocities of the
    feedback only help to name the cause.

    The crank has to follow within the commanded path `max_error` [rad]; `reaction_time` is T [s].
    """

    def __init__(self, crank: CrankFeedback, max_error: float, reaction_time: float) -> None:
        self.crank = crank
        self.configure(max_error, reaction_time)
        self._steps = EncoderSteps()
        self._window = PathWindow(max_error, MIN_RATIO)
        self._turn_window = PathWindow(SLIP_PATH, MIN_SLIP_RATIO)
        self.restart()

    def configure(self, max_error: float, reaction_time: float) -> None:
        """Replace the commanded path [rad], and the greatest delay [s]."""
        self.max_error = max_error
        self.reaction_time = min(reaction_time, MAX_REACTION_TIME)

    @property
    def has_followed(self) -> bool:
        """Return whether the crank has just followed over half a turn."""
        return not self._errors and self._turn_window.commanded >= SLIP_PATH

    def restart(self, begin: float = -inf) -> None:
        """Forget the path; the next one begins at a time [s]."""
        self._begin = begin
        # The last command, and its sense: 0 before there is any [rad/s].
        self._rate = self._sense = 0.0
        self._path = PathMark(0.0, 0.0, 0.0, 0.0)
        # Marks whose commands may not have reached the motor yet.
        self._pending: deque[PathMark] = deque()
        self._window.marks.clear()
        self._turn_window.marks.clear()
        # Readings in a row that show a following error.
        self._errors = 0

    def update(self, rate: float, seconds: float, now: float) -> Fault | None:
        """Take the rate commanded from now on, after `seconds` of the last one [rad/s]."""
        crank, is_new = self.crank, self._steps.read(self.crank)
        if rate * self._sense < 0.0:
            # A motor that turns the other way has to stop first.
            self.restart(now + self.reaction_time)
        elif not rate and not self._pending:
            # At standstill it may be turned by hand.
            self.restart()
        last_rate, self._rate = self._rate, rate
        self._sense = copysign(1.0, rate) if rate else self._sense
        if not self._sense or now < self._begin or crank.age(now) > MAX_READING_AGE:
            return None
        self._path = path = PathMark(
            now,
            self._path.commanded + abs(last_rate) * seconds,
            self._sense * (crank.position - self._steps.offset),
            self._path.by_velocity + self._sense * crank.velocity * seconds,
        )
        pending = self._pending
        if not pending or path.commanded > pending[-1].commanded + MARK_DISTANCE:
            pending.append(path)
        self._window.length = max(self.max_error, STEPS * self._steps.largest)
        while pending and pending[0].time <= now - self.reaction_time:
            mark = pending.popleft()
            self._window.add(mark)
            self._turn_window.add(mark)
        if not is_new:
            return None
        follows = self._window.is_followed(path) and self._turn_window.is_followed(path)
        self._errors = 0 if follows else self._errors + 1
        return self._fault() if self._errors >= CONFIRMATIONS else None

    def _fault(self) -> Fault:
        """Return the fault of a crank that does not follow."""
        path = self._path
        is_slipping = self._window.is_followed(path)
        window = self._turn_window if is_slipping else self._window
        moved = path.since(window.marks[0])
        # What happened last may differ from what the window still contains of the time before.
        last = path.since(self._pending[0]) if self._pending else moved
        kind = FaultKind.NOT_TURNING
        if is_slipping:
            kind = FaultKind.SLIPPING
        elif any(part.measured < -WRONG_WAY_RATIO * part.commanded for part in (moved, last)):
            kind = FaultKind.WRONG_WAY
        elif last.by_velocity > TURNING_RATIO * last.commanded:
            kind = FaultKind.FROZEN
        measured, commanded = self._sense * moved.measured, self._sense * moved.commanded
        text = (
            f'{self.crank.joint} {kind.value} ({measured:+.2f} rad measured, '
            f'{commanded:+.2f} rad commanded): {ADVICE[kind]}'
        )
        return Fault(kind, self.crank.joint, text)


class BodyMonitor:
    """
    Watch by its IMU whether the body is upright, and whether it falls.

    The vertical is that of the orientation, or without one a mean of the specific force. `tilt` is
    that of the last reading [rad].
    """

    def __init__(self) -> None:
        self.tilt = 0.0
        self._was_upright = False
        # Time since which it is tilted [s].
        self._since = inf
        # Time of the last reading [s], and means of the force and of its norm [m/s^2].
        self._time = nan
        self._force = 0.0, 0.0, 0.0
        self._norm = 0.0
        # Whether its accelerometer measures gravity, in m/s^2.
        self._has_gravity = False

    def update(self, reading: ImuReading, now: float, max_tilt: float) -> Fault | None:
        """Take a reading that arrives at a time [s]; return a fault, by a greatest tilt [rad]."""
        if reading.force is not None and all(map(isfinite, reading.force)):
            self._average(reading.force, reading.at)
        if reading.attitude is not None:
            roll, pitch = reading.attitude
            self.tilt = acos(max(-1.0, min(1.0, cos(roll) * cos(pitch))))
        elif self._has_gravity:
            x, y, z = self._force
            self.tilt = atan2(hypot(x, y), z)
        if self._has_gravity and self._norm < FREE_FALL_FORCE:
            text = f'the body falls: its specific force is {self._norm:.1f} m/s^2'
            return Fault(FaultKind.FREE_FALL, '', text)
        if self.tilt <= max_tilt:
            self._was_upright, self._since = True, inf
            return None
        self._since = min(self._since, now)
        angle = f'{degrees(self.tilt):.0f} deg (max_tilt {degrees(max_tilt):.0f} deg)'
        if not self._was_upright:
            text = f'the IMU was never upright, it is tilted by {angle}'
            return Fault(FaultKind.TILTED, '', f'{text}: check its axes, or the robot lies')
        if now - self._since < TILT_TIME:
            return None
        return Fault(FaultKind.TILTED, '', f'the body is tilted by {angle}: it has fallen')

    def _average(self, force: Triple, time: float) -> None:
        """Take a specific force [m/s^2] at a time [s]."""
        norm = hypot(*force)
        passed = time - self._time
        # NaN compares with nothing: the first reading, and one of another clock, begin the means.
        if not 0.0 <= passed < VERTICAL_TIME:
            self._force, self._norm = force, norm
        gain = low_pass_gain(passed, VERTICAL_TIME)
        x, y, z = self._force
        x += gain * (force[0] - x)
        y += gain * (force[1] - y)
        z += gain * (force[2] - z)
        self._force = x, y, z
        self._norm += low_pass_gain(passed, FREE_FALL_TIME) * (norm - self._norm)
        # The mean of accelerations alone is 0.
        self._has_gravity |= hypot(x, y, z) > GRAVITY / 2.0
        self._time = time


# An effort beyond its limit for this time is an overload; impacts are shorter [s].
OVERLOAD_TIME = 0.5
# Longer steps between readings count as this, as their efforts are unknown [s].
MAX_READING_STEP = 0.1


class LoadMonitor:
    """The effort of the crank of a joint, as its driver gives it [N m]."""

    def __init__(self, joint: str) -> None:
        self._joint = joint
        # The last effort, NaN before the first.
        self.effort = nan
        # Time of the last reading by the control clock, and that of the overload so far [s].
        self._last_time = nan
        self._overload_time = 0.0

    def read(self, effort: float, now: float, max_effort: float) -> Fault | None:
        """Take an effort; return a fault if it has exceeded a limit (0: none) for too long."""
        step = now - self._last_time
        self.effort = effort
        self._last_time = now
        # NaN compares with nothing.
        if not 0.0 < max_effort < abs(effort):
            self._overload_time = 0.0
            return None
        if isfinite(step):
            self._overload_time += min(max(0.0, step), MAX_READING_STEP)
        if self._overload_time < OVERLOAD_TIME:
            return None
        self._overload_time = 0.0
        text = f'{self._joint} has an effort of {effort:+.3g} N m, beyond max_effort'
        return Fault(FaultKind.OVERLOAD, self._joint, f'{text} ({max_effort:g} N m)')
