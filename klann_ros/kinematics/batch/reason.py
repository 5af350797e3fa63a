"""Why there is no pose at a crank angle."""

from enum import IntEnum


class Reason(IntEnum):
    """
    Why a pose of a batch was not solved; 0 where it was.

    The dyads are those of `UnreachableError`, the loops those of `LoopsOpenError`. Ends that
    coincide, so that their dyad closes nowhere or everywhere, count as too close. Of the third
    block and those behind it the numbers go on alike, by `unreachable` and `open_loops`.
    """

    SOLVED = 0
    CRANK_ANGLE = 1  # not finite, or beyond +-1e6 rad
    DYAD_1_TOO_FAR = 2
    DYAD_1_TOO_CLOSE = 3
    DYAD_2_TOO_FAR = 4
    DYAD_2_TOO_CLOSE = 5
    DYAD_3_TOO_FAR = 6
    DYAD_3_TOO_CLOSE = 7
    LOOPS_1_OPEN = 101
    LOOPS_2_OPEN = 102
    REFUSED = 255  # these numbers are no linkage


def unreachable(block: int, *, far: bool) -> int:
    """Return the reason for a dyad that does not close, of the block's number from 1."""
    return 2 * block + (not far)


def open_loops(block: int) -> int:
    """Return the reason for coupled loops that do not close."""
    return 100 + block
