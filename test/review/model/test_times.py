"""Holes of a log, held against the moments in them one by one."""

from hypothesis import given, strategies as st
from klann_ros.review.model.times import covered_time, merge_intervals, overlaps
import numpy as np

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
