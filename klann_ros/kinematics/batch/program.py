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
from the structure alone, so it is compiled once; the kernels run the operations. The program of a
four-bar has 24. Its foot is the joint; `cos` and `sin` are those of the crank angle:

>>> from klann_ros.kinematics import FourBar
>>> print(compile_program(FourBar(180, 80, 200, 150).linkage.structure, links=False))
k0 = crank.x; k1 = fixed.x; k2 = fixed.y; k3 = half; k4 = folded; k5 = stretched
k6 = f0.x; k7 = f1.x; k8 = f2.y; k9 = fixed.x; k10 = fixed.y
t0 = cos * k0
t1 = sin * k0
t2 = t0 + k1
t3 = t1 + k2
t4 = t2 * t2
t5 = t3 * t3
t6 = t4 + t5
t7 = k3 / t6
t8 = t6 - k4
t9 = k5 - t6
t10 = t9 * t8
t11 = sqrt(t10)
t12 = k7 * t7
t13 = t12 + k6
t14 = k8 * t11
t15 = t14 * t7
t16 = t2 * t13
t17 = t3 * t13
t18 = t2 * t15
t19 = t3 * t15
t20 = t16 - t19
t21 = t17 + t18
t22 = t20 + k9
t23 = t21 + k10
foot = (t22, t23)

The derivative of a program by the crank angle is a program too: each operation is followed by its
rule. Derivatives of a coordinate y by the dimensions are found by the adjoint method: one pass
over the dyads, the last first, serves all dimensions. A rotation of body j changes y by g_j. A
dyad with the links A = W_a u_a and B = W_b u_b follows an opening r of its loop by the rotations
-(B . r) / D and (A . r) / D, D = A x B, which change y by

    m . r,    m = (g_b A - g_a B) / D,

