"""
A calculation as a student writes it: angles in degrees, each step recorded, or with one mistake.

A *slip* is a category, such as degrees for radians; a *mistake* is one instance of it, named SLIP
or SLIP:PLACE, such as 'radians:trig'. The course formulas with a mistake give the wrong answer of
that mistake, so that marking can name the slip.
"""

from collections.abc import Callable, Mapping
from math import acos, atan2, cos, degrees, floor, log10, pi, radians, sin
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import FloatArray
import numpy as np

Answer = float | str
Equations = Callable[[FloatArray], FloatArray]
# Maximum number of iterations; stopping correction, and that of convergence [deg].
MAX_STUDENT_ITERATIONS, STOP_STEP, CONVERGED_STEP = 12, 1e-2, 1e-7
HALF_TURN, TURN_DEG = 180.0, 360.0


class Step(NamedTuple):
    """
    An intermediate result.

    Attributes
    ----------
    symbol : str
        Name of the quantity.
    value : float
        Its value in `unit`.
    unit : str
        'mm', 'deg', ...; '1' for a number.
    formula : str
        The equation it follows from.

    """

    symbol: str
    value: float
    unit: str
    formula: str


class Calculation:
    """
    A calculation from givens in mm, deg, s and N.

    Parameters
    ----------
    givens : mapping of str to float
        The given numbers.
    mistake : str
        SLIP:PLACE; none by default.
    input_angle : str
        The given angle to which mistakes of the input apply.

    """

    def __init__(
        self, givens: Mapping[str, float], mistake: str = '', input_angle: str = ''
    ) -> None:
        self.mistake = mistake
        self.steps: list[Step] = []
        self.answers: dict[str, Answer] = {}
        self.givens, self._input = givens, input_angle
        slip, _, place = mistake.partition(':')
        self._digits = int(place) if slip == 'rounding' else 0
        self._entry = tuple(map(int, place.split(','))) if slip in ('f', 'phi') else ()

    def __getitem__(self, name: str) -> float:
        """Return a given number; the input angle with its mistake."""
        value = self.givens[name]
        if name == self._input:
            readings = {
                'clockwise:input': -value,
                'side:input': HALF_TURN - value,
                'side:half': HALF_TURN + value,
                # It exchanges sine and cosine of the input alone.
                'sine:input': 90.0 - value,
            }
            return readings.get(self.mistake, value)
        return value

    def many(self, *names: str) -> tuple[float, ...]:
        """Return several givens."""
        return tuple(self[name] for name in names)

    def sign(self, loop: int = 1) -> float:
        """Return +1, or -1 where this loop is closed in the other assembly mode."""
        slip, _, loops = self.mistake.partition(':')
        return -1.0 if slip == 'assembly' and str(loop) in loops else 1.0

    def cos(self, angle: float) -> float:
        """Return the cosine of an angle [deg]."""
        radian = angle if self.mistake == 'radians:trig' else radians(angle)
        return sin(radian) if self.mistake == 'sine:all' else cos(radian)

    def sin(self, angle: float) -> float:
        """Return the sine of an angle [deg]."""
        radian = angle if self.mistake == 'radians:trig' else radians(angle)
        return cos(radian) if self.mistake == 'sine:all' else sin(radian)

    def acos(self, cosine: float) -> float:
        """Return an angle from its cosine [deg]; a ValueError beyond +-1."""
        return self._angle(acos(cosine))

    def atan2(self, y: float, x: float) -> float:
        """Return the direction of (x, y), in (-180, 180] [deg]."""
        return self._angle(atan2(y, x))

    def _angle(self, radian: float) -> float:
        return radian if self.mistake == 'radians:trig' else degrees(radian)

    @property
    def half_turn(self) -> float:
        """Return 180 deg, or pi on a calculator set to radians."""
        return pi if self.mistake == 'radians:trig' else HALF_TURN

    def wrapped(self, angle: float) -> float:
        """Return an angle within half a turn of 0 [deg]."""
        return self.half_turn - (self.half_turn - angle) % (2.0 * self.half_turn)

    def step(self, symbol: str, value: float, unit: str, formula: str = '') -> float:
        """Record an intermediate result; return it, rounded if that is the mistake."""
        value = self._rounded(value)
        self.steps.append(Step(symbol, value, unit, formula))
        return value

    def answer(self, name: str, value: Answer, unit: str = '', formula: str = '') -> None:
        """Record an answer, which with a unit is a step as well."""
        self.answers[name] = value
        if unit and isinstance(value, float):
            self.steps.append(Step(name, value, unit, formula))

    def solve(self, phi: FloatArray, right: FloatArray) -> FloatArray:
        """Return Phi^-1 right [rad or rad/s], by this student."""
        solved: Any = np.linalg.solve(self._jacobian(phi), self._left(right))
        return -solved if self.mistake == 'sign:step' else solved  # type: ignore[no-any-return]

    def _jacobian(self, phi: FloatArray) -> FloatArray:
        if len(self._entry) == 2:
            phi = phi.copy()
            phi[self._entry] = -phi[self._entry]
        return self._all_rounded(phi.T if self.mistake == 'transposed' else phi)

    def _left(self, f: FloatArray) -> FloatArray:
        if len(self._entry) == 1:
            f = f.copy()
            f[self._entry[0]] = -f[self._entry[0]]
        return self._all_rounded(f)

    def newton(
        self, f: Equations, phi: Equations, guess: FloatArray, names: tuple[str, ...]
    ) -> None:
        """
        Iterate x_(k+1) = x_k - Phi^-1 f from a guess [deg].

        The answers are f and two entries of Phi at the guess, x_2, the converged x, and the number
        of iterations up to the first one whose corrections are all at most `STOP_STEP`.
        """
        for k, value in enumerate(self._left(f(guess)).tolist(), 1):
            self.answer(f'f_{k}', value, 'mm', f'f_{k}(x_1)')
        entries = self._jacobian(phi(guess)).tolist()
        for row, values in enumerate(entries, 1):
            for column, value in enumerate(values, 1):
                self.step(f'Phi_{row}{column}', value, 'mm', f'∂f_{row}/∂x_{column} (x_1)')
        self.answer('Phi_12', entries[0][1])
        self.answer('Phi_21', entries[1][0])
        x, count = [np.asarray(guess, dtype=float)], 0
        while len(x) <= MAX_STUDENT_ITERATIONS:
            correction = self.solve(phi(x[-1]), f(x[-1]))
            if self.mistake not in ('radians:step', 'radians:trig'):
                correction = np.degrees(correction)
            x.append(self._all_rounded(x[-1] - correction))
            for name, value in zip(names, x[-1].tolist(), strict=True):
                self.step(f'{name}_{len(x)}', value, 'deg', 'x_(k+1) = x_k - Φ⁻¹ f')
            largest = np.abs(correction).max()
            count = count or (len(x) - 1 if largest <= STOP_STEP else 0)
            if largest <= CONVERGED_STEP:
                break
        slip, _, place = self.mistake.partition(':')
        last = x[min(int(place), len(x) - 1)] if slip == 'short' else x[-1]
        second = x[0] if self.mistake == 'short:1' else x[1]
        for name, value in zip(names, second.tolist(), strict=True):
            self.answer(f'{name}_2', value)
        for name, value in zip(names, last.tolist(), strict=True):
            self.answer(name, value)
        self.answer('iterations', float(count))

    def use_other_root(
        self, position: Callable[['Calculation'], object], names: tuple[str, ...]
    ) -> None:
        """Answer with the root of the other assembly mode, as Newton may converge to it."""
        if self.mistake.startswith('assembly'):
            other = Calculation(self.givens, self.mistake, self._input)
            position(other)
            self.answers |= {name: other.answers[name] for name in names}

    def _all_rounded(self, values: FloatArray) -> FloatArray:
        if not self._digits:
            return values
        rounded: FloatArray = np.vectorize(self._rounded)(values)
        return rounded

    def _rounded(self, value: float) -> float:
        return significant(value, self._digits) if self._digits else float(value)


def significant(value: float, digits: int) -> float:
    """Return a value rounded to significant digits."""
    if value == 0.0 or not np.isfinite(value):
        return value
    return round(value, digits - 1 - floor(log10(abs(value))))


def newton_mistakes(count: int) -> tuple[str, ...]:
    """Return the mistakes of a sign in one equation, or in one entry of Phi, of n unknowns."""
    entries = [f'phi:{row},{column}' for row in range(count) for column in range(count)]
    return (*(f'f:{row}' for row in range(count)), *entries)


def slip_of(mistake: str) -> str:
    """Return the slip of a mistake."""
    slip = mistake.partition(':')[0]
    return 'sign' if slip in ('f', 'phi') else slip
