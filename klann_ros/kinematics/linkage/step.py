"""
Newton-Raphson and the derivatives of a linkage, as generated straight-line code.

The topology of a linkage is known when it is made, and never changes. So a code generator runs the
loops over bodies, signs and blocks once, while it writes the source; only arithmetic on local
names is left. One source serves all linkages of a structure, with their numbers as its constants.
It holds no name of a user's file, only indices.

The source of a four-bar; `predict` differs from `correct` in its first lines alone:

>>> from klann_ros.kinematics import FourBar
>>> linkage = FourBar(180, 80, 200, 150).linkage
>>> source = StepSource(linkage.structure)
>>> print(source.text(source.constants(linkage, linkage.assembly)))
def make(kind, linkage, a0, d0, a1, d1, a2, d2, c0x, c0y, hx, hy, rounding0, ...):
    def correct(p0, guess, tolerance, max_iterations):
        (p1, p2,) = guess
        v0x = a0 * cos(p0)
        v0y = d0 * sin(p0)
        k0x = c0x + v0x
        k0y = c0y + v0y
        converged = False
        for iterations in range(1, max_iterations + 1):
            v1x = a1 * cos(p1)
            v1y = d1 * sin(p1)
            v2x = a2 * cos(p2)
            v2y = d2 * sin(p2)
            f0x = k0x + v1x - v2x
            f0y = k0y + v1y - v2y
            D0 = v1x * v2y - v1y * v2x
            if converged or (-rounding0 <= f0x <= rounding0 and -rounding0 <= f0y <= rounding0):
                break
            if D0 == 0.0:
                return None
            e1 = (v2x * f0x + v2y * f0y) / D0
            e2 = (v1x * f0x + v1y * f0y) / D0
            p1 -= e1
            p2 -= e2
            converged = -tolerance <= e1 <= tolerance and -tolerance <= e2 <= tolerance
        else:
            return None
        if D0 == 0.0:
            coefficients = (nan, nan, )
        else:
            r0x = -v0y
            q1 = (v2x * r0x + v2y * v0x) / D0
            q2 = (v1x * r0x + v1y * v0x) / D0
            coefficients = (-q1, -q2,)
        signed0 = D0 * sign0
        if signed0 < least0:
            return None
        if not (-pi < p1 <= pi and -pi < p2 <= pi):
            if not (-MAX_UNWRAPPED < p1 < MAX_UNWRAPPED and -MAX_UNWRAPPED < p2 < MAX_UNWRAPPED):
                return None
            p1 = wrap(p1)
            p2 = wrap(p2)
        if signed0 <= singular0:
            coefficients = (nan, nan, )
        return new(kind, (
            p0, (p1, p2,), (hx + v2x, hy + v2y), iterations,
            hypot(f0x, f0y), coefficients, (abs(signed0) * inverse0,), linkage, 0,
        ))
    ...
    def velocity(p0, x, coefficients, rate):
        (p1, p2,) = x
        (q1, q2,) = coefficients
        q0 = rate
        q1 *= rate
        q2 *= rate
        v2x = a2 * cos(p2)
        v2y = d2 * sin(p2)
        return (q0, q1, q2,), (-v2y * q2, v2x * q2)
    ...

The names are those of `step_source`; e are the corrections of the coordinates less their sign and
q the coefficients dx/dalpha. Phi is block lower triangular, so forward substitution, block by
block, makes the corrections of the full Newton of `Linkage.f`.
"""

from collections.abc import Callable, Iterable, Sequence
import linecache
from math import cos, hypot, inf, nan, pi, sin
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import MAX_UNWRAPPED, wrap

from .equations import LoopEquations
from .step_source import (
    BlockSource,
    elimination_source,
    format_sum,
    LoopVectors,
    repeat,
    Sum,
    Term,
    Terms,
)
from .structure import Structure

# A guess of coupled loops that needs more correction may have left its branch [rad].
MAX_BRANCH_JUMP = 0.05

