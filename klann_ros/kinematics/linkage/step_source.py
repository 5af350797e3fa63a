"""
Source text of a step: the vectors of a structure, their derivatives, and a block's linear step.

The names in the text: p are the coordinates, c and s their cosines and sines, v the vectors
W_kj u_j (each once, however many loops it is in), l the directions of sliding bodies, f the loop
equations, D the determinants, g and h the Jacobian's columns of a sliding dyad.
"""

from collections.abc import Iterable, Sequence

from .structure import FIXED, Structure

# A product of named factors with its sign.
Term = tuple[int, str]
# The x and the y of a sum of vectors.
Sum = tuple[list[Term], list[Term]]
# A vector: the bars that it is the sum of.
Bars = tuple[tuple[int, int], ...]
# The vector that each body adds to a loop, or to the foot: its sign, and its number.
Terms = dict[int, tuple[int, int]]


class LoopVectors:
    """The vectors W_kj u_j of a structure, each once, however many loops it is in."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        # Each one's number under its body and its bars; the first bar's sign is +1.
        self._numbers: dict[tuple[int, Bars], int] = {}
        # Bodies that orient others, which slide along them.
        self._frames = {frame for j, frame in enumerate(structure.frames) if frame != j}
        paths = structure.paths
        self.loops = [self._terms(path.bars) for path in paths.loops]
        self.foot = self._terms(paths.points[structure.points.index(structure.foot)].bars)
        self.in_foot = {v for _, v in self.foot.values()}
        self.in_loops: set[int] = set()
        for terms in self.loops:
            self.in_loops.update(v for _, v in terms.values())

    def constants(self, all_bars: Sequence[complex]) -> dict[str, float]:
        """Return the constants that the text names, by the bars of a linkage."""
        constants: dict[str, float] = {}
        for (body, bars), v in self._numbers.items():
            w = sum(times * all_bars[bar] for bar, times in bars)
            frame = self._structure.frames[body]
            sense = 1 if frame == FIXED else self._structure.senses[frame]
            constants |= {f'a{v}': w.real, f'd{v}': sense * w.real}
            if not self._is_straight(bars):
                constants |= {f'b{v}': w.imag, f'g{v}': -sense * w.imag}
        return constants

    def lines(self, bodies: Iterable[int], numbers: set[int]) -> list[str]:
        """Return what computes the vectors of these numbers that are fixed to some bodies."""
        lines = []
        # Sliding bodies follow the turning ones that carry them.
        for body in sorted(bodies, key=lambda j: self._structure.bodies[j].slides):
            body_bars = {}
            for (j, bars), v in self._numbers.items():
                if j == body and v in numbers:
                    body_bars[v] = bars
            if self._structure.bodies[body].slides:
                for v in body_bars:
                    lines += self._sliding_lines(body, v)
            else:
                lines += self._turning_lines(body, body_bars)
        return lines

    def _turning_lines(self, body: int, body_bars: dict[int, Bars]) -> list[str]:
        """Return what computes vectors of a body that turns, each v with its bars."""
        c, s = f'cos(p{body})', f'sin(p{body})'
        lines = []
        is_single = len(body_bars) == 1 and all(map(self._is_straight, body_bars.values()))
        if body in self._frames:
            # Bodies that slide along it use them as well.
            lines = [f'C{body} = {c}', f'S{body} = {s}']
            c, s = f'C{body}', f'S{body}'
        elif body_bars and not is_single:
            lines = [f'c = {c}', f's = {s}']
            c, s = 'c', 's'
        for v, bars in body_bars.items():
            if self._is_straight(bars):
                lines += [f'v{v}x = a{v} * {c}', f'v{v}y = d{v} * {s}']
            else:
                lines += [
                    f'v{v}x = a{v} * {c} + g{v} * {s}',
                    f'v{v}y = b{v} * {c} + d{v} * {s}',
                ]
        return lines

    def first_derivative(self, terms: Terms, rates: dict[int, Term]) -> Sum:
        """Return the sum of W_j du_j over the bodies that have a rate: see `joints`."""
        x, y = [], []
        for body, (sign, v) in terms.items():
            frame = self._structure.frames[body]
            if frame in rates:
                times, rate = rates[frame]
                sense = self._structure.senses[frame] * sign * times
                factor = f' * {rate}' if rate else ''
                x.append((-sense, f'v{v}y{factor}'))
                y.append((sense, f'v{v}x{factor}'))
            if frame != body and body in rates:
                times, rate = rates[body]
                factor = f' * {rate}' if rate else ''
                x.append((sign * times, f'l{v}x{factor}'))
                y.append((sign * times, f'l{v}y{factor}'))
        return x, y

    def velocity_products(self, terms: Terms, squares: dict[int, str]) -> Sum:
        """Return the sum of what the rates' squares and products alone add to W_j d2u_j."""
        x, y = [], []
        for body, (sign, v) in terms.items():
            frame = self._structure.frames[body]
            if frame in squares:
                x.append((-sign, f'v{v}x * {squares[frame]}'))
                y.append((-sign, f'v{v}y * {squares[frame]}'))
                if frame != body:
                    sense = self._structure.senses[frame] * sign
                    x.append((-sense, f'l{v}y * 2.0 * q{body} * q{frame}'))
                    y.append((sense, f'l{v}x * 2.0 * q{body} * q{frame}'))
        return x, y

    def _sliding_lines(self, body: int, v: int) -> list[str]:
        """Return what computes the vector of a body that slides, and that along its line."""
        frame = self._structure.frames[body]
        along = [f'l{v}x = a{v}', f'l{v}y = b{v}']
        if frame != FIXED:
            along = [
                f'l{v}x = a{v} * C{frame} + g{v} * S{frame}',
                f'l{v}y = b{v} * C{frame} + d{v} * S{frame}',
            ]
        return [*along, f'v{v}x = p{body} * l{v}x', f'v{v}y = p{body} * l{v}y']

    def _is_straight(self, bars: Bars) -> bool:
        """Return whether a vector lies along its body's angle, whatever the numbers are."""
        return len(bars) == 1 and bars[0][0] in self._structure.straight

    def _terms(self, bars: Bars) -> Terms:
        """Return a sum of bars as one vector a body: its sign, and its number."""
        bars_of: dict[int, list[tuple[int, int]]] = {}
        for bar, times in bars:
            bars_of.setdefault(self._structure.carriers[bar], []).append((bar, times))
        bars_of.pop(FIXED, None)
        terms = {}
        for body, body_bars in bars_of.items():
            sign = body_bars[0][1]
            key = body, tuple((bar, sign * times) for bar, times in body_bars)
            terms[body] = sign, self._numbers.setdefault(key, len(self._numbers))
        return terms


