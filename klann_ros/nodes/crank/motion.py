"""The motion of a crank: parameters, and angle and rate as functions of time alone."""

from dataclasses import dataclass
from math import copysign, cos, floor, isfinite, pi, remainder, sin

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.errors import KinematicsError
from klann_ros.nodes.parameters import Declaration
from klann_ros.sanitize.text import refusal

MODES = ('constant', 'sine', 'sweep', 'step')
# Periods of sine, sweep and step [s].
_MIN_PERIOD, _MAX_PERIOD = 1e-6, 1e9
# Rate of the return of a bounded motion to its bounds, after a driver [rad/s].
_RETURN_RATE = 1.0


class CrankMotionError(KinematicsError, ValueError):
    """An invalid motion; the text says why."""


@dataclass(frozen=True, kw_only=True)
class CrankMotion:
    """
    The motion of a crank over time t; a CrankMotionError for an invalid one.

        constant  start + speed t
        sine      start + amplitude sin(2 pi frequency t)
        sweep     from start to start + amplitude and back, at speed
        step      start + amplitude k after k / frequency: a jump every 1 / frequency
    """

    mode: str = 'constant'
    # Crank rate of constant (signed) and sweep (its magnitude counts) [rad/s].
    speed: float = TURN
    # Crank angle at t = 0 [rad].
    start: float = 0.0
    # Size of sine, sweep and step, signed [rad].
    amplitude: float = pi / 6.0
    # Frequency of sine and step, > 0 [Hz].
    frequency: float = 0.5

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise CrankMotionError(refusal('mode', self.mode, f'one of {", ".join(MODES)}'))
        for name in ('speed', 'start', 'amplitude', 'frequency'):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and isfinite(value)):
                raise CrankMotionError(refusal(name, value, 'a finite number'))
        if self.mode in ('sine', 'step') and self.frequency <= 0.0:
            raise CrankMotionError(f'frequency = {self.frequency:g} Hz is refused: it must be > 0')
        if self.mode == 'sweep' and 0.0 in (self.speed, self.amplitude):
            raise CrankMotionError(
                'a sweep is refused without speed and amplitude: both must be other than 0'
            )
        if self.mode != 'constant' and not _MIN_PERIOD <= self.period <= _MAX_PERIOD:
            raise CrankMotionError(
                f'a period of {self.period:g} s is refused: '
                f'it must be within {_MIN_PERIOD:g} .. {_MAX_PERIOD:g} s'
            )

    @property
    def period(self) -> float:
        """Return the time of one turn (constant) or one period [s]; infinite at speed 0."""
        if self.mode == 'constant':
            return TURN / abs(self.speed) if self.speed else float('inf')
        if self.mode == 'sweep':
            return 2.0 * abs(self.amplitude / self.speed)
        return 1.0 / self.frequency

    def at(self, t: float) -> tuple[float, float]:
        """Return angle [rad] and rate [rad/s] at a time [s]; the rate of a step is 0."""
        if self.mode == 'constant':
            return self.start + self.speed * t, self.speed
        if self.mode == 'sine':
            phase = TURN * self.frequency * t
            rate = TURN * self.frequency * self.amplitude * cos(phase)
            return self.start + self.amplitude * sin(phase), rate
        if self.mode == 'sweep':
            half_periods = (t / self.period) % 1.0 * 2.0
            share = min(half_periods, 2.0 - half_periods)
            rate = 2.0 * self.amplitude / self.period
            return self.start + self.amplitude * share, rate if half_periods < 1.0 else -rate
        # Rounding of t must not postpone a jump.
        return self.start + self.amplitude * floor(self.frequency * t + 1e-9), 0.0


class ResumableMotion:
    """
    A motion that goes on where a driver has left the crank.

    `constant` goes on without bounds; the others return to theirs, step by step.
    """

    def __init__(self, motion: CrankMotion, steps_per_second: float) -> None:
        self._motion = motion
        self._steps_per_second = steps_per_second
        # Offset of the motion since a driver has turned the crank [rad].
        self._offset = 0.0

    def resume(self, t: float, angle: float) -> None:
        """Go on at a time [s] from an angle [rad]."""
        self._offset = angle - self._motion.at(t)[0]

    def step(self, t: float) -> tuple[float, float]:
        """Return angle [rad] and rate [rad/s] at the time of the next step [s]."""
        angle, rate = self._motion.at(t)
        if self._offset and self._motion.mode != 'constant':
            # Whole turns are not unwound.
            excess = remainder(self._offset, TURN)
            size = min(_RETURN_RATE / self._steps_per_second, abs(excess))
            self._offset -= copysign(size, excess)
            rate -= copysign(size * self._steps_per_second, excess)
        return angle + self._offset, rate


_DEFAULT = CrankMotion()
OUTPUTS = ('crank_angle', 'crank_state', 'crank_command')
MOTION = (
    Declaration('mode', _DEFAULT.mode, 'how the crank moves', choices=MODES),
    Declaration(
        'speed', _DEFAULT.speed, 'rate of constant and sweep [rad/s]', constraint='finite'
    ),
    Declaration('start', _DEFAULT.start, 'crank angle at the start [rad]', constraint='finite'),
    Declaration(
        'amplitude', _DEFAULT.amplitude, 'size of sine, sweep and step [rad]', constraint='finite'
    ),
    Declaration(
        'frequency', _DEFAULT.frequency, 'of sine and step [Hz]', constraint='finite, > 0'
    ),
)
CRANK_PARAMETERS = (
    *MOTION,
    Declaration('rate', 100.0, 'messages a second [Hz]', limits=(1e-3, 1e4)),
    Declaration('revolutions', 0.0, 'turns, or periods, until the node ends; 0: endless'),
    Declaration('output', 'crank_angle', 'the topic to publish', choices=OUTPUTS),
    Declaration('crank_joint', 'crank', 'name of the joint in crank_state and crank_command'),
    Declaration(
        'min_subscribers',
        0,
        'subscribers that the crank waits for, so that none misses the start',
        limits=(0, 1000),
    ),
)
