"""Why there is no pose at a crank angle."""

from enum import IntEnum


class Reason(IntEnum):
    """
    Why a pose of a batch was not solved; 0 where it was.

    The dyads are those of `UnreachableError`: 1 is BC and DC between B and D, 2 is EF and FG
    between E and G. Ends that coincide, so that their dyad closes nowhere or everywhere, count as
    too close.
    """

    SOLVED = 0
    CRANK_ANGLE = 1  # not finite, or beyond +-1e6 rad
    DYAD_1_TOO_FAR = 2
    DYAD_1_TOO_CLOSE = 3
    DYAD_2_TOO_FAR = 4
    DYAD_2_TOO_CLOSE = 5
