"""From a commanded motion to commands of the cranks, and what permits or stops it."""

from collections.abc import Mapping
from math import degrees, inf, isfinite

from klann_ros.gait import Steering, Twist2D

from .control_laws import CrankCommand, MotionFeedback, PhaseLock
from .faults import DiagnosticLevel, Fault, FaultKind, FaultLatch, Refusal, RefusalKind
from .feedback import CrankFeedback, SteadyClock, Watchdog
from .limits import MotionLimiter
from .loop import ControlLoop, EventLog
from .monitors import FollowingMonitor
from .settings import ControllerSettings


class Interlocks:
    """
    The permission to move, which is withdrawn by users and by an emergency stop.

    `is_active` is the state of a managed node, and `is_enabled` that of a servo drive: while it is
    disabled the cranks are commanded to stand. An emergency stop trips the `latch`. `steady` is
    a clock that always runs [s]; see `WalkController`.
    """

    def __init__(self, steady: SteadyClock | None = None) -> None:
        self.is_active = True
        self.is_enabled = True
        self.latch = FaultLatch()
        self._is_pressed = False
        # Age of the last message about the emergency stop, infinite before the first.
        self._e_stop_age = Watchdog(steady)

    def enable(self) -> str:
        """Permit motion; return the reason of a refusal, '' if it is permitted."""
        if not self.latch.fault:
            self.is_enabled = True
        return self.latch.reason

    def take_e_stop(self, *, is_pressed: bool, now: float) -> None:
        """Take the state of the emergency stop."""
        self._is_pressed = is_pressed
        self._e_stop_age.feed(now)

    def pause(self, now: float) -> None:
        """Excuse the silence of the emergency stop up to now: this process was paused."""
        if self._e_stop_age.age(now) < inf:
            self._e_stop_age.feed(now)

    def check(self, now: float, e_stop_timeout: float) -> None:
        """Trip the latch while the emergency stop is pressed, or silent for too long [s]."""
        silence = self._e_stop_age.age(now)
        if self._is_pressed:
            self._trip('e_stop is pressed')
        elif 0.0 < e_stop_timeout < silence < inf:
            self._trip(f'e_stop has been silent for {silence:.1f} s')

    def _trip(self, text: str) -> None:
        self.latch.trip(Fault(FaultKind.E_STOP, '', text))

    @property
    def hold_reason(self) -> str:
        """Return why users make the cranks stand, '' if they do not."""
        if not self.is_active:
            return 'inactive: it commands nothing'
        return '' if self.is_enabled else 'disabled: ~/enable permits motion'


STANDS = Twist2D(0.0, 0.0)


class CommandInput:
    """
    The commanded motion of a walker, and its age.

    `rejected`, `late` and `refused` count commands that were not finite or too old, and turns that
    it cannot follow.
    """

    def __init__(self, steady: SteadyClock | None) -> None:
        self.rejected = 0
        self.late = 0
        self.refused = 0
        self.watchdog = Watchdog(steady)
        self._motion = STANDS

    def motion(self, now: float, timeout: float) -> Twist2D:
        """Return the commanded motion; older than a timeout [s] it is none."""
        return STANDS if self.is_old(now, timeout) else self._motion

    def is_old(self, now: float, timeout: float) -> bool:
        """Return whether the last command is older than a timeout [s]."""
        return self.watchdog.age(now) > timeout

    def take(
        self, motion: Twist2D, now: float, age: float, delay: float, timeout: float
    ) -> Refusal | None:
        """Take a command with its age by the stamp, and its delay [s]; return a refusal."""
        if not (isfinite(motion.linear) and isfinite(motion.angular)):
            self.rejected += 1
            motion_text = f'{motion.linear:g} m/s, {motion.angular:g} rad/s'
            text = f'cmd_vel {motion_text} is rejected: not finite'
            return Refusal(RefusalKind.NOT_FINITE, text)
        late = ''
        if age > timeout:
            late = f'cmd_vel is {age:.1f} s old by its stamp: too late, or the clocks differ'
        elif delay > timeout:
            late = f'cmd_vel waited {delay:.1f} s while this process was paused: too late'
        if late:
            self.late += 1
            return Refusal(RefusalKind.LATE, late)
        self._motion = motion
        self.watchdog.feed(now, delay)
        return None

    def refuse_turn(self) -> Refusal:
        """Go straight on, as the walker cannot turn."""
        self.refused += 1
        self._motion = self._motion._replace(angular=0.0)
        text = 'it cannot turn: its legs share one crank, or all cranks are on one side'
        return Refusal(RefusalKind.CANNOT_TURN, text)