_FUNCTIONS = """\
def make(kind, linkage, {constants}):
    def correct(p0, guess, tolerance, max_iterations):
        {p} = guess
        {newton}
    def predict(p0, step, x, coefficients, tolerance, max_iterations):
        {p} = x
        {q} = coefficients
        {tangent_steps}
        {newton}
    def velocity(p0, x, coefficients, rate):
        {p} = x
        {q} = coefficients
        {rates}
        {velocity}
    def acceleration(p0, x, coefficients, rate, change):
        {p} = x
        {q} = coefficients
        {rates}
        {acceleration}
    return correct, predict, velocity, acceleration
"""
# Names of the guess, where coupled loops need it, and a tolerance, where something slides.
_NEWTON = """\
{guess}
{length_tolerance}
{crank_vectors}
{crank_openings}
converged = False
for iterations in range(1, max_iterations + 1):
    {vectors}
    {openings}
    {determinants}
    if converged or ({closed}):
        break
    {refuse_singular}
    {corrections}
    converged = {small}
else:
    return None
{foot_vectors}
{coefficients}
{signs}
if {wrong_sign}:
    return None
{refuse_jump}
{wrap}
if {singular}:
    {no_coefficients}
return new(kind, (
    p0, {p}, ({foot}), iterations,
    hypot({gaps}), coefficients, ({sines},), linkage, 0,
))
"""
# A statement whose body is of one kind alone.
_RETURN_IF = """\
if {condition}:
    return None
"""
_WRAP = """\
if not ({inside}):
    if not ({near}):
        return None
    {wraps}
"""
_COEFFICIENTS = """\
if {vanish}:
    {no_coefficients}
    {no_determinants}
else:
    {coefficients}
"""


class StepFunctions(NamedTuple):
    """The functions of a linkage."""

    # Takes alpha, the other angles, the tolerance [rad] and the maximum of iterations; returns the
    # pose, None where it does not converge, or not on the branch.
    correct: Callable[..., Any]
    # Takes alpha, a step of the crank, the x and coefficients of the pose before it, and the
    # limits of `correct`; returns the pose from the guess along the tangent.
    predict: Callable[..., Any]
    # Takes alpha, x, coefficients and the crank's rate; returns the rates of all angles, and of
    # the foot.
    velocity: Callable[..., Any]
    # Takes what `velocity` takes, and the change of the crank's rate; returns the accelerations of
    # all angles, and of the foot.
    acceleration: Callable[..., Any]


