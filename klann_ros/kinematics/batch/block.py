"""One block of poses, and the memory that all blocks of a batch share."""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .constants import Array

Codes: TypeAlias = NDArray[np.uint8]

# Poses a block: all that is made of them stays in a processor's second-level cache.
SIZE = 8192


class Rows(NamedTuple):
    """What a kernel makes of a block's poses, each of the block's shape; see `constants`."""

    h_x: Array
    h_y: Array
    m_x: Array  # B - D
    m_y: Array
    w_1: Array
    r_1: Array
    u_x: Array  # G - E
    u_y: Array
    w_2: Array
    r_2: Array
    # From here on it is the NumPy kernel's own.
    d_1: Array
    d_2: Array
    f_x: Array
    f_y: Array


class Block(NamedTuple):
    """
    Some legs at some crank angles, as a table: shape (legs, angles).

    Where `across` is set it is (angles, legs), so that the longer side is along the rows.
    """

    legs: slice
    across: bool
    cos: Array  # shape (angles,), of the crank angles
    sin: Array
    rows: Array  # shape (14, ...): `Rows`
    reason: Codes


class Scratch:
    """
    The memory of a batch, however many blocks it has.

    Parameters
    ----------
    turns : bool
        Whether a block may have its legs along the rows.

    """

    def __init__(self, *, turns: bool) -> None:
        """Take it."""
        self._turns = turns
        self._angles = np.empty((3, SIZE))
        self._rows = np.empty(len(Rows._fields) * SIZE)
        self._reason = np.empty(SIZE, dtype=np.uint8)

    def angles(self, count: int) -> tuple[Array, Array, Array]:
        """Return room for some crank angles, their cosines and their sines."""
        alphas, cos, sin = self._angles[:, :count]
        return alphas, cos, sin

    def block(self, legs: slice, cos: Array, sin: Array) -> Block:
        """Return a block that has yet to be computed."""
        shape = (legs.stop - legs.start, cos.size)
        across = self._turns and shape[0] > shape[1]
        if across:
            shape = shape[::-1]
        size = shape[0] * shape[1]
        rows = self._rows[: len(Rows._fields) * size].reshape(-1, *shape)
        return Block(legs, across, cos, sin, rows, self._reason[:size].reshape(shape))
