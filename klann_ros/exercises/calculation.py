"""
A calculation as a student writes it: angles in degrees, each step recorded, or with one mistake.

A *slip* is a category, such as degrees for radians; a *mistake* is one instance of it, named SLIP
or SLIP:PLACE, such as 'radians:trig'. The course formulas with a mistake give the wrong answer of
that mistake, so that marking can name the slip. `formulas` has the formulas.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from math import acos, atan2, cos, degrees, floor, hypot, inf, log10, nan, pi, radians, sin, sqrt
from pathlib import Path
from typing import Any, NamedTuple

from klann_ros.kinematics import peak
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.sanitize.yaml_text import parse_file
import numpy as np

Answer = float | str
DATA_FILE = Path(__file__).with_name('exercises.yaml')
HALF_TURN, TURN_DEG = 180.0, 360.0
# Determinant of rows of length 1 below which rounding decides whether a matrix has an inverse.
SINGULAR = 1e-12


class Step(NamedTuple):
    """
    An intermediate result: its name, its value in `unit`, and the equation it follows from.

    Units are 'mm', 'deg', ...; '1' is that of a number.
    """

    symbol: str
    value: float
    unit: str
    formula: str


class Calculation:
    """
    A calculation from givens in mm, deg, s and N, on which formulas are worked.

    Formulas use its functions, which have the student's mistake, SLIP:PLACE; angles are in
    degrees. Mistakes of the input apply to the given angle `input_angle`.
    """

    sqrt = staticmethod(sqrt)
    hypot = staticmethod(hypot)
    smallest: Any = staticmethod(min)
    largest: Any = staticmethod(max)

    def __init__(
        self, givens: Mapping[str, float], mistake: str = '', input_angle: str = ''
    ) -> None:
        self.mistake = mistake
        self.steps: list[Step] = []
        self.answers: dict[str, Answer] = {}
        self._givens = givens
        self._input = input_angle
        self._slip, _, self._place = mistake.partition(':')
        self._digits = int(self._place) if self._slip == 'rounding' else 0
        self._series = int(self._place) if self._slip == 'dither' else 0
        is_radian = mistake == 'radians:trig'
        self._to_rad, self._to_deg = (float, float) if is_radian else (radians, degrees)
        self._cosine, self._sine = (sin, cos) if mistake == 'sine:all' else (cos, sin)
        self.half_turn: Any = pi if is_radian else HALF_TURN
        # Numbers that formulas read are attributes: givens, with the mistake of the input angle,
        # and results.
        vars(self).update(givens)
        reading = data()['mistakes']['input'].get(mistake)
        if reading and input_angle in givens:
            setattr(self, input_angle, reading[0] * givens[input_angle] + reading[1])

    def __getattr__(self, name: str) -> Any:
        """Refuse the name of a number that is not there."""
        raise AttributeError(f'{name} is no given number and no result')

    def __getitem__(self, name: str) -> Any:
        """Return a given number, the input angle with its mistake, or a result."""
        return getattr(self, name)

    def read(self, names: str) -> list[Any]:
        """Return several numbers."""
        return [self[name] for name in names.split()]

    def cos(self, angle: Any) -> Any:
        """Return the cosine of an angle [deg]; its sine by a mistake."""
        return self._dithered(self._cosine(self._to_rad(angle)))

    def sin(self, angle: Any) -> Any:
        """Return the sine of an angle [deg]; its cosine by a mistake."""
        return self._dithered(self._sine(self._to_rad(angle)))

    def acos(self, cosine: Any) -> Any:
        """Return the angle of a cosine [deg]."""
        return self._to_deg(acos(cosine))

    def atan2(self, y: Any, x: Any) -> Any:
        """Return the angle of a vector [deg]."""
        return self._to_deg(atan2(y, x))

    def wrapped(self, angle: Any) -> Any:
        """Return an angle in (-180, 180] [deg]."""
        return self.half_turn - (self.half_turn - angle) % (2.0 * self.half_turn)

    def sign(self, loop: int) -> Any:
        """Return -1 where a loop is closed in the other assembly mode, else 1."""
        return -1.0 if self._slip == 'assembly' and str(loop) in self._place else 1.0

    def choose(self, condition: Any, if_true: Any, if_false: Any) -> Any:
        """Return one of two values."""
        return if_true if condition else if_false

    def require(self, *conditions: Any) -> None:
        """Raise a ValueError where a right calculation does not meet the conditions."""
        # A wrong calculation goes on, as its student does.
        if not self.mistake and not all(conditions):
            raise ValueError('the draw is not kept')

    def define(self, symbol: str, value: Any) -> Any:
        """Return a value that is no step, under a symbol."""
        self.answers[symbol] = value
        setattr(self, symbol, value)
        return value

    def result(self, symbol_and_unit: str, value: Any, formula: str) -> Any:
        """Record and return a step that is used as it is."""
        symbol, unit = symbol_and_unit.split()
        self.steps.append(Step(symbol, value, unit, formula))
        return self.define(symbol, value)

    def step(self, symbol_and_unit: str, value: Any, formula: str) -> Any:
        """Record and return a step, rounded if that is the mistake."""
        return self.result(symbol_and_unit, self._rounded(value), formula)

    def solve(
        self,
        symbols_and_unit: str,
        phi: Sequence[Sequence[Any]],
        right: Sequence[Any],
        formula: str,
        *,
        is_result: bool = False,
    ) -> None:
        """Record the solution of a linear system."""
        *symbols, unit = symbols_and_unit.split()
        record = self.result if is_result else self.step
        solution = self._solution(*self._written(phi, right))
        for symbol, value in zip(symbols, solution.tolist(), strict=True):
            record(f'{symbol} {unit}', value, formula)

    def _written(
        self, phi: Sequence[Sequence[Any]], right: Sequence[Any]
    ) -> tuple[FloatArray, FloatArray]:
        """Return matrix and right side of a linear system as this student writes them."""
        matrix: FloatArray = np.array(phi, dtype=np.float64)
        vector: FloatArray = np.array(right, dtype=np.float64)
        if self._slip == 'phi':
            row, column = map(int, self._place.split(','))
            matrix[row, column] *= -1.0
        elif self._slip == 'f':
            vector[int(self._place)] *= -1.0
        if self.mistake == 'transposed':
            matrix = matrix.T
        return self._all_rounded(matrix), self._all_rounded(vector)

    def _solution(self, phi: FloatArray, f: FloatArray) -> FloatArray:
        """Return Phi^-1 f [rad or rad/s], by this student; a LinAlgError where Phi is singular."""
        size = np.prod(np.linalg.norm(phi, axis=1))
        if abs(np.linalg.det(phi)) <= SINGULAR * size:
            raise np.linalg.LinAlgError('singular')
        solution = np.asarray(np.linalg.solve(phi, f), dtype=np.float64)
        return -solution if self.mistake == 'sign:step' else solution

    def newton(self, system: Any) -> None:
        """
        Iterate x_(k+1) = x_k - Phi^-1 f of a `formulas.EquationSystem` from a guess [deg].

        The answers are f and two entries of Phi at the guess, x_2, the converged x, and the number
        of iterations up to the first one whose corrections are all small. A right calculation
        must reach the root of the assembly mode that is drawn, in a fair number of iterations.
        """
        guess = np.array([self._givens[f'{name}_1'] for name in system.unknowns], dtype=float)
        phi, f = self._linearised(system, guess)
        for k, value in enumerate(f.tolist(), 1):
            self.result(f'f_{k} mm', value, f'f_{k}(x_1)')
        for (row, column), value in np.ndenumerate(phi):
            formula = f'∂f_{row + 1}/∂x_{column + 1} (x_1)'
            self.step(f'Phi_{row + 1}{column + 1} mm', float(value), formula)
        x, count = self._iterates(system, guess)
        last = x[min(int(self._place), len(x) - 1)] if self._slip == 'short' else x[-1]
        second = x[0] if self.mistake == 'short:1' else x[1]
        limits = data()['iterations']
        if np.abs(np.subtract(x[-1], x[-2])).max() > limits['lost']:
            last = [nan] * len(last)
        for n, name in enumerate(system.unknowns):
            self.answers[f'{name}_2'] = second[n]
            self.answers[name] = last[n]
        self.answers['iterations'] = float(count)
        if self.mistake and self._slip != 'assembly':
            return
        closed = Calculation(self._givens, self.mistake, self._input)
        system.position(closed)
        self.require(limits['fewest'] <= count <= limits['fair'])
        for name in system.unknowns:
            self.require(abs(closed[name] - self.answers[name]) <= limits['stop'])
            self.answers[name] = closed[name]

    def _linearised(self, system: Any, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return Phi and f at x."""
        vars(self).update(zip(system.unknowns, x.tolist(), strict=True))
        return self._written(system.phi(self), system.f(self))

    def _iterates(self, system: Any, guess: FloatArray) -> tuple[list[list[float]], int]:
        """Return the iterates, and the number of the first small correction; 0 if none is."""
        x = guess
        iterates = [guess.tolist()]
        count = 0
        limits = data()['iterations']
        while len(iterates) <= limits['most']:
            correction = self._solution(*self._linearised(system, x))
            if self.mistake not in ('radians:step', 'radians:trig'):
                correction = np.degrees(correction)
            x = self._all_rounded(x - correction)
            iterates.append(x.tolist())
            for name, value in zip(system.unknowns, iterates[-1], strict=True):
                self.step(f'{name}_{len(iterates)} deg', value, 'x_(k+1) = x_k - Φ⁻¹ f')
            largest = np.abs(correction).max()
            count = count or (len(iterates) - 1 if largest <= limits['stop'] else 0)
            if largest <= limits['converged']:
                break
        return iterates, count

    def sweep(self, formula: Callable[['Calculation'], None], extremes: Mapping[str, str]) -> None:
        """Answer with the differences of extremes over a turn of the input angle."""

        def calculated(angle: float) -> Calculation:
            givens = {**self._givens, self._input: angle}
            calculation = Calculation(givens, self.mistake, self._input)
            formula(calculation)
            return calculation

        spacing, printed = data()['table']['step'], data()['table']['printed']
        table = {float(angle): calculated(angle) for angle in range(0, 360, spacing)}
        for angle in range(0, 360, printed):
            for name in extremes.values():
                self.step(f'{name} mm', table[angle][name], f'α = {angle}°')

        def greatest(name: str, sense: float) -> float:
            near = max(table, key=lambda angle: sense * table[angle][name])
            angle = peak(
                lambda angle: sense * calculated(angle)[name], near - spacing, near + spacing
            )
            return float(sense * calculated(angle)[name])

        for answer, name in extremes.items():
            extent = greatest(name, 1.0) + greatest(name, -1.0)
            self.result(f'{answer} mm', extent, f'max {name} - min {name}')

    def _all_rounded(self, numbers: FloatArray) -> FloatArray:
        if not self._digits and not self._series:
            return numbers
        return np.asarray(np.vectorize(self._rounded)(numbers))

    def _rounded(self, number: Any) -> Any:
        if self._digits:
            # Without the last bits of a tie.
            return float(f'{float(f"{number:.11e}"):.{self._digits - 1}e}')
        return self._dithered(number)

    def _dithered(self, number: Any) -> Any:
        """Return a number with an error below half its third digit, by its size and a series."""
        if not self._series or not 0.0 < abs(number) < inf:
            return number
        second_digit = 10.0 ** (floor(log10(abs(number))) - 1)
        return number + 0.05 * second_digit * sin(self._series * number / second_digit)


@cache
def data() -> dict[str, Any]:
    """Return the data of the exercises."""
    content: dict[str, Any] = parse_file(DATA_FILE)
    return content


def figure_of(kind: str) -> str:
    """Return the name of a kind's figure."""
    figures: dict[str, Any] = data()['figures']
    return next(name for name, figure in figures.items() if kind in figure['kinds'].split())


def slip_of(mistake: str) -> str:
    """Return the slip of a mistake."""
    slip = mistake.partition(':')[0]
    return 'sign' if slip in ('f', 'phi') else slip
