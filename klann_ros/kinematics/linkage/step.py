"""
Newton-Raphson and the derivatives of a linkage, as generated straight-line code.

The topology of a linkage is known when it is made, and never changes. So a code generator runs the
loops over bodies, signs and blocks once, while it writes the source; only arithmetic on local
names is left. One source serves all linkages of a structure, with their numbers as its constants.
It holds no name of a user's file, only indices.

The names in the source are those of `step_source`, and e are the corrections of the coordinates
less their sign and q the coefficients dx/dalpha. Phi is block
lower triangular, so forward substitution, block by block, makes the corrections of the full Newton
of `Linkage.f`.
"""

from collections.abc import Callable, Iterable, Sequence
import linecache
from math import cos, hypot, inf, nan, pi, sin
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import MAX_UNWRAPPED, wrap

from .equations import LoopEquations
from .step_source import BlockSource, elimination_source, format_sum, LoopVectors, Sum, Term, Terms
from .structure import Structure

# A guess of coupled loops that needs more correction may have left its branch [rad].
MAX_BRANCH_JUMP = 0.05


class StepFunctions(NamedTuple):
    """The functions of a linkage."""

    # Of alpha, the other angles, the tolerance [rad] and the most iterations: the pose; None where
    # it does not converge, or not on the branch.
    correct: Callable[..., Any]
    # Of alpha, a step of the crank, and the x and coefficients of the pose before it: the same as
    # `correct`, from the guess along the tangent.
    predict: Callable[..., Any]
    # Of alpha, x, coefficients and the crank's rate: the rates of all angles, and of the foot.
    velocity: Callable[..., Any]
    # Of alpha, x, coefficients, the crank's rate and its change: the same, once more.
    acceleration: Callable[..., Any]


