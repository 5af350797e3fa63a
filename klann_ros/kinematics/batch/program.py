"""
The geometric method for many poses at once, as a program: a list of operations on whole arrays.

With points as complex numbers, one dyad places two bodies. Its ends are P and Q, M = Q - P, its
links r_a and r_b, d = |M|^2; `dyad_joint` is then

    W_a u_a = J - P = z M,      W_b u_b = Q - J = (1 - z) M,      z = 1/2 + w (K + i s r),
    w = 1 / (2 d),    K = (r_a - r_b) (r_a + r_b),
    r = sqrt(((r_a + r_b)^2 - d) (d - (r_a - r_b)^2)),

where r is Heron's product, its factors in pairs: this needs no root of d and keeps the digits. A
vector fixed to a dyad's bodies, T_a u_a + T_b u_b, is then M times f0 + w (f1 + f2 r), with the
linkage's constants

    f0 = T_b / W_b + k / 2,    f1 = k K,    f2 = i s k,    k = T_a / W_a - T_b / W_b.

The next dyad's M and the foot are a constant, the crank's part, and such products. They follow
from the structure alone, so it is compiled once; the kernels run the operations. The derivative of
a program by the crank angle is a program too: each operation is followed by its rule.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from sys import float_info
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.linkage.equations import path_terms
from klann_ros.kinematics.linkage.structure import Structure
from klann_ros.kinematics.linkage.topology import Path
import numpy as np

# The name of a real number in a program; None if it is 0 for every linkage of the structure.
Number = str | None
Components = tuple[Number, Number]
Bars = tuple[tuple[int, int], ...]
# Computes one constant of n linkages, shape (n,).
Constant = Callable[['PathTerms'], Any]


class Operation(NamedTuple):
    """`name` = `one` OP `other`, where OP is + - * / or sqrt, which has no `other`."""

    name: str
    operator: str
    one: str
    other: str = ''


class Program(NamedTuple):
    """The operations that compute poses, and the names of the results."""

    # In order; 'cos' and 'sin' are the crank's, 'k0', 'k1', ... the constants.
    operations: tuple[Operation, ...]
    constants: tuple[Constant, ...]
    # Coordinates of the foot.
    foot: tuple[str, str]
    # Squared distance of each dyad's ends.
    distances: tuple[str, ...]
    # W_a u_a and W_b u_b of each dyad; empty for a program of the foot alone.
    links: tuple[tuple[str, str], ...]
    # Coordinates of each point; empty as above.
    points: tuple[tuple[str, str], ...]


class PathTerms:
    """
    The terms of paths (rows of W, c, Q and q) of many linkages of a structure.

    Computed from their pivots and bars as vectors; `signs` are their assembly modes, shape (number
    of dyads, n).
    """

    def __init__(
        self, structure: Structure, pivots: Sequence[Any], bars: Sequence[Any], signs: FloatArray
    ) -> None:
        self._structure, self._pivots, self._bars, self.signs = structure, pivots, bars, signs
        self._rows: dict[Path, tuple[Mapping[int, Any], Any]] = {}

    def body(self, path: Path, j: int) -> Any:
        """Return the coefficient of a body in a path."""
        return self._row(path)[0].get(j, 0.0)

    def fixed(self, path: Path) -> Any:
        """Return the constant of a path, by the pivots."""
        return self._row(path)[1]

    def links(self, k: int) -> tuple[Any, Any]:
        """Return W_a and W_b of a dyad."""
        a, b = self._structure.groups[k]
        (loop,) = self._structure.paths.rows[k]
        path = self._structure.paths.loops[loop]
        return self.body(path, a), self.body(path, b)

    def singular_sine(self, k: int) -> Any:
        """Return the threshold of a dyad's sine for singularity: see `Block.singular_sine`."""
        (loop,) = self._structure.paths.rows[k]
        bodies, fixed = self._row(self._structure.paths.loops[loop])
        longest = np.max(np.broadcast_arrays(np.abs(fixed), *map(np.abs, bodies.values())), axis=0)
        shorter = np.minimum(*(np.abs(link) for link in self.links(k)))
        return np.sqrt(8.0 * float_info.epsilon * longest / shorter)

    def _row(self, path: Path) -> tuple[Mapping[int, Any], Any]:
        if path not in self._rows:
            self._rows[path] = path_terms(self._structure, path, self._pivots, self._bars)
        return self._rows[path]


