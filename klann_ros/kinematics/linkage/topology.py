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
from itertools import chain, combinations
from typing import NamedTuple

from klann_ros.kinematics.errors import GeometryError
from klann_ros.sanitize.text import counted

# All subsets of the bodies are tried.
MAX_BODIES = 25

Group = tuple[int, ...]


class Graph(NamedTuple):
    """The fixed points, and the bodies."""

    pivots: Sequence[str]
    # The points of each body, its name in errors, and the body that it slides along: -1 for the
    # ground, None if it turns.
    bodies: Sequence[Sequence[str]]
    names: Sequence[str]
    along: Sequence[int | None]


def assembly_order(graph: Graph) -> list[Group]:
    """
    Return the groups of bodies in the order in which they are placed; the crank is body 0.

    Two bodies are a dyad, four or more coupled loops. A GeometryError says why the crank does not
    determine the motion: the loops have fewer or more equations than unknown angles, as a whole
    or in a part.
    """
    _check_connected(graph)
    if _count_loops(graph, (0,)):
        raise GeometryError(f'the crank {graph.names[0]} holds two pivots and cannot turn')
    placed: Group = (0,)
    waiting = tuple(range(1, len(graph.bodies)))
    groups = []
    while waiting:
        group = _next_group(graph, placed, waiting)
        groups.append(group)
        placed += group
        waiting = tuple(j for j in waiting if j not in group)
    if not groups:
        raise GeometryError('no loop closes: two bodies must lead to the same point')
    return groups


def _next_group(graph: Graph, placed: Group, waiting: Group) -> Group:
    """Return the fewest bodies that close a loop for every two of them."""
    loop_count = _count_loops(graph, placed)
    touched = {-1, *placed, *chain(graph.pivots, *(graph.bodies[j] for j in placed))}
    for size in range(1, len(waiting) + 1):
        for group in combinations(waiting, size):
            bodies = {*placed, *group}
            # A sliding body waits for its carrier.
            if any(graph.along[j] not in {None, -1, *bodies} for j in bodies):
                continue
            equations = 2 * (_count_loops(graph, placed + group) - loop_count)
            neighbours = chain(*((graph.along[j], *graph.bodies[j]) for j in group))
            # Bodies that touch nothing placed have only the angles to each other.
            unknowns = size - (equations == size and touched.isdisjoint(neighbours))
            if equations > unknowns:
                names = ', '.join(graph.names[j] for j in group)
                angles = counted(unknowns, 'unknown angle')
                reason = f'since {equations} loop equations stand against {angles}'
                raise GeometryError(f'{names}: cannot move, {reason}')
            if equations == size:
                return group
    total = _count_loops(graph, placed + waiting)
    loose = [j for j in waiting if _count_loops(graph, {*placed, *waiting} - {j}) == total]
    names = ', '.join(graph.names[j] for j in loose or waiting)
    if loose:
        raise GeometryError(f'{names}: turns freely, since no loop closes over it')
    raise GeometryError(
        f'the crank alone does not move it in one definite way: {len(waiting)} unknown angles '
        f'({names}) and {2 * (total - loop_count)} loop equations'
    )


def _count_loops(graph: Graph, bodies: Iterable[int]) -> int:
    """Return the number of independent loops of some bodies and the ground."""
    parent: dict[str, str] = {}

    def root(node: str) -> str:
        while parent.setdefault(node, node) != node:
            node = parent[node]
        return node

    # The space keeps a body's node apart from every point's name; the ground is body -1.
    edges = [(-1, point) for point in graph.pivots]
    for j in bodies:
        edges += [(j, point) for point in graph.bodies[j]]
        if graph.along[j] is not None:
            edges.append((j, f'body {graph.along[j]}'))
    loops = 0
    for body, node in edges:
        body_root = root(f'body {body}')
        node_root = root(node)
        loops += body_root == node_root
        parent[body_root] = node_root
    return loops


def _check_connected(graph: Graph) -> None:
    """Raise a GeometryError if a body is connected to no pivot."""
    if len(graph.bodies) > MAX_BODIES:
        count = len(graph.bodies)
        raise GeometryError(f'there are {count} bodies: more than {MAX_BODIES} are not solved')
    reached: set[str | int] = {-1, *graph.pivots}
    unreached = list(range(len(graph.bodies)))
    while unreached:
        joined = []
        for j in unreached:
            if graph.along[j] in reached or not reached.isdisjoint(graph.bodies[j]):
                joined.append(j)
        if not joined:
            j = unreached[0]
            raise GeometryError(
                f'body {graph.names[j]} ({"-".join(graph.bodies[j])}) is connected '
                f'to no pivot, not even by other bodies: the pivots are {", ".join(graph.pivots)}'
            )
        for j in joined:
            reached |= {j, *graph.bodies[j]}
            unreached.remove(j)


class Path(NamedTuple):
    """A sum of pivots and bars, each forward (+1) or backward (-1)."""

    # The indices of the pivots and of the bars, rising, with their signs.
    pivots: tuple[tuple[int, int], ...]
    bars: tuple[tuple[int, int], ...]

    def plus(self, path: 'Path', sign: int = 1) -> 'Path':
        """Return the sum with another path, or the difference."""
        return Path(_sum(self.pivots, path.pivots, sign), _sum(self.bars, path.bars, sign))


def add_paths(
    paths: dict[str, Path], bars: Sequence[tuple[int, str, str]], group: Group
) -> list[tuple[str, Path]]:
    """
    Add the paths to the points of a group; return the loops that it closes, and where.

    Every point is reached along bars (body, start, end), over as few of the group's as can be. A
    bar that leads to a point which has been reached already closes a loop: the path over this bar
    less the point's own.
    """
    waiting = [number for number, (body, _, _) in enumerate(bars) if body in group]
    waiting.sort(key=lambda number: group.index(bars[number][0]))
    loops = []
    while waiting:
        reached = [n for n in waiting if bars[n][1] in paths or bars[n][2] in paths]
        number = min(reached, key=lambda n: _bars_away(bars[n], paths))
        waiting.remove(number)
        _, start, end = bars[number]
        sign = 1 if start in paths else -1
        if start not in paths:
            start, end = end, start
        path = paths[start].plus(Path((), ((number, sign),)))
        if end in paths:
            loops.append((end, path.plus(paths[end], -1)))
        else:
            paths[end] = path
    return loops


def _bars_away(bar: tuple[int, str, str], paths: Mapping[str, Path]) -> int:
    _, start, end = bar
    return len(paths[start if start in paths else end].bars)


def _sum(
    terms: tuple[tuple[int, int], ...], addends: tuple[tuple[int, int], ...], sign: int
) -> tuple[tuple[int, int], ...]:
    total = dict(terms)
    for number, times in addends:
        total[number] = total.get(number, 0) + sign * times
    return tuple((number, times) for number, times in sorted(total.items()) if times)
