"""
The topology of a linkage: which bodies are placed together, and its loops, along bars.

Bodies and points make a graph, a body being joined to each of its points, and to the body that it
slides along; the pivots belong to the ground. Its independent loops, edges - nodes + parts, have
two equations each. The fewest bodies that close a loop for every two of them can be placed by
themselves: two bodies and one loop are a dyad, more are coupled loops (Assur groups of a higher
class). One group after the other, this makes the Jacobian block lower triangular.

With u_j = exp(i s_j phi_j), the unit vector of body j (s_j = -1 for a clockwise angle phi_j),
every vector of a linkage is a sum of constants times these: the loops are closed where

    f = W u + c = 0        (complex: the real parts are the x equations, the imaginary ones the y)

and the points are at p = Q u + q. A `Path` is a row of these in whole numbers: how often it takes
a bar or a pivot, forward or backward. For the Klann leg f is SEM 104's f1 + i f2 and f3 + i f4.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

from klann_ros.kinematics.errors import GeometryError

# All subsets of the bodies are tried.
MAX_BODIES = 25

Group = tuple[int, ...]


class _Graph(NamedTuple):
    """The fixed points, the points of each body, and the bodies' names."""

    pivots: Sequence[str]
    bodies: Sequence[Sequence[str]]
    names: Sequence[str]
    along: Sequence[int | None]


def assembly_order(
    pivots: Sequence[str],
    bodies: Sequence[Sequence[str]],
    names: Sequence[str],
    along: Sequence[int | None],
) -> list[Group]:
    """
    Return the groups of bodies in the order in which they are placed; the crank is body 0.

    Two bodies are a dyad, four or more coupled loops. A GeometryError says why the crank does not
    determine the motion: the loops have fewer or more equations than unknown angles, as a whole
    or in a part. Bodies are given by their points, by their names in errors,
    and by the body that they slide along: -1 for the ground, None if they turn.
    """
    graph = _Graph(pivots, bodies, names, along)
    _check_connected(graph)
    if _loops(graph, (0,)):
        raise GeometryError(f'the crank {names[0]} holds two pivots and cannot turn')
    known: Group = (0,)
    rest = tuple(range(1, len(bodies)))
    groups = []
    while rest:
        group = _next_group(graph, known, rest)
        groups.append(group)
        known += group
        rest = tuple(j for j in rest if j not in group)
    if not groups:
        raise GeometryError('no loop closes: two bodies must lead to the same point')
    return groups


def _next_group(graph: _Graph, known: Group, rest: Group) -> Group:
    """Return the fewest bodies that close a loop for every two of them."""
    before = _loops(graph, known)
    for size in range(1, len(rest) + 1):
        for group in combinations(rest, size):
            if not _stands(graph, (*known, *group)):
                continue
            closed = _loops(graph, known + group) - before
            if 2 * closed > size:
                names = ', '.join(graph.names[j] for j in group)
                raise GeometryError(
                    f'{names}: cannot move, since {2 * closed} loop equations stand against '
                    f'{size} unknown angle{"s" if size > 1 else ""}'
                )
            if 2 * closed == size:
                return group
    closed = _loops(graph, known + rest) - before
    loose = [j for j in rest if _loops(graph, set(known + rest) - {j}) - before == closed]
    names = ', '.join(graph.names[j] for j in loose or rest)
    if loose:
        msg = f'{names}: turns freely, since no loop closes over it'
    else:
        msg = (
            f'the crank alone does not move it in one definite way: {len(rest)} unknown angles '
            f'({names}) and {2 * closed} loop equations'
        )
    raise GeometryError(msg)


def _stands(graph: _Graph, bodies: Group) -> bool:
    """Return whether the carriers of all sliding bodies are among them."""
    return all(graph.along[j] in {None, -1, *bodies} for j in bodies)


def _loops(graph: _Graph, bodies: Iterable[int]) -> int:
    """Return the number of independent loops of some bodies and the ground."""
    parent: dict[str, str] = {}

    def root(node: str) -> str:
        while parent.setdefault(node, node) != node:
            node = parent[node]
        return node

    loops = 0
    # The space keeps a body's node apart from every point's name; the ground is body -1.
    joined = [(-1, point) for point in graph.pivots]
    joined += [(j, point) for j in bodies for point in graph.bodies[j]]
    joined += [(j, f'body {graph.along[j]}') for j in bodies if graph.along[j] is not None]
    for body, other in joined:
        body_root, other_root = root(f'body {body}'), root(other)
        loops += body_root == other_root
        parent[body_root] = other_root
    return loops


def _check_connected(graph: _Graph) -> None:
    if len(graph.bodies) > MAX_BODIES:
        msg = f'there are {len(graph.bodies)} bodies: more than {MAX_BODIES} are not solved'
        raise GeometryError(msg)
    reached: set[str | int] = {-1, *graph.pivots}
    rest = list(range(len(graph.bodies)))
    while rest:
        joined = [
            j for j in rest if graph.along[j] in reached or not reached.isdisjoint(graph.bodies[j])
        ]
        if not joined:
            raise GeometryError(
                f'body {graph.names[rest[0]]} ({"-".join(graph.bodies[rest[0]])}) is connected to '
                f'no pivot, not even by other bodies: the pivots are {", ".join(graph.pivots)}'
            )
        reached.update(joined, *(graph.bodies[j] for j in joined))
        rest = [j for j in rest if j not in joined]


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
