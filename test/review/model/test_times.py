"""Pairs of stamps and holes of a log, held against plain dictionaries and sets."""

from collections import defaultdict

from hypothesis import example, given, strategies as st
from klann_ros.review.model.times import (
    alone,
    covered_time,
    isin,
    match_stamps,
    merge_intervals,
    overlaps,
    pairs,
)
import numpy as np

stamps = st.lists(st.integers(-3, 8), max_size=12).map(lambda some: np.array(some, dtype=np.int64))
rising = stamps.map(np.unique)
either = st.one_of(stamps, rising)


def by_stamp(some):
    found = defaultdict(list)
    for row, stamp in enumerate(some.tolist()):
        found[stamp].append(row)
    return found


@given(either, either)
@example(np.array([0]), np.array([0, 0]))
def test_the_kth_of_a_stamp_belongs_to_the_kth_if_none_is_missing(first, second) -> None:
    a, b = by_stamp(first), by_stamp(second)
    expected = [
        pair
        for stamp in a
        if len(a[stamp]) == len(b.get(stamp, ()))
        for pair in zip(a[stamp], b[stamp], strict=True)
    ]
    of_first, of_second = pairs(first, second)
    found = list(zip(of_first.tolist(), of_second.tolist(), strict=True))
    assert found == sorted(expected, key=lambda pair: pair[1])


@given(either)
def test_a_row_is_alone_if_its_stamp_is_there_once(some) -> None:
    expected = sorted(rows[0] for rows in by_stamp(some).values() if len(rows) == 1)
    assert alone(some).tolist() == expected


@given(either, either.map(np.unique), st.randoms())
def test_each_row_finds_its_stamp(some, single, random) -> None:
    shuffled = single.tolist()
    random.shuffle(shuffled)
    single = np.array(shuffled, dtype=np.int64)
    known, places = match_stamps(some, single)
    assert known.tolist() == [row for row, stamp in enumerate(some.tolist()) if stamp in shuffled]
    assert (single[places] == some[known]).all()


@given(either, either)
def test_isin_equals_set_membership(some, others) -> None:
    expected = [stamp in set(others.tolist()) for stamp in some.tolist()]
    assert isin(some, others).tolist() == expected


times = st.integers(-20, 20)
unrecorded = st.lists(st.tuples(times, times), max_size=5)


@given(unrecorded, st.lists(st.tuples(times, st.integers(0, 9)), min_size=1, max_size=5))
def test_a_stretch_touches_a_hole_if_a_moment_of_it_is_in_one(some, stretches) -> None:
    inside = {t for begin, end in some for t in range(begin, end + 1)}
    begins = np.array([begin for begin, _ in stretches])
    ends = np.array([begin + length for begin, length in stretches])
    # Holes and stretches end at whole numbers, so that these are moments enough.
    touched = [
        not inside.isdisjoint(range(begin, end + 1))
        for begin, end in zip(begins.tolist(), ends.tolist(), strict=True)
    ]
    assert overlaps(begins, ends, merge_intervals(some)).tolist() == touched
    full = {t for begin, end in some for t in range(begin, end)}
    parts = [
        len(full & set(range(begin, end)))
        for begin, end in zip(begins.tolist(), ends.tolist(), strict=True)
    ]
    assert covered_time(begins, ends, merge_intervals(some)).tolist() == parts
