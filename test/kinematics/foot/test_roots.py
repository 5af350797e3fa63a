"""`root`: bracketed, and exact to the last digits."""

import math

from hypothesis import given, strategies as st
from klann_ros.kinematics.foot.extremes import MOST_CALLS, root
import pytest

roots = st.floats(-10.0, 10.0)


@given(zero=roots, left=st.floats(0.01, 5.0), right=st.floats(0.01, 5.0), odd=st.integers(0, 4))
def test_it_finds_a_root_of_any_odd_order(
    zero: float, left: float, right: float, odd: int
) -> None:
    calls = []

    def function(t: float) -> float:
        calls.append(t)
        return math.copysign(abs(t - zero) ** (2 * odd + 1) * math.exp(t), t - zero)

    ends = [(t, function(t)) for t in (zero - left, zero + right)]
    found = root(function, *ends)
    # So near its root the function may be 0 in floats.
    assert abs(found - zero) <= 1e-14 * (1.0 + abs(zero)) or function(found) == 0.0
    assert len(calls) < MOST_CALLS
    assert all(ends[0][0] <= t <= ends[1][0] for t in calls)


def test_a_smooth_function_takes_few_calls() -> None:
    calls = []

    def function(t: float) -> float:
        calls.append(t)
        return math.cos(t) - t

    assert root(function, (0.0, 1.0), (1.0, math.cos(1.0) - 1.0)) == pytest.approx(
        0.7390851332151607, abs=1e-15
    )
    assert len(calls) <= 10


def test_a_jump_is_found_by_bisection() -> None:
    found = root(lambda t: math.copysign(1.0, t - 0.3), (0.0, -1.0), (1.0, 1.0))
    assert found == pytest.approx(0.3, abs=1e-15)


def test_an_end_that_is_a_root_is_taken() -> None:
    assert root(lambda t: t, (0.0, 0.0), (1.0, 1.0)) == 0.0
    assert root(lambda t: t - 1.0, (0.0, -1.0), (1.0, 0.0)) == 1.0


def test_where_a_function_has_no_value_it_turns() -> None:
    cusp = root(lambda t: math.nan if t == 0.5 else t - 0.5, (0.0, -0.5), (1.0, 0.5))
    assert cusp == 0.5
