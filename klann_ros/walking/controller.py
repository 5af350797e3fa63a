"""From a wanted motion to commands of the cranks, and what stops a walker."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache
from math import degrees, hypot, inf, isfinite

from .feedback import CrankFeedback
from .limits import Limits
from .phase_lock import CrankCommand, INTEGRAL, PhaseLock, PROPORTIONAL
from .steering import Motion, Rates, Steering

# A crank that is told to turn, and turns at less than this part of that, for so long, is blocked.
BLOCKED_SHARE, BLOCKED_AFTER = 0.1, 0.5
# Told so little, it may well stand [rad/s].
CREEPING = 0.05
# A step is never longer than this, whatever stood still meanwhile [s].
LONGEST_STEP = 0.1
STANDS = Motion(0.0, 0.0)


class Level(Enum):
    """How a walker is."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Settings:
    """
    How a walker is controlled.

    Attributes
    ----------
    limits : Limits
        What it may do.
    cmd_vel_timeout, feedback_timeout : float
        Older commands, and older feedback of any crank, stop it [s].
    phase_lock : bool
        Whether cranks are kept in phase by their feedback.
    proportional, integral, rephase : float
        Of the lock: see `PhaseLock`.

    """

    limits: Limits = field(default_factory=Limits)
    cmd_vel_timeout: float = 0.5
    feedback_timeout: float = 0.3
    phase_lock: bool = True
    proportional: float = PROPORTIONAL
    integral: float = INTEGRAL
    rephase: float = 0.1


