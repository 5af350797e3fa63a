"""
Control laws of a walker: limits and feedback of its motion, and the lock of its cranks' phases.

The speed of a walker at given crank rates depends on the floor, and on the phases of its cranks.
So the rates are those of command + K e, e being the integral of commanded minus measured motion.

With open-loop speed commands the motors drift out of phase, and a walker whose legs lose their
phases falls. Each crank has a target that moves at its commanded rate r, and gets the rate

    u = r (1 + i) + P e,   |P e| <= |r|,   e = target - position,   di/dt = I e / r,

cut so that it never has the opposite sign of r. So i is the relative speed error of the motor,
learned once for all speeds; a phase error is made up at no more than the commanded rate, by a
crank that is ahead by waiting, and at standstill not at all. If a crank lags for all that, all
targets slow down, until they wait for it.

In a curve left and right pass each other: that is how it turns. Straight on all are brought back
to the phases of the gait, so slowly that this turns the body little; cranks of one side always.
"""

from collections.abc import Sequence
from math import atan2, copysign, cos, pi, sin
from typing import NamedTuple

from klann_ros.gait import clip, Twist2D
from klann_ros.kinematics.angles import wrap

from .settings import ControllerSettings

# Greatest product of the proportional gain of the phase lock and the delay of the feedback [rad].
MAX_DELAY_PHASE = 0.6
# A larger delay is reported [s].
LATE_FEEDBACK = 0.15
# A larger delay by stamps is a difference of clocks [s]; share of a reading in the mean delay.
MAX_DELAY, DELAY_SHARE = 2.0, 0.02


class MotionFeedback:
    """
    Correct a commanded motion by the measured one.

    `unit_motion` is what the walker can do: its speed at 1 rad/s of all cranks, and its yaw rate
    at 1 rad/s of the sides against each other. In curves the motion comes in steps: the body
    turns and goes back and forth at some phases of its cranks alone, however slow the command.
    So the largest lag is the motion of half a turn of the cranks, and the correction is bounded
    by what the walker can do, not by the command alone.
    """

    def __init__(self, settings: ControllerSettings, unit_motion: Twist2D) -> None:
        self.settings = settings
        self._unit = Twist2D(abs(unit_motion.linear), abs(unit_motion.angular))
        self.reset()

    def reset(self) -> None:
        """Forget the lag, the integral of commanded minus measured motion [m, rad]."""
        self.lag = Twist2D(0.0, 0.0)

    def measure(self, commanded: Twist2D, measured: Twist2D, seconds: float) -> None:
        """Add the motion of a time [s]."""
        settings = self.settings
        # A measurement over a longer time says little about the motion within it.
        if not (settings.motion_gain and 0.0 < seconds <= 0.1):
            return
        if commanded.angular:
            max_lag = Twist2D(pi * self._unit.linear, pi * self._unit.angular)
        else:
            windup = settings.max_windup * abs(commanded.linear)
            max_lag = Twist2D(windup / settings.motion_gain, 0.0)
        linear = self.lag.linear + (commanded.linear - measured.linear) * seconds
        angular = self.lag.angular + (commanded.angular - measured.angular) * seconds
        self.lag = Twist2D(clip(linear, max_lag.linear), clip(angular, max_lag.angular))

    def corrected(self, commanded: Twist2D) -> Twist2D:
        """Return the motion to drive for; straight on the yaw is not corrected."""
        linear, angular = commanded
        s = self.settings
        forwards = s.motion_gain * self.lag.linear
        turn = s.motion_gain * self.lag.angular
        slowdown = s.max_correction * abs(linear)
        if not angular:
            return Twist2D(linear + clip(forwards, slowdown), 0.0)
        if not linear:
            # Never at rest, or it would stay in phases in which it does not turn.
            ratio = 1.0 + s.spot_gain * turn / angular
            ratio = max(1.0 / s.max_spot_ratio, min(s.max_spot_ratio, ratio))
            return Twist2D(forwards, ratio * angular)
        # In curves likewise: the walk goes on at a part of the commanded speed. It may turn back.
        speedup = abs(linear) + s.curve_correction * self._unit.linear
        faster = max(-slowdown, min(speedup, copysign(1.0, linear) * forwards))
        max_turn = abs(angular) + s.curve_correction * self._unit.angular
        return Twist2D(linear + copysign(1.0, linear) * faster, angular + clip(turn, max_turn))


class CrankCommand(NamedTuple):
    """What the cranks are to do: where each is to be [rad], and the rate of its motor [rad/s]."""

    position: tuple[float, ...]
    velocity: tuple[float, ...]


