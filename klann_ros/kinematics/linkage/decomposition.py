"""
The block structure of a linkage's Jacobian: which loops are solved together, in which order.

Each loop has two equations. A set of k loops with 2 k unknown angles can be solved by itself; the
smallest such sets, one after the other, make the Jacobian block lower triangular. One loop with
two unknown angles is a dyad; more loops are coupled (Assur groups of a higher class).
"""

from dataclasses import dataclass
from itertools import combinations

from klann_ros.kinematics.errors import GeometryError

from .description import Description
from .loops import LoopEquations

# All subsets of the loops are tried.
MOST_LOOPS = 12


@dataclass(frozen=True)
class Block:
    """
    Loops that are solved together.

    Attributes
    ----------
    loops : tuple of int
        Rows of the loop equations.
    unknowns : tuple of int
        The bodies whose angles they give, twice as many.

    """

    loops: tuple[int, ...]
    unknowns: tuple[int, ...]


def blocks(description: Description, equations: LoopEquations) -> list[Block]:
    """
    Return the blocks in the order in which they are solved; the crank is body 0.

    Raises
    ------
    GeometryError
        The crank does not move the linkage in one definite way: the loops have fewer or more
        equations than unknown angles, as a whole or in a part.

    """
    names = [body.angle for body in description.bodies]
    bodies_of = [
        frozenset(j for j in range(1, len(names)) if row[j] != 0.0) for row in equations.w
    ]
    _check_count(names, bodies_of)
    remaining, solved, found = set(range(len(bodies_of))), frozenset[int](), list[Block]()
    while remaining:
        block = _smallest(remaining, solved, bodies_of)
        unknowns = [names[j] for j in block.unknowns]
        if len(unknowns) < 2 * len(block.loops):
            closing = ', '.join(equations.closing[i] for i in block.loops)
            msg = (
                f'the loops that close at {closing} cannot move: {2 * len(block.loops)} equations '
                f'for {", ".join(unknowns) or "no unknown angle"} alone'
            )
            raise GeometryError(msg)
        found.append(block)
        remaining.difference_update(block.loops)
        solved |= set(block.unknowns)
    return found


def _check_count(names: list[str], bodies_of: list[frozenset[int]]) -> None:
    if len(bodies_of) > MOST_LOOPS:
        msg = f'there are {len(bodies_of)} loops: more than {MOST_LOOPS} are not solved'
        raise GeometryError(msg)
    if not bodies_of:
        msg = 'no loop closes: two bodies must lead to the same point'
        raise GeometryError(msg)
    free = set(range(1, len(names))).difference(*bodies_of)
    if free:
        loose = ', '.join(names[j] for j in sorted(free))
        msg = f'{loose}: turns freely, since no loop closes over it'
        raise GeometryError(msg)
    unknowns, equations = len(names) - 1, 2 * len(bodies_of)
    if unknowns > equations:
        msg = (
            f'the crank alone does not move it in one definite way: {unknowns} unknown angles '
            f'and {equations} equations in {len(bodies_of)} loops'
        )
        raise GeometryError(msg)


def _smallest(
    remaining: set[int], solved: frozenset[int], bodies_of: list[frozenset[int]]
) -> Block:
    """Return the fewest loops that have no more unknown angles than equations."""
    for size in range(1, len(remaining) + 1):
        for loops in combinations(sorted(remaining), size):
            unknowns = frozenset[int]().union(*(bodies_of[i] for i in loops)) - solved
            if len(unknowns) <= 2 * size:
                return Block(loops, tuple(sorted(unknowns)))
    # The whole has no more unknowns than equations, so the last size has returned.
    msg = 'the loops cannot be put in order'
    raise GeometryError(msg)
