"""
Derivatives by the crank angle, of what a program computes and of coupled loops.

A program is a list of + - * / and sqrt on whole arrays, and so is its derivative: each operation
is followed by its rule, and whichever kernel runs the program runs both.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import BoolArray, ComplexArray, FloatArray
from klann_ros.kinematics.linkage import joints
from klann_ros.kinematics.linkage.linkage import Linkage
import numpy as np

from .program import Number, Operation, Program


class Derived(NamedTuple):
    """A program that computes derivatives, too, and their names by those of its numbers."""

    program: Program
    names: dict[str, str]

    def of(self, pairs: Sequence[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
        """Return the names of the derivatives of points or vectors."""
        return tuple((self.names[x], self.names[y]) for x, y in pairs)


@cache
def differentiated(program: Program) -> Derived:
    """Return a program with the derivatives of all its numbers by the crank angle."""
    writer = _Writer(program)
    for step in program.operations:
        writer.derive(step)
    made = program._replace(
        operations=(*program.operations, *writer.operations),
        constants=(*program.constants, lambda _: 0.0),
    )
    known = [*(f'k{k}' for k in range(len(program.constants))), *writer.derivatives]
    return Derived(made, {name: writer.derivatives.get(name) or writer.zero for name in known})


class _Writer:
    """Writes down the rules; a derivative that is 0 costs no operation."""

    def __init__(self, program: Program) -> None:
        self.zero = f'k{len(program.constants)}'
        self.operations: list[Operation] = []
        self.derivatives: dict[str, Number] = {'sin': 'cos'}
        self.derivatives['cos'] = self._apply('-', self.zero, 'sin')

    def derive(self, step: Operation) -> None:
        """Add the derivative of a number to those before it."""
        self.derivatives[step.name] = self._rule(step)

    def _rule(self, step: Operation) -> Number:
        name, operator, one, other = step
        d_one, d_other = self.derivatives.get(one), self.derivatives.get(other)
        if operator == '+':
            return self._sum(d_one, d_other)
        if operator == '-':
            return self._difference(d_one, d_other)
        if operator == '*':
            left = d_one and self._apply('*', d_one, other)
            right = left if one == other else d_other and self._apply('*', one, d_other)
            return self._sum(left, right)
        if operator == '/':
            # (a / b)' = (a' - (a / b) b') / b
            above = self._difference(d_one, d_other and self._apply('*', name, d_other))
            return above and self._apply('/', above, other)
        return d_one and self._apply('/', d_one, self._apply('+', name, name))

    def _sum(self, one: Number, other: Number) -> Number:
        return self._apply('+', one, other) if one and other else one or other

    def _difference(self, one: Number, other: Number) -> Number:
        return self._apply('-', one or self.zero, other) if other else one

    def _apply(self, operator: str, one: str, other: str) -> str:
        name = f'd{len(self.operations)}'
        self.operations.append(Operation(name, operator, one, other))
        return name


def rates(linkage: Linkage, u: ComplexArray) -> tuple[FloatArray, ComplexArray]:
    """
    Return dx/dalpha, shape (n, k), and du/dalpha of all bodies, shape (n, k), of many poses.

    `u` are the bodies' vectors, shape (n, k); NaN at a singular pose. Block by block, each as in
    the velocity of one pose: Phi of its own bodies against what the others open its loops by.
    """
    structure = linkage.structure
    x_1 = np.zeros(u.shape)
    x_1[0] = 1.0
    u_1 = np.zeros_like(u)
    u_1[0] = 1j * linkage.structure.senses[0] * u[0]
    for own, closing in closing_blocks(linkage, u):
        for j in own:
            # What slides is turned by what is placed already.
            u_1[j] = joints.carried(structure, u, x_1, j, own)
        x_1[own] = closing(u_1)
        for j in own:
            u_1[j] = joints.moved(structure, u, x_1, j)
    singular = np.isnan(x_1).any(axis=0)
    x_1[:, singular] = u_1[:, singular] = np.nan
    return x_1, u_1


def closing_blocks(
    linkage: Linkage, u: ComplexArray
) -> Iterator[tuple[list[int], Callable[[ComplexArray], FloatArray]]]:
    """
    Yield of each block its bodies, and what closes its loops again, at many poses.

    That takes du of all bodies, shape (n, k), and returns the changes of the block's coordinates
    that make up for it, shape (number of unknowns, k); NaN at a singular pose.
    """
    for block in linkage.blocks:
        matrix = block.jacobian(u)
        gone = ~(np.abs(block.sine(u)) > block.singular_sine)
        gone |= ~np.isfinite(matrix).all(axis=(1, 2))
        matrix[gone] = np.eye(matrix.shape[-1])
        yield list(block.unknowns), partial(_closed, block.rows, matrix, gone)


def _closed(
    rows: Sequence[Any], matrix: FloatArray, gone: BoolArray, du: ComplexArray
) -> FloatArray:
    opened = np.array([sum((w * du[j] for j, w in t.items()), 0j * du[0]) for t, _ in rows])
    right = np.stack([opened.real, opened.imag], axis=1).reshape(-1, len(gone)).T
    gone = gone | ~np.isfinite(right).all(axis=1)
    changes: FloatArray = np.full(right.T.shape, np.nan)
    changes[:, ~gone] = np.linalg.solve(matrix[~gone], -right[~gone, :, None])[..., 0].T
    return changes


def angle_rates(links: Any, links_1: Any, sense: int) -> Any:
    """Return dx/dalpha of a body by its link W u, two coordinates each, and the derivative."""
    (x, y), (x_1, y_1) = links, links_1
    return sense * (x * y_1 - y * x_1) / (x * x + y * y)
