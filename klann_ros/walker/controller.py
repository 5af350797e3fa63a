"""From a commanded motion to commands of the cranks, and what stops a walker."""

from collections.abc import Mapping
from math import degrees, inf, isfinite

from klann_ros.gait import Rates, Steering, Twist2D

from .control_laws import CrankCommand, MotionFeedback, PhaseLock
from .faults import DiagnosticLevel, FaultLatch, Refusal, RefusalKind
from .feedback import CrankFeedback, SteadyClock, Watchdog
from .interlocks import Interlocks
from .limits import MotionLimiter
from .loop import ControlLoop, EventLog
from .monitors import FollowingMonitor
from .settings import ControllerSettings

STANDS = Twist2D(0.0, 0.0)


class WalkController:
    """
    Turn the cranks of a walker so that it moves as commanded.

    Times are of one control clock, which may be simulated. Timeouts run on the steady clock as
    well, so that they pass where the control clock stands still.

    `motion` is that for which the `cranks`, in the order of `Feet.joints`, are driven just now.
    They stand while a fault trips the `latch`, or the `interlocks` do not permit motion.
    `rejected`, `late` and `refused` count commands that were not finite or too old, and turns that
    it cannot follow. `limits_hit` are the active limits.

    Parameters
    ----------
    steering : Steering
        The walker's.
    settings : ControllerSettings
        Limits, timeouts and gains.
    steady : callable, optional
        Returns the time of a clock that always runs [s]; not needed if the control clock does.

    """

    def __init__(
        self, steering: Steering, settings: ControllerSettings, steady: SteadyClock | None = None
    ) -> None:
        self.steering = steering
        feet = steering.feet
        self.cranks = [CrankFeedback(joint, inf, steady) for joint in feet.joints]
        self.monitors = [FollowingMonitor(crank, inf, inf) for crank in self.cranks]
        self.lock = PhaseLock(feet.senses.tolist(), feet.sides.tolist(), settings)
        self.motion_feedback = MotionFeedback(settings, steering.unit_motion)
        self.latch = FaultLatch()
        self.interlocks = Interlocks(self.latch, steady)
        self.events, self.loop = EventLog(steady), ControlLoop(steady)
        self._limiter = MotionLimiter(settings.limits)
        self.configure(settings)
        self.motion, self._wanted = STANDS, STANDS
        self.rejected = self.late = self.refused = 0
        self.limits_hit: list[str] = []
        self._command_age = Watchdog(steady)
        self._rates = Rates(0.0, 0.0)

    def configure(self, settings: ControllerSettings) -> None:
        """Replace limits, timeouts and gains."""
        self.settings = self.lock.settings = self.motion_feedback.settings = settings
        self.latch.auto_reset = settings.auto_reset
        self._limiter.limits = settings.limits
        for crank in self.cranks:
            crank.max_rate = 4.0 * settings.limits.max_crank_rate
        for monitor in self.monitors:
            monitor.configure(settings.max_following_error, settings.feedback_timeout)

    # Inputs.

    def command(
        self,
        linear: float,
        angular: float,
        now: float,
        age: float = 0.0,
        transport_age: float | None = None,
    ) -> Refusal | None:
        """
        Take a commanded motion [m/s, rad/s]; return why it is not followed, None if it is.

        `age` is that by its stamp, and `transport_age` that by the middleware's time of sending
        [s]; the clocks of sender and receiver may differ by any offset in the latter.
        """
        self.keep_alive(now)
        delay = self._command_age.delay(transport_age, now)
        if not (isfinite(linear) and isfinite(angular)):
            self.rejected += 1
            text = f'cmd_vel {linear:g} m/s, {angular:g} rad/s is rejected: not finite'
            return Refusal(RefusalKind.NOT_FINITE, text)
        if age > self.settings.cmd_vel_timeout:
            self.late += 1
            text = f'cmd_vel is {age:.1f} s old by its stamp: too late, or the clocks differ'
            return Refusal(RefusalKind.LATE, text)
        if delay > self.settings.cmd_vel_timeout:
            self.late += 1
            text = f'cmd_vel waited {delay:.1f} s while this process was paused: too late'
            return Refusal(RefusalKind.LATE, text)
        self._wanted = Twist2D(linear, angular)
        self._command_age.feed(now, delay)
        self.latch.command(is_motion=linear != 0.0 or angular != 0.0)
        if angular != 0.0 and not self.steering.can_turn:
            self.refused += 1
            self._wanted = Twist2D(linear, 0.0)
            text = 'it cannot turn: its legs share one crank, or all cranks are on one side'
            return Refusal(RefusalKind.CANNOT_TURN, text)
        return None

    def feedback(
        self,
        readings: Mapping[str, tuple[float, float | None]],
        now: float,
        at: float | None = None,
        transport_age: float | None = None,
    ) -> bool:
        """
        Take angles and rates of cranks by their joints; return whether encoders jumped.

        `at` is their own time by any clock [s]; `transport_age` as in `command`.
        """
        self.keep_alive(now)
        has_jumped = False
        for crank in self.cranks:
            reading, jumps = readings.get(crank.joint), crank.accepted_jumps
            if reading and (offset := crank.read(*reading, now, at=at, age=transport_age)):
                text = f'{crank.joint}: position offset of {_angle(offset)} accepted'
                if crank.accepted_jumps > jumps:
                    has_jumped = True
                    self.lock.reset(self.positions)
                    text += ', phases restart from there'
                self.events.add(text, now)
        return has_jumped

    def keep_alive(self, now: float) -> None:
        """Note that the control loop runs; whatever is called next may be the first in a while."""
        gap = self.loop.keep_alive(now)
        if self.settings.max_gap < gap < inf:
            self._pause(gap, now)
        self.interlocks.check(now, self.settings.e_stop_timeout)

    def _pause(self, gap: float, now: float) -> None:
        """Restart after a gap in the loop [s]: inputs may have waited in their queues."""
        self.loop.pause(gap, now, self.lock.targets)
        for watchdog in (self._command_age, *(crank.watchdog for crank in self.cranks)):
            watchdog.pause(now)
        self.interlocks.pause(now)
        if gap > self.settings.feedback_timeout:
            self.motion = STANDS

    def measured(self, motion: Twist2D, seconds: float) -> None:
        """Take the mean motion of the body over a time [s]."""
        pace = self.lock.rate_scale
        commanded = Twist2D(self.motion.linear * pace, self.motion.angular * pace)
        self.motion_feedback.measure(commanded, motion, seconds)

    @property
    def positions(self) -> list[float]:
        """Return the cranks' angles [rad]; NaN before the first feedback."""
        return [crank.position for crank in self.cranks]

    @property
    def is_known(self) -> bool:
        """Return whether all cranks gave feedback."""
        return all(crank.is_known for crank in self.cranks)

    # Outputs.

    def step(self, now: float) -> CrankCommand | None:
        """Return the command of the cranks at this time; None before all gave feedback."""
        self.keep_alive(now)
        if self.loop.time is not None and now < self.loop.time:
            self._reset_clock(now)
        gap = self.loop.step(now, self.settings.max_gap)
        if gap > self.settings.max_gap:
            self._pause(gap, now)
        self.limits_hit = []
        if not self.is_known:
            return None
        if self.stop_reason(now) or self.interlocks.hold_reason:
            return self._hold_position()
        if self.loop.gap:
            self._restart(now)
            gap = 0.0
        wanted = STANDS if self._is_command_old(now) else self._wanted
        limits = self.settings.limits
        aim, self.limits_hit = limits.motion(wanted, self.steering.rates)
        self.motion = self._limiter.approach(self.motion, aim, gap)
        command = self.lock.step(gap, self._crank_rates(gap), self.positions)
        for monitor, rate in zip(self.monitors, command.velocity, strict=True):
            if fault := monitor.update(rate, gap, now):
                self.latch.trip(fault)
        if all(monitor.has_followed for monitor in self.monitors):
            self.latch.note_walk()
        return self._hold_position() if self.latch.fault else command

    def _reset_clock(self, now: float) -> None:
        """Forget the times of commands: a simulation has restarted."""
        self._command_age.clear()
        self.loop.reset_clock()
        for crank in self.cranks:
            crank.received = min(crank.received, now)
        if self.is_known:
            self._hold_position()

    def _restart(self, now: float) -> None:
        """Restart the set points at the measured angles, until these are current."""
        self._reset_set_points()
        # It would not have slowed down during the gaps.
        if self._is_command_old(now):
            self.motion = STANDS
        # Readings from before the gap are as old as those that waited.
        if any(crank.delay or crank.received < self.loop.resumed for crank in self.cranks):
            return
        before = self.loop.targets_before or self.positions
        moved = ', '.join(
            f'{crank.joint} {_angle(crank.position - target)}'
            for crank, target in zip(self.cranks, before, strict=True)
        )
        text = f'the control loop was paused for {self.loop.gap:.1f} s'
        self.events.add(f'{text}: set points restart at the measured angles ({moved})', now)
        self.loop.gap = 0.0

    @property
    def standstill(self) -> CrankCommand:
        """Return the command to stand at the measured angles."""
        return CrankCommand(tuple(self.positions), (0.0,) * len(self.cranks))

    def _hold_position(self) -> CrankCommand:
        """Stop at once; return the command."""
        self.motion, self._rates = STANDS, Rates(0.0, 0.0)
        self._reset_set_points()
        for monitor in self.monitors:
            monitor.restart()
        return self.standstill

    def _reset_set_points(self) -> None:
        self.motion_feedback.reset()
        self.lock.reset(self.positions)

    def _is_command_old(self, now: float) -> bool:
        return self._command_age.age(now) > self.settings.cmd_vel_timeout

    def _crank_rates(self, dt: float) -> list[float]:
        """Return the rates of the cranks for the motion, within their limits [rad/s]."""
        wanted, targets = self.motion_feedback.corrected(self.motion), self.lock.targets
        rates = self.steering.planned_rates(
            wanted, targets or self.positions, on_spot=not self.motion.linear
        )
        most = self.settings.limits.max_crank_rate
        share = most / max(most, *map(abs, rates))
        most = self.settings.max_crank_acceleration * dt if self.motion != STANDS else inf
        left, right = (
            was + max(-most, min(most, share * rate - was))
            for was, rate in zip(self._rates, rates, strict=True)
        )
        self._rates = Rates(left, right)
        return self.steering.crank_rates(self._rates)

    # Diagnostics.

    def verdict(self, now: float) -> tuple[DiagnosticLevel, str]:
        """Return the level, and the most important message."""
        if stopped := self.stop_reason(now):
            return DiagnosticLevel.ERROR, f'stopped: {stopped}'
        if warning := self._warning(now):
            return DiagnosticLevel.WARN, warning
        if self.motion == STANDS:
            standing = f'standing{": no cmd_vel" * self._is_command_old(now)}'
            return DiagnosticLevel.OK, self.interlocks.hold_reason or standing
        return DiagnosticLevel.OK, 'walking'

    def _warning(self, now: float) -> str:
        """Return what a user should know of a walker that works, '' if there is nothing."""
        units = (crank.units.suspicion for crank in self.cranks)
        clock = self.loop.clock_warning(self.settings.max_gap)
        for warning in (clock, self.events.recent(now), self.lock.delay_warning, *units):
            if warning:
                return warning
        if self.lock.rate_scale < 1.0 and self.motion != STANDS:
            lags = [degrees(abs(error)) for error in self.lock.errors]
            joint = self.cranks[lags.index(max(lags))].joint
            return f'slowing down: {joint} lags by {max(lags):.0f} deg'
        return f'cmd_vel is limited by {", ".join(self.limits_hit)}' if self.limits_hit else ''

    def stop_reason(self, now: float) -> str:
        """Return why all cranks have to stand, '' if they need not."""
        if self.latch.fault:
            return self.latch.reason
        timeout, ages = self.settings.feedback_timeout, {c.joint: c.age(now) for c in self.cranks}
        silent = [joint for joint, age in ages.items() if age > timeout]
        if silent:
            oldest = max(ages.values())
            since = f'for {oldest:.1f} s' if oldest < inf else 'yet'
            repeats = any(crank.repeats for crank in self.cranks if crank.joint in silent)
            cause = ': its stamp repeats' if repeats else ''
            return f'no valid feedback of {", ".join(silent)} {since}{cause}'
        standing_time = self.loop.standing_time(now)
        if standing_time > timeout:
            return f'the clock has stood still for {standing_time:.1f} s'
        return ''


def _angle(radians: float) -> str:
    return f'{radians:+.3f} rad ({degrees(radians):+.1f} deg)'
