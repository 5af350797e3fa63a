"""
The lab with the exercises; `python -m klann_ros.exercises.lab` writes its page.

The lab's JavaScript works the same formulas: as rows `SYMBOL UNIT = EXPRESSION | FORMULA` of a
step, `:=` of a result, which are traced by working the formulas with symbols for numbers.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
import re
from typing import Any

from klann_ros.web import LAB_FILE, lab_page
import numpy as np

from .calculation import Calculation, data
from .formulas import EquationSystem, Formula, FORMULAS, SYSTEMS

# Ranks of operators, from the loosest to the tightest.
CHOICE, COMPARISON, SUM, PRODUCT, SIGN, POWER, ATOM = range(7)
NAME = re.compile(r'[A-Za-z]\w*')


class Symbol:
    """An expression of the lab's JavaScript; the rank is that of its last operator."""

    __hash__ = None  # type: ignore[assignment]  # == makes an expression

    def __init__(self, text: str, rank: int = ATOM) -> None:
        self.text = text
        self.rank = rank

    def __neg__(self) -> 'Symbol':
        return Symbol(f'-{_operand(self, SIGN)}', SIGN)

    def __abs__(self) -> 'Symbol':
        return _called('abs', self)


def _operand(operand: Any, rank: int) -> str:
    """Return an operand of an operator, in parentheses where they are needed."""
    if isinstance(operand, str):
        return f"'{operand}'"
    if not isinstance(operand, Symbol):
        return np.format_float_positional(operand, trim='-')
    return operand.text if operand.rank >= rank else f'({operand.text})'


def _called(name: str, *arguments: Any) -> Symbol:
    return Symbol(f'{name}({", ".join(_operand(argument, CHOICE) for argument in arguments)})')


def _operator(sign: str, rank: int) -> tuple[Callable[..., Symbol], Callable[..., Symbol]]:
    """Return the methods of an operator, and of the operator with the symbol to the right."""
    # Powers group to the right, all others to the left.
    left_rank, right_rank = (ATOM, SIGN) if rank == POWER else (rank, rank + 1)

    def left(self: Any, right: Any) -> Symbol:
        return Symbol(f'{_operand(self, left_rank)}{sign}{_operand(right, right_rank)}', rank)

    return left, lambda self, other: left(other, self)


for _method, _sign, _rank in (
    ('add', '+', SUM), ('sub', '-', SUM), ('mul', '*', PRODUCT), ('truediv', '/', PRODUCT),
    ('pow', '**', POWER), ('lt', ' < ', COMPARISON), ('gt', ' > ', COMPARISON),
    ('le', ' <= ', COMPARISON), ('ge', ' >= ', COMPARISON), ('eq', ' == ', COMPARISON),
):  # fmt: skip
    _left, _right = _operator(_sign, _rank)
    setattr(Symbol, f'__{_method}__', _left)
    if _rank != COMPARISON:
        setattr(Symbol, f'__r{_method}__', _right)


class Trace(Calculation):
    """A calculation with symbols, whose steps are rows."""

    def __init__(self) -> None:
        super().__init__({})
        self.rows: list[Any] = []
        self.half_turn = Symbol('half_turn')
        for name in ('sqrt', 'hypot', 'cos', 'sin', 'acos', 'atan2', 'wrapped', 'sign'):
            setattr(self, name, partial(_called, name))
        self.smallest = partial(_called, 'min')
        self.largest = partial(_called, 'max')

    def __getattr__(self, name: str) -> Symbol:
        """Return the symbol of a number."""
        return Symbol(name)

    def choose(self, condition: Any, if_true: Any, if_false: Any) -> Any:
        """Return an expression with a condition."""
        texts = (_operand(part, COMPARISON) for part in (if_true, condition, if_false))
        return Symbol('{} if {} else {}'.format(*texts), CHOICE)

    def require(self, *conditions: Any) -> None:
        """Record requirements."""
        self.rows += [f'require {condition.text}' for condition in conditions]

    def define(self, symbol: str, value: Any) -> Any:
        """Record a value that is no step."""
        return self._record(symbol, '=', value)

    def result(self, symbol_and_unit: str, value: Any, formula: str) -> Any:
        """Record a step that is used as it is."""
        return self._record(symbol_and_unit, ':=', value, f' | {formula}')

    def step(self, symbol_and_unit: str, value: Any, formula: str) -> Any:
        """Record a step."""
        return self._record(symbol_and_unit, '=', value, f' | {formula}')

    def _record(self, names: str, becomes: str, value: Any, formula: str = '') -> Symbol:
        self.rows.append(f'{names} {becomes} {_operand(value, CHOICE)}{formula}')
        return Symbol(names.split(maxsplit=1)[0])

    def solve(
        self,
        symbols_and_unit: str,
        phi: Sequence[Sequence[Any]],
        right: Sequence[Any],
        formula: str,
        *,
        is_result: bool = False,
    ) -> None:
        """Record a linear system."""
        gives = f'{symbols_and_unit} {":=" if is_result else "="} {formula}'
        system = {'solve': list(map(_list, phi)), 'right': _list(right), 'gives': gives}
        self.rows.append(system)

    def newton(self, system: Any) -> None:
        """Record the name of a system to be iterated."""
        self.rows.append({'newton': _name_of(system, SYSTEMS)})

    def sweep(self, formula: Formula, extremes: Mapping[str, str]) -> None:
        """Record the name of formulas to be worked over a turn."""
        self.rows.append({'sweep': _name_of(formula, FORMULAS), 'extremes': extremes})