class WalkController:
    """
    Turn the cranks of a walker so that it moves as commanded.

    Times are of one control clock, which may be simulated. Timeouts run on the steady clock as
    well, so that they pass where the control clock stands still.

    `motion` is that for which the `cranks`, in the order of `Feet.joints`, are driven just now.
    They stand while a fault trips the `latch`, or the `interlocks` do not permit motion.
    `limits_hit` are the active limits.

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
        self.interlocks = Interlocks(steady)
        self.events = EventLog(steady)
        self.loop = ControlLoop(steady)
        self.commands = CommandInput(steady)
        self.motion = STANDS
        self._limiter = MotionLimiter(settings.limits)
        self.limits_hit: list[str] = []
        self.configure(settings)

    @property
    def latch(self) -> FaultLatch:
        """Return the latch of its faults."""
        return self.interlocks.latch

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
        motion = Twist2D(linear, angular)
        delay = self.commands.watchdog.delay(transport_age, now)
        refusal = self.commands.take(motion, now, age, delay, self.settings.cmd_vel_timeout)
        if refusal is not None:
            return refusal
        self.latch.command(is_motion=motion != STANDS)
        can_follow = angular == 0.0 or self.steering.can_turn
        return None if can_follow else self.commands.refuse_turn()

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
            reading = readings.get(crank.joint)
            if reading is None:
                continue
            jump_count = crank.jump_filter.accepted
            offset = crank.read(*reading, now, at=at, age=transport_age)
            if not offset:
                continue
            text = f'{crank.joint}: position offset of {_angle(offset)} accepted'
            if crank.jump_filter.accepted > jump_count:
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
        for watchdog in (self.commands.watchdog, *(crank.watchdog for crank in self.cranks)):
            watchdog.pause(now)
        self.interlocks.pause(now)
        if gap > self.settings.feedback_timeout:
            self.motion = STANDS

    def measure_motion(self, motion: Twist2D, seconds: float) -> None:
        """Compare the mean motion of the body over a time [s] with the commanded one."""
        rate_scale = self.lock.rate_scale
        commanded = Twist2D(self.motion.linear * rate_scale, self.motion.angular * rate_scale)
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
        commanded = self.commands.motion(now, self.settings.cmd_vel_timeout)
        target, self.limits_hit = self.settings.limits.motion(commanded, self.steering.rates)
        self.motion = self._limiter.approach(self.motion, target, gap)
        command = self.lock.step(gap, self._crank_rates(gap), self.positions)
        for monitor, rate in zip(self.monitors, command.velocity, strict=True):
            if fault := monitor.update(rate, gap, now):
                self.latch.trip(fault)
        if all(monitor.has_followed for monitor in self.monitors):
            self.latch.note_walk()
        return self._hold_position() if self.latch.fault else command

    def _reset_clock(self, now: float) -> None:
        """Forget the times of commands: a simulation has restarted."""
        self.commands.watchdog.clear()
        self.loop.reset_clock()
        for crank in self.cranks:
            received = min(crank.times.received, now)
            crank.times = crank.times._replace(received=received)
        if self.is_known:
            self._hold_position()

    def _restart(self, now: float) -> None:
        """Restart the set points at the measured angles, until these are current."""
        self._reset_set_points()
        # It would not have slowed down during the gaps.
        if self.commands.is_old(now, self.settings.cmd_vel_timeout):
            self.motion = STANDS
        targets = self.loop.targets_before or self.positions
        displacements = []
        for crank, target in zip(self.cranks, targets, strict=True):
            if crank.times.delay or crank.times.received < self.loop.resumed:
                # Readings from before the gap are as old as those that waited.
                return
            displacements.append(f'{crank.joint} {_angle(crank.position - target)}')
        text = f'the control loop was paused for {self.loop.gap:.1f} s'
        moved = ', '.join(displacements)
        self.events.add(f'{text}: set points restart at the measured angles ({moved})', now)
        self.loop.gap = 0.0

    @property
    def standstill(self) -> CrankCommand:
        """Return the command to stand at the measured angles."""
        return CrankCommand(tuple(self.positions), (0.0,) * len(self.cranks))

    def _hold_position(self) -> CrankCommand:
        """Stop at once; return the command."""
        self.motion = STANDS
        self._limiter.stop_rates()
        self._reset_set_points()
        for monitor in self.monitors:
            monitor.restart()
        return self.standstill

    def _reset_set_points(self) -> None:
        self.motion_feedback.reset()
        self.lock.reset(self.positions)

    def _crank_rates(self, dt: float) -> list[float]:
        """Return the rates of the cranks for the motion, within their limits [rad/s]."""
        corrected = self.motion_feedback.corrected(self.motion)
        angles = self.lock.targets or self.positions
        is_on_spot = not self.motion.linear
        rates = self.steering.planned_rates(corrected, angles, on_spot=is_on_spot)
        max_change = self.settings.max_crank_acceleration * dt if self.motion != STANDS else inf
        return self.steering.crank_rates(self._limiter.limited_rates(rates, max_change))

    # Diagnostics.

    def verdict(self, now: float) -> tuple[DiagnosticLevel, str]:
        """Return the level, and the most important message."""
        if stopped := self.stop_reason(now):
            return DiagnosticLevel.ERROR, f'stopped: {stopped}'
        if warning := self._warning(now):
            return DiagnosticLevel.WARN, warning
        if self.motion == STANDS:
            is_old = self.commands.is_old(now, self.settings.cmd_vel_timeout)
            standing = 'standing: no cmd_vel' if is_old else 'standing'
            return DiagnosticLevel.OK, self.interlocks.hold_reason or standing
        return DiagnosticLevel.OK, 'walking'

    def _warning(self, now: float) -> str:
        """Return what a user should know of a walker that works, '' if there is nothing."""
        warnings = [
            self.loop.clock_warning(self.settings.max_gap),
            self.events.recent(now),
            self.lock.delay_warning,
            *(crank.units.suspicion for crank in self.cranks),
        ]
        for warning in filter(None, warnings):
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
        timeout = self.settings.feedback_timeout
        silent = [crank for crank in self.cranks if crank.age(now) > timeout]
        if silent:
            oldest = max(crank.age(now) for crank in silent)
            since = f'for {oldest:.1f} s' if oldest < inf else 'yet'
            repeats = any(crank.counts.repeats for crank in silent)
            cause = ': its stamp repeats' if repeats else ''
            joints = ', '.join(crank.joint for crank in silent)
            return f'no valid feedback of {joints} {since}{cause}'
        standing_time = self.loop.standing_time(now)
        if standing_time > timeout:
            return f'the clock has stood still for {standing_time:.1f} s'
        return ''

    def crank_figures(self, now: float) -> dict[str, str]:
        """Return the figures of each crank by name."""
        figures = dict[str, str]()
        phases = self.lock.phases()
        for index, crank in enumerate(self.cranks):
            figures[f'{crank.joint} phase_error'] = f'{self.lock.errors[index]:.5f}'
            figures[f'{crank.joint} off_gait'] = f'{phases[index]:.4f}'
            figures |= crank.figures(now)
        return figures

    @property
    def figures(self) -> dict[str, str]:
        """Return the figures of the control for diagnostics, by name."""
        return {
            'linear': f'{self.motion.linear:.4f}',
            'angular': f'{self.motion.angular:.4f}',
            'rate_scale': f'{self.lock.rate_scale:.3f}',
            'feedback_delay': f'{self.lock.delay:.3f}',
            'pauses': str(self.loop.pauses),
            'limits_hit': ' '.join(self.limits_hit),
            'cmd_vel_rejected': str(self.commands.rejected),
            'cmd_vel_late': str(self.commands.late),
            'cmd_vel_refused': str(self.commands.refused),
        }


def _angle(radians: float) -> str:
    return f'{radians:+.3f} rad ({degrees(radians):+.1f} deg)'