class PhaseLock:
    """
    The lock of a walker's cranks.

    `targets` are their set points, and `errors` target - position at the last step [rad];
    `delay` is that of the feedback by its stamps [s], for which the gains are reduced;
    `rate_scale` is the ratio of the targets' rates to the commanded ones, below 1 while they wait
    for a crank.

    Parameters
    ----------
    senses, sides : sequence of float
        Which way each drives forwards, and on which side: see `Feet`.
    settings : ControllerSettings
        Gains and the limit of the crank rate; they can be replaced at any time.

    """

    def __init__(
        self, senses: Sequence[float], sides: Sequence[float], settings: ControllerSettings
    ) -> None:
        self._senses = list(senses)
        self._sides = list(sides)
        self.settings = settings
        # The relative speed errors of the motors, i above.
        self._speed_errors = [0.0] * len(self._senses)
        self.targets: list[float] = []
        self.errors = [0.0] * len(self._senses)
        self.rate_scale = 1.0
        self.delay = 0.0

    def take_delay(self, delay: float) -> None:
        """Take the delay of a reading [s]; one of another clock says nothing."""
        if 0.0 <= delay < MAX_DELAY:
            self.delay += DELAY_SHARE * (delay - self.delay)

    @property
    def delay_warning(self) -> str:
        """Return that the feedback is late, '' if it is not."""
        if self.delay < LATE_FEEDBACK:
            return ''
        text = f'the feedback is {self.delay:.2f} s old by its stamps'
        return f'{text}: late, or the clocks differ; the phase lock is slow'

    def reset(self, positions: Sequence[float]) -> None:
        """Restart the set points at measured angles [rad]; learned speed errors stay."""
        self.targets = list(positions)
        self.errors = [0.0] * len(self._senses)

    def phases(self, group: Sequence[int] | None = None) -> list[float]:
        """
        Return by how much targets are off the gait's phase, within +-pi of their mean [rad].

        `group` holds indices of cranks; default: all.
        """
        group = range(len(self.targets)) if group is None else group
        if len(group) < 2 or not self.targets:
            return [0.0] * (len(group) or len(self._senses))
        phases = [self._senses[k] * self.targets[k] for k in group]
        mean = atan2(sum(map(sin, phases)), sum(map(cos, phases)))
        return [wrap(phase - mean) for phase in phases]

    def step(self, dt: float, rates: Sequence[float], positions: Sequence[float]) -> CrankCommand:
        """Move the targets on by a time [s] at rates [rad/s], and return the command."""
        if not self.targets:
            self.reset(positions)
        is_locked = self.settings.phase_lock
        self.rate_scale = self._scale(rates, positions) if is_locked else 1.0
        moving = [rate * self.rate_scale for rate in rates]
        if is_locked:
            moving = self._rephased(moving)
        # New lists: pauses remember the old ones.
        self.targets = [target + r * dt for target, r in zip(self.targets, moving, strict=True)]
        self.errors = [target - p for target, p in zip(self.targets, positions, strict=True)]
        velocities = moving
        if is_locked:
            velocities = [
                self._velocity(crank, dt, rate, rates[crank]) for crank, rate in enumerate(moving)
            ]
        return CrankCommand(tuple(self.targets), tuple(velocities))

    def _velocity(self, crank: int, dt: float, rate: float, commanded: float) -> float:
        """Return the rate of a crank [rad/s] whose target moves at `rate`."""
        settings, error, speed_error = self.settings, self.errors[crank], self._speed_errors[crank]
        limit = abs(commanded)
        forward = rate * (1.0 + speed_error)
        # Feedback that is late makes a larger gain swing.
        delay_phase = settings.phase_gain * self.delay
        gain_share = min(1.0, MAX_DELAY_PHASE / delay_phase) if delay_phase else 1.0
        requested = forward + gain_share * settings.phase_gain * error
        max_rate = settings.limits.max_crank_rate
        low, high = (0.0, max_rate) if commanded >= 0.0 else (-max_rate, 0.0)
        velocity = max(low, min(high, max(forward - limit, min(forward + limit, requested))))
        # No wind-up: a saturated rate teaches nothing.
        if rate and (velocity == requested or requested * error < 0.0):
            gain = gain_share**2 * settings.phase_integral
            speed_error += gain * error * rate / (rate**2 + settings.learning_rate**2) * dt
            self._speed_errors[crank] = clip(speed_error, settings.integral_limit)
        return velocity

    def _scale(self, rates: Sequence[float], positions: Sequence[float]) -> float:
        """Return 1, or less where a crank lags."""
        max_lag = 0.0
        for crank, rate in enumerate(rates):
            if rate:
                lag = copysign(1.0, rate) * (self.targets[crank] - positions[crank])
                max_lag = max(max_lag, lag)
        slowdown, stop = self.settings.error_slowdown, self.settings.error_stop
        return min(1.0, max(0.0, (stop - max_lag) / (stop - slowdown)))

    def _rephased(self, rates: Sequence[float]) -> list[float]:
        """Return the rates with what brings the cranks back into phase."""
        forwards = [sense * rate for sense, rate in zip(self._senses, rates, strict=True)]
        groups = [list(range(len(rates)))]
        # Sides whose rates are the same within rounding go straight on.
        if max(forwards) - min(forwards) > 1e-3 * max(map(abs, forwards)):
            groups = [[k for k in groups[0] if self._sides[k] == side] for side in (-1, 0, 1)]
        rephased = list(rates)
        for group in filter(None, groups):
            for crank, phase in zip(group, self.phases(group), strict=True):
                max_change = self.settings.rephase * abs(rates[crank])
                change = clip(phase / self.settings.rephase_time, max_change)
                rephased[crank] -= self._senses[crank] * change
        return rephased
