"""
Arithmetic that is recorded as a list of operations, for whole arrays or for a compiler.

A formula that is computed with `Number`s and `Vector`s, such as `m * z` or `(f_2 * r + f_1) * w`,
appends its operations to a `Recorder`. An operation that is there already is not repeated, a sum
with 0 or a product with 0 or 1 costs none, and neither does a change of sign.
"""

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

# Names of numbers that stand in no operation.
ZERO, ONE = '0', '1'


class Operation(NamedTuple):
    """`name` = `left` OP `right`, where OP is + - * / or sqrt, which has no `right`."""

    name: str
    operator: str
    left: str
    right: str = ''

    def __str__(self) -> str:
        """Return the operation as a statement."""
        if not self.right:
            return f'{self.name} = {self.operator}({self.left})'
        return f'{self.name} = {self.left} {self.operator} {self.right}'


def needed_operations(operations: Sequence[Operation], outputs: Iterable[str]) -> list[Operation]:
    """Return the operations on which the outputs depend, in order."""
    names = {*outputs}
    needed = []
    for operation in reversed(operations):
        if operation.name in names:
            names |= {operation.left, operation.right}
            needed.append(operation)
    return needed[::-1]


class Constant(NamedTuple):
    """A number of each linkage: its role, and a function that computes it from their terms."""

    role: str
    compute: Callable[[Any], Any]


class Recorder:
    """Records operations and constants; their names are 't0', 't1', ... and 'k0', 'k1', ..."""

    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self.constants: list[Constant] = []
        self._names: dict[Hashable, str] = {}

    @property
    def zero(self) -> 'Number':
        """Return a number that is 0 for every linkage."""
        return Number(self, ZERO)

    @property
    def one(self) -> 'Number':
        """Return a number that is 1 for every linkage."""
        return Number(self, ONE)

    def constant(self, role: str, compute: Callable[[Any], Any], key: Hashable) -> 'Number':
        """Return a constant; one of the same role and key is there once."""
        if (role, key) not in self._names:
            self._names[role, key] = f'k{len(self.constants)}'
            self.constants.append(Constant(role, compute))
        return Number(self, self._names[role, key])

    def vector(
        self, role: str, compute: Callable[[Any], Any], key: Hashable, *, axes: str = 'xy'
    ) -> 'Vector':
        """Return a complex constant as a vector; without an axis this part is 0."""
        x = y = self.zero
        if 'x' in axes:
            x = self.constant(f'{role}.x', lambda terms: np.real(compute(terms)), key)
        if 'y' in axes:
            y = self.constant(f'{role}.y', lambda terms: np.imag(compute(terms)), key)
        return Vector(x, y)

    def apply(self, operator: str, left: 'Number', right: 'Number | None' = None) -> 'Number':
        """Return the number that an operation on two unsigned numbers computes."""
        left_name = self.output(left)
        right_name = '' if right is None else self.output(right)
        key = operator, left_name, right_name
        if key not in self._names:
            self._names[key] = f't{len(self.operations)}'
            self.operations.append(Operation(self._names[key], operator, left_name, right_name))
        return Number(self, self._names[key])

    def output(self, number: 'Number') -> str:
        """Return the name under which the operations compute a number, its sign included."""
        if number.sign < 0:
            return self.apply('-', self.zero, -number).name
        if number.name in (ZERO, ONE):
            role = 'zero' if number.is_zero else 'one'
            return self.constant(role, lambda _: float(number.name), None).name
        return number.name


@dataclass(frozen=True)
class Number:
    """A number by its name and its sign, +1 or -1."""

    recorder: Recorder
    name: str
    sign: int = 1

    @property
    def is_zero(self) -> bool:
        """Return whether it is 0 for every linkage."""
        return self.name == ZERO

    def __neg__(self) -> 'Number':
        return Number(self.recorder, self.name, -self.sign)

    def __add__(self, addend: 'Number') -> 'Number':
        if self.is_zero or addend.is_zero:
            return self if addend.is_zero else addend
        if self.sign == addend.sign:
            return self.recorder.apply('+', abs(self), abs(addend)).with_sign(self.sign)
        positive, negative = (self, addend) if self.sign > 0 else (addend, self)
        return self.recorder.apply('-', positive, -negative)

    def __sub__(self, subtrahend: 'Number') -> 'Number':
        return self + -subtrahend

    def __mul__(self, factor: 'Number') -> 'Number':
        sign = self.sign * factor.sign
        if self.is_zero or factor.name == ONE:
            return self.with_sign(sign)
        if factor.is_zero or self.name == ONE:
            return factor.with_sign(sign)
        return self.recorder.apply('*', abs(self), abs(factor)).with_sign(sign)

    def __truediv__(self, divisor: 'Number') -> 'Number':
        if self.is_zero:
            return self
        quotient = self.recorder.apply('/', abs(self), abs(divisor))
        return quotient.with_sign(self.sign * divisor.sign)

    def __abs__(self) -> 'Number':
        return self.with_sign(1)

    def with_sign(self, sign: int) -> 'Number':
        """Return the number with this sign instead of its own."""
        return Number(self.recorder, self.name, sign)

    def root(self) -> 'Number':
        """Return the square root."""
        return self.recorder.apply('sqrt', self)


@dataclass(frozen=True)
class Vector:
    """A vector of the plane, or a complex number x + i y."""

    x: Number
    y: Number

    def __add__(self, addend: 'Vector') -> 'Vector':
        return Vector(self.x + addend.x, self.y + addend.y)

    def __sub__(self, subtrahend: 'Vector') -> 'Vector':
        return Vector(self.x - subtrahend.x, self.y - subtrahend.y)

    def __mul__(self, factor: 'Vector') -> 'Vector':
        """Return the product of complex numbers; in this order NumPy needs few buffers."""
        by_x = self.scaled(factor.x)
        by_y = self.scaled(factor.y)
        return Vector(by_x.x - by_y.y, by_x.y + by_y.x)

    def component(self, axis: str) -> Number:
        """Return the coordinate along an axis, 'x' or 'y'."""
        return self.x if axis == 'x' else self.y

    def scaled(self, factor: Number) -> 'Vector':
        """Return the product with a real number."""
        return Vector(self.x * factor, self.y * factor)

    def turned(self) -> 'Vector':
        """Return the vector turned by +90 deg, the product with i."""
        return Vector(-self.y, self.x)

    def dot(self, vector: 'Vector') -> Number:
        """Return the dot product."""
        return self.x * vector.x + self.y * vector.y

    def cross(self, vector: 'Vector') -> Number:
        """Return the cross product."""
        return self.x * vector.y - self.y * vector.x
