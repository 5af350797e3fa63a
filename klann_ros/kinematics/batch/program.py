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

Derivatives of a coordinate y by the dimensions are found by the adjoint method: one pass over the
dyads, the last first, serves all dimensions. A rotation of body j changes y by g_j. A dyad with
the links A = W_a u_a and B = W_b u_b follows an opening r of its loop by the rotations
-(B . r) / D and (A . r) / D, D = A x B, which change y by

    m . r,    m = (g_b A - g_a B) / D,

and r is the direct part of a dimension, plus i W_j u_j times the rotations of the bodies before:
these add m . (i W_j u_j) to their g_j. So dy is the direct part of y, plus m . r of each loop.
"""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence, Set as AbstractSet
from dataclasses import dataclass
from functools import cache, partial
from sys import float_info
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.linkage.dimension_derivatives import moved_bars, vector_derivatives
from klann_ros.kinematics.linkage.equations import path_terms
from klann_ros.kinematics.linkage.structure import Dimension, Structure
from klann_ros.kinematics.linkage.topology import Path
import numpy as np

# The name of a real number in a program; None if it is 0 for every linkage of the structure.
Number = str | None
# A number that is 1: a factor that costs no operation.
ONE = '1'
Components = tuple[Number, Number]
Pair = tuple[str, str]
Bars = tuple[tuple[int, int], ...]
# Computes one constant of n linkages, shape (n,).
Constant = Callable[['PathTerms'], Any]


class Operation(NamedTuple):
    """`name` = `one` OP `other`, where OP is + - * / or sqrt, which has no `other`."""

    name: str
    operator: str
    one: str
    other: str = ''


@dataclass(frozen=True, eq=False)
class Program:
    """The operations that compute poses, and the names of the results."""

    # In order; 'cos' and 'sin' are the crank's, 'k0', 'k1', ... the constants.
    operations: tuple[Operation, ...]
    constants: tuple[Constant, ...]
    # Coordinates of the foot.
    foot: Pair
    # Squared distance of each dyad's ends.
    distances: tuple[str, ...]
    # W_a u_a and W_b u_b of each dyad; empty for a program of the foot alone.
    links: tuple[Pair, ...]
    # Coordinates of each point; empty as above.
    points: tuple[Pair, ...]
    # The cross product of each dyad's links, its determinant; empty likewise.
    determinants: tuple[str, ...]
    # Derivatives of the requested quantities by the dimensions: of 'h', shape (2, d), of 'points',
    # shape (p, 2, d), and of 'angles', shape (n - 1, d), as flat lists.
    gradients: dict[str, tuple[str, ...]]
    # The derivative of each number by the crank angle, if requested.
    rates: dict[str, str]


class PathTerms:
    """
    The terms of paths (rows of W, c, Q and q) of many linkages of a structure.

    Computed from their pivots and bars as vectors; `signs` are their assembly modes, shape (number
    of dyads, n).
    """

    def __init__(
        self, structure: Structure, pivots: Sequence[Any], bars: Sequence[Any], signs: FloatArray
    ) -> None:
        self._structure, self._pivots, self.bars, self.signs = structure, pivots, bars, signs
        self._rows: dict[Path, tuple[Mapping[int, Any], Any]] = {}

    def body(self, path: Path, j: int) -> Any:
        """Return the coefficient of a body in a path."""
        return self._row(path)[0].get(j, 0.0)

    def fixed(self, path: Path) -> Any:
        """Return the constant of a path, by the pivots."""
        return self._row(path)[1]

    def derivative(self, dimension: Dimension, bars: Sequence[int]) -> Any:
        """Return the derivative of a sum of bars by a dimension."""
        _, moved = vector_derivatives(self._structure, self.bars, [dimension])
        return moved[[*bars], 0].sum(axis=0)

    def links(self, k: int) -> tuple[Any, Any]:
        """Return W_a and W_b of a dyad."""
        a, b = self._structure.groups[k]
        (loop,) = self._structure.paths.rows[k]
        path = self._structure.paths.loops[loop]
        return self.body(path, a), self.body(path, b)

    def singular_determinant(self, k: int) -> Any:
        """Return the threshold of |D| of a dyad for singularity: see `Block.singular_sine`."""
        (loop,) = self._structure.paths.rows[k]
        bodies, fixed = self._row(self._structure.paths.loops[loop])
        longest = np.max(np.broadcast_arrays(np.abs(fixed), *map(np.abs, bodies.values())), axis=0)
        one, other = (np.abs(link) for link in self.links(k))
        sine = np.sqrt(8.0 * float_info.epsilon * longest / np.minimum(one, other))
        return sine * one * other

    def _row(self, path: Path) -> tuple[Mapping[int, Any], Any]:
        if path not in self._rows:
            self._rows[path] = path_terms(self._structure, path, self._pivots, self.bars)
        return self._rows[path]


@cache
def compile_program(
    structure: Structure,
    *,
    links: bool,
    gradients: AbstractSet[str] = frozenset(),
    rates: bool = False,
) -> Program:
    """
    Return the program of a structure whose blocks are all dyads, cached.

    With `links` it also computes the links and the points, with `gradients` the derivatives by the
    dimensions of some of 'h', 'points' and 'angles', and with `rates` those by the crank angle.
    """
    wanted = sorted(gradients)
    return _Compiler(structure).program(links or bool(wanted), wanted, rates=rates)


class _Compiler:
    """Generates operations; a number that is 0 for the whole structure costs none."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._paths = structure.paths
        self._operations: list[Operation] = []
        self._constants: list[Constant] = []
        self._spans: list[Pair] = []
        self._roots: list[Pair] = []
        self._links: list[Pair] = []
        # The dyad of each body but the crank, and its side.
        self._sides = {j: (k, s) for k, g in enumerate(structure.groups) for s, j in enumerate(g)}
        # Operations and constants that are there already.
        self._known: dict[Hashable, str] = {}

    def program(self, links: bool, gradients: Sequence[str], *, rates: bool) -> Program:
        distances = []
        for k, (loop,) in enumerate(self._paths.rows):
            # M = W_a u_a + W_b u_b is minus the rest of the loop.
            path = Path((), ()).plus(self._paths.loops[loop], -1)
            m = self._sum(self._shortest(path, k), range(k), self._structure.groups[k])
            distance, w, r = self._close(k, m)
            distances.append(distance)
            self._spans.append(m)
            self._roots.append((w, r))
            if links:
                self._links += self._link_pair(k, m, w, r)
        names, foot = self._structure.points, self._structure.foot
        blocks = range(len(self._paths.rows))
        path = self._shortest(self._paths.points[names.index(foot)], len(blocks))
        ends = self._sum(path, blocks, ())
        points = [
            ends if name == foot else self._point(self._shortest(path, len(blocks)))
            for name, path in (zip(names, self._paths.points, strict=True) if links else ())
        ]
        found = {name: tuple(self._gradient(name)) for name in gradients}
        determinants = [self._determinant(k) for k in blocks] if links else ()
        derivatives = self._rates() if rates else {}
        return Program(
            operations=tuple(self._operations),
            constants=tuple(self._constants),
            foot=ends,
            distances=tuple(distances),
            links=tuple(self._links),
            points=tuple(points),
            determinants=tuple(determinants),
            gradients=found,
            rates=derivatives,
        )

    def _rates(self) -> dict[str, str]:
        """Append the derivatives of all numbers by the crank angle; return their names."""
        found: dict[str, Number] = {f'k{k}': None for k in range(len(self._constants))}
        found |= {'sin': 'cos', 'cos': self._add(None, 'sin', '-')}
        for name, operator, one, other in self._operations[:]:
            d_one, d_other = found.get(one), found.get(other)
            if operator in '+-':
                found[name] = self._add(d_one, d_other, operator)
            elif operator == '*':
                left = self._times(d_one, other)
                right = left if one == other else self._times(one, d_other)
                found[name] = self._add(left, right)
            elif operator == '/':
                # (a / b)' = (a' - (a / b) b') / b
                above = self._add(d_one, self._times(name, d_other), '-')
                found[name] = above and self._apply('/', above, other)
            else:
                found[name] = d_one and self._apply('/', d_one, self._apply('+', name, name))
        return {name: rate or self._zero for name, rate in found.items()}

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

    def _point(self, path: Path) -> Pair:
        """Return the end of a path, by the crank and the links of the dyads."""
        x, y = (
            self._constant(lambda n: np.real(n.fixed(path))),
            self._constant(lambda n: np.imag(n.fixed(path))),
        )
        for j in self._bodies(path):
            (u, v), sign = self._vector(path, j)
            x, y = self._apply(sign, x, u), self._apply(sign, y, v)
        return x, y

    def _bodies(self, path: Path) -> list[int]:
        """Return the bodies along a path."""
        return sorted({self._structure.bars[bar][0] for bar, _ in path.bars})

    def _bars(self, path: Path, j: int) -> Bars:
        return tuple(item for item in path.bars if self._structure.bars[item[0]][0] == j)

    def _vector(self, path: Path, j: int) -> tuple[Pair, str]:
        """Return the vector of a body in a path up to the sign of its first bar, and this sign."""
        first = ''
        x: Number = None
        y: Number = None
        for bar, times in self._bars(path, j):
            (u, v), sign = self._bar(bar)
            own = '-+'[(sign == '+') == (times > 0)]
            first = first or own
            for _ in range(abs(times)):
                x, y = (self._add(*pair, '-+'[own == first]) for pair in ((x, u), (y, v)))
        return (x or self._zero, y or self._zero), first

    def _bar(self, bar: int) -> tuple[Pair, str]:
        """Return the vector of a bar up to a sign, and this sign."""
        j = self._structure.bars[bar][0]
        if j:
            k, side = self._sides[j]
            link = self._bars(self._loop(k), j)
            if {*link} <= {(bar, 1), (bar, -1)}:
                return self._links[2 * k + side], '+-'[link[0][1] < 0]
        is_straight = bar in self._structure.straight
        return self._fixed_vector(lambda n: n.bars[bar], j, bar, real=is_straight), '+'

    def _fixed_vector(self, w: Constant, j: int, key: Hashable, *, real: bool) -> Pair:
        """Return the vector w u_j, which is fixed to a body."""
        if j == 0:
            return self._rotated(w, key, real=real)
        k, side = self._sides[j]

        def ratio(n: PathTerms) -> Any:
            return w(n) / n.links(k)[side]

        link = {bar for bar, _ in self._bars(self._loop(k), j)}
        is_real = real and link <= self._structure.straight
        factor = self._part(ratio, 0, key), None if is_real else self._part(ratio, 1, key)
        return self._product(self._links[2 * k + side], factor)

    def _loop(self, k: int) -> Path:
        return self._paths.loops[self._paths.rows[k][0]]

    def _crank(self, path: Path) -> Components:
        own = self._bars(path, 0)
        real = {bar for bar, _ in own} <= self._structure.straight
        return self._rotated(lambda n: n.body(path, 0), own, real=real) if own else (None, None)

    def _rotated(self, w: Constant, key: Hashable, *, real: bool) -> Pair:
        """Return w u_0 of a constant and the crank."""
        sense = self._structure.senses[0]
        x = self._apply('*', self._part(w, 0, key), 'cos')
        y = self._apply('*', self._part(lambda n: sense * w(n), 0, (sense, key)), 'sin')
        if real:
            return x, y
        g = self._part(lambda n: -sense * w(n), 1, (sense, key))
        x = self._apply('+', x, self._apply('*', g, 'sin'))
        return x, self._apply('+', y, self._apply('*', self._part(w, 1, key), 'cos'))

    # Derivatives by the dimensions.

    def _gradient(self, name: str) -> Iterator[str]:
        """Yield the derivatives of the foot, of all points or of all angles."""
        structure = self._structure
        if name == 'angles':
            for j in range(1, len(structure.bodies)):
                sense = float(structure.senses[j])
                yield from self._derivatives([], {j: self._constant(partial(_number, sense))})
            return
        some = [structure.foot] if name == 'h' else structure.points
        for point in some:
            path = self._paths.points[structure.points.index(point)]
            for axis in (0, 1):
                rates: dict[int, Number] = {}
                for j in self._bodies(path):
                    vector, sign = self._vector(path, j)
                    # Of i v: -y and x.
                    rates[j] = self._add(None, vector[1 - axis], '-+'[(sign == '+') == axis])
                direct: Components = (ONE, None) if axis == 0 else (None, ONE)
                yield from self._derivatives([(path, direct)], rates)

    def _derivatives(
        self, arms: list[tuple[Path, Components]], rates: dict[int, Number]
    ) -> Iterator[str]:
        """
        Yield the derivatives of a coordinate y by each dimension.

        `arms` are paths r with m of dy = m . r, and `rates` are dy by a rotation of each body; the
        dyads turn these into further arms.
        """
        for k in reversed(range(len(self._structure.groups))):
            loop, (a, b) = self._loop(k), self._structure.groups[k]
            g_a, g_b = rates.pop(a, None), rates.pop(b, None)
            if g_a is None and g_b is None:
                continue
            inverse = self._apply('/', self._one, self._determinant(k))
            g_a, g_b = self._times(g_a, inverse), self._times(g_b, inverse)
            m_x, m_y = (
                self._add(self._times(g_b, v), self._times(g_a, w), '-')
                for v, w in zip(*self._links[slice(2 * k, 2 * k + 2)], strict=True)
            )
            arms = [*arms, (loop, (m_x, m_y))]
            for j in self._bodies(loop):
                if j not in {0, a, b}:
                    vector, sign = self._vector(loop, j)
                    rates[j] = self._add(rates.get(j), self._cross(vector, (m_x, m_y), sign))
        for dimension in self._structure.dimensions:
            found = self._derivative(arms, dimension) or self._zero
            yield self._one if found == ONE else found

    def _derivative(self, arms: Sequence[tuple[Path, Components]], dimension: Dimension) -> Number:
        if dimension.kind in {'x', 'y'}:
            often = [dict(path.pivots).get(dimension.place, 0) for path, _ in arms]
            weight = self._weight(arms, often)['xy'.index(dimension.kind)]
            return self._add(None, weight, '+-'[dimension.sense < 0])
        # Bars that occur alike in all paths are moved together.
        moved: dict[tuple[int, ...], list[int]] = {}
        for bar in moved_bars(self._structure, dimension):
            moved.setdefault(tuple(dict(path.bars).get(bar, 0) for path, _ in arms), []).append(
                bar
            )
        total: Number = None
        for times, bars in moved.items():
            if any(times):
                pairs = zip(self._weight(arms, times), self._moved(dimension, bars), strict=True)
                x, y = (self._times(*pair) for pair in pairs)
                total = self._add(total, self._add(x, y))
        return total

    def _cross(self, one: Components, other: Components, sign: str) -> Number:
        """Return the cross product of two vectors, of the other with the one for '-'."""
        (x, y), (u, v) = (one, other) if sign == '+' else (other, one)
        return self._add(self._times(x, v), self._times(y, u), '-')

    def _weight(self, arms: Sequence[tuple[Path, Components]], times: Sequence[int]) -> Components:
        """Return the sum of the arms' m, each so often."""
        x: Number = None
        y: Number = None
        for (_, m), count in zip(arms, times, strict=True):
            for _ in range(abs(count)):
                x, y = (self._add(v, w, '+-'[count < 0]) for v, w in zip((x, y), m, strict=True))
        return x, y

    def _moved(self, dimension: Dimension, bars: Sequence[int]) -> Pair:
        """Return the derivative of a body's bars by a dimension."""
        is_along = {*bars} <= self._structure.straight
        body, _ = self._structure.bars[bars[0]]
        key = dimension, *bars
        return self._fixed_vector(
            lambda n: n.derivative(dimension, bars), body, key, real=is_along
        )

    def _determinant(self, k: int) -> str:
        """Return D of a dyad."""
        (x, y), (u, v) = self._links[slice(2 * k, 2 * k + 2)]
        return self._apply('-', self._apply('*', x, v), self._apply('*', y, u))

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

    def _part(self, make: Constant, axis: int, key: Hashable = None) -> str:
        part = (np.real, np.imag)[axis]
        return self._constant(lambda n: part(make(n)), key and (axis, key))

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

    def _link_pair(self, k: int, m: tuple[str, str], w: str, r: str) -> list[tuple[str, str]]:
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

    @property
    def _zero(self) -> str:
        return self._constant(lambda _: 0.0, 'zero')

    @property
    def _one(self) -> str:
        return self._constant(lambda _: 1.0, 'one')

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
        if other is None:
            return one
        if one is None and sign == '+':
            return other
        return self._apply(sign, one or self._zero, other)

    def _times(self, one: Number, other: Number) -> Number:
        if one is None or other is None:
            return None
        return other if one == ONE else one if other == ONE else self._apply('*', one, other)

    def _apply(self, operator: str, one: str, other: str) -> str:
        one, other = (self._one if name == ONE else name for name in (one, other))
        if (operator, one, other) not in self._known:
            name = self._known[operator, one, other] = f't{len(self._operations)}'
            self._operations.append(Operation(name, operator, one, other))
        return self._known[operator, one, other]

    def _constant(self, make: Constant, key: Hashable = None) -> str:
        """Return a new constant, or the one that has the key already."""
        if key is not None and key in self._known:
            return self._known[key]
        self._constants.append(make)
        name = f'k{len(self._constants) - 1}'
        if key is not None:
            self._known[key] = name
        return name


def _number(value: float, _: PathTerms) -> float:
    return value


def constants(program: Program, terms: PathTerms, count: int) -> FloatArray:
    """Return the constants of `count` linkages, shape (number of constants, count)."""
    table = np.empty((len(program.constants), count))
    with np.errstate(all='ignore'):
        for row, make in zip(table, program.constants, strict=True):
            row[:] = make(terms)
    return table
