"""
A calculation as a student writes it: angles in degrees, each step recorded, or with one mistake.

A *slip* is a category, such as degrees for radians; a *mistake* is one instance of it, named SLIP
or SLIP:PLACE, such as 'radians:trig'. The course formulas with a mistake give the wrong answer of
that mistake, so that marking can name the slip. exercises.yaml has the formulas.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from math import acos, atan2, cos, degrees, hypot, pi, radians, sin, sqrt
from pathlib import Path
import re
from types import CodeType
from typing import Any, NamedTuple

from klann_ros.kinematics import peak
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.sanitize.yaml_text import parse_file
import numpy as np

Answer = float | str
DATA_FILE = Path(__file__).with_name('exercises.yaml')
# SYMBOLS UNIT = EXPRESSION | FORMULA AS SHOWN, and the results of a system.
ROW = re.compile(r'(\w+)(?: (\S+))? (:?=) (.+?)(?: \| (.*))?')
RESULTS = re.compile(r'(.+?) (\S+) (:?=) (.*)')
HALF_TURN, TURN_DEG = 180.0, 360.0
# Functions of expressions beside those with a student's mistakes.
FUNCTIONS = {
    '__builtins__': {}, 'sqrt': sqrt, 'hypot': hypot, 'min': min, 'max': max, 'abs': abs
}  # fmt: skip


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
        self._givens, self._input = givens, input_angle
        self._slip, _, self._place = mistake.partition(':')
        self._digits = int(self._place) if self._slip == 'rounding' else 0
        is_radian = mistake == 'radians:trig'
        to_rad, to_deg = (float, float) if is_radian else (radians, degrees)
        cosine, sine = (sin, cos) if mistake == 'sine:all' else (cos, sin)
        half = pi if is_radian else HALF_TURN
        self._scope: dict[str, Any] = {
            **FUNCTIONS,
            'cos': lambda angle: cosine(to_rad(angle)),
            'sin': lambda angle: sine(to_rad(angle)),
            'acos': lambda x: to_deg(acos(x)),
            'atan2': lambda y, x: to_deg(atan2(y, x)),
            # -1 where a loop is closed in the other assembly mode.
            'sign': lambda k: -1.0 if self._slip == 'assembly' and str(k) in self._place else 1.0,
            'wrapped': lambda angle: half - (half - angle) % (2.0 * half),
            'half_turn': half,
            **givens,
        }
        reading = data()['mistakes']['input'].get(mistake)
        if reading and input_angle in givens:
            self._scope[input_angle] = reading[0] * givens[input_angle] + reading[1]

    def __getitem__(self, name: str) -> float:
        """Return a given number, the input angle with its mistake, or a result."""
        return float(self._scope[name])

    def work(self, name: str) -> None:
        """
        Work the formulas of this name.

        Raises
        ------
        ValueError, ArithmeticError, numpy.linalg.LinAlgError
            They lead nowhere, or a requirement is not met.

        """
        for row in data()['formulas'][name]:
            if isinstance(row, str):
                self._work_row(row)
            elif 'solve' in row:
                self._solve_system(row)
            elif 'sweep' in row:
                self._sweep(row['sweep'], row['extremes'])
            else:
                self._newton(row['newton'])

    def _work_row(self, row: str) -> None:
        word, _, rest = row.partition(' ')
        if word == 'use':
            self.work(rest)
        elif word == 'require':
            # A wrong calculation goes on, as its student does.
            if not self.mistake and not self._value(rest):
                raise ValueError(rest)
        else:
            symbol, unit, becomes, expression, formula = _groups(ROW, row)
            self._record(symbol, unit, becomes, self._value(expression), formula)

    def _value(self, expression: str) -> Any:
        return eval(_compiled(expression), self._scope)  # noqa: S307 - of our own data file

    def _record(self, symbol: str, unit: str, becomes: str, value: Any, formula: str) -> None:
        """Record a step, rounded if that is the mistake, unless it is a result."""
        if unit:
            value = self._rounded(value) if becomes == '=' else value
            self.steps.append(Step(symbol, value, unit, formula))
        self.answers[symbol] = self._scope[symbol] = value

    def _solve_system(self, row: Mapping[str, Any]) -> None:
        system = row['solve']
        rows = data()['systems'][system]['phi'] if isinstance(system, str) else system
        found = self._solution(*self._written(rows, row['right']))
        symbols, unit, becomes, formula = _groups(RESULTS, row['gives'])
        for symbol, value in zip(symbols.split(), found.tolist(), strict=True):
            self._record(symbol, unit, becomes, value, formula)

    def _written(self, rows: Sequence[str], right: str) -> tuple[FloatArray, FloatArray]:
        """Return matrix and right side of a linear system as this student writes them."""
        phi, f = (
            np.array([self._value(f'{each},') for each in expressions])
            for expressions in (rows, [right])
        )
        if self._slip == 'phi':
            row, column = map(int, self._place.split(','))
            phi[row, column] *= -1.0
        elif self._slip == 'f':
            f[0, int(self._place)] *= -1.0
        return self._all_rounded(
            phi.T if self.mistake == 'transposed' else phi
        ), self._all_rounded(f[0])

    def _solution(self, phi: FloatArray, f: FloatArray) -> FloatArray:
        """Return Phi^-1 f [rad or rad/s], by this student."""
        solved: Any = np.linalg.solve(phi, f)
        return np.asarray(-solved if self.mistake == 'sign:step' else solved)

    def _newton(self, name: str) -> None:
        """
        Iterate x_(k+1) = x_k - Phi^-1 f from a guess [deg].

        The answers are f and two entries of Phi at the guess, x_2, the converged x, and the number
        of iterations up to the first one whose corrections are all small.
        """
        system = data()['systems'][name]
        names = system['unknowns'].split()
        guess = np.array([self._givens[f'{each}_1'] for each in names], dtype=float)
        phi, f = self._linearised(system, guess)
        for k, value in enumerate(f.tolist(), 1):
            self._record(f'f_{k}', 'mm', ':=', value, f'f_{k}(x_1)')
        for (row, column), value in np.ndenumerate(phi):
            shown = f'∂f_{row + 1}/∂x_{column + 1} (x_1)'
            self._record(f'Phi_{row + 1}{column + 1}', 'mm', '=', float(value), shown)
        x, count = self._iterates(system, guess)
        last = x[min(int(self._place), len(x) - 1)] if self._slip == 'short' else x[-1]
        second = x[0] if self.mistake == 'short:1' else x[1]
        seconds = [f'{each}_2' for each in names]
        self.answers |= zip([*seconds, *names], [*second, *last], strict=True)
        self.answers['iterations'] = float(count)
        if self._slip == 'assembly':
            # Newton may converge to the root of the other assembly mode.
            other = Calculation(self._givens, self.mistake, self._input)
            other.work(system['position'])
            self.answers |= {each: other.answers[each] for each in names}

    def _linearised(
        self, system: Mapping[str, Any], x: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return Phi and f at x."""
        self._scope.update(zip(system['unknowns'].split(), x.tolist(), strict=True))
        return self._written(system['phi'], ', '.join(system['f']))

    def _iterates(self, system: Mapping[str, Any], guess: FloatArray) -> tuple[Any, int]:
        """Return the iterates, and the number of the first small correction; 0 if none is."""
        x, count, limits = [guess], 0, data()['iterations']
        while len(x) <= limits['most']:
            correction = self._solution(*self._linearised(system, x[-1]))
            if self.mistake not in ('radians:step', 'radians:trig'):
                correction = np.degrees(correction)
            x.append(self._all_rounded(x[-1] - correction))
            for name, value in zip(system['unknowns'].split(), x[-1].tolist(), strict=True):
                self._record(f'{name}_{len(x)}', 'deg', '=', value, 'x_(k+1) = x_k - Φ⁻¹ f')
            largest = np.abs(correction).max()
            count = count or (len(x) - 1 if largest <= limits['stop'] else 0)
            if largest <= limits['converged']:
                break
        return [each.tolist() for each in x], count

    def _sweep(self, formulas: str, extremes: Mapping[str, str]) -> None:
        """Answer with the differences of extremes over a turn of the input angle."""

        def at(angle: float) -> Calculation:
            one = Calculation({**self._givens, self._input: angle}, self.mistake, self._input)
            one.work(formulas)
            return one

        step, printed = data()['table']['step'], data()['table']['printed']
        table = {float(angle): at(angle) for angle in range(0, 360, step)}
        for angle in range(0, 360, printed):
            for name in extremes.values():
                self._record(name, 'mm', '=', table[angle][name], f'α = {angle}°')

        def greatest(name: str, sense: float) -> float:
            near = max(table, key=lambda angle: sense * table[angle][name])
            most = peak(lambda angle: sense * at(angle)[name], near - step, near + step)
            return sense * at(most)[name]

        for answer, name in extremes.items():
            extent = greatest(name, 1.0) + greatest(name, -1.0)
            self._record(answer, 'mm', ':=', extent, f'max {name} - min {name}')

    def _all_rounded(self, values: FloatArray) -> FloatArray:
        if not self._digits:
            return values
        rounded: FloatArray = np.vectorize(self._rounded)(values)
        return rounded

    def _rounded(self, value: float) -> float:
        return float(f'{value:.{self._digits - 1}e}' if self._digits else value)


@cache
def data() -> dict[str, Any]:
    """Return the data of the exercises."""
    found: dict[str, Any] = parse_file(DATA_FILE)
    return found


def figure_of(kind: str) -> str:
    """Return the name of a kind's figure."""
    figures: dict[str, Any] = data()['figures']
    return next(name for name, figure in figures.items() if kind in figure['kinds'].split())


@cache
def _compiled(expression: str) -> CodeType:
    return compile(expression, str(DATA_FILE), 'eval')


@cache
def _groups(form: re.Pattern[str], text: str) -> Sequence[str]:
    found = form.fullmatch(text)
    if not found:
        raise SyntaxError(f'{DATA_FILE}: {text}')
    return found.groups(default='')


def slip_of(mistake: str) -> str:
    """Return the slip of a mistake."""
    slip = mistake.partition(':')[0]
    return 'sign' if slip in ('f', 'phi') else slip