def _list(expressions: Sequence[Any]) -> str:
    return ', '.join(_operand(expression, CHOICE) for expression in expressions)


def _name_of(value: Any, names: Mapping[str, Any]) -> str:
    return next(name for name, named in names.items() if named is value)


@cache
def sources(name: str) -> dict[str, list[str]]:
    """Return for each question of an exercise those that its answer is computed from."""
    questions = [
        q for group in data()['kinds'][name]['asked'].split(', ') for q in group.split()[1:]
    ]
    names_of: dict[str, set[str]] = {}
    for row in _rows(FORMULAS[name]):
        symbols: list[str] = []
        names: list[str] = []
        if isinstance(row, str) and not row.startswith('require'):
            symbol_and_unit, expression = re.split(' :?= ', row.partition(' | ')[0], maxsplit=1)
            symbols = symbol_and_unit.split()[:1]
            names = NAME.findall(expression)
        elif 'solve' in row:
            symbols = re.split(' :?= ', row['gives'])[0].split()[:-1]
            names = NAME.findall(f'{row["solve"]} {row["right"]}')
        elif 'newton' in row:
            # The second iterates come from f and Phi of the guess, the root from all of them.
            unknowns = SYSTEMS[row['newton']].unknowns
            symbols = [*(f'{unknown}_2' for unknown in unknowns), *unknowns, 'iterations']
            names = [question for question in questions if question not in symbols]
        # The unknowns of a system are computed one after the other.
        for symbol in symbols:
            names_of[symbol] = {*names}.union(*(names_of.get(name, ()) for name in names))
            names = [*names, symbol]
    return {q: [name for name in questions if name in names_of.get(q, ())] for q in questions}


def _rows(formula: Formula) -> list[Any]:
    trace = Trace()
    formula(trace)
    return trace.rows


def _system_content(system: EquationSystem) -> dict[str, Any]:
    trace = Trace()
    return {
        'unknowns': ' '.join(system.unknowns),
        'position': _name_of(system.position, POSITIONS),
        'f': [_operand(equation, CHOICE) for equation in system.f(trace)],
        'phi': list(map(_list, system.phi(trace))),
    }


POSITIONS = {name: system.position for name, system in SYSTEMS.items()}


def lab_data() -> dict[str, Any]:
    """Return the data of the exercises for the lab's JavaScript."""
    formulas: dict[str, list[Any]] = {}
    for name, formula in (POSITIONS | FORMULAS).items():
        rows = _rows(formula)
        # Formulas that begin with others name them.
        for begin, first_rows in reversed(formulas.items()):
            count = len(first_rows)
            if rows[:count] == first_rows:
                rows = [f'use {begin}', *rows[count:]]
        formulas[name] = rows
    systems = {name: _system_content(system) for name, system in SYSTEMS.items()}
    return {
        **data(),
        'systems': systems,
        'formulas': formulas,
        'sources': {name: sources(name) for name in data()['kinds']},
    }


if __name__ == '__main__':
    LAB_FILE.write_text(lab_page(lab_data()), encoding='utf-8', newline='\n')
