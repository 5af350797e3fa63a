"""
Guesses made from nothing, on a linkage's assembly branch.

A dyad's are exact: two circles. There is no closed form for coupled loops. Their branch is what
the linkage reaches from its start when the crank is turned, without passing a singular pose; it is
followed once, in small steps, and kept. A guess is the nearest pose in the table, led on along its
tangent.
"""

from contextlib import suppress
from math import isnan, pi
from sys import float_info

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arcs import Arc, arcs_inside, normal
from klann_ros.kinematics.errors import GeometryError, LoopsOpenError, UnreachableError

from .blocks import CoupledLoops, Dyad
from .branch_table import BranchTable, Row, TRUSTED
from .configuration import Configuration
from .linkage import Linkage
from .rates import rates
from .refinement import refine_block

# Between the table's poses [rad]: an eighth of what a tangent of the Klann leg may lead astray.
STEP = 0.05
# Where steps smaller than this fail the branch ends [rad].
SHORTEST = 1e-9
TOLERANCE = 1e-9
ITERATIONS = 6


class Seeds:
    """
    Guesses for any crank angle.

    Parameters
    ----------
    linkage : Linkage
        The linkage; the tables of its coupled loops are made here, in some 10 ms each.

    """

    def __init__(self, linkage: Linkage) -> None:
        """Follow the branch of the coupled loops."""
        self._linkage = linkage
        self._dyads = [block for block in linkage.blocks if isinstance(block, Dyad)]
        self._tables: dict[int, BranchTable] = {}
        for place, block in enumerate(linkage.blocks):
            if isinstance(block, CoupledLoops):
                self._tables[place] = self._followed(place)
        self._check_seams()

    def seed(self, alpha: float) -> tuple[float, ...]:
        """
        Return a guess of the angles x at a crank angle: exact where every block is a dyad.

        Raises
        ------
        UnreachableError
            A dyad does not close.
        LoopsOpenError
            Coupled loops do not close on this branch.

        """
        return tuple(self.assembled(alpha).angles[1:])

    def assembled(self, alpha: float) -> Configuration:
        """Return the closed configuration at a crank angle; raises as `seed` does."""
        return self._assembled(alpha, len(self._linkage.blocks))

    def arcs(self) -> list[Arc]:
        """Return the arcs of crank angles at which every block closes [rad]."""
        # Each table was followed with the blocks before it closed, so the last holds them all.
        arc = [(0.0, TURN), *(table.arc for table in self._tables.values())][-1]
        return normal(arcs_inside(self._clearance, arc) if self._dyads else [arc])

    def _clearance(self, alpha: float) -> float:
        """Return the clearance of the dyad that fails [m], or else the least of all dyads."""
        try:
            u = self.assembled(alpha).u
        except UnreachableError as error:
            # Where the ends of a dyad coincide nothing closes, although nothing is short.
            return min(-error.shortfall, -float_info.min)
        except LoopsOpenError:
            return -float_info.min
        return max(0.0, min(dyad.clearance(u) for dyad in self._dyads))

    def _assembled(self, alpha: float, count: int) -> Configuration:
        """Return a configuration in which the first `count` blocks are closed."""
        linkage = self._linkage
        found = Configuration(linkage.senses, [alpha, *linkage.start[1:]])
        for place in range(count):
            block = linkage.blocks[place]
            if isinstance(block, Dyad):
                _put(block, block.assemble(found.u, alpha, linkage.assembly[place]), found)
            else:
                table = self._tables[place]
                _put(block, table.guess(alpha), found)
                if not refine_block(block, found, TOLERANCE, ITERATIONS):
                    raise LoopsOpenError(alpha, place + 1, table.nearest(alpha))
        return found

    # Coupled loops: the branch is followed from the start, both ways.

    def _followed(self, place: int) -> BranchTable:
        linkage = self._linkage
        start = linkage.start[0]
        angles = tuple(linkage.start[j] for j in linkage.blocks[place].unknowns)
        first = self._row(place, start, angles)
        if first is None:
            msg = (
                'its coupled loops cannot be followed from the start: it is nearly singular there'
            )
            raise GeometryError(msg)
        ahead = self._walk(place, first, 1.0)
        if BranchTable.is_closed(ahead):
            return BranchTable(place + 1, ahead)
        back = self._walk(place, first, -1.0)
        return BranchTable(place + 1, _one_turn([*reversed(back[1:]), *ahead], start))

    def _check_seams(self) -> None:
        """Refuse a crank that can turn on to where the linkage is put together in another way."""
        for table in self._tables.values():
            first, last = table.arc
            if TURN - 2.0 * STEP <= last - first < TURN:
                with suppress(UnreachableError, LoopsOpenError):
                    self.assembled(first + 2.0 * STEP)
                    self.assembled(last - 2.0 * STEP)
                    msg = (
                        'its coupled loops are not back where they were after a turn of the '
                        'crank: one crank angle has two poses, and such a linkage is not solved'
                    )
                    raise GeometryError(msg)

    def _walk(self, place: int, first: Row, direction: float) -> list[Row]:
        """Return the poses from the first on, for a whole turn or until the branch ends."""
        rows, step = [first], STEP
        while abs(rows[-1].alpha - first.alpha) < TURN and step > SHORTEST:
            guess = rows[-1].ahead(direction * step)
            row = self._row(place, rows[-1].alpha + direction * step, guess)
            if row is None:
                step /= 2.0
            else:
                rows.append(row)
                step = min(STEP, 2.0 * step)
        return rows

    def _row(self, place: int, alpha: float, guess: tuple[float, ...]) -> Row | None:
        """Return the pose at a crank angle; None where the guess does not lead to it safely."""
        linkage = self._linkage
        block, sign = linkage.blocks[place], linkage.assembly[place]
        try:
            found = self._assembled(alpha, place)
        except (UnreachableError, LoopsOpenError):
            return None
        _put(block, guess, found)
        if not refine_block(block, found, TOLERANCE, ITERATIONS):
            return None
        x = tuple(found.angles[j] for j in block.unknowns)
        astray = max(abs(a - b) for a, b in zip(x, guess, strict=True))
        if astray > TRUSTED or block.sine(found.u) * sign <= block.singular_sine:
            return None
        rate = rates(linkage, found.u, place + 1)
        x_1 = tuple(rate[j] for j in block.unknowns)
        return None if isnan(x_1[0]) else Row(alpha, x, x_1)


def _one_turn(rows: list[Row], start: float) -> list[Row]:
    """Return the rows of one turn around the start; on a longer branch an angle has two poses."""
    if rows[-1].alpha - rows[0].alpha < TURN:
        return rows
    first = min(max(rows[0].alpha, start - pi), rows[-1].alpha - TURN)
    return [row for row in rows if first <= row.alpha <= first + TURN]


def _put(
    block: Dyad | CoupledLoops, angles: tuple[float, ...], configuration: Configuration
) -> None:
    for j, angle in zip(block.unknowns, angles, strict=True):
        configuration.put(j, angle)