@cache
def compile_program(structure: Structure, *, links: bool) -> Program:
    """
    Return the program of a structure whose blocks are all dyads, cached.

    With `links` it also computes the links and the points.
    """
    return _Compiler(structure).compile(links=links)


class _Compiler:
    """Generates operations; a number that is 0 for the whole structure costs none."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._paths = structure.paths
        self._operations: list[Operation] = []
        self._constants: list[Constant] = []
        self._spans: list[tuple[str, str]] = []
        self._roots: list[tuple[str, str]] = []

    def compile(self, *, links: bool) -> Program:
        distances, vectors = [], []
        for k, (loop,) in enumerate(self._paths.rows):
            # M = W_a u_a + W_b u_b is minus the rest of the loop.
            path = Path((), ()).plus(self._paths.loops[loop], -1)
            m = self._sum(self._shortest(path, k), range(k), self._structure.groups[k])
            distance, w, r = self._close(k, m)
            distances.append(distance)
            self._spans.append(m)
            self._roots.append((w, r))
            if links:
                vectors += self._links(k, m, w, r)
        names, foot = self._structure.points, self._structure.foot
        blocks = range(len(self._paths.rows))
        path = self._shortest(self._paths.points[names.index(foot)], len(blocks))
        ends = self._sum(path, blocks, ())
        points = [
            ends if name == foot else self._point(self._shortest(path, len(blocks)), vectors)
            for name, path in (zip(names, self._paths.points, strict=True) if links else ())
        ]
        own = tuple(self._operations), tuple(self._constants)
        return Program(*own, ends, tuple(distances), tuple(vectors), tuple(points))

    # Paths.

    def _shortest(self, path: Path, blocks: int) -> Path:
        """Return the path with the same ends over the fewest bodies, by closed loops."""
        loops = [self._paths.loops[rows[0]] for rows in self._paths.rows[:blocks]]
        others = [path.plus(loop, sign) for loop in reversed(loops) for sign in (1, -1)]
        best = min([path, *others], key=self._cost)
        return path if self._cost(best) >= self._cost(path) else self._shortest(best, blocks)

    def _cost(self, path: Path) -> tuple[int, int]:
        bodies = {self._structure.bars[bar][0] for bar, _ in path.bars}
        blocks = [k for k, group in enumerate(self._structure.groups) if bodies & {*group}]
        return len(blocks) + (0 in bodies), len(path.bars)

    def _sum(self, path: Path, blocks: Sequence[int], without: Sequence[int]) -> tuple[str, str]:
        """Return a path's vector: the crank's part, the dyads', and a constant."""
        x, y = self._crank(path)
        for k in blocks:
            bodies = {self._structure.bars[bar][0] for bar, _ in path.bars}
            if bodies & {*self._structure.groups[k]} - {*without}:
                u, v = self._product(self._spans[k], self._factor(k, path))
                x, y = self._add(x, u), self._add(y, v)
        fixed = (
            self._constant(lambda n: np.real(n.fixed(path))),
            self._constant(lambda n: np.imag(n.fixed(path))),
        )
        x, y = self._add(x, fixed[0]), self._add(y, fixed[1])
        return x or fixed[0], y or fixed[1]

    def _point(self, path: Path, links: Sequence[tuple[str, str]]) -> tuple[str, str]:
        """Return the end of a path, by the links of the dyads."""
        x, y = self._crank(path)
        for k, group in enumerate(self._structure.groups):
            loop = self._paths.loops[self._paths.rows[k][0]]
            for side, j in enumerate(group):
                own, link = (
                    tuple(item for item in each.bars if self._structure.bars[item[0]][0] == j)
                    for each in (path, loop)
                )
                if own:
                    (u, v), sign = self._along(links[2 * k + side], own, link, (path, k, side))
                    x, y = self._add(x, u, sign), self._add(y, v, sign)
        fixed = self._constant(lambda n: np.real(n.fixed(path)))
        level = self._constant(lambda n: np.imag(n.fixed(path)))
        return self._add(x, fixed) or fixed, self._add(y, level) or level

    def _along(
        self, link: tuple[str, str], own: Bars, bars: Bars, which: tuple[Path, int, int]
    ) -> tuple[tuple[str, str], str]:
        """Return a vector of a body, and its sign; the link itself if it is the same vector."""
        if own == bars:
            return link, '+'
        if own == tuple((bar, -times) for bar, times in bars):
            return link, '-'
        path, k, side = which
        j = self._structure.groups[k][side]

        def ratio(n: PathTerms) -> Any:
            return n.body(path, j) / n.links(k)[side]

        factor = self._part(ratio, 0), self._part(ratio, 1)
        return self._product(link, factor), '+'

    def _crank(self, path: Path) -> Components:
        bars = [bar for bar, _ in path.bars if self._structure.bars[bar][0] == 0]
        if not bars:
            return None, None
        sense = self._structure.senses[0]
        a = self._constant(lambda n: np.real(n.body(path, 0)))
        d = self._constant(lambda n: sense * np.real(n.body(path, 0)))
        x, y = self._apply('*', a, 'cos'), self._apply('*', d, 'sin')
        if {*bars} <= self._structure.straight:
            return x, y
        b = self._constant(lambda n: np.imag(n.body(path, 0)))
        g = self._constant(lambda n: -sense * np.imag(n.body(path, 0)))
        return (
            self._add(x, self._apply('*', g, 'sin')),
            self._add(y, self._apply('*', b, 'cos')),
        )

    # A dyad.

    def _close(self, k: int, m: tuple[str, str]) -> tuple[str, str, str]:
        """Return d, w and r."""
        x, y = m
        d = self._apply('+', self._apply('*', x, x), self._apply('*', y, y))
        w = self._apply('/', self._constant(lambda _: 0.5), d)

        def reach(n: PathTerms, sign: int) -> Any:
            w_a, w_b = n.links(k)
            return (np.abs(w_a) + sign * np.abs(w_b)) ** 2

        stretched = self._constant(lambda n: reach(n, 1))
        folded = self._constant(lambda n: reach(n, -1))
        heron = self._apply('*', self._apply('-', stretched, d), self._apply('-', d, folded))
        return d, w, self._apply('sqrt', heron, '')

    def _factor(self, k: int, path: Path) -> Components:
        """Return f0 + w (f1 + f2 r), the factor of a dyad's M in a path."""
        w, r = self._roots[k]
        a, b = self._structure.groups[k]
        real = self._is_real(k, path)

        def parts(n: PathTerms) -> tuple[Any, Any]:
            w_a, w_b = n.links(k)
            t_b = n.body(path, b) / w_b
            return t_b, n.body(path, a) / w_a - t_b

        def f_1(n: PathTerms) -> Any:
            w_a, w_b = np.abs(n.links(k)[0]), np.abs(n.links(k)[1])
            return parts(n)[1] * ((w_a - w_b) * (w_a + w_b))

        constants: list[Callable[[PathTerms], Any]] = [
            lambda n: parts(n)[0] + parts(n)[1] / 2.0,
            f_1,
            lambda n: 1j * n.signs[k] * parts(n)[1],
        ]
        # For vectors along the links f0 and f1 are real, and f2 is imaginary.
        f_x, f_y = (
            [
                None if real and (axis == 0) == (order == 2) else self._part(make, axis)
                for order, make in enumerate(constants)
            ]
            for axis in (0, 1)
        )
        return self._polynomial(f_x, w, r), self._polynomial(f_y, w, r)

    def _part(self, make: Callable[['PathTerms'], Any], axis: int) -> str:
        part = (np.real, np.imag)[axis]
        return self._constant(lambda n: part(make(n)))

    def _polynomial(self, f: Sequence[Number], w: str, r: str) -> Number:
        inner = self._add(f[2] and self._apply('*', f[2], r), f[1])
        return self._add(inner and self._apply('*', inner, w), f[0])

    def _is_real(self, k: int, path: Path) -> bool:
        """Return whether a path follows a dyad's links, or their bodies' first bars."""
        group, straight = self._structure.groups[k], self._structure.straight
        loop = self._paths.loops[self._paths.rows[k][0]]
        return all(
            bar in straight
            for each in (path, loop)
            for bar, _ in each.bars
            if self._structure.bars[bar][0] in group
        )

    def _links(self, k: int, m: tuple[str, str], w: str, r: str) -> list[tuple[str, str]]:
        """Return W_a u_a = z M and W_b u_b = M - z M."""

        def excess(n: PathTerms) -> Any:
            w_a, w_b = (np.abs(link) for link in n.links(k))
            return (w_a - w_b) * (w_a + w_b)

        z_x = self._apply(
            '+', self._apply('*', self._constant(excess), w), self._constant(lambda _: 0.5)
        )
        z_y = self._apply('*', self._apply('*', self._constant(lambda n: n.signs[k]), r), w)
        x, y = self._product(m, (z_x, z_y))
        return [(x, y), (self._apply('-', m[0], x), self._apply('-', m[1], y))]

    # Numbers.

    def _product(self, one: tuple[str, str], other: Components) -> tuple[str, str]:
        """Return a complex product."""
        (x, y), (u, v) = one, other
        xu, yu = u and self._apply('*', x, u), u and self._apply('*', y, u)
        xv, yv = v and self._apply('*', x, v), v and self._apply('*', y, v)
        if xu is None or yu is None:
            raise AssertionError('a factor has a real part')
        if xv is None or yv is None:
            return xu, yu
        return self._apply('-', xu, yv), self._apply('+', yu, xv)

    def _add(self, one: Number, other: Number, sign: str = '+') -> Number:
        if one is None and sign == '-':
            one = self._constant(lambda _: 0.0)
        if one is None or other is None:
            return one or other
        return self._apply(sign, one, other)

    def _apply(self, operator: str, one: str, other: str) -> str:
        name = f't{len(self._operations)}'
        self._operations.append(Operation(name, operator, one, other))
        return name

    def _constant(self, make: Constant) -> str:
        self._constants.append(make)
        return f'k{len(self._constants) - 1}'


