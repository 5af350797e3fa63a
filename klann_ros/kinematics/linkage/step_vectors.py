"""What a step's text is made of: vectors, sums of them, and the solution of equations."""

from collections.abc import Iterable, Sequence

from .structure import FIXED, Structure

# A product of named factors with its sign.
Term = tuple[int, str]
# The x and the y of a sum of vectors.
Sum = tuple[list[Term], list[Term]]
# A vector: the bars that it is the sum of.
Bars = tuple[tuple[int, int], ...]
# Of each body the vector that it adds to a loop, or to the foot: its sign, and its number.
Terms = dict[int, tuple[int, int]]


class Vectors:
    """
    The vectors W_kj u_j of a structure, each once, however many loops it is in.

    Attributes
    ----------
    loops : list of Terms
        What each loop consists of.
    foot : Terms
        The same of the foot.

    """

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        # Each one's number under its body and its bars; the first bar's sign is +1.
        self._numbers: dict[tuple[int, Bars], int] = {}
        paths = structure.paths
        self.loops = [self._terms(path.bars) for path in paths.loops]
        self.foot = self._terms(paths.points[structure.points.index(structure.foot)].bars)
        self.in_loops = {v for terms in self.loops for _, v in terms.values()}
        self.in_foot = {v for _, v in self.foot.values()}

    def constants(self, all_bars: Sequence[complex]) -> dict[str, float]:
        """Return the constants that the text names, by the bars of a linkage."""
        found: dict[str, float] = {}
        for (body, bars), v in self._numbers.items():
            w = sum(n * all_bars[bar] for bar, n in bars)
            frame = self._structure.frames[body]
            sense = 1 if frame == FIXED else self._structure.senses[frame]
            found |= {f'a{v}': w.real, f'd{v}': sense * w.real}
            if not self._is_straight(bars):
                found |= {f'b{v}': w.imag, f'g{v}': -sense * w.imag}
        return found

    def lines(self, bodies: Iterable[int], wanted: set[int]) -> list[str]:
        """Return what computes the vectors that are wanted, of some bodies."""
        lines = []
        # What slides is turned by what turns.
        for body in sorted(bodies, key=lambda j: self._structure.bodies[j].slides):
            numbers = self._numbers.items()
            own = [(v, bars) for (j, bars), v in numbers if j == body and v in wanted]
            if self._structure.bodies[body].slides:
                for v, _ in own:
                    lines += self._slid(body, v)
                continue
            c, s = 'c', 's'
            if any(frame == body for j, frame in enumerate(self._structure.frames) if j != body):
                # What slides along it asks for them again.
                c, s = f'C{body}', f'S{body}'
                lines += [f'{c} = cos(p{body})', f'{s} = sin(p{body})']
            elif len(own) == 1 and self._is_straight(own[0][1]):
                v = own[0][0]
                lines += [f'v{v}x = a{v} * cos(p{body})', f'v{v}y = d{v} * sin(p{body})']
                continue
            elif own:
                lines += [f'c = cos(p{body})', f's = sin(p{body})']
            for v, bars in own:
                if self._is_straight(bars):
                    lines += [f'v{v}x = a{v} * {c}', f'v{v}y = d{v} * {s}']
                else:
                    lines += [
                        f'v{v}x = a{v} * {c} + g{v} * {s}',
                        f'v{v}y = b{v} * {c} + d{v} * {s}',
                    ]
        return lines

    def turned(self, terms: Terms, rates: dict[int, Term]) -> Sum:
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

    def slowed(self, terms: Terms, squares: dict[int, str]) -> Sum:
        """Return the sum of what the rates' squares and products alone add to W_j d2u_j."""
        x, y = [], []
        for body, (sign, v) in terms.items():
            frame = self._structure.frames[body]
            if frame in squares:
                x.append((-sign, f'v{v}x * {squares[frame]}'))
                y.append((-sign, f'v{v}y * {squares[frame]}'))
                if frame != body:
                    turned = self._structure.senses[frame] * sign
                    x.append((-turned, f'l{v}y * 2.0 * q{body} * q{frame}'))
                    y.append((turned, f'l{v}x * 2.0 * q{body} * q{frame}'))
        return x, y

    def _slid(self, body: int, v: int) -> list[str]:
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
        found = {}
        carriers = self._structure.carriers
        for body in dict.fromkeys(carriers[bar] for bar, _ in bars):
            if body == FIXED:
                continue
            own = tuple(item for item in bars if carriers[item[0]] == body)
            sign = own[0][1]
            key = body, tuple((bar, sign * times) for bar, times in own)
            found[body] = sign, self._numbers.setdefault(key, len(self._numbers))
        return found


def joined(terms: Sequence[Term]) -> str:
    """Return a sum of signed products; 0.0 for none."""
    ordered = sorted(terms, key=lambda term: -term[0])
    text = ''.join(f' {"+" if sign > 0 else "-"} {product}' for sign, product in ordered)
    return {' + ': '', ' - ': '-'}[text[:3]] + text[3:] if text else '0.0'


def elimination(n: int) -> list[str]:
    """Return a function that solves n equations by Gauss's elimination with row pivots."""
    rows = [[f'm{i}_{j}' for j in range(n)] + [f'b{i}'] for i in range(n)]
    given = ', '.join([*(name for row in rows for name in row[:-1]), *(row[-1] for row in rows)])
    lines = [f'def solve{n}({given}):', '    det = 1.0']
    failed = ', '.join(['0.0'] * (n + 1))
    for k in range(n):
        for i in range(k + 1, n):
            ours, theirs = ', '.join(rows[k][k:]), ', '.join(rows[i][k:])
            lines += [
                f'    if abs({rows[i][k]}) > abs({rows[k][k]}):',
                f'        {ours}, {theirs} = {theirs}, {ours}',
                '        det = -det',
            ]
        lines += [f'    if {rows[k][k]} == 0.0:', f'        return {failed}']
        lines += [f'    det *= {rows[k][k]}']
        for i in range(k + 1, n):
            lines += [f'    t = {rows[i][k]} / {rows[k][k]}']
            for j in range(k + 1, n + 1):
                lines += [f'    {rows[i][j]} -= t * {rows[k][j]}']
    for k in reversed(range(n)):
        known = ''.join(f' - {rows[k][j]} * {rows[j][n]}' for j in range(k + 1, n))
        lines += [f'    b{k} = (b{k}{known}) / {rows[k][k]}']
    return [*lines, f'    return det, {", ".join(f"b{k}" for k in range(n))}']