class StepSource:
    """The source for a structure, and the constants that it names of a linkage."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._vectors = LoopVectors(structure)
        self._loops = self._vectors.loops
        self._source = BlockSource(structure, self._vectors)
        self._bodies = range(len(structure.bodies))
        self._others = self._bodies[slice(1, None)]

    @property
    def _blocks(self) -> range:
        return range(len(self._source.blocks))

    @property
    def _dyads(self) -> list[int]:
        return [b for b in self._blocks if not self._source.is_coupled(b)]

    @property
    def _coupled(self) -> list[int]:
        return [b for b in self._blocks if self._source.is_coupled(b)]

    def constants(self, linkage: LoopEquations, signs: Sequence[int]) -> dict[str, float]:
        """Return the constants of a linkage of this structure, with the signs of its blocks."""
        constants = self._vectors.constants(linkage.bars)
        _, foot = linkage.point_rows[linkage.foot]
        for k, (_, constant) in enumerate(linkage.rows):
            constants |= {f'c{k}x': constant.real, f'c{k}y': constant.imag}
        constants |= {'hx': foot.real, 'hy': foot.imag}
        for b, block in enumerate(linkage.blocks):
            constants[f'rounding{b}'] = block.rounding
            # The determinant's sign, and the limits below which it is rounding, or singular.
            constants[f'sign{b}'] = signs[b] * self._source.sine_sign(b)
            # NumPy's numbers are slow to compare.
            constants[f'least{b}'] = float(-block.rounding_of_sine * block.scale)
            constants[f'singular{b}'] = float(block.singular_sine * block.scale)
            constants[f'inverse{b}'] = 1.0 / block.scale
            if not block.two_branches:
                # It closes in one way only, whichever sign that has.
                constants[f'least{b}'] = -inf
        if self._structure.slides:
            constants['size'] = linkage.size
        return constants

    def text(self, constants: Iterable[str]) -> str:
        """Return the source of all functions, for constants of these names."""
        lines = []
        sizes = {len(self._source.blocks[b][0]) for b in self._coupled}
        for size in sorted(sizes):
            lines += elimination_source(size)
        lines += _fill(
            _FUNCTIONS,
            constants=', '.join(constants),
            p=_tuple('p', self._others),
            q=_tuple('q', self._others),
            newton=self._newton(),
            tangent_steps=repeat('p{0} += step * q{0}', self._others),
            rates=['q0 = rate', *repeat('q{} *= rate', self._others)],
            velocity=self._velocity(),
            acceleration=self._acceleration(),
        )
        return '\n'.join(lines) + '\n'

    # Newton-Raphson.

    def _newton(self) -> list[str]:
        """Return the lines of the iterations, and of the pose that they end at."""
        vectors = self._vectors
        foot_alone = vectors.in_foot - vectors.in_loops
        # Distances are as precise as angles, in the linkage's size.
        length_tolerance = ['length_tolerance = tolerance * size'] * self._structure.slides
        guess = f'{_tuple("o", self._others)} = {_tuple("p", self._others)}'
        gaps = repeat('f{0}x, f{0}y', range(len(self._loops)))
        return _fill(
            _NEWTON,
            guess=[guess] if self._coupled else [],
            length_tolerance=length_tolerance,
            crank_vectors=vectors.lines([0], vectors.in_loops),
            crank_openings=self._crank_openings(),
            vectors=vectors.lines(self._others, vectors.in_loops),
            openings=self._openings(),
            determinants=self._source.determinants(),
            closed=self._closed(),
            refuse_singular=_fill(_RETURN_IF, condition=self._vanish) if self._dyads else [],
            corrections=self._corrections(),
            small=self._within('e{}', 'tolerance', 'length_tolerance'),
            # Vectors of the foot alone, before the angles are wrapped.
            foot_vectors=vectors.lines(self._bodies, foot_alone),
            coefficients=self._coefficients(),
            signs=repeat('signed{0} = D{0} * sign{0}', self._blocks),
            wrong_sign=' or '.join(repeat('signed{0} < least{0}', self._blocks)),
            refuse_jump=self._refuse_jump() if self._coupled else [],
            wrap=self._wrap(),
            singular=' or '.join(map(self._is_singular, self._blocks)),
            no_coefficients=self._no_coefficients,
            p=_tuple('p', self._others),
            foot=self._foot(),
            gaps=', '.join(gaps),
            sines=', '.join(map(self._sine, self._blocks)),
        )

    def _crank_openings(self) -> list[str]:
        """Return the lines of what the constant and the crank add to each loop."""
        lines = []
        for k, terms in enumerate(self._loops):
            for axis in 'xy' if 0 in terms else '':
                sign, v = terms[0]
                opening = format_sum([(1, f'c{k}{axis}'), (sign, f'v{v}{axis}')])
                lines.append(f'k{k}{axis} = {opening}')
        return lines

    def _openings(self) -> list[str]:
        lines = []
        for k, terms in enumerate(self._loops):
            start = f'k{k}' if 0 in terms else f'c{k}'
            for axis in 'xy':
                addends = [(1, f'{start}{axis}')]
                for j, (sign, v) in terms.items():
                    if j:
                        addends.append((sign, f'v{v}{axis}'))
                lines.append(f'f{k}{axis} = {format_sum(addends)}')
        return lines

    def _closed(self) -> str:
        conditions = []
        for b, (_, loops) in enumerate(self._source.blocks):
            for k in loops:
                conditions.append(f'-rounding{b} <= f{k}x <= rounding{b}')
                conditions.append(f'-rounding{b} <= f{k}y <= rounding{b}')
        return ' and '.join(conditions)

    @property
    def _vanish(self) -> str:
        return ' or '.join(repeat('D{} == 0.0', self._dyads))

    def _corrections(self) -> list[str]:
        lines: list[str] = []
        corrections: dict[int, Term] = {}
        for b, (_, loops) in enumerate(self._source.blocks):
            opened = []
            for k in loops:
                x, y = self._vectors.first_derivative(self._loops[k], corrections)
                opened.append(([(1, f'f{k}x'), *x], [(1, f'f{k}y'), *y]))
            corrections |= self._solve(b, opened, 'e', lines)
            if self._source.is_coupled(b):
                lines += _fill(_RETURN_IF, condition=f'D{b} == 0.0')
        for j, (sign, name) in corrections.items():
            lines.append(f'p{j} {"+" if sign > 0 else "-"}= {name}')
        return lines

    def _solve(
        self, block: int, opened: Sequence[Sum], letter: str, lines: list[str]
    ) -> dict[int, Term]:
        """Append the solution of a block; return the changes of its bodies' coordinates."""
        solution, changes = self._source.solution(block, opened, letter)
        lines += solution
        return changes

    def _within(self, term: str, limit: str, limit_of_slider: str) -> str:
        """Return the condition that a term of each body but the crank is within its limit."""
        conditions = []
        for j in self._others:
            bound = limit_of_slider if self._structure.bodies[j].slides else limit
            conditions.append(f'-{bound} <= {term.format(j)} <= {bound}')
        return ' and '.join(conditions)

    def _coefficients(self) -> list[str]:
        """Return the lines of the derivatives by the crank angle, by the same substitution."""
        lines: list[str] = []
        rates: dict[int, Term] = {0: (1, '')}
        for b, (_, loops) in enumerate(self._source.blocks):
            opened = [self._vectors.first_derivative(self._loops[k], rates) for k in loops]
            rates |= self._solve(b, opened, 'q', lines)
        lines.append(f'coefficients = ({self._signed(rates)},)')
        if not self._dyads:
            return lines
        return _fill(
            _COEFFICIENTS,
            vanish=self._vanish,
            no_coefficients=self._no_coefficients,
            no_determinants=repeat('D{} = 0.0', self._coupled),
            coefficients=lines,
        )

    @property
    def _no_coefficients(self) -> str:
        return f'coefficients = ({"nan, " * len(self._others)})'

    def _refuse_jump(self) -> list[str]:
        """Refuse a jump from the guess: signs alone do not tell the branches of coupled loops."""
        is_near = self._within('p{0} - o{0}', 'MAX_BRANCH_JUMP', 'MAX_BRANCH_JUMP * size')
        return _fill(_RETURN_IF, condition=f'not ({is_near})')

    def _wrap(self) -> list[str]:
        """Return the lines that bring angles into (-pi, pi]."""
        turning = [j for j in self._others if not self._structure.bodies[j].slides]
        if not turning:
            return []
        return _fill(
            _WRAP,
            inside=' and '.join(repeat('-pi < p{} <= pi', turning)),
            near=' and '.join(repeat('-MAX_UNWRAPPED < p{} < MAX_UNWRAPPED', turning)),
            wraps=repeat('p{0} = wrap(p{0})', turning),
        )

    def _is_singular(self, block: int) -> str:
        signed = f'abs(signed{block})' if self._source.slides(block) else f'signed{block}'
        return f'{signed} <= singular{block}'

    def _sine(self, block: int) -> str:
        if self._source.slides(block) and not self._source.is_coupled(block):
            # The columns of what slides along a link are as long as the distance is.
            lengths = f'hypot(g{block}x, g{block}y) * hypot(h{block}x, h{block}y)'
            return f'abs(signed{block}) / ({lengths})'
        return f'abs(signed{block}) * inverse{block}'

    def _foot(self) -> str:
        x = [(1, 'hx')]
        y = [(1, 'hy')]
        for sign, v in self._vectors.foot.values():
            x.append((sign, f'v{v}x'))
            y.append((sign, f'v{v}y'))
        return f'{format_sum(x)}, {format_sum(y)}'

    # Motion.

    def _velocity(self) -> list[str]:
        """Return the lines of `velocity`: the rates of all angles, and of the foot."""
        lines = self._vectors.lines(self._bodies, self._vectors.in_foot)
        rates: dict[int, Term] = {j: (1, f'q{j}') for j in self._bodies}
        foot_rate = self._vectors.first_derivative(self._vectors.foot, rates)
        x, y = map(format_sum, foot_rate)
        return [*lines, f'return {_tuple("q", self._bodies)}, ({x}, {y})']

    def _acceleration(self) -> list[str]:
        """Return the lines of `acceleration`: those of all angles, and of the foot."""
        vectors = self._vectors
        lines = vectors.lines(self._bodies, vectors.in_loops | vectors.in_foot)
        lines += self._source.determinants()
        lines += repeat('s{0} = q{0} * q{0}', self._bodies)
        accelerations: dict[int, Term] = {0: (1, 'change')}
        for b, (_, loops) in enumerate(self._source.blocks):
            opened = [self._second_derivative(self._loops[k], accelerations) for k in loops]
            accelerations |= self._solve(b, opened, 'e', lines)
        x, y = map(format_sum, self._second_derivative(vectors.foot, accelerations))
        lines.append(f'return (change, {self._signed(accelerations)}), ({x}, {y})')
        return lines

    def _second_derivative(self, terms: Terms, accelerations: dict[int, Term]) -> Sum:
        x, y = self._vectors.first_derivative(terms, accelerations)
        squares = {j: f's{j}' for j in self._bodies}
        product_x, product_y = self._vectors.velocity_products(terms, squares)
        return [*x, *product_x], [*y, *product_y]

    def _signed(self, terms: dict[int, Term]) -> str:
        """Return the terms of all bodies but the crank."""
        signed = []
        for j in self._others:
            sign, name = terms[j]
            signed.append(f'-{name}' if sign < 0 else name)
        return ', '.join(signed)


