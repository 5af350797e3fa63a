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
from dataclasses import dataclass, field
from math import atan2, copysign, cos, inf, pi, sin
from typing import NamedTuple

from klann_ros.gait.steering import Rates, Twist2D
from klann_ros.kinematics.angles import TURN

# The largest correction, as a part of the command, and that of the yaw rate in curves, whose plan
# may be off by more; and the largest lag, of which K times makes this part of the command.
MAX_SHARE, MAX_CURVE_SHARE, MAX_WINDUP = 0.5, 1.0, 3.0
# K of the yaw rate on the spot, where it comes evenly, as a multiple of that of the speed and of
# the yaw rate in curves. Chosen in MuJoCo, as those of `phase_map`.
SPOT_GAIN = 2.0
# A measurement over a longer time is not used [s].
MAX_INTERVAL = 0.1
# Greatest relative speed error of a motor that is learned.
INTEGRAL_LIMIT = 0.4
# All cranks slow down for one that lags by the first, and stop for one by the second [rad].
ERROR_SLOWDOWN, ERROR_STOP = 0.1, 0.3
# At rates below this little is learned of a motor [rad/s].
LEARNING_RATE = 0.2
# Sides whose rates differ by less than this part go straight on.
STRAIGHT = 1e-3
# Time constant of small phase corrections [s].
REPHASE_TIME = 1.0


@dataclass(frozen=True)
class MotionLimits:
    """
    What a walker may do.

    Attributes
    ----------
    max_linear, max_angular : float
        Of its speed [m/s] and yaw rate [rad/s].
    max_linear_acceleration, max_angular_acceleration : float
        Of their changes [m/s^2, rad/s^2].
    max_curvature : float
        Of its path [1/m]; infinite where it may turn on the spot.
    max_crank_rate : float
        Of each crank [rad/s].

    """

    max_linear: float = 0.3
    max_angular: float = 0.3
    max_linear_acceleration: float = 0.3
    max_angular_acceleration: float = 0.6
    max_curvature: float = inf
    max_crank_rate: float = 3.0

    def motion(self, wanted: Twist2D) -> tuple[Twist2D, list[str]]:
        """Return the motion that is allowed, on the same path, and what limits it."""
        hit = []
        linear, angular = wanted
        if abs(angular) > self.max_curvature * abs(linear):
            hit.append('max_curvature')
            most = self.max_curvature * abs(linear)
            angular = max(-most, min(most, angular))
        share = 1.0
        for name, value, most in (
            ('max_linear', linear, self.max_linear),
            ('max_angular', angular, self.max_angular),
        ):
            if abs(value) > most:
                hit.append(name)
                share = min(share, most / abs(value))
        return Twist2D(linear * share, angular * share), hit

    def rates(self, wanted: Rates) -> tuple[float, list[str]]:
        """Return which part of these rates the cranks can have, and what limits them."""
        fastest = max(map(abs, wanted))
        if fastest <= self.max_crank_rate:
            return 1.0, []
        return self.max_crank_rate / fastest, ['max_crank_rate']

    def approach(self, now: Twist2D, wanted: Twist2D, dt: float) -> Twist2D:
        """Return the motion after a time; both parts approach the command in proportion."""
        linear, angular = wanted.linear - now.linear, wanted.angular - now.angular
        share = min(
            1.0,
            self.max_linear_acceleration * dt / abs(linear) if linear else 1.0,
            self.max_angular_acceleration * dt / abs(angular) if angular else 1.0,
        )
        return Twist2D(now.linear + share * linear, now.angular + share * angular)


@dataclass(frozen=True)
class ControllerSettings:
    """
    Limits, timeouts and gains of the controller.

    Attributes
    ----------
    limits : MotionLimits
        Of its motion.
    cmd_vel_timeout, feedback_timeout : float
        Older commands, and older feedback of any crank, stop it [s].
    max_gap : float
        After a longer gap between two steps the set points restart at the measured angles [s].
    phase_lock : bool
        Whether cranks are kept in phase by their feedback.
    phase_gain, phase_integral : float
        P [1/s] and I [1/s^2] of the phase lock.
    rephase : float
        The part of its rate by which a crank goes faster or slower to get back into phase.
    motion_gain : float
        K of the motion feedback; 0 for no correction [1/s].

    """

    limits: MotionLimits = field(default_factory=MotionLimits)
    cmd_vel_timeout: float = 0.5
    feedback_timeout: float = 0.3
    max_gap: float = 0.2
    phase_lock: bool = True
    phase_gain: float = 4.0
    phase_integral: float = 4.0
    rephase: float = 0.1
    motion_gain: float = 0.5


class MotionFeedback:
    """
    Correct a commanded motion by the measured one.

    Parameters
    ----------
    gain : float
        K [1/s]; 0 for no correction.
    speed : float
        Of the walker, by its crank rate [m/rad].

    Attributes
    ----------
    lag : Twist2D
        The integral of commanded minus measured motion [m, rad].

    """

    def __init__(self, gain: float, speed: float) -> None:
        self.gain, self._step = gain, abs(speed) * pi
        self.reset()

    def reset(self) -> None:
        """Forget the lag."""
        self.lag = Twist2D(0.0, 0.0)

    def measure(self, commanded: Twist2D, measured: Twist2D, seconds: float) -> None:
        """Add the motion of a time [s]."""
        if not (self.gain and 0.0 < seconds <= MAX_INTERVAL):
            return
        limits = [MAX_WINDUP / self.gain * abs(each) for each in commanded]
        if _is_on_spot(commanded):
            limits[0] = self._step
        both = zip(self.lag, commanded, measured, limits, strict=True)
        self.lag = Twist2D(
            *(max(-most, min(most, lag + (is_ - was) * seconds)) for lag, is_, was, most in both)
        )

    def corrected(self, commanded: Twist2D) -> Twist2D:
        """Return the motion to drive for; straight on the yaw is not corrected."""
        linear, angular = commanded
        forwards, turn = (self.gain * lag for lag in self.lag)
        if _is_on_spot(commanded):
            return Twist2D(forwards, _corrected(angular, SPOT_GAIN * turn, MAX_SHARE))
        return Twist2D(
            _corrected(linear, forwards, MAX_SHARE), _corrected(angular, turn, MAX_CURVE_SHARE)
        )