and r is the direct part of a dimension, plus i W_j u_j times the rotations of the bodies before:
these add m . (i W_j u_j) to their g_j. So dy is the direct part of y, plus m . r of each loop.
"""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence, Set as AbstractSet
from dataclasses import dataclass
from functools import cache
from itertools import chain
from sys import float_info
from typing import Any, NamedTuple

from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.linkage.dimension_derivatives import moved_bars, vector_derivatives
from klann_ros.kinematics.linkage.equations import path_terms
from klann_ros.kinematics.linkage.structure import Dimension, Structure
from klann_ros.kinematics.linkage.topology import Path
import numpy as np

from .operations import Constant, needed_operations, Number, Operation, Recorder, Vector

# The names of the coordinates of a vector.
Pair = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Program:
    """The operations that compute poses, and the names of what they compute."""

    # In order; 'cos' and 'sin' are the crank's, 'k0', 'k1', ... the constants.
    operations: tuple[Operation, ...]
    constants: tuple[Constant, ...]
    # Coordinates of the foot; the first is NaN where a dyad does not close, foot or not.
    foot: Pair
    # Squared distance of each dyad's ends.
    distances: tuple[str, ...]
    # W_a u_a and W_b u_b of each dyad; empty for a program of the foot alone.
    links: tuple[Pair, ...]
    # Coordinates of each point; empty for a program of the foot alone.
    points: tuple[Pair, ...]
    # The cross product of each dyad's links, its determinant; empty for the foot alone.
    determinants: tuple[str, ...]
    # Derivatives of the requested quantities by the dimensions: of 'h', shape (2, d), of 'points',
    # shape (p, 2, d), and of 'angles', shape (n - 1, d), as flat lists.
    gradients: dict[str, tuple[str, ...]]
    # The derivative by the crank angle of each number that is named above, if requested.
    rates: dict[str, str]

    def __str__(self) -> str:
        """Return the program as text: the roles of the constants, the operations, the foot."""
        roles = [f'k{k} = {constant.role}' for k, constant in enumerate(self.constants)]
        lines = []
        for k in range(0, len(roles), 6):
            lines.append('; '.join(roles[slice(k, k + 6)]))
        return '\n'.join([*lines, *map(str, self.operations), f'foot = ({", ".join(self.foot)})'])


class PathTerms:
    """
    The terms of paths (rows of W, c, Q and q) of many linkages of a structure.

    Computed from their pivots and bars as vectors; `signs` are their assembly modes, shape (number
    of dyads, n).
    """

    def __init__(
        self, structure: Structure, pivots: Sequence[Any], bars: Sequence[Any], signs: FloatArray
    ) -> None:
        self._structure = structure
        self._pivots = pivots
        self.bars = bars
        self.signs = signs
        self._rows: dict[Path, tuple[Mapping[int, Any], Any]] = {}

    def body(self, path: Path, j: int) -> Any:
        """Return the coefficient of a body in a path."""
        return self._row(path)[0].get(j, 0.0)

    def fixed(self, path: Path) -> Any:
        """Return the constant of a path, by the pivots."""
        return self._row(path)[1]

    def derivative(self, dimension: Dimension, bars: Sequence[int]) -> Any:
        """Return the derivative of a sum of bars by a dimension."""
        _, bar_derivatives = vector_derivatives(self._structure, self.bars, [dimension])
        return bar_derivatives[[*bars], 0].sum(axis=0)

    def links(self, k: int) -> tuple[Any, Any]:
        """Return W_a and W_b of a dyad."""
        a, b = self._structure.groups[k]
        path = self._structure.dyad_loop(k)
        return self.body(path, a), self.body(path, b)

    def link_lengths(self, k: int) -> tuple[Any, Any]:
        """Return r_a and r_b of a dyad [m]."""
        w_a, w_b = self.links(k)
        return np.abs(w_a), np.abs(w_b)

    def excess(self, k: int) -> Any:
        """Return K = (r_a - r_b) (r_a + r_b) of a dyad [m^2]."""
        r_a, r_b = self.link_lengths(k)
        return (r_a - r_b) * (r_a + r_b)

    def singular_determinants(self, count: int) -> FloatArray:
        """Return the thresholds of |D| of each dyad of n linkages, shape (number of dyads, n)."""
        thresholds = np.empty((len(self._structure.groups), count))
        for k, row in enumerate(thresholds):
            row[:] = self._singular_determinant(k)
        return thresholds

    def _singular_determinant(self, k: int) -> Any:
        """Return the threshold of |D| of a dyad for singularity: see `Block.singular_sine`."""
        bodies, constant = self._row(self._structure.dyad_loop(k))
        vectors = np.broadcast_arrays(np.abs(constant), *map(np.abs, bodies.values()))
        longest = np.max(vectors, axis=0)
        r_a, r_b = self.link_lengths(k)
        sine = np.sqrt(8.0 * float_info.epsilon * longest / np.minimum(r_a, r_b))
        return sine * r_a * r_b

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
    names = sorted(gradients)
    return _Compiler(structure).program(links or bool(names), names, rates=rates)


class _PlacedDyad(NamedTuple):
    """The numbers of a dyad: M, d, w and r."""

    span: Vector
    distance: Number
    w: Number
    r: Number


class Arm(NamedTuple):
    """A path whose opening r changes a coordinate y by m . r."""

    path: Path
    m: Vector


class _Compiler:
    """Records the operations of a program."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._paths = structure.paths
        self._recorder = Recorder()
        sin = Number(self._recorder, 'sin', structure.senses[0])
        # u_0 of the crank, W_j u_j of each body of a dyad.
        self._vectors = {0: Vector(Number(self._recorder, 'cos'), sin)}
        self._dyads: list[_PlacedDyad] = []
        self._dyad_of: dict[int, int] = {}
        for k, group in enumerate(structure.groups):
            self._dyad_of |= dict.fromkeys(group, k)

    def program(self, links: bool, gradients: Sequence[str], *, rates: bool) -> Program:
        """Record the operations of all outputs; return them as a program."""
        for k, group in enumerate(self._structure.groups):
            # M = W_a u_a + W_b u_b is minus the rest of the loop.
            path = Path((), ()).plus(self._structure.dyad_loop(k), -1)
            self._dyads.append(self._close(k, self._end(self._shortest(path), group)))
            if links:
                self._place_links(k)
        foot = self._end(self._shortest(self._paths.points[self._foot]), ())
        points: list[Vector] = []
        link_vectors: list[Vector] = []
        if links:
            points = [self._point(n, foot) for n in range(len(self._paths.points))]
            link_vectors = [self._vectors[j] for j in self._dyad_of]
        derivatives = {name: list(self._gradient(name)) for name in gradients}
        determinants = []
        if links:
            determinants = list(map(self._determinant, range(len(self._dyads))))
        output = self._recorder.output
        gradient_names: dict[str, tuple[str, ...]] = {}
        outputs: dict[str, Any] = {
            'foot': self._outputs(foot),
            'distances': tuple(output(dyad.distance) for dyad in self._dyads),
            'links': tuple(map(self._outputs, link_vectors)),
            'points': tuple(map(self._outputs, points)),
            'determinants': tuple(map(output, determinants)),
            'gradients': gradient_names,
        }
        for name, numbers in derivatives.items():
            gradient_names[name] = tuple(map(output, numbers))
        rate_names: dict[str, str] = {}
        if rates:
            rates_of = self._rates()
            pairs = (outputs['foot'], *outputs['links'], *outputs['points'])
            for name in chain(*pairs, *outputs['gradients'].values()):
                rate_names[name] = output(rates_of.get(name, self._recorder.zero))
        # Last: the derivative of the check is 0, and must not be recorded.
        x, y = outputs['foot']
        checked_x = output(self._nan_where_open(foot.x))
        outputs['foot'] = checked_x, y
        if rates:
            rate_names[checked_x] = rate_names[x]
        operations = tuple(self._recorder.operations)
        return Program(operations, tuple(self._recorder.constants), **outputs, rates=rate_names)

    def _outputs(self, vector: Vector) -> Pair:
        return self._recorder.output(vector.x), self._recorder.output(vector.y)

    def _nan_where_open(self, x: Number) -> Number:
        """Return a coordinate of the foot, NaN where a dyad that does not carry it is open."""
        recorder = self._recorder
        checks = [x]
        for dyad in reversed(self._dyads):
            names = map(recorder.output, checks)
            operations = needed_operations(recorder.operations, names)
            if dyad.r.name not in {operation.name for operation in operations}:
                # NaN beyond the reach, and where the ends coincide.
                checks.append(dyad.r * dyad.w)
        for check in checks[1:]:
            x += check - check
        return x

    def _rates(self) -> dict[str, Number]:
        """Record the derivatives by the crank angle of all numbers that change with it."""
        recorder = self._recorder
        rates = {'sin': Number(recorder, 'cos'), 'cos': -Number(recorder, 'sin')}
        for operation in recorder.operations[:]:
            computed = Number(recorder, operation.name)
            left = Number(recorder, operation.left)
            right = Number(recorder, operation.right)
            left_rate = rates.get(left.name, recorder.zero)
            right_rate = rates.get(right.name, recorder.zero)
            if operation.operator == '+':
                rate = left_rate + right_rate
            elif operation.operator == '-':
                rate = left_rate - right_rate
            elif operation.operator == '*':
                term = left_rate * right
                rate = term + (term if left == right else left * right_rate)
            elif operation.operator == '/':
                # (a / b)' = (a' - (a / b) b') / b
                rate = (left_rate - computed * right_rate) / right
            else:
                rate = left_rate / (computed + computed)
            rates[operation.name] = rate
        return rates

    # Paths.

    @property
    def _foot(self) -> int:
        return self._structure.points.index(self._structure.foot)

    def _shortest(self, path: Path) -> Path:
        """Return the path with the same ends over the fewest bodies, by loops already closed."""
        detours = [path]
        for k in reversed(range(len(self._dyads))):
            loop = self._structure.dyad_loop(k)
            detours += [path.plus(loop), path.plus(loop, -1)]
        best = min(detours, key=self._cost)
        return path if self._cost(best) >= self._cost(path) else self._shortest(best)

    def _cost(self, path: Path) -> tuple[int, int]:
        """Return the numbers of blocks, the crank included, and of bars along a path."""
        blocks = {self._dyad_of.get(j, -1) for j in self._bodies(path)}
        return len(blocks), len(path.bars)

    def _end(self, path: Path, without: Sequence[int]) -> Vector:
        """Return a path's vector: what the crank and the dyads add to it, and a constant."""
        end = self._crank_part(path)
        bodies = {*self._bodies(path)} - {*without}
        for k, dyad in enumerate(self._dyads):
            if bodies & {*self._structure.groups[k]}:
                end += dyad.span * self._factor(k, path)
        return end + self._fixed(path)

    def _point(self, number: int, foot: Vector) -> Vector:
        """Return a point, by the crank and the links of the dyads."""
        if number == self._foot:
            return foot
        path = self._shortest(self._paths.points[number])
        point = self._fixed(path)
        for j in self._bodies(path):
            point += self._body_part(path, j)
        return point

    def _fixed(self, path: Path) -> Vector:
        return self._recorder.vector('fixed', lambda terms: terms.fixed(path), path)

    def _bodies(self, path: Path) -> list[int]:
        """Return the bodies along a path."""
        return sorted({self._structure.bars[bar][0] for bar, _ in path.bars})

    def _bars(self, path: Path, j: int) -> list[tuple[int, int]]:
        """Return the bars of a body along a path, with their signs."""
        return [(bar, sign) for bar, sign in path.bars if self._structure.bars[bar][0] == j]

    def _is_straight(self, path: Path, bodies: Sequence[int]) -> bool:
        """Return whether a path follows the first bars of some bodies alone."""
        for bar, _ in path.bars:
            if self._structure.bars[bar][0] in bodies and bar not in self._structure.straight:
                return False
        return True

    def _body_part(self, path: Path, j: int) -> Vector:
        """Return what a body adds to a path."""
        part = Vector(self._recorder.zero, self._recorder.zero)
        for bar, times in self._bars(path, j):
            vector = self._bar(bar)
            for _ in range(abs(times)):
                part = part + vector if times > 0 else part - vector
        return part

    def _bar(self, bar: int) -> Vector:
        """Return the vector of a bar."""
        j = self._structure.bars[bar][0]
        if j:
            link = self._bars(self._structure.dyad_loop(self._dyad_of[j]), j)
            if len(link) == 1 and link[0] in {(bar, 1), (bar, -1)}:
                return self._vectors[j].scaled(self._recorder.one.with_sign(link[0][1]))
        is_straight = bar in self._structure.straight
        return self._fixed_vector(lambda terms: terms.bars[bar], j, bar, is_straight=is_straight)

    def _fixed_vector(
        self, w: Callable[[PathTerms], Any], j: int, key: Hashable, *, is_straight: bool
    ) -> Vector:
        """Return the vector w u_j, which is fixed to a body."""
        if j == 0:
            axes = 'x' if is_straight else 'xy'
            return self._vectors[0] * self._recorder.vector('crank', w, key, axes=axes)
        k = self._dyad_of[j]
        side = self._structure.groups[k].index(j)
        is_real = is_straight and self._is_straight(self._structure.dyad_loop(k), [j])
        ratio = self._recorder.vector(
            'ratio', lambda terms: w(terms) / terms.links(k)[side], key, axes='xy'[: 2 - is_real]
        )
        return self._vectors[j] * ratio

    def _crank_part(self, path: Path) -> Vector:
        """Return what the crank adds to a path."""
        bars = self._bars(path, 0)
        if not bars:
            return Vector(self._recorder.zero, self._recorder.zero)
        is_straight = self._is_straight(path, [0])
        return self._fixed_vector(
            lambda terms: terms.body(path, 0), 0, tuple(bars), is_straight=is_straight
        )

    # Derivatives by the dimensions.

    def _gradient(self, name: str) -> Iterator[Number]:
        """Yield the derivatives of the foot, of all points or of all angles."""
        structure = self._structure
        zero = self._recorder.zero
        unit = self._recorder.one
        if name == 'angles':
            for j in range(1, len(structure.bodies)):
                yield from self._derivatives([], {j: unit.with_sign(structure.senses[j])})
            return
        for number in [self._foot] if name == 'h' else range(len(structure.points)):
            path = self._paths.points[number]
            for axis, direct in (('x', Vector(unit, zero)), ('y', Vector(zero, unit))):
                rates = {}
                for j in self._bodies(path):
                    rates[j] = self._body_part(path, j).turned().component(axis)
                yield from self._derivatives([Arm(path, direct)], rates)

    def _derivatives(self, arms: list[Arm], rates: dict[int, Number]) -> Iterator[Number]:
        """
        Yield the derivatives of a coordinate y by each dimension.

        `rates` are dy by a rotation of each body; the dyads turn these into further arms.
        """
        zero = self._recorder.zero
        for k in reversed(range(len(self._dyads))):
            a, b = self._structure.groups[k]
            g_a = rates.pop(a, zero)
            g_b = rates.pop(b, zero)
            if g_a.is_zero and g_b.is_zero:
                continue
            inverse = self._recorder.one / self._determinant(k)
            m = self._vectors[a].scaled(g_b * inverse) - self._vectors[b].scaled(g_a * inverse)
            loop = self._structure.dyad_loop(k)
            arms = [*arms, Arm(loop, m)]
            for j in self._bodies(loop):
                if j not in {0, a, b}:
                    rates[j] = rates.get(j, zero) + self._body_part(loop, j).cross(m)
        for dimension in self._structure.dimensions:
            yield self._derivative(arms, dimension)

    def _derivative(self, arms: Sequence[Arm], dimension: Dimension) -> Number:
        """Return the derivative by a dimension of the coordinate that arms change."""
        if dimension.kind in {'x', 'y'}:
            counts = tuple(dict(arm.path.pivots).get(dimension.place, 0) for arm in arms)
            return self._gradient_by_vector(arms, counts).component(dimension.kind)
        # Bars with the same counts in the paths of the arms are moved together.
        bars_by_counts: dict[tuple[int, ...], list[int]] = {}
        for bar in moved_bars(self._structure, dimension):
            counts = tuple(dict(arm.path.bars).get(bar, 0) for arm in arms)
            bars_by_counts.setdefault(counts, []).append(bar)
        derivative = self._recorder.zero
        for counts, bars in bars_by_counts.items():
            if any(counts):
                gradient = self._gradient_by_vector(arms, counts)
                derivative += gradient.dot(self._bar_derivative(dimension, bars))
        return derivative

    def _gradient_by_vector(self, arms: Sequence[Arm], counts: Sequence[int]) -> Vector:
        """Return dy by a vector that the path of each arm adds a number of times."""
        gradient = Vector(self._recorder.zero, self._recorder.zero)
        for arm, count in zip(arms, counts, strict=True):
            for _ in range(abs(count)):
                gradient = gradient - arm.m if count < 0 else gradient + arm.m
        return gradient

    def _bar_derivative(self, dimension: Dimension, bars: Sequence[int]) -> Vector:
        """Return the derivative of the sum of a body's bars by a dimension."""
        is_straight = {*bars} <= self._structure.straight
        body, _ = self._structure.bars[bars[0]]
        key = dimension, *bars
        return self._fixed_vector(
            lambda terms: terms.derivative(dimension, bars), body, key, is_straight=is_straight
        )

    # A dyad.

    def _determinant(self, k: int) -> Number:
        """Return D of a dyad."""
        a, b = self._structure.groups[k]
        return self._vectors[a].cross(self._vectors[b])

    def _half(self) -> Number:
        return self._recorder.constant('half', lambda _: 0.5, None)

    def _close(self, k: int, span: Vector) -> _PlacedDyad:
        """Return the numbers of a dyad by M."""
        distance = span.dot(span)
        w = self._half() / distance

        def stretched(terms: PathTerms) -> Any:
            r_a, r_b = terms.link_lengths(k)
            return (r_a + r_b) ** 2

        def folded(terms: PathTerms) -> Any:
            r_a, r_b = terms.link_lengths(k)
            return (r_a - r_b) ** 2

        beyond_folded = distance - self._recorder.constant('folded', folded, k)
        before_stretched = self._recorder.constant('stretched', stretched, k) - distance
        return _PlacedDyad(span, distance, w, (before_stretched * beyond_folded).root())

    def _factor(self, k: int, path: Path) -> Vector:
        """Return f0 + w (f1 + f2 r), the factor of a dyad's M in a path."""
        a, b = self._structure.groups[k]

        def ratios(terms: PathTerms) -> tuple[Any, Any]:
            """Return T_b / W_b and k."""
            w_a, w_b = terms.links(k)
            ratio_b = terms.body(path, b) / w_b
            return ratio_b, terms.body(path, a) / w_a - ratio_b

        def f_0(terms: PathTerms) -> Any:
            ratio_b, difference = ratios(terms)
            return ratio_b + difference / 2.0

        def f_1(terms: PathTerms) -> Any:
            return ratios(terms)[1] * terms.excess(k)

        def f_2(terms: PathTerms) -> Any:
            return 1j * terms.signs[k] * ratios(terms)[1]

        # For vectors along the links f0 and f1 are real, and f2 is imaginary.
        loop = self._structure.dyad_loop(k)
        is_straight = self._is_straight(path, [a, b]) and self._is_straight(loop, [a, b])
        real, imaginary = ('x', 'y') if is_straight else ('xy', 'xy')
        c_0 = self._recorder.vector('f0', f_0, (k, path), axes=real)
        c_1 = self._recorder.vector('f1', f_1, (k, path), axes=real)
        c_2 = self._recorder.vector('f2', f_2, (k, path), axes=imaginary)
        w = self._dyads[k].w
        r = self._dyads[k].r
        # First x, then y: NumPy needs fewer buffers.
        x = (c_2.x * r + c_1.x) * w + c_0.x
        y = (c_2.y * r + c_1.y) * w + c_0.y
        return Vector(x, y)

    def _place_links(self, k: int) -> None:
        """Place the links W_a u_a = z M and W_b u_b = M - z M of a dyad."""
        a, b = self._structure.groups[k]
        dyad = self._dyads[k]
        excess = self._recorder.constant('K', lambda terms: terms.excess(k), k)
        sign = self._recorder.constant('s', lambda terms: terms.signs[k], k)
        z = Vector(excess * dyad.w + self._half(), sign * dyad.r * dyad.w)
        self._vectors[a] = dyad.span * z
        self._vectors[b] = dyad.span - self._vectors[a]


def constants(program: Program, terms: PathTerms, count: int) -> FloatArray:
    """Return the constants of `count` linkages, shape (number of constants, count)."""
    table = np.empty((len(program.constants), count))
    with np.errstate(all='ignore'):
        for row, constant in zip(table, program.constants, strict=True):
            row[:] = constant.compute(terms)
    return table
