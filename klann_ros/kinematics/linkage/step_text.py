"""
The text of a step: which operations a structure takes, one after the other.

The letters of the text: p are the angles, c and s their cosines and sines, v the vectors W_kj u_j
(each once, however many loops it is in), f the loop equations, e the corrections of an angle less
their sign, D the determinants, q the derivatives by the crank angle.

The corrections are those of the full Newton of `Linkage.f` and its Jacobian: Phi is block lower
triangular, so forward substitution, block by block, is the same as inverting it. With A = W_a u_a,
B = W_b u_b and r the loop's f, opened by the corrections of the bodies before it, a dyad takes

    d_a = -s_a (B . r) / (A x B),    d_b = s_b (A . r) / (A x B),

and coupled loops take Gauss's elimination with pivots.
"""

from collections.abc import Iterable, Sequence
from math import inf, prod

from .equations import LoopEquations
from .step_vectors import elimination, joined, Sum, Term, Vectors
from .structure import Structure


class Writer:
    """Writes the text for a structure, and tells the constants of a linkage in its order."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._paths = structure.paths
        self._senses = structure.senses
        self._vectors = Vectors(structure)
        self._lines: list[str] = []

    def constants(self, linkage: LoopEquations) -> dict[str, float]:
        """Return the constants that the text names, of a linkage of this structure."""
        found = self._vectors.constants(linkage.bars)
        fixed = {f'c{k}': constant for k, (_, constant) in enumerate(linkage.rows)}
        for name, constant in (*fixed.items(), ('h', linkage.point_rows[linkage.foot][1])):
            found |= {f'{name}x': constant.real, f'{name}y': constant.imag}
        for b, (block, sign) in enumerate(zip(linkage.blocks, linkage.assembly, strict=True)):
            # The determinant's sign, and what of it is rounding, or singular.
            found |= {f'rounding{b}': block.rounding, f'sign{b}': sign * self._sine_sign(b)}
            found |= {f'least{b}': -block.rounding_of_sine * block.scale}
            found |= {f'singular{b}': block.singular_sine * block.scale}
            found |= {f'inverse{b}': 1.0 / block.scale}
            if block.closing is not None and not block.closing.two_branches:
                # It closes in one way only, whichever sign that has.
                found[f'least{b}'] = -inf
        if self._structure.slides:
            found['size'] = linkage.size
        return found

    @property
    def _is_coupled(self) -> bool:
        return any(len(loops) > 1 for loops in self._paths.rows)

    # Blocks.

    def _sine_sign(self, block: int) -> int:
        """Return the sign between the text's determinant and the block's sine."""
        group, loops = self._structure.groups[block], self._paths.rows[block]
        if len(loops) > 1:
            return 1
        if self._slides(block):
            turning = (j for j in group if not self._structure.bodies[j].slides)
            return prod(self._senses[j] for j in turning)
        terms = self._vectors.loops[loops[0]]
        a, b = group
        return -terms[a][0] * terms[b][0]

    def _determinants(self, indent: int) -> None:
        for block, (group, loops) in enumerate(self._pairs()):
            if len(loops) == 1 and self._slides(block):
                for side, j in zip('gh', group, strict=True):
                    column = self._vectors.turned(self._vectors.loops[loops[0]], {j: (1, '')})
                    for axis, terms in zip('xy', column, strict=True):
                        self._write(indent, f'{side}{block}{axis} = {joined(terms)}')
                self._write(indent, f'D{block} = g{block}x * h{block}y - g{block}y * h{block}x')
            elif len(loops) == 1:
                (_, p), (_, q) = (self._vectors.loops[loops[0]][j] for j in group)
                self._write(indent, f'D{block} = v{p}x * v{q}y - v{p}y * v{q}x')

    def _solve(
        self, block: int, opened: Sequence[Sum], letter: str, indent: int
    ) -> dict[int, Term]:
        """Write the turns of a block's bodies that open its loops by -r; return their names."""
        group, loops = self._structure.groups[block], self._paths.rows[block]
        right = []
        for k, sums in zip(loops, opened, strict=True):
            for axis, terms in zip('xy', sums, strict=True):
                text = joined(terms)
                if text.isidentifier():
                    right.append(text)
                else:
                    self._write(indent, f'r{k}{axis} = {text}')
                    right.append(f'r{k}{axis}')
        if len(loops) > 1:
            return self._eliminate(block, right, letter, indent)
        (a, b), own, (x, y) = group, self._vectors.loops[loops[0]], right
        if self._slides(block):
            g, h = f'g{block}', f'h{block}'
            self._write(indent, f'{letter}{a} = ({x} * {h}y - {y} * {h}x) / D{block}')
            self._write(indent, f'{letter}{b} = ({g}x * {y} - {g}y * {x}) / D{block}')
            return {a: (-1, f'{letter}{a}'), b: (-1, f'{letter}{b}')}
        (sign_a, p), (sign_b, q) = own[a], own[b]
        self._write(indent, f'{letter}{a} = (v{q}x * {x} + v{q}y * {y}) / D{block}')
        self._write(indent, f'{letter}{b} = (v{p}x * {x} + v{p}y * {y}) / D{block}')
        return {
            a: (-self._senses[a] * sign_a, f'{letter}{a}'),
            b: (self._senses[b] * sign_b, f'{letter}{b}'),
        }

    def _eliminate(
        self, block: int, right: Sequence[str], letter: str, indent: int
    ) -> dict[int, Term]:
        group, loops = self._structure.groups[block], self._paths.rows[block]
        entries = []
        for k in loops:
            columns = [self._vectors.turned(self._vectors.loops[k], {j: (1, '')}) for j in group]
            for axis in (0, 1):
                entries += [joined(column[axis]) for column in columns]
        found = ', '.join(f'{letter}{j}' for j in group)
        given = ', '.join([*entries, *right])
        self._write(indent, f'D{block}, {found} = solve{len(group)}({given})')
        return {j: (-1, f'{letter}{j}') for j in group}

    def _slides(self, block: int) -> bool:
        """Return whether a body of a block slides."""
        return any(self._structure.bodies[j].slides for j in self._structure.groups[block])

    def _pairs(self) -> Iterable[tuple[tuple[int, ...], tuple[int, ...]]]:
        return zip(self._structure.groups, self._paths.rows, strict=True)

    # The text.

    def text(self, constants: Iterable[str]) -> str:
        """Return the whole text, for constants of these names."""
        self._lines = []
        sizes = {len(group) for group, loops in self._pairs() if len(loops) > 1}
        for size in sorted(sizes):
            self._lines += elimination(size)
        self._write(0, f'def make(kind, linkage, {", ".join(constants)}):')
        others = range(1, len(self._structure.bodies))
        guess, tangent = _tuple('p', others), _tuple('q', others)
        self._write(1, 'def refine(p0, guess, tolerance, most):', f'    {guess} = guess')
        self._newton()
        self._write(
            1,
            'def ahead(p0, step, x, coefficients, tolerance, most):',
            f'    {guess} = x',
            f'    {tangent} = coefficients',
        )
        for j in others:
            self._write(2, f'p{j} += step * q{j}')
        self._newton()
        self._write(1, 'def velocity(p0, x, coefficients, rate):')
        self._motion(second=False)
        self._write(1, 'def acceleration(p0, x, coefficients, rate, change):')
        self._motion(second=True)
        self._write(1, 'return refine, ahead, velocity, acceleration')
        return '\n'.join(self._lines) + '\n'

    def _write(self, indent: int, *lines: str) -> None:
        self._lines += ['    ' * indent + line for line in lines]

    def _compute(self, bodies: Iterable[int], wanted: set[int], indent: int) -> None:
        self._write(indent, *self._vectors.lines(bodies, wanted))

    def _newton(self) -> None:
        """Write the iterations, and the pose that they end at."""
        others = range(1, len(self._structure.bodies))
        if self._is_coupled:
            self._write(2, f'{_tuple("o", others)} = {_tuple("p", others)}')
        if self._structure.slides:
            # Distances are as precise as angles, in the linkage's size.
            self._write(2, 'span = tolerance * size')
        self._compute([0], self._vectors.in_loops, 2)
        for k, terms in enumerate(self._vectors.loops):
            crank = [terms[0]] if 0 in terms else []
            for axis in 'xy' if crank else '':
                parts = [(sign, f'v{v}{axis}') for sign, v in crank]
                self._write(2, f'k{k}{axis} = {joined([(1, f"c{k}{axis}"), *parts])}')
        self._write(2, 'settled = False', 'for iterations in range(1, most + 1):')
        self._compute(others, self._vectors.in_loops, 3)
        for k, terms in enumerate(self._vectors.loops):
            for axis in 'xy':
                parts = [(sign, f'v{v}{axis}') for j, (sign, v) in terms.items() if j]
                fixed = f'{"k" if 0 in terms else "c"}{k}{axis}'
                self._write(3, f'f{k}{axis} = {joined([(1, fixed), *parts])}')
        self._determinants(3)
        closed = [
            f'-rounding{b} <= f{k}{axis} <= rounding{b}'
            for b, (_, loops) in enumerate(self._pairs())
            for k in loops
            for axis in 'xy'
        ]
        self._write(3, f'if settled or ({" and ".join(closed)}):', '    break')
        dyads = [f'D{b} == 0.0' for b, (_, loops) in enumerate(self._pairs()) if len(loops) == 1]
        if dyads:
            self._write(3, f'if {" or ".join(dyads)}:', '    return None')
        turns = self._corrections()
        for j, (sign, name) in turns.items():
            self._write(3, f'p{j} {"+" if sign > 0 else "-"}= {name}')
        limits = ['span' if body.slides else 'tolerance' for body in self._structure.bodies]
        small = [f'-{limits[j]} <= e{j} <= {limits[j]}' for j in others]
        self._write(3, f'settled = {" and ".join(small)}')
        self._write(2, 'else:')
        self._write(3, 'return None')
        self._pose(others)

    def _corrections(self) -> dict[int, Term]:
        """Write the corrections of all angles; return their names."""
        turns: dict[int, Term] = {}
        for block, (_, loops) in enumerate(self._pairs()):
            opened = []
            for k in loops:
                x, y = self._vectors.turned(self._vectors.loops[k], turns)
                opened.append(([(1, f'f{k}x'), *x], [(1, f'f{k}y'), *y]))
            turns |= self._solve(block, opened, 'e', 3)
            if len(loops) > 1:
                self._write(3, f'if D{block} == 0.0:', '    return None')
        return turns

    def _pose(self, others: Sequence[int]) -> None:
        self._tangent()
        blocks = range(len(self._structure.groups))
        for b in blocks:
            self._write(2, f'size{b} = D{b} * sign{b}')
        self._write(
            2, f'if {" or ".join(f"size{b} < least{b}" for b in blocks)}:', '    return None'
        )
        if self._is_coupled:
            # The signs alone do not tell the branches of coupled loops apart.
            sizes = [' * size' if body.slides else '' for body in self._structure.bodies]
            trusted = [f'-TRUSTED{sizes[j]} <= p{j} - o{j} <= TRUSTED{sizes[j]}' for j in others]
            self._write(2, f'if not ({" and ".join(trusted)}):', '    return None')
        self._wrap()
        singular = [
            f'abs(size{b}) <= singular{b}' if self._slides(b) else f'size{b} <= singular{b}'
            for b in blocks
        ]
        self._write(
            2,
            f'if {" or ".join(singular)}:',
            f'    coefficients = ({"nan, " * len(others)})',
        )
        gaps = ', '.join(f'f{k}{axis}' for k in range(len(self._vectors.loops)) for axis in 'xy')
        # The columns of what slides along a link are as long as the distance is.
        sines = ', '.join(
            f'abs(size{b}) / (hypot(g{b}x, g{b}y) * hypot(h{b}x, h{b}y))'
            if self._slides(b) and len(loops) == 1
            else f'abs(size{b}) * inverse{b}'
            for b, (_, loops) in enumerate(self._pairs())
        )
        foot = []
        for axis in 'xy':
            parts = [(sign, f'v{v}{axis}') for sign, v in self._vectors.foot.values()]
            foot.append(joined([(1, f'h{axis}'), *parts]))
        self._write(
            2,
            'return new(kind, (',
            f'    p0, {_tuple("p", others)}, ({", ".join(foot)}), iterations,',
            f'    hypot({gaps}), coefficients, ({sines},), linkage,',
            '))',
        )

    def _wrap(self) -> None:
        """Write what brings angles into (-pi, pi]."""
        turning = [j for j, body in enumerate(self._structure.bodies) if j and not body.slides]
        if not turning:
            return
        inside = [f'-pi < p{j} <= pi' for j in turning]
        self._write(2, f'if not ({" and ".join(inside)}):')
        near = [f'-FAR < p{j} < FAR' for j in turning]
        self._write(3, f'if not ({" and ".join(near)}):', '    return None')
        for j in turning:
            self._write(3, f'p{j} = wrap(p{j})')

    def _tangent(self) -> None:
        """Write the derivatives by the crank angle, by the same substitution; and the foot."""
        others = range(1, len(self._structure.bodies))
        rest = self._vectors.in_foot - self._vectors.in_loops
        # Vectors of the foot alone, before the angles are wrapped.
        self._compute(range(len(self._structure.bodies)), rest, 2)
        zero = [f'D{b} == 0.0' for b, (_, loops) in enumerate(self._pairs()) if len(loops) == 1]
        indent = 2
        if zero:
            self._write(
                2, f'if {" or ".join(zero)}:', f'    coefficients = ({"nan, " * len(others)})'
            )
            coupled = [b for b, (_, loops) in enumerate(self._pairs()) if len(loops) > 1]
            for b in coupled:
                self._write(3, f'D{b} = 0.0')
            self._write(2, 'else:')
            indent = 3
        rates: dict[int, Term] = {0: (1, '')}
        for block, (_, loops) in enumerate(self._pairs()):
            opened = [self._vectors.turned(self._vectors.loops[k], rates) for k in loops]
            rates |= self._solve(block, opened, 'q', indent)
        signed = [f'{"-" if rates[j][0] < 0 else ""}{rates[j][1]}' for j in others]
        self._write(indent, f'coefficients = ({", ".join(signed)},)')

    def _motion(self, *, second: bool) -> None:
        """Write the rates, or their changes, of the angles and of the foot."""
        others = range(1, len(self._structure.bodies))
        bodies = range(len(self._structure.bodies))
        self._write(
            2, f'{_tuple("p", others)} = x', f'{_tuple("q", others)} = coefficients', 'q0 = rate'
        )
        for j in others:
            self._write(2, f'q{j} *= rate')
        if not second:
            self._compute(bodies, self._vectors.in_foot, 2)
            foot = self._vectors.turned(self._vectors.foot, {j: (1, f'q{j}') for j in bodies})
            ends = ', '.join(joined(axis) for axis in foot)
            self._write(2, f'return {_tuple("q", bodies)}, ({ends})')
            return
        self._compute(bodies, self._vectors.in_loops | self._vectors.in_foot, 2)
        self._determinants(2)
        for j in bodies:
            self._write(2, f's{j} = q{j} * q{j}')
        squares = {j: f's{j}' for j in bodies}
        changes: dict[int, Term] = {0: (1, 'change')}
        for block, (_, loops) in enumerate(self._pairs()):
            opened = []
            for k in loops:
                turned = self._vectors.turned(self._vectors.loops[k], changes)
                slowed = self._vectors.slowed(self._vectors.loops[k], squares)
                opened.append((turned[0] + slowed[0], turned[1] + slowed[1]))
            changes |= self._solve(block, opened, 'e', 2)
        turned, slowed = (
            self._vectors.turned(self._vectors.foot, changes),
            self._vectors.slowed(self._vectors.foot, squares),
        )
        ends = ', '.join(joined(turned[axis] + slowed[axis]) for axis in (0, 1))
        signed = [f'{"-" if changes[j][0] < 0 else ""}{changes[j][1]}' for j in others]
        self._write(2, f'return (change, {", ".join(signed)}), ({ends})')


def _tuple(letter: str, numbers: Iterable[int]) -> str:
    return f'({", ".join(f"{letter}{j}" for j in numbers)},)'
