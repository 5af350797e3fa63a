"""
The order in which a linkage is assembled: which bodies must be placed together.

Bodies and points make a graph, a body being joined to each of its points; the pivots belong to the
ground. Its independent loops, edges - nodes + parts, have two equations each. The fewest bodies
that close a loop for every two of them can be placed by themselves: two bodies and one loop are a
dyad, more are coupled loops (Assur groups of a higher class). One group after the other, this
makes the Jacobian block lower triangular.
"""

from collections.abc import Iterable
from itertools import combinations

from klann_ros.kinematics.errors import GeometryError

from .description import Description

# All subsets of the bodies are tried.
MOST_BODIES = 25

Group = tuple[int, ...]


def assembly_order(description: Description) -> list[Group]:
    """
    Return the groups of bodies in the order in which they are placed; the crank is body 0.

    Parameters
    ----------
    description : Description
        The linkage.

    Returns
    -------
    list of tuple of int
        The bodies of each group: two for a dyad, four or more for coupled loops.

    Raises
    ------
    GeometryError
        The crank does not move the linkage in one definite way: the loops have fewer or more
        equations than unknown angles, as a whole or in a part.

    """
    _check_connected(description)
    if _loops(description, (0,)):
        msg = f'the crank {description.crank.angle} holds two pivots and cannot turn'
        raise GeometryError(msg)
    known: Group = (0,)
    rest = tuple(range(1, len(description.bodies)))
    groups = []
    while rest:
        group = _next_group(description, known, rest)
        groups.append(group)
        known += group
        rest = tuple(j for j in rest if j not in group)
    if not groups:
        msg = 'no loop closes: two bodies must lead to the same point'
        raise GeometryError(msg)
    return groups


def _next_group(description: Description, known: Group, rest: Group) -> Group:
    """Return the fewest bodies that close a loop for every two of them."""
    before = _loops(description, known)
    for size in range(1, len(rest) + 1):
        for group in combinations(rest, size):
            closed = _loops(description, known + group) - before
            if 2 * closed > size:
                names = ', '.join(description.bodies[j].angle for j in group)
                msg = (
                    f'{names}: cannot move, since {2 * closed} loop equations stand against '
                    f'{size} unknown angle{"s" if size > 1 else ""}'
                )
                raise GeometryError(msg)
            if 2 * closed == size:
                return group
    closed = _loops(description, known + rest) - before
    loose = [j for j in rest if _loops(description, set(known + rest) - {j}) - before == closed]
    names = ', '.join(description.bodies[j].angle for j in loose or rest)
    if loose:
        msg = f'{names}: turns freely, since no loop closes over it'
    else:
        msg = (
            f'the crank alone does not move it in one definite way: {len(rest)} unknown angles '
            f'({names}) and {2 * closed} loop equations'
        )
    raise GeometryError(msg)


def _loops(description: Description, bodies: Iterable[int]) -> int:
    """Return how many independent loops some bodies and the ground close."""
    parent: dict[str, str] = {}

    def root(node: str) -> str:
        while parent.setdefault(node, node) != node:
            node = parent[node]
        return node

    loops = 0
    joined = [description.pivots, *(description.bodies[j].points for j in bodies)]
    for number, points in enumerate(joined):
        for point in points:
            # The space keeps a body's node apart from every point's name.
            body_root, point_root = root(f'body {number}'), root(point)
            loops += body_root == point_root
            parent[body_root] = point_root
    return loops


def _check_connected(description: Description) -> None:
    if len(description.bodies) > MOST_BODIES:
        msg = f'there are {len(description.bodies)} bodies: more than {MOST_BODIES} are not solved'
        raise GeometryError(msg)
    reached, rest = set(description.pivots), list(description.bodies)
    while rest:
        joined = [body for body in rest if not reached.isdisjoint(body.points)]
        if not joined:
            body = rest[0]
            msg = (
                f'body {body.angle} ({"-".join(body.points)}) is connected to no pivot, not even '
                f'by other bodies: the pivots are {", ".join(description.pivots)}'
            )
            raise GeometryError(msg)
        reached.update(*(body.points for body in joined))
        rest = [body for body in rest if body not in joined]