class BlockSource:
    """
    Source of a block's linear step: the changes of its coordinates that open its loops by -r.

    Newton's corrections, the coefficients dx/dalpha and the accelerations are all such steps;
    they differ in r alone, and so does a derivative by a dimension. With A = W_a u_a and
    B = W_b u_b a dyad of two turning links takes

        d_a = -s_a (B . r) / (A x B),    d_b = s_b (A . r) / (A x B),

    a sliding one Cramer's rule, and coupled loops Gauss's elimination with pivots.
    """

    def __init__(self, structure: Structure, vectors: LoopVectors) -> None:
        self._structure = structure
        self._vectors = vectors
        self.blocks = tuple(zip(structure.groups, structure.paths.rows, strict=True))

    def is_coupled(self, block: int) -> bool:
        """Return whether a block has several loops."""
        return len(self.blocks[block][1]) > 1

    def slides(self, block: int) -> bool:
        """Return whether a body of a block slides."""
        return self._structure.slides_any(self.blocks[block][0])

    def sine_sign(self, block: int) -> int:
        """Return the sign between the determinant D and the block's sine."""
        group, loops = self.blocks[block]
        if self.is_coupled(block):
            return 1
        if self.slides(block):
            return self._structure.turning_sense(group)
        terms = self._vectors.loops[loops[0]]
        a, b = group
        return -terms[a][0] * terms[b][0]

    def determinants(self) -> list[str]:
        """Return the lines of the dyads' determinants; `solution` computes coupled ones."""
        lines = []
        for block, (group, loops) in enumerate(self.blocks):
            if self.is_coupled(block):
                continue
            loop = self._vectors.loops[loops[0]]
            if not self.slides(block):
                a, b = group
                _, p = loop[a]
                _, q = loop[b]
                lines.append(f'D{block} = v{p}x * v{q}y - v{p}y * v{q}x')
                continue
            for side, j in zip('gh', group, strict=True):
                column = self._vectors.first_derivative(loop, {j: (1, '')})
                for axis, terms in zip('xy', column, strict=True):
                    lines.append(f'{side}{block}{axis} = {format_sum(terms)}')
            lines.append(f'D{block} = g{block}x * h{block}y - g{block}y * h{block}x')
        return lines

    def solution(
        self, block: int, opened: Sequence[Sum], letter: str
    ) -> tuple[list[str], dict[int, Term]]:
        """Return the lines that solve a block for the openings r, and its changes by body."""
        group, loops = self.blocks[block]
        lines = []
        right = []
        for k, sums in zip(loops, opened, strict=True):
            for axis, terms in zip('xy', sums, strict=True):
                text = format_sum(terms)
                if not text.isidentifier():
                    lines.append(f'r{k}{axis} = {text}')
                    text = f'r{k}{axis}'
                right.append(text)
        if self.is_coupled(block):
            changes = ', '.join(repeat(letter + '{}', group))
            arguments = ', '.join([*self._jacobian(block), *right])
            lines.append(f'D{block}, {changes} = solve{len(group)}({arguments})')
            return lines, {j: (-1, f'{letter}{j}') for j in group}
        a, b = group
        x, y = right
        if self.slides(block):
            lines += [
                f'{letter}{a} = ({x} * h{block}y - {y} * h{block}x) / D{block}',
                f'{letter}{b} = (g{block}x * {y} - g{block}y * {x}) / D{block}',
            ]
            return lines, {a: (-1, f'{letter}{a}'), b: (-1, f'{letter}{b}')}
        loop = self._vectors.loops[loops[0]]
        sign_a, p = loop[a]
        sign_b, q = loop[b]
        lines += [
            f'{letter}{a} = (v{q}x * {x} + v{q}y * {y}) / D{block}',
            f'{letter}{b} = (v{p}x * {x} + v{p}y * {y}) / D{block}',
        ]
        senses = self._structure.senses
        return lines, {
            a: (-senses[a] * sign_a, f'{letter}{a}'),
            b: (senses[b] * sign_b, f'{letter}{b}'),
        }

    def _jacobian(self, block: int) -> list[str]:
        """Return the entries of a block's Jacobian, row by row."""
        group, loops = self.blocks[block]
        entries = []
        for k in loops:
            loop = self._vectors.loops[k]
            row_x = []
            row_y = []
            for j in group:
                x, y = self._vectors.first_derivative(loop, {j: (1, '')})
                row_x.append(format_sum(x))
                row_y.append(format_sum(y))
            entries += row_x + row_y
        return entries


