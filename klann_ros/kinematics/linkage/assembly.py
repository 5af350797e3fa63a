"""
The order in which a linkage is assembled: which bodies must be placed together.

Bodies and points make a graph, a body being joined to each of its points; the pivots belong to the
ground. Its independent loops, edges - nodes + parts, have two equations each. The fewest bodies
that close a loop for every two of them can be placed by themselves: two bodies and one loop are a
dyad, more are coupled loops (Assur groups of a higher class). One group after the other, this
makes the Jacobian block lower triangular.
"""

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import NamedTuple

from klann_ros.kinematics.errors import GeometryError

# All subsets of the bodies are tried.
MOST_BODIES = 25

Group = tuple[int, ...]


class _Graph(NamedTuple):
    """The fixed points, the points of each body, and the bodies' names."""

    pivots: Sequence[str]
    bodies: Sequence[Sequence[str]]
    names: Sequence[str]


def assembly_order(
    pivots: Sequence[str], bodies: Sequence[Sequence[str]], names: Sequence[str]
) -> list[Group]:
    """
    Return the groups of bodies in the order in which they are placed; the crank is body 0.

    Two bodies are a dyad, four or more coupled loops. A GeometryError says why the crank does not
    move the linkage in one definite way: the loops have fewer or more equations than unknown
    angles, as a whole or in a part. Bodies are given by their points, and by their names in
    errors.
    """
    graph = _Graph(pivots, bodies, names)
    _check_connected(graph)
    if _loops(graph, (0,)):
        msg = f'the crank {names[0]} holds two pivots and cannot turn'
        raise GeometryError(msg)
    known: Group = (0,)
    rest = tuple(range(1, len(bodies)))
    groups = []
    while rest:
        group = _next_group(graph, known, rest)
        groups.append(group)
        known += group
        rest = tuple(j for j in rest if j not in group)
    if not groups:
        msg = 'no loop closes: two bodies must lead to the same point'
        raise GeometryError(msg)
    return groups


def _next_group(graph: _Graph, known: Group, rest: Group) -> Group:
    """Return the fewest bodies that close a loop for every two of them."""
    before = _loops(graph, known)
    for size in range(1, len(rest) + 1):
        for group in combinations(rest, size):
            closed = _loops(graph, known + group) - before
            if 2 * closed > size:
                names = ', '.join(graph.names[j] for j in group)
                msg = (
                    f'{names}: cannot move, since {2 * closed} loop equations stand against '
                    f'{size} unknown angle{"s" if size > 1 else ""}'
                )
                raise GeometryError(msg)
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


def _loops(graph: _Graph, bodies: Iterable[int]) -> int:
    """Return how many independent loops some bodies and the ground close."""
    parent: dict[str, str] = {}

    def root(node: str) -> str:
        while parent.setdefault(node, node) != node:
            node = parent[node]
        return node

    loops = 0
    joined = [graph.pivots, *(graph.bodies[j] for j in bodies)]
    for number, points in enumerate(joined):
        for point in points:
            # The space keeps a body's node apart from every point's name.
            body_root, point_root = root(f'body {number}'), root(point)
            loops += body_root == point_root
            parent[body_root] = point_root
    return loops


def _check_connected(graph: _Graph) -> None:
    if len(graph.bodies) > MOST_BODIES:
        msg = f'there are {len(graph.bodies)} bodies: more than {MOST_BODIES} are not solved'
        raise GeometryError(msg)
    reached, rest = set(graph.pivots), list(range(len(graph.bodies)))
    while rest:
        joined = [j for j in rest if not reached.isdisjoint(graph.bodies[j])]
        if not joined:
            msg = (
                f'body {graph.names[rest[0]]} ({"-".join(graph.bodies[rest[0]])}) is connected to '
                f'no pivot, not even by other bodies: the pivots are {", ".join(graph.pivots)}'
            )
            raise GeometryError(msg)
        reached.update(*(graph.bodies[j] for j in joined))
        rest = [j for j in rest if j not in joined]
