"""Pairs of stamps and holes of a log, held against plain dictionaries and sets."""

from collections import defaultdict
from functools import partial

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

any_stamps = st.lists(st.integers(-3, 8), max_size=12).map(partial(np.array, dtype=np.int64))
unique_stamps = any_stamps.map(np.unique)
stamp_arrays = st.one_of(any_stamps, unique_stamps)


def by_stamp(stamps):
    rows = defaultdict(list)
    for row, stamp in enumerate(stamps.tolist()):
        rows[stamp].append(row)
    return rows


@given(stamp_arrays, stamp_arrays)
@example(np.array([0]), np.array([0, 0]))
def test_the_kth_of_a_stamp_belongs_to_the_kth_if_none_is_missing(first, second) -> None:
    second_by_stamp = by_stamp(second)
    expected = []
    for stamp, first_rows in by_stamp(first).items():
        second_rows = second_by_stamp[stamp]
        if len(first_rows) == len(second_rows):
            expected += zip(second_rows, first_rows, strict=True)
    first_rows, second_rows = pairs(first, second)
    assert [*zip(second_rows.tolist(), first_rows.tolist(), strict=True)] == sorted(expected)


@given(stamp_arrays)
def test_a_row_is_alone_if_its_stamp_is_there_once(stamps) -> None:
    expected = sorted(rows[0] for rows in by_stamp(stamps).values() if len(rows) == 1)
    assert alone(stamps).tolist() == expected


@given(stamp_arrays, unique_stamps, st.randoms())
def test_each_row_finds_its_stamp(stamps, single, random) -> None:
    single = np.array(random.sample(single.tolist(), len(single)), dtype=np.int64)
    rows, indices = match_stamps(stamps, single)
    assert rows.tolist() == np.flatnonzero(np.isin(stamps, single)).tolist()
    assert (single[indices] == stamps[rows]).all()


@given(stamp_arrays, stamp_arrays)
def test_isin_equals_set_membership(stamps, among) -> None:
    assert isin(stamps, among).tolist() == np.isin(stamps, among).tolist()


times = st.integers(-20, 20)
intervals = st.lists(st.tuples(times, times), max_size=5)


@given(intervals, times, st.integers(0, 9))
def test_a_stretch_touches_a_hole_if_a_moment_of_it_is_in_one(holes, begin, length) -> None:
    # Holes and stretches end at whole numbers, so that these are moments enough.
    moments = set()
    seconds = set()
    for hole_begin, hole_end in holes:
        moments |= {*range(hole_begin, hole_end + 1)}
        seconds |= {*range(hole_begin, hole_end)}
    end = begin + length
    begins, ends = np.array([[begin], [end]])
    is_touched = not moments.isdisjoint(range(begin, end + 1))
    assert overlaps(begins, ends, merge_intervals(holes)).tolist() == [is_touched]
    covered = len(seconds & {*range(begin, end)})
    assert covered_time(begins, ends, merge_intervals(holes)).tolist() == [covered]
