"""Which kernel computes a batch: NumPy's, or the one that numba compiles where it is installed."""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple, Protocol

from . import numpy_kernel
from .block import Block
from .constants import Array

# Loading numba and its machine code takes as long as NumPy takes for millions of poses; a batch
# as large as this is unlikely to be the only one.
WORTH_COMPILING = 100_000


class Place(Protocol):
    """Fill in a block; see `numpy_kernel.place`."""

    def __call__(self, constants: Array, block: Block, *, keep: bool) -> None:
        """Fill it in."""


class Kernel(NamedTuple):
    """The functions of a kernel, and whether it takes blocks with the legs along the rows."""

    turn: Callable[[Array, Array, Array], None]
    place: Place
    across: bool


NUMPY = Kernel(numpy_kernel.turn, numpy_kernel.place, across=True)


def choose(name: str | None, poses: int) -> Kernel:
    """
    Return a kernel.

    Parameters
    ----------
    name : str or None
        'numpy' or 'numba'; None takes numba's for large batches, if it can be had.
    poses : int
        How many poses the batch has.

    Raises
    ------
    ValueError
        There is no such kernel, or numba is missing or does not work here.

    """
    if name not in (None, 'numpy', 'numba'):
        msg = f"kernel = {name!r} is refused: it must be 'numpy', 'numba' or None"
        raise ValueError(msg)
    if name == 'numpy' or (name is None and poses < WORTH_COMPILING):
        return NUMPY
    kernel, problem = _numba()
    if kernel is not None:
        return kernel
    if name is None:
        return NUMPY
    msg = f"kernel = 'numba' is refused: numba cannot be used here ({problem})"
    raise ValueError(msg)


@cache
def _numba() -> tuple[Kernel | None, str]:
    try:
        from . import numba_kernel  # noqa: PLC0415 - numba takes long to load
    except Exception as error:  # noqa: BLE001, RUF100 - a numba that does not fit breaks anyhow
        return None, f'{type(error).__name__}: {error}'
    return Kernel(numba_kernel.turn, numba_kernel.place, across=False), ''