def _is_on_spot(commanded: Twist2D) -> bool:
    return commanded.linear == 0.0 and commanded.angular != 0.0


def _corrected(wanted: float, correction: float, most: float) -> float:
    return wanted + copysign(min(abs(correction), most * abs(wanted)), correction)


class CrankCommand(NamedTuple):
    """
    What the cranks are to do.

    Attributes
    ----------
    position : tuple of float
        Where each is to be [rad].
    velocity : tuple of float
        The rate that its motor is to have [rad/s].

    """

    position: tuple[float, ...]
    velocity: tuple[float, ...]


class PhaseLock:
    """
    The lock of a walker's cranks.

    Parameters
    ----------
    senses, sides : sequence of float
        Which way each drives forwards, and on which side: see `Feet`.
    settings : ControllerSettings
        Gains and the limit of the crank rate; they can be replaced at any time.

    Attributes
    ----------
    targets : list of float
        The set points of the cranks [rad].
    errors : list of float
        Target - position, at the last step [rad].
    rate_scale : float
        Ratio of the targets' rates to the commanded ones: below 1 while they wait for a crank.

    """

    def __init__(
        self, senses: Sequence[float], sides: Sequence[float], settings: ControllerSettings
    ) -> None:
        self._senses, self._sides, self.settings = list(senses), list(sides), settings
        self._speed_errors = [0.0] * len(self._senses)
        self.targets: list[float] = []
        self.errors = [0.0] * len(self._senses)
        self.rate_scale = 1.0

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
        return [(phase - mean + pi) % TURN - pi for phase in phases]

    def step(self, dt: float, rates: Sequence[float], positions: Sequence[float]) -> CrankCommand:
        """
        Move the targets on, and return the command.

        Parameters
        ----------
        dt : float
            The time since the last step [s].
        rates : sequence of float
            The commanded crank rates [rad/s].
        positions : sequence of float
            Where they are [rad].

        """
        if not self.targets:
            self.reset(positions)
        moving, is_locked = list(rates), self.settings.phase_lock
        self.rate_scale = 1.0
        if is_locked:
            self.rate_scale = self._scale(rates, positions)
            moving = self._rephased([rate * self.rate_scale for rate in rates])
        self.targets = [t + r * dt for t, r in zip(self.targets, moving, strict=True)]
        self.errors = [t - p for t, p in zip(self.targets, positions, strict=True)]
        both = enumerate(zip(moving, rates, strict=True))
        velocities = moving
        if is_locked:
            velocities = [self._velocity(k, dt, rate, wanted) for k, (rate, wanted) in both]
        return CrankCommand(tuple(self.targets), tuple(velocities))

    def _velocity(self, k: int, dt: float, rate: float, commanded: float) -> float:
        """Return the rate of a crank [rad/s] whose target moves at `rate`."""
        error, limit = self.errors[k], abs(commanded)
        forward = rate * (1.0 + self._speed_errors[k])
        wanted = forward + self.settings.phase_gain * error
        most = self.settings.limits.max_crank_rate
        low, high = (0.0, most) if commanded >= 0.0 else (-most, 0.0)
        velocity = max(low, min(high, max(forward - limit, min(forward + limit, wanted))))
        # No wind-up: a saturated rate teaches nothing.
        if rate and (velocity == wanted or wanted * error < 0.0):
            learned = self._speed_errors[k]
            learned += (
                self.settings.phase_integral * error * rate / (rate**2 + LEARNING_RATE**2) * dt
            )
            self._speed_errors[k] = max(-INTEGRAL_LIMIT, min(INTEGRAL_LIMIT, learned))
        return velocity

    def _scale(self, rates: Sequence[float], positions: Sequence[float]) -> float:
        """Return 1, or less where a crank lags."""
        lags = (
            copysign(1.0, rate) * (target - position)
            for rate, target, position in zip(rates, self.targets, positions, strict=True)
            if rate
        )
        lag = max(lags, default=0.0)
        return min(1.0, max(0.0, (ERROR_STOP - lag) / (ERROR_STOP - ERROR_SLOWDOWN)))

    def _rephased(self, rates: Sequence[float]) -> list[float]:
        """Return the rates with what brings the cranks back into phase."""
        forwards = [sense * rate for sense, rate in zip(self._senses, rates, strict=True)]
        groups = [list(range(len(rates)))]
        if max(forwards) - min(forwards) > STRAIGHT * max(map(abs, forwards)):
            groups = [[k for k in groups[0] if self._sides[k] == side] for side in (-1, 0, 1)]
        changed = list(rates)
        for group in filter(None, groups):
            for k, off in zip(group, self.phases(group), strict=True):
                most = self.settings.rephase * abs(rates[k])
                changed[k] -= self._senses[k] * max(-most, min(most, off / REPHASE_TIME))
        return changed
