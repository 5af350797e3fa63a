"""
The ways along bars to every point of a linkage, and the loops that they close.

With u_j = exp(i s_j phi_j), the unit vector of body j (s_j = -1 where its angle phi_j is measured
clockwise), every vector of a linkage is a sum of constants times these: the loops are closed where

    f = W u + c = 0        (complex: the real parts are the x equations, the imaginary ones the y)

and the points are at p = Q u + q. Here W, Q, c and q are still whole numbers: how often a bar or a
pivot is on the way, forward or backward. For the Klann leg f is SEM 104's f1 + i f2 and f3 + i f4,
term by term.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from .assembly import Group


class Path(NamedTuple):
    """A sum of pivots and bars, each forward (+1) or backward (-1)."""

    # Which ones, rising, with their signs.
    pivots: tuple[tuple[int, int], ...]
    bars: tuple[tuple[int, int], ...]

    def plus(self, other: 'Path', sign: int = 1) -> 'Path':
        """Return the sum with another path, or the difference."""
        return Path(_sum(self.pivots, other.pivots, sign), _sum(self.bars, other.bars, sign))


def loop_paths(
    pivots: Sequence[str], bars: Sequence[tuple[int, str, str]], groups: Sequence[Group]
) -> tuple[list[list[tuple[str, Path]]], dict[str, Path]]:
    """
    Return the loops that each group closes, with the points where they close, and all ways.

    Every point is reached from the pivots along bars (body, start, end), group by group, and in a
    group over as few bars as can be. A bar that leads to a point which has been reached already
    closes a loop: the path over this bar less the point's own.
    """
    paths = {name: Path(((place, 1),), ()) for place, name in enumerate(pivots)}
    return [_grow(bars, group, paths) for group in groups], paths


def _grow(
    bars: Sequence[tuple[int, str, str]], group: Group, paths: dict[str, Path]
) -> list[tuple[str, Path]]:
    """Reach the points of a group; return the loops that are closed on the way."""
    rest = [number for number, (body, _, _) in enumerate(bars) if body in group]
    rest.sort(key=lambda number: group.index(bars[number][0]))
    loops = []
    while rest:
        reached = [n for n in rest if bars[n][1] in paths or bars[n][2] in paths]
        number = min(reached, key=lambda n: _bars_away(bars[n], paths))
        rest.remove(number)
        _, start, end = bars[number]
        begin, point, sign = (start, end, 1) if start in paths else (end, start, -1)
        path = paths[begin].plus(Path((), ((number, sign),)))
        if point in paths:
            loops.append((point, path.plus(paths[point], -1)))
        else:
            paths[point] = path
    return loops


def _bars_away(bar: tuple[int, str, str], paths: Mapping[str, Path]) -> int:
    _, start, end = bar
    return len(paths[start if start in paths else end].bars)


def _sum(
    one: tuple[tuple[int, int], ...], other: tuple[tuple[int, int], ...], sign: int
) -> tuple[tuple[int, int], ...]:
    total = dict(one)
    for number, times in other:
        total[number] = total.get(number, 0) + sign * times
    return tuple((number, times) for number, times in sorted(total.items()) if times)