class CodeGenerator:
    """Writes the text for a structure, and tells the constants of a linkage in its order."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._vectors = LoopVectors(structure)
        self._loops, self._foot = self._vectors.loops, self._vectors.foot
        self._source = BlockSource(structure, self._vectors)
        self._blocks = [*enumerate(self._source.blocks)]
        self._dyads = [b for b, (_, loops) in self._blocks if len(loops) == 1]
        self._coupled = [b for b, (_, loops) in self._blocks if len(loops) > 1]
        self._bodies = range(len(structure.bodies))
        self._others = self._bodies[slice(1, None)]
        self._lines: list[str] = []

    def constants(self, linkage: LoopEquations) -> dict[str, float]:
        """Return the constants that the text names, of a linkage of this structure."""
        found = self._vectors.constants(linkage.bars)
        fixed = {f'c{k}': constant for k, (_, constant) in enumerate(linkage.rows)}
        for name, constant in (*fixed.items(), ('h', linkage.point_rows[linkage.foot][1])):
            found |= {f'{name}x': constant.real, f'{name}y': constant.imag}
        for b, (block, sign) in enumerate(zip(linkage.blocks, linkage.assembly, strict=True)):
            # The determinant's sign, and what of it is rounding, or singular.
            found |= {f'rounding{b}': block.rounding, f'sign{b}': sign * self._source.sine_sign(b)}
            found |= {f'least{b}': -block.rounding_of_sine * block.scale}
            found |= {f'singular{b}': block.singular_sine * block.scale}
            found |= {f'inverse{b}': 1.0 / block.scale}
            if not block.two_branches:
                # It closes in one way only, whichever sign that has.
                found[f'least{b}'] = -inf
        if self._structure.slides:
            found['size'] = linkage.size
        return found

    # The text.

    def source(self, constants: Iterable[str]) -> str:
        """Return the text of all functions, for constants of these names."""
        guess, tangent = _tuple('p', self._others), _tuple('q', self._others)
        self._lines = []
        for size in sorted({len(self._source.blocks[b][0]) for b in self._coupled}):
            self._lines += elimination_source(size)
        self._write(0, f'def make(kind, linkage, {", ".join(constants)}):')
        self._write(
            1, 'def correct(p0, guess, tolerance, max_iterations):', f'    {guess} = guess'
        )
        self._write_newton()
        self._write(
            1,
            'def predict(p0, step, x, coefficients, tolerance, max_iterations):',
            f'    {guess} = x',
            f'    {tangent} = coefficients',
            *(f'    p{j} += step * q{j}' for j in self._others),
        )
        self._write_newton()
        self._write(1, 'def velocity(p0, x, coefficients, rate):')
        self._write_motion(second=False)
        self._write(1, 'def acceleration(p0, x, coefficients, rate, change):')
        self._write_motion(second=True)
        self._write(1, 'return correct, predict, velocity, acceleration')
        return '\n'.join(self._lines) + '\n'

    def _write(self, indent: int, *lines: str) -> None:
        self._lines += ['    ' * indent + line for line in lines]

    def _write_solution(
        self, indent: int, block: int, opened: Sequence[Sum], letter: str
    ) -> dict[int, Term]:
        lines, changes = self._source.solution(block, opened, letter)
        self._write(indent, *lines)
        return changes

    def _write_vectors(self, bodies: Iterable[int], wanted: set[int], indent: int) -> None:
        self._write(indent, *self._vectors.lines(bodies, wanted))

    def _moved(self, terms: Terms, rates: dict[int, Term]) -> Sum:
        return self._vectors.first_derivative(terms, rates)

    def _plus(self, one: Sum, other: Sum) -> Sum:
        return [*one[0], *other[0]], [*one[1], *other[1]]

    def _write_newton(self) -> None:
        """Write the iterations, and the pose that they end at."""
        if self._coupled:
            self._write(2, f'{_tuple("o", self._others)} = {_tuple("p", self._others)}')
        if self._structure.slides:
            # Distances are as precise as angles, in the linkage's size.
            self._write(2, 'length_tolerance = tolerance * size')
        self._write_vectors([0], self._vectors.in_loops, 2)
        for k, terms in enumerate(self._loops):
            for axis in 'xy' if 0 in terms else '':
                sign, v = terms[0]
                known = format_sum([(1, f'c{k}{axis}'), (sign, f'v{v}{axis}')])
                self._write(2, f'k{k}{axis} = {known}')
        self._write(2, 'converged = False', 'for iterations in range(1, max_iterations + 1):')
        self._write_vectors(self._others, self._vectors.in_loops, 3)
        for k, terms in enumerate(self._loops):
            for axis in 'xy':
                parts = [(sign, f'v{v}{axis}') for j, (sign, v) in terms.items() if j]
                fixed = f'{"k" if 0 in terms else "c"}{k}{axis}'
                self._write(3, f'f{k}{axis} = {format_sum([(1, fixed), *parts])}')
        self._write(3, *self._source.determinants())
        closed = ' and '.join(
            f'-rounding{b} <= f{k}{axis} <= rounding{b}'
            for b, (_, loops) in self._blocks
            for k in loops
            for axis in 'xy'
        )
        self._write(3, f'if converged or ({closed}):', '    break')
        if self._dyads:
            self._write(3, f'if {self._vanish}:', '    return None')
        turns = self._write_corrections()
        for j, (sign, name) in turns.items():
            self._write(3, f'p{j} {"+" if sign > 0 else "-"}= {name}')
        limits = ['length_tolerance' if b.slides else 'tolerance' for b in self._structure.bodies]
        small = ' and '.join(f'-{limits[j]} <= e{j} <= {limits[j]}' for j in self._others)
        self._write(3, f'converged = {small}')
        self._write(2, 'else:', '    return None')
        self._write_pose()

    @property
    def _vanish(self) -> str:
        return ' or '.join(f'D{b} == 0.0' for b in self._dyads)

    def _write_corrections(self) -> dict[int, Term]:
        """Write the corrections of all angles; return their names."""
        turns: dict[int, Term] = {}
        for block, (_, loops) in self._blocks:
            opened = []
            for k in loops:
                x, y = self._moved(self._loops[k], turns)
                opened.append(([(1, f'f{k}x'), *x], [(1, f'f{k}y'), *y]))
            turns |= self._write_solution(3, block, opened, 'e')
            if len(loops) > 1:
                self._write(3, f'if D{block} == 0.0:', '    return None')
        return turns

    def _write_pose(self) -> None:
        self._write_coefficients()
        count = len(self._blocks)
        for b in range(count):
            self._write(2, f'signed{b} = D{b} * sign{b}')
        wrong = ' or '.join(f'signed{b} < least{b}' for b in range(count))
        self._write(2, f'if {wrong}:', '    return None')
        if self._coupled:
            # The signs alone do not tell the branches of coupled loops apart.
            sizes = [' * size' if body.slides else '' for body in self._structure.bodies]
            trusted = ' and '.join(
                f'-MAX_BRANCH_JUMP{sizes[j]} <= p{j} - o{j} <= MAX_BRANCH_JUMP{sizes[j]}'
                for j in self._others
            )
            self._write(2, f'if not ({trusted}):', '    return None')
        self._write_wrap()
        singular = ' or '.join(
            f'abs(signed{b}) <= singular{b}'
            if self._source.slides(b)
            else f'signed{b} <= singular{b}'
            for b in range(count)
        )
        self._write(2, f'if {singular}:', f'    {self._no_coefficients}')
        gaps = ', '.join(f'f{k}{axis}' for k in range(len(self._loops)) for axis in 'xy')
        # The columns of what slides along a link are as long as the distance is.
        sines = ', '.join(
            f'abs(signed{b}) / (hypot(g{b}x, g{b}y) * hypot(h{b}x, h{b}y))'
            if self._source.slides(b) and b in self._dyads
            else f'abs(signed{b}) * inverse{b}'
            for b in range(count)
        )
        foot = ', '.join(
            format_sum([(1, f'h{axis}'), *((s, f'v{v}{axis}') for s, v in self._foot.values())])
            for axis in 'xy'
        )
        self._write(
            2,
            'return new(kind, (',
            f'    p0, {_tuple("p", self._others)}, ({foot}), iterations,',
            f'    hypot({gaps}), coefficients, ({sines},), linkage,',
            '))',
        )

    def _write_wrap(self) -> None:
        """Write what brings angles into (-pi, pi]."""
        turning = [j for j in self._others if not self._structure.bodies[j].slides]
        if turning:
            inside = ' and '.join(f'-pi < p{j} <= pi' for j in turning)
            near = ' and '.join(f'-MAX_UNWRAPPED < p{j} < MAX_UNWRAPPED' for j in turning)
            self._write(2, f'if not ({inside}):', f'    if not ({near}):', '        return None')
            self._write(3, *(f'p{j} = wrap(p{j})' for j in turning))

    @property
    def _no_coefficients(self) -> str:
        return f'coefficients = ({"nan, " * len(self._others)})'

    def _write_coefficients(self) -> None:
        """Write the derivatives by the crank angle, by the same substitution; and the foot."""
        # Vectors of the foot alone, before the angles are wrapped.
        self._write_vectors(self._bodies, self._vectors.in_foot - self._vectors.in_loops, 2)
        indent = 2
        if self._dyads:
            self._write(2, f'if {self._vanish}:', f'    {self._no_coefficients}')
            self._write(3, *(f'D{b} = 0.0' for b in self._coupled))
            self._write(2, 'else:')
            indent = 3
        rates: dict[int, Term] = {0: (1, '')}
        for block, (_, loops) in self._blocks:
            opened = [self._moved(self._loops[k], rates) for k in loops]
            rates |= self._write_solution(indent, block, opened, 'q')
        signed = ', '.join(_signed(rates[j]) for j in self._others)
        self._write(indent, f'coefficients = ({signed},)')

    def _write_motion(self, *, second: bool) -> None:
        """Write the rates, or their changes, of the angles and of the foot."""
        vectors = self._vectors
        self._write(
            2,
            f'{_tuple("p", self._others)} = x',
            f'{_tuple("q", self._others)} = coefficients',
            'q0 = rate',
            *(f'q{j} *= rate' for j in self._others),
        )
        if not second:
            self._write_vectors(self._bodies, vectors.in_foot, 2)
            foot = self._moved(self._foot, {j: (1, f'q{j}') for j in self._bodies})
            ends = ', '.join(map(format_sum, foot))
            self._write(2, f'return {_tuple("q", self._bodies)}, ({ends})')
            return
        self._write_vectors(self._bodies, vectors.in_loops | vectors.in_foot, 2)
        self._write(2, *self._source.determinants())
        self._write(2, *(f's{j} = q{j} * q{j}' for j in self._bodies))
        squares = {j: f's{j}' for j in self._bodies}
        changes: dict[int, Term] = {0: (1, 'change')}

        def accelerated(terms: Terms) -> Sum:
            bent = vectors.velocity_products(terms, squares)
            return self._plus(self._moved(terms, changes), bent)

        for block, (_, loops) in self._blocks:
            opened = [accelerated(self._loops[k]) for k in loops]
            changes |= self._write_solution(2, block, opened, 'e')
        ends = ', '.join(map(format_sum, accelerated(self._foot)))
        signed = ', '.join(_signed(changes[j]) for j in self._others)
        self._write(2, f'return (change, {signed}), ({ends})')


def _tuple(letter: str, numbers: Iterable[int]) -> str:
    return f'({", ".join(f"{letter}{j}" for j in numbers)},)'


def _signed(term: Term) -> str:
    sign, name = term
    return f'{"-" if sign < 0 else ""}{name}'


_functions: dict[Structure, tuple[CodeGenerator, Callable[..., Any]]] = {}


def step_functions(linkage: LoopEquations, kind: type[tuple[Any, ...]]) -> StepFunctions:
    """Return the functions of a linkage, for a class of poses."""
    structure = linkage.structure
    if structure not in _functions:
        generator = CodeGenerator(structure)
        text = generator.source(generator.constants(linkage))
        _functions[structure] = generator, _made(text, f'<klann_ros step {len(_functions)}>')
    generator, make = _functions[structure]
    return StepFunctions(*make(kind, linkage, **generator.constants(linkage)))


def _made(text: str, name: str) -> Callable[..., Any]:
    # So that a traceback, or a reader, can see the text.
    linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
    names: dict[str, Any] = {
        'cos': cos, 'sin': sin, 'hypot': hypot, 'wrap': wrap, 'pi': pi, 'nan': nan,
        'MAX_UNWRAPPED': MAX_UNWRAPPED, 'MAX_BRANCH_JUMP': MAX_BRANCH_JUMP,
        'new': tuple.__new__,
    }  # fmt: skip
    exec(compile(text, name, 'exec'), names)  # noqa: S102 - of indices alone
    made: Callable[..., Any] = names['make']
    return made