def _fill(template: str, **parts: str | Sequence[str]) -> list[str]:
    """Return the lines of a template; a list of lines fills a line of its own."""
    lines = []
    for line in template.splitlines():
        place = line.strip()
        indent = line[: len(line) - len(place)]
        part = parts.get(place.strip('{}'), '')
        if isinstance(part, list):
            lines += [indent + part_line for part_line in part]
        else:
            lines.append(line.format_map(parts))
    return lines


def _tuple(letter: str, numbers: Iterable[int]) -> str:
    return f'({", ".join(repeat(letter + "{}", numbers))},)'


_makers: dict[Structure, tuple[StepSource, Callable[..., Any]]] = {}


def step_functions(
    linkage: LoopEquations, kind: type[tuple[Any, ...]], signs: Sequence[int]
) -> StepFunctions:
    """Return the functions of a linkage, for a class of poses, with the signs of its blocks."""
    structure = linkage.structure
    if structure not in _makers:
        source = StepSource(structure)
        name = f'<klann_ros step {len(_makers)}>'
        _makers[structure] = source, _compile(source.text(source.constants(linkage, signs)), name)
    source, make = _makers[structure]
    return StepFunctions(*make(kind, linkage, **source.constants(linkage, signs)))


def _compile(text: str, name: str) -> Callable[..., Any]:
    # So that a traceback, or a reader, can see the text.
    linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
    names: dict[str, Any] = {
        'cos': cos, 'sin': sin, 'hypot': hypot, 'wrap': wrap, 'pi': pi, 'nan': nan,
        'MAX_UNWRAPPED': MAX_UNWRAPPED, 'MAX_BRANCH_JUMP': MAX_BRANCH_JUMP,
        'new': tuple.__new__,
    }  # fmt: skip
    exec(compile(text, name, 'exec'), names)  # noqa: S102 - of indices alone
    make: Callable[..., Any] = names['make']
    return make
