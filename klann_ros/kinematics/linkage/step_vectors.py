"""The vectors that a step's text computes, and sums of them."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from .structure import Structure

if TYPE_CHECKING:
    from .linkage import Linkage

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
        """Give each vector its number."""
        self._structure = structure
        # Each one's number under its body and its bars; the first bar's sign is +1.
        self._numbers: dict[tuple[int, Bars], int] = {}
        paths = structure.paths
        self.loops = [self._terms(path.bars) for path in paths.loops]
        self.foot = self._terms(paths.points[structure.points.index(structure.foot)].bars)
        self.in_loops = {v for terms in self.loops for _, v in terms.values()}
        self.in_foot = {v for _, v in self.foot.values()}

    def constants(self, linkage: 'Linkage') -> dict[str, float]:
        """Return the constants that the text names, of a linkage of this structure."""
        found: dict[str, float] = {}
        for (body, bars), v in self._numbers.items():
            w = sum(n * linkage.bars[bar] for bar, n in bars)
            sense = self._structure.senses[body]
            found |= {f'a{v}': w.real, f'd{v}': sense * w.real}
            if not self._is_straight(bars):
                found |= {f'b{v}': w.imag, f'g{v}': -sense * w.imag}
        return found

    def lines(self, bodies: Iterable[int], wanted: set[int]) -> list[str]:
        """Return what computes the vectors that are wanted, of some bodies."""
        lines = []
        for body in bodies:
            numbers = self._numbers.items()
            own = [(v, bars) for (j, bars), v in numbers if j == body and v in wanted]
            if len(own) == 1 and self._is_straight(own[0][1]):
                v = own[0][0]
                lines += [f'v{v}x = a{v} * cos(p{body})', f'v{v}y = d{v} * sin(p{body})']
                continue
            if own:
                lines += [f'c = cos(p{body})', f's = sin(p{body})']
            for v, bars in own:
                if self._is_straight(bars):
                    lines += [f'v{v}x = a{v} * c', f'v{v}y = d{v} * s']
                else:
                    lines += [f'v{v}x = a{v} * c + g{v} * s', f'v{v}y = b{v} * c + d{v} * s']
        return lines

    def turned(self, terms: Terms, rates: dict[int, Term]) -> Sum:
        """Return the sum of i s_j W_j u_j times a rate, over the bodies that have one."""
        x, y = [], []
        for body, (sign, v) in terms.items():
            if body in rates:
                times, rate = rates[body]
                sense = self._structure.senses[body] * sign * times
                factor = f' * {rate}' if rate else ''
                x.append((-sense, f'v{v}y{factor}'))
                y.append((sense, f'v{v}x{factor}'))
        return x, y

    def slowed(self, terms: Terms, squares: dict[int, str]) -> Sum:
        """Return the sum of -W_j u_j times the square of a rate."""
        x = [(-s, f'v{v}x * {squares[j]}') for j, (s, v) in terms.items() if j in squares]
        y = [(-s, f'v{v}y * {squares[j]}') for j, (s, v) in terms.items() if j in squares]
        return x, y

    def _is_straight(self, bars: Bars) -> bool:
        """Return whether a vector lies along its body's angle, whatever the numbers are."""
        return len(bars) == 1 and bars[0][0] in self._structure.straight

    def _terms(self, bars: Bars) -> Terms:
        """Return a sum of bars as one vector a body: its sign, and its number."""
        found = {}
        for body in dict.fromkeys(self._structure.bars[bar][0] for bar, _ in bars):
            own = tuple(item for item in bars if self._structure.bars[item[0]][0] == body)
            sign = own[0][1]
            key = body, tuple((bar, sign * times) for bar, times in own)
            found[body] = sign, self._numbers.setdefault(key, len(self._numbers))
        return found


def joined(terms: Sequence[Term]) -> str:
    """Return a sum of signed products; 0.0 for none."""
    ordered = sorted(terms, key=lambda term: -term[0])
    text = ''.join(f' {"+" if sign > 0 else "-"} {product}' for sign, product in ordered)
    return {' + ': '', ' - ': '-'}[text[:3]] + text[3:] if text else '0.0'
