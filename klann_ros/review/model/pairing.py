"""Which answer belongs to which: by their stamps, which an input gives to all of its answers."""

from typing import NamedTuple

import numpy as np

from .times import Flags, RowIndices, Times


class _Groups(NamedTuple):
    """Rows by stamp: the stamps, each once, where its rows begin in `order`, how many it has."""

    stamps: Times
    begins: RowIndices
    counts: RowIndices
    order: RowIndices


def pairs(first: Times, second: Times) -> tuple[RowIndices, RowIndices]:
    """
    Return which rows of the first belong to which of the second, in the order of the second.

    A simulated clock gives many the same stamp: the k-th of a stamp belongs to the k-th of the
    other. Where one of them is missing nobody knows which, and none of the stamp is paired.
    """
    if len(first) == len(second) and (first == second).all() and rises(first):
        rows = np.arange(len(first), dtype=np.intp)
        return rows, rows
    a, b = _groups(first), _groups(second)
    _, in_a, in_b = np.intersect1d(a.stamps, b.stamps, assume_unique=True, return_indices=True)
    equal = a.counts[in_a] == b.counts[in_b]
    in_a, in_b = in_a[equal], in_b[equal]
    of_a, of_b = _rows(a, in_a), _rows(b, in_b)
    by_b = np.argsort(of_b, kind='stable')
    return of_a[by_b], of_b[by_b]


def alone(stamps: Times) -> RowIndices:
    """Return the rows whose stamp no other row has."""
    if rises(stamps):
        return np.arange(len(stamps))
    groups = _groups(stamps)
    return np.sort(groups.order[groups.begins[groups.counts == 1]])


def many_to_one(stamps: Times, single: Times) -> tuple[RowIndices, RowIndices]:
    """Return which rows have a stamp that is in `single`, once at most, and where it is there."""
    if not len(single):
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    # Sorted already, as a rule: what NumPy has for it needs five times the memory.
    order = None if rises(single) else np.argsort(single, kind='stable')
    ordered = single if order is None else single[order]
    place = np.searchsorted(ordered, stamps)
    np.minimum(place, len(ordered) - 1, out=place)
    known = np.flatnonzero(ordered[place] == stamps)
    return known, place[known] if order is None else order[place[known]]


def are_among(stamps: Times, among: Times) -> Flags:
    """Return which stamps are among others."""
    found = np.zeros(len(stamps), dtype=bool)
    found[many_to_one(stamps, among if rises(among) else np.unique(among))[0]] = True
    return found


class StampCounts(NamedTuple):
    """How often each stamp is there."""

    # Shape (k,): the stamps that are among the first, each once, in their order.
    stamps: Times
    # Which of them each of the first is.
    of_first: RowIndices
    # Shape (k,): how often each is among the first, and among the second.
    first: RowIndices
    second: RowIndices


def stamp_counts(first: Times, second: Times) -> StampCounts:
    """Return how often each stamp of the first is there, and how often among the second."""
    stamps, of_first, counts = np.unique(first, return_inverse=True, return_counts=True)
    ordered = np.sort(second)
    begins, ends = (np.searchsorted(ordered, stamps, side=side) for side in ('left', 'right'))
    return StampCounts(stamps, of_first, counts, ends - begins)


def rises(stamps: Times) -> bool:
    """Return whether each stamp is later than the one before."""
    return bool((np.diff(stamps) > 0).all())


def _groups(stamps: Times) -> _Groups:
    order = np.argsort(stamps, kind='stable')
    found, begins, counts = np.unique(stamps[order], return_index=True, return_counts=True)
    return _Groups(found, begins, counts, order)


def _rows(groups: _Groups, which: RowIndices) -> RowIndices:
    """Return the rows of some groups, one group after the other."""
    begins, counts = groups.begins[which], groups.counts[which]
    ends = np.cumsum(counts)
    within = np.arange(ends[-1] if len(ends) else 0) - np.repeat(ends - counts, counts)
    rows: RowIndices = groups.order[np.repeat(begins, counts) + within]
    return rows
