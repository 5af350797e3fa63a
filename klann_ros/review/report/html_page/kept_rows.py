"""Which rows of a long run a page keeps: even ones, and the extremes of every stretch."""

from collections.abc import Sequence

from klann_ros.review.loading.layouts import Floats
import numpy as np
from numpy.typing import ArrayLike, NDArray

Rows = NDArray[np.intp]


def kept_rows(count: int, columns: Sequence[Floats], most: int, needed: ArrayLike = ()) -> Rows:
    """
    Return the rows to keep, rising: all of them where they are no more than `most`.

    Half of those that are kept are evenly spaced. The others hold the least and the greatest value
    of each column in equal stretches of the run, so that no peak gets lost.

    Parameters
    ----------
    count : int
        How many rows there are.
    columns : sequence of numpy.ndarray, shape (count,)
        What shall keep its extremes; NaN is none.
    most : int
        About so many rows may be kept.
    needed : sequence of int
        Rows that are kept in any case.

    """
    if count <= most:
        return np.arange(count)
    half = max(most // 2, 2)
    even = np.linspace(0, count - 1, half).astype(np.intp)
    stretches = max(half // (2 * max(len(columns), 1)), 1)
    rows = [even, np.asarray(needed, dtype=np.intp)]
    for column in columns:
        rows += [_greatest(column, stretches), _greatest(-column, stretches)]
    kept: Rows = np.unique(np.concatenate(rows))
    return kept


def _greatest(column: Floats, stretches: int) -> Rows:
    """Return where the greatest value of each stretch is."""
    size = -(-len(column) // stretches)
    known = np.where(np.isnan(column), -np.inf, column)
    whole = len(known) // size
    begins = np.arange(whole) * size
    table = known[slice(whole * size)].reshape(whole, size)
    rows: Rows = begins + table.argmax(axis=1)
    rest = known[slice(whole * size, None)]
    return np.append(rows, whole * size + rest.argmax()) if rest.size else rows
