"""
The geometric method for many poses at once, as a list of operations on whole arrays.

With points as complex numbers, one dyad places two bodies. Its ends are P and Q, M = Q - P, its
links r_a and r_b, d = |M|^2; `dyad.joint` is then

    W_a u_a = J - P = z M,      W_b u_b = Q - J = (1 - z) M,      z = 1/2 + w (K + i s r),
    w = 1 / (2 d),    K = (r_a - r_b) (r_a + r_b),
    r = sqrt(((r_a + r_b)^2 - d) (d - (r_a - r_b)^2)),

where r is Heron's product again: its factors are taken two at a time, which needs no root of d and
keeps the same digits. So whatever is fixed to a dyad's bodies, T_a u_a + T_b u_b, is M times a
factor f0 + w (f1 + f2 r) whose constants are the linkage's:

    f0 = T_b / W_b + k / 2,    f1 = k K,    f2 = i s k,    k = T_a / W_a - T_b / W_b.

The next dyad's M and the foot are a constant, the crank's part, and such products. Which of them
there are follows from the structure alone: it is made into operations once. NumPy runs them in
buffers that are used again; numba compiles the same list.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from sys import float_info
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.linkage.paths import Path
from klann_ros.kinematics.linkage.shape import row
from klann_ros.kinematics.linkage.structure import Structure
import numpy as np

# A real number of a pose by its name in a program; None where it is 0 whatever the linkage.
Number = str | None
Pair = tuple[Number, Number]
Bars = tuple[tuple[int, int], ...]
# Makes one constant of n linkages, shape (n,), from what the program asks of their numbers.
Constant = Callable[['Numbers'], Any]


class Operation(NamedTuple):
    """`name` = `one` OP `other`, where OP is one of + - * / and sqrt, which has no other."""

    name: str
    operator: str
    one: str
    other: str = ''


class Program(NamedTuple):
    """What computes poses."""

    # In their order; 'cos' and 'sin' are the crank's, 'k0' and so on the constants.
    operations: tuple[Operation, ...]
    # How to make each constant.
    constants: tuple[Constant, ...]
    # The foot's coordinates.
    foot: tuple[str, str]
    # The square of the distance of each dyad's ends.
    distances: tuple[str, ...]
    # Of each dyad W_a u_a and W_b u_b, in turn; empty where only the foot is wanted.
    links: tuple[tuple[str, str], ...]
    # Of each point its coordinates; empty as above.
    points: tuple[tuple[str, str], ...]


class Numbers:
    """
    The rows of W, c, Q and q of many linkages of a structure, by their pivots and bars as vectors.

    `signs` are their assembly, shape (number of dyads, n).
    """

    def __init__(
        self, structure: Structure, pivots: Sequence[Any], bars: Sequence[Any], signs: FloatArray
    ) -> None:
        self._structure, self._pivots, self._bars, self.signs = structure, pivots, bars, signs
        self._rows: dict[Path, tuple[Mapping[int, Any], Any]] = {}

    def body(self, path: Path, j: int) -> Any:
        """Return what a body adds to a path."""
        return self._row(path)[0].get(j, 0.0)

    def fixed(self, path: Path) -> Any:
        """Return what the pivots add to a path."""
        return self._row(path)[1]

    def links(self, k: int) -> tuple[Any, Any]:
        """Return W_a and W_b of a dyad."""
        a, b = self._structure.groups[k]
        (loop,) = self._structure.paths.rows[k]
        path = self._structure.paths.loops[loop]
        return self.body(path, a), self.body(path, b)

    def singular_sine(self, k: int) -> Any:
        """Return the sine of a dyad below which it is singular: see `Block.singular_sine`."""
        (loop,) = self._structure.paths.rows[k]
        bodies, fixed = self._row(self._structure.paths.loops[loop])
        longest = np.max(np.broadcast_arrays(np.abs(fixed), *map(np.abs, bodies.values())), axis=0)
        shorter = np.minimum(*(np.abs(link) for link in self.links(k)))
        return np.sqrt(8.0 * float_info.epsilon * longest / shorter)

    def _row(self, path: Path) -> tuple[Mapping[int, Any], Any]:
        if path not in self._rows:
            self._rows[path] = row(self._structure, path, self._pivots, self._bars)
        return self._rows[path]


@cache
def program(structure: Structure, *, links: bool) -> Program:
    """
    Return the program of a structure whose blocks are all dyads.

    With `links` it gives the links and the points beside the foot.
    """
    return _Compiler(structure).program(links=links)


class _Compiler:
    """Writes down operations; a number that is 0 for the whole structure costs none."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._paths = structure.paths
        self._operations: list[Operation] = []
        self._constants: list[Constant] = []
        self._ways: list[tuple[str, str]] = []
        self._closed: list[tuple[str, str]] = []

    def program(self, *, links: bool) -> Program:
        distances, vectors = [], []
        for k, (loop,) in enumerate(self._paths.rows):
            # M = W_a u_a + W_b u_b is the loop's other part, turned about.
            path = Path((), ()).plus(self._paths.loops[loop], -1)
            m = self._sum(self._shortest(path, k), range(k), self._structure.groups[k])
            distance, w, r = self._close(k, m)
            distances.append(distance)
            self._ways.append(m)
            self._closed.append((w, r))
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
        made = tuple(self._operations), tuple(self._constants)
        return Program(*made, ends, tuple(distances), tuple(vectors), tuple(points))

    # What leads where.

    def _shortest(self, path: Path, blocks: int) -> Path:
        """Return a way with the same ends, by loops that are closed, over the fewest bodies."""
        loops = [self._paths.loops[rows[0]] for rows in self._paths.rows[:blocks]]
        ways = [path.plus(loop, sign) for loop in reversed(loops) for sign in (1, -1)]
        best = min([path, *ways], key=self._cost)
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
                u, v = self._product(self._ways[k], self._factor(k, path))
                x, y = self._add(x, u), self._add(y, v)
        fixed = (
            self._constant(lambda n: np.real(n.fixed(path))),
            self._constant(lambda n: np.imag(n.fixed(path))),
        )
        x, y = self._add(x, fixed[0]), self._add(y, fixed[1])
        return x or fixed[0], y or fixed[1]

    def _point(self, path: Path, links: Sequence[tuple[str, str]]) -> tuple[str, str]:
        """Return where a path leads to, by the links of the dyads."""
        x, y = self._crank(path)
        for k, group in enumerate(self._structure.groups):
            loop = self._paths.loops[self._paths.rows[k][0]]
            for side, j in enumerate(group):
                own, link = (
                    tuple(item for item in way.bars if self._structure.bars[item[0]][0] == j)
                    for way in (path, loop)
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
        """Return a vector of a body, which its link may be already; and its sign."""
        if own == bars:
            return link, '+'
        if own == tuple((bar, -times) for bar, times in bars):
            return link, '-'
        path, k, side = which
        j = self._structure.groups[k][side]

        def ratio(n: Numbers) -> Any:
            return n.body(path, j) / n.links(k)[side]

        factor = self._part(ratio, 0), self._part(ratio, 1)
        return self._product(link, factor), '+'

    def _crank(self, path: Path) -> Pair:
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

        def reach(n: Numbers, sign: int) -> Any:
            w_a, w_b = n.links(k)
            return (np.abs(w_a) + sign * np.abs(w_b)) ** 2

        stretched = self._constant(lambda n: reach(n, 1))
        folded = self._constant(lambda n: reach(n, -1))
        heron = self._apply('*', self._apply('-', stretched, d), self._apply('-', d, folded))
        return d, w, self._apply('sqrt', heron, '')

    def _factor(self, k: int, path: Path) -> Pair:
        """Return f0 + w (f1 + f2 r), by which a dyad's M adds to a path."""
        w, r = self._closed[k]
        a, b = self._structure.groups[k]
        real = self._is_real(k, path)

        def parts(n: Numbers) -> tuple[Any, Any]:
            w_a, w_b = n.links(k)
            t_b = n.body(path, b) / w_b
            return t_b, n.body(path, a) / w_a - t_b

        def f_1(n: Numbers) -> Any:
            w_a, w_b = np.abs(n.links(k)[0]), np.abs(n.links(k)[1])
            return parts(n)[1] * ((w_a - w_b) * (w_a + w_b))

        constants: list[Callable[[Numbers], Any]] = [
            lambda n: parts(n)[0] + parts(n)[1] / 2.0,
            f_1,
            lambda n: 1j * n.signs[k] * parts(n)[1],
        ]
        # Of what lies along its links f0 and f1 are real, and f2 is imaginary.
        f_x, f_y = (
            [
                None if real and (axis == 0) == (order == 2) else self._part(make, axis)
                for order, make in enumerate(constants)
            ]
            for axis in (0, 1)
        )
        return self._polynomial(f_x, w, r), self._polynomial(f_y, w, r)

    def _part(self, make: Callable[['Numbers'], Any], axis: int) -> str:
        part = (np.real, np.imag)[axis]
        return self._constant(lambda n: part(make(n)))

    def _polynomial(self, f: Sequence[Number], w: str, r: str) -> Number:
        inner = self._add(f[2] and self._apply('*', f[2], r), f[1])
        return self._add(inner and self._apply('*', inner, w), f[0])

    def _is_real(self, k: int, path: Path) -> bool:
        """Return whether a path goes along a dyad's links, or their bodies' first bars."""
        group, straight = self._structure.groups[k], self._structure.straight
        loop = self._paths.loops[self._paths.rows[k][0]]
        return all(
            bar in straight
            for way in (path, loop)
            for bar, _ in way.bars
            if self._structure.bars[bar][0] in group
        )

    def _links(self, k: int, m: tuple[str, str], w: str, r: str) -> list[tuple[str, str]]:
        """Return W_a u_a = z M and W_b u_b = M - z M."""

        def excess(n: Numbers) -> Any:
            w_a, w_b = (np.abs(link) for link in n.links(k))
            return (w_a - w_b) * (w_a + w_b)

        z_x = self._apply(
            '+', self._apply('*', self._constant(excess), w), self._constant(lambda _: 0.5)
        )
        z_y = self._apply('*', self._apply('*', self._constant(lambda n: n.signs[k]), r), w)
        x, y = self._product(m, (z_x, z_y))
        return [(x, y), (self._apply('-', m[0], x), self._apply('-', m[1], y))]

    # Numbers.

    def _product(self, one: tuple[str, str], other: Pair) -> tuple[str, str]:
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


def constants(made: Program, numbers: Numbers, count: int) -> FloatArray:
    """Return the constants of `count` linkages, shape (number of constants, count)."""
    table = np.empty((len(made.constants), count))
    with np.errstate(all='ignore'):
        for line, make in zip(table, made.constants, strict=True):
            line[:] = make(numbers)
    return table