def repeat(text: str, numbers: Iterable[int]) -> list[str]:
    """Return a text once for each number, which stands for its braces."""
    return [text.format(number) for number in numbers]


def format_sum(terms: Sequence[Term]) -> str:
    """Return a sum of signed products; 0.0 for none."""
    text = ''
    for sign, product in sorted(terms, key=lambda term: -term[0]):
        if text:
            text += f' + {product}' if sign > 0 else f' - {product}'
        else:
            text = product if sign > 0 else f'-{product}'
    return text or '0.0'


def elimination_source(n: int) -> list[str]:
    """Return a function that solves n equations by Gauss's elimination with row pivots."""
    rows = []
    entries = []
    right = repeat('b{}', range(n))
    for i in range(n):
        coefficients = repeat(f'm{i}_{{}}', range(n))
        entries += coefficients
        rows.append([*coefficients, right[i]])
    lines = [f'def solve{n}({", ".join([*entries, *right])}):', '    det = 1.0']
    failed = ', '.join(['0.0'] * (n + 1))
    for k in range(n):
        for i in range(k + 1, n):
            upper = ', '.join(rows[k][k:])
            lower = ', '.join(rows[i][k:])
            lines += [
                f'    if abs({rows[i][k]}) > abs({rows[k][k]}):',
                f'        {upper}, {lower} = {lower}, {upper}',
                '        det = -det',
            ]
        lines += [f'    if {rows[k][k]} == 0.0:', f'        return {failed}']
        lines += [f'    det *= {rows[k][k]}']
        for i in range(k + 1, n):
            lines += [f'    t = {rows[i][k]} / {rows[k][k]}']
            for j in range(k + 1, n + 1):
                lines += [f'    {rows[i][j]} -= t * {rows[k][j]}']
    for k in reversed(range(n)):
        right_side = f'b{k}'
        for j in range(k + 1, n):
            right_side += f' - {rows[k][j]} * b{j}'
        lines += [f'    b{k} = ({right_side}) / {rows[k][k]}']
    return [*lines, f'    return det, {", ".join(right)}']