class WalkController:
    """
    Turn the cranks of a walker so that it moves as it is told.

    Times are of one clock, whichever; where it goes back, all begins anew.

    Parameters
    ----------
    steering : Steering
        The walker's.
    settings : Settings
        How.

    Attributes
    ----------
    cranks : list of CrankFeedback
        The cranks, in the order of `Feet.joints`.
    motion : Motion
        What it is made to do just now.
    rejected, late, refused : int
        Commands that were no numbers, that came too late, and to turn that it cannot follow.
    limits_hit : list of str
        What limits it just now.

    """

    def __init__(self, steering: Steering, settings: Settings) -> None:
        self.steering, self._settings = steering, settings
        feet = steering.feet
        # Half a second that the first command need not wait for.
        steering.rates(STANDS)
        self.cranks = [CrankFeedback(joint, 4.0 * self._fastest) for joint in feet.joints]
        self.lock = PhaseLock(
            feet.senses.tolist(),
            feet.sides.tolist(),
            max_rate=self._fastest,
            proportional=settings.proportional * settings.phase_lock,
            integral=settings.integral * settings.phase_lock,
            rephase=settings.rephase * settings.phase_lock,
        )
        # What is wanted is mostly what it was at the step before.
        self._limited = lru_cache(maxsize=1)(self._limit)
        self._rates = lru_cache(maxsize=1)(self._crank_rates)
        self.motion, self._wanted = STANDS, STANDS
        self._commanded = -inf
        self.rejected = self.late = self.refused = 0
        self.limits_hit: list[str] = []
        self._last: float | None = None
        self._since = [0.0] * len(self.cranks)
        self._told: Sequence[float] = [0.0] * len(self.cranks)
        self._blocked: list[str] = []
        self._jumped = ''

    @property
    def _fastest(self) -> float:
        return self._settings.limits.max_crank_rate

    # What comes in.

    def command(self, linear: float, angular: float, now: float, age: float = 0.0) -> str:
        """
        Take a wanted motion [m/s, rad/s]; return why it is not followed, '' if it is.

        `age` is how old it is, where it tells that [s].
        """
        if not (isfinite(linear) and isfinite(angular)):
            self.rejected += 1
            return f'cmd_vel {linear:g} m/s, {angular:g} rad/s is rejected: not finite'
        if age > self._settings.cmd_vel_timeout:
            self.late += 1
            return f'cmd_vel is {age:.1f} s old by its stamp: too late, or the clocks differ'
        self._wanted, self._commanded = Motion(linear, angular), now
        if linear == 0.0 and angular == 0.0:
            # Whoever has let go may try anew.
            self._blocked.clear()
            self._jumped = ''
        if angular != 0.0 and not self.steering.can_turn:
            self.refused += 1
            self._wanted = Motion(linear, 0.0)
            return 'it cannot turn: its legs share one crank, or all cranks are on one side'
        return ''

    def feedback(self, readings: Mapping[str, tuple[float, float | None]], now: float) -> bool:
        """Take angles and rates of cranks by their joints; return whether any was among them."""
        known = False
        for crank in self.cranks:
            reading = readings.get(crank.joint)
            if reading is None:
                continue
            known = True
            if crank.read(*reading, now):
                self._jumped = f'{crank.joint} jumped by {degrees(crank.jumped_by):.0f} deg'
                # Where it is, the lock goes on from.
                self.lock.reset(self.positions)
        return known

    @property
    def positions(self) -> list[float]:
        """Return the cranks' angles [rad]; NaN where one was never heard of."""
        return [crank.position for crank in self.cranks]

    @property
    def velocities(self) -> list[float]:
        """Return the cranks' rates [rad/s]."""
        return [crank.velocity for crank in self.cranks]

    # What goes out.

    def step(self, now: float) -> CrankCommand | None:
        """Return what the cranks are to do now; None while one was never heard of."""
        if self._last is not None and now < self._last:
            self._begin_anew(now)
        dt = 0.0 if self._last is None else min(now - self._last, LONGEST_STEP)
        self._last = now
        self.limits_hit = []
        if not all(crank.is_known for crank in self.cranks):
            return None
        if self.silent(now) or self._blocked:
            return self._halted()
        rates = self._rates(self._approach(now, dt))
        command = self.lock.step(dt, rates, self.positions)
        self._told = command.velocity
        self._look_for_blocked(dt)
        return self._halted() if self._blocked else command

    def _begin_anew(self, now: float) -> None:
        """Forget what was at other times: a simulation has begun again."""
        self._commanded = -inf
        self._last = None
        self.motion = STANDS
        for crank in self.cranks:
            crank.at = min(crank.at, now)

    def _halted(self) -> CrankCommand:
        """Return the command to stand where they are, at once."""
        self.motion = STANDS
        self.lock.reset(self.positions)
        self._since = [0.0] * len(self.cranks)
        self._told = [0.0] * len(self.cranks)
        return CrankCommand(tuple(self.positions), tuple(self._told))

    def _approach(self, now: float, dt: float) -> Motion:
        is_old = now - self._commanded > self._settings.cmd_vel_timeout
        aim, self.limits_hit = self._limited(STANDS if is_old else self._wanted)
        if self.motion != aim:
            self.motion = self._settings.limits.approach(self.motion, aim, dt)
        return self.motion

    def _limit(self, wanted: Motion) -> tuple[Motion, list[str]]:
        """Return the motion that is possible, and what limits it."""
        limits = self._settings.limits
        wanted, hit = limits.motion(wanted)
        share, slow = limits.rates(self.steering.rates(wanted))
        return Motion(wanted.linear * share, wanted.angular * share), hit + slow

    def _crank_rates(self, motion: Motion) -> list[float]:
        return self.steering.crank_rates(
            Rates(0.0, 0.0) if hypot(*motion) == 0.0 else self.steering.rates(motion)
        )

    def _look_for_blocked(self, dt: float) -> None:
        for k, crank in enumerate(self.cranks):
            told = abs(self._told[k])
            stuck = told > CREEPING and abs(crank.velocity) < BLOCKED_SHARE * told
            self._since[k] = self._since[k] + dt if stuck else 0.0
            if self._since[k] > BLOCKED_AFTER:
                self._blocked.append(crank.joint)

    def silent(self, now: float) -> list[str]:
        """Return the cranks whose feedback has stopped, or never began."""
        most = self._settings.feedback_timeout
        return [crank.joint for crank in self.cranks if crank.age(now) > most]

    def verdict(self, now: float) -> tuple[Level, str]:
        """Return how it is, and the most important thing to say."""
        stopped = self._stopped_by(now)
        if stopped:
            return Level.ERROR, f'stopped: {stopped}'
        if self._jumped:
            return Level.WARN, f'the encoder of {self._jumped}: phases are taken from there'
        if self.lock.pace < 1.0 and self.motion != STANDS:
            late = max(range(len(self.cranks)), key=lambda k: abs(self.lock.errors[k]))
            return Level.WARN, f'all wait for {self.cranks[late].joint}, which is behind'
        if self.limits_hit:
            return Level.WARN, f'cmd_vel is limited by {", ".join(self.limits_hit)}'
        if self.motion == STANDS:
            is_old = now - self._commanded > self._settings.cmd_vel_timeout
            return Level.OK, 'standing: no cmd_vel' if is_old else 'standing'
        return Level.OK, 'walking'

    def _stopped_by(self, now: float) -> str:
        silent = self.silent(now)
        if silent:
            age = max(crank.age(now) for crank in self.cranks)
            since = f'for {age:.1f} s' if age < inf else 'yet'
            return f'no feedback of {", ".join(silent)} {since}'
        if self._blocked:
            return f'{", ".join(self._blocked)} does not turn; a cmd_vel of 0 tries anew'
        return ''