def constants(program: Program, terms: PathTerms, count: int) -> FloatArray:
    """Return the constants of `count` linkages, shape (number of constants, count)."""
    table = np.empty((len(program.constants), count))
    with np.errstate(all='ignore'):
        for row, make in zip(table, program.constants, strict=True):
            row[:] = make(terms)
    return table


class Derived(NamedTuple):
    """A program with derivatives, and their names by the names of its numbers."""

    program: Program
    names: dict[str, str]

    def of(self, pairs: Sequence[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
        """Return the names of the derivatives of points or vectors."""
        return tuple((self.names[x], self.names[y]) for x, y in pairs)


@cache
def differentiate(program: Program) -> Derived:
    """Return a program with the derivatives of all its numbers by the crank angle, cached."""
    writer = _Differentiator(program)
    for step in program.operations:
        writer.derive(step)
    full = program._replace(
        operations=(*program.operations, *writer.operations),
        constants=(*program.constants, lambda _: 0.0),
    )
    known = [*(f'k{k}' for k in range(len(program.constants))), *writer.derivatives]
    return Derived(full, {name: writer.derivatives.get(name) or writer.zero for name in known})


class _Differentiator:
    """Generates derivatives; one that is 0 costs no operation."""

    def __init__(self, program: Program) -> None:
        self.zero = f'k{len(program.constants)}'
        self.operations: list[Operation] = []
        self.derivatives: dict[str, Number] = {'sin': 'cos'}
        self.derivatives['cos'] = self._apply('-', self.zero, 'sin')

    def derive(self, step: Operation) -> None:
        """Append the derivative of an operation."""
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
