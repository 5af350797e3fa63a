"""All blocks of a batch, one after the other, in the same memory."""

from collections.abc import Callable, Iterator
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from .block import Block, Codes, Scratch, SIZE
from .constants import Array
from .joints import Joints
from .kernels import Kernel

A = TypeVar('A', Array, Codes)
Progress: TypeAlias = Callable[[int, int], object]
Where: TypeAlias = tuple[slice, slice]


class Results(NamedTuple):
    """Where a batch goes: n legs at k crank angles."""

    h: Array  # shape (n, k, 2)
    reason: Codes  # shape (n, k)
    angles: Array | None  # shape (n, k, 4)
    points: Array | None  # shape (n, k, 8, 2)


def fill(
    constants: Array,
    alphas: NDArray[np.generic],
    results: Results,
    kernel: Kernel,
    progress: Progress | None,
) -> None:
    """
    Fill in the results.

    Parameters
    ----------
    constants : numpy.ndarray, shape (27, n)
        The legs; see `constants.pack`.
    alphas : numpy.ndarray, shape (k,)
        Crank angles, of any real type [rad].
    results : Results
        Where they go.
    kernel : Kernel
        What computes them.
    progress : callable or None
        Called with (done, total) poses after each block.

    """
    keep = results.angles is not None or results.points is not None
    done, total = 0, results.reason.size
    # What cannot be computed becomes NaN on its way, and is then explained.
    with np.errstate(all='ignore'):
        for where, block in _blocks(constants, alphas, kernel):
            kernel.place(constants, block, keep=keep)
            _store(constants, block, where, results)
            done += block.reason.size
            if progress is not None:
                progress(done, total)


def _blocks(
    constants: Array, alphas: NDArray[np.generic], kernel: Kernel
) -> Iterator[tuple[Where, Block]]:
    """Yield each block with its place: all legs at the first crank angles, then at the next."""
    scratch, legs = Scratch(turns=kernel.across), constants.shape[1]
    for first in range(0, alphas.size, SIZE):
        columns = slice(first, min(first + SIZE, alphas.size))
        angles, cos, sin = scratch.angles(columns.stop - first)
        angles[:] = alphas[columns]
        kernel.turn(angles, cos, sin)
        step = SIZE // angles.size
        for leg in range(0, legs, step):
            rows = slice(leg, min(leg + step, legs))
            yield (rows, columns), scratch.block(rows, cos, sin)


def _store(constants: Array, block: Block, where: Where, results: Results) -> None:
    def part(result: A) -> A:
        """Return the block's part of a result, turned as the block is."""
        cells: A = result[where].swapaxes(0, 1) if block.across else result[where]
        return cells

    h = part(results.h)
    h[..., 0], h[..., 1] = block.rows[0], block.rows[1]
    part(results.reason)[...] = block.reason
    if results.angles is None and results.points is None:
        return
    joints = Joints(constants, block)
    if results.angles is not None:
        joints.angles(part(results.angles))
    if results.points is not None:
        joints.points(part(results.points))
