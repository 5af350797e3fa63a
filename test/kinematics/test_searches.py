"""Roots and minima, of one function and of many at once, against known ones."""

import math
from typing import Any

from hypothesis import given, strategies as st
from klann_ros.kinematics.searches import last_nonnegative, MAX_CALLS, minimum_near, root
import numpy as np
import pytest

ENDS = np.array([0.3, 1e-7, 0.999999, 0.5, 0.7])


@given(
    zero=st.floats(-10.0, 10.0),
    left=st.floats(0.01, 5.0),
    right=st.floats(0.01, 5.0),
    odd=st.integers(0, 4),
)
def test_a_root_of_odd_order_is_found(zero: float, left: float, right: float, odd: int) -> None:
    calls = []

    def function(t: float) -> float:
        calls.append(t)
        return math.copysign(abs(t - zero) ** (2 * odd + 1) * math.exp(t), t - zero)

    ends = [(t, function(t)) for t in (zero - left, zero + right)]
    crossing = root(function, *ends)
    # Near its root the function may underflow to 0.
    assert abs(crossing - zero) <= 1e-14 * (1.0 + abs(zero)) or function(crossing) == 0.0
    assert len(calls) < MAX_CALLS
    assert all(ends[0][0] <= t <= ends[1][0] for t in calls)


def test_a_smooth_function_takes_few_calls() -> None:
    calls = []

    def function(t: float) -> float:
        calls.append(t)
        return math.cos(t) - t

    crossing = root(function, (0.0, 1.0), (1.0, math.cos(1.0) - 1.0))
    assert crossing == pytest.approx(0.7390851332151607, abs=1e-15)
    assert len(calls) <= 10


@pytest.mark.parametrize(
    ('function', 'expected'),
    [
        (lambda t: math.copysign(1.0, t - 0.3), pytest.approx(0.3, abs=1e-15)),
        (lambda t: t, 0.0),
        (lambda t: t - 1.0, 1.0),
        (lambda t: math.nan if t == 0.5 else t - 0.5, 0.5),
    ],
    ids=['a jump', 'its start', 'its end', 'an argument without a value'],
)
def test_a_root_may_be_anything_with_a_change_of_sign(function: Any, expected: Any) -> None:
    assert root(function, (0.0, function(0.0)), (1.0, function(1.0))) == expected


def falling(indices: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return functions negative beyond ENDS: smooth, steep, a jump, one that ends, a root."""
    end = ENDS[indices]
    with np.errstate(invalid='ignore'):
        shapes = [
            end - t**3 / end**2,
            np.tanh(50.0 * (end - t)),
            np.where(t <= end, 1.0, -1.0),
            np.where(t <= end, 0.3, -np.inf),
            np.sqrt(end - t),
        ]
    return np.choose(indices, shapes)


def test_the_last_nonnegative_argument_is_found_to_rounding() -> None:
    last_arguments = last_nonnegative(falling, np.zeros(5), np.ones(5))
    assert last_arguments == pytest.approx(ENDS, rel=4e-16, abs=2e-16)
    assert (np.nan_to_num(falling(np.arange(5), last_arguments), nan=-1.0) >= 0.0).all()


def test_many_smooth_functions_take_few_calls() -> None:
    calls = []

    def function(indices: np.ndarray, t: np.ndarray) -> np.ndarray:
        calls.append(len(indices))
        return np.cos(t) - t * (1.0 + indices)

    last_nonnegative(function, np.zeros(3), np.ones(3))
    assert sum(calls) < 3 * 15


def test_a_function_negative_at_its_start_ends_there() -> None:
    assert last_nonnegative(lambda _, t: -1.0 - t, np.zeros(1), np.ones(1)).tolist() == [0.0]


def test_minima_of_every_shape_are_found() -> None:
    places = np.array([0.31, -0.77, 0.05, 0.999, 0.5])

    def function(indices: np.ndarray, arguments: np.ndarray) -> np.ndarray:
        x = arguments - places[indices, None]
        k = indices[:, None]
        shapes = [x**2, np.abs(x), np.sqrt(np.abs(x)), np.expm1(x) - x, x**4 + np.maximum(x, 0.0)]
        return np.choose(k, shapes)

    arguments, minima = minimum_near(function, np.zeros(5), 1.0, np.full(5, 1e-16))
    assert arguments == pytest.approx(places, abs=1e-3)
    assert minima == pytest.approx(0.0, abs=3e-4)
    assert minima[[0, 3, 4]] == pytest.approx(0.0, abs=1e-14)
    assert minima[1] == pytest.approx(0.0, abs=1e-8)


def test_a_function_without_values_has_no_minimum() -> None:
    rounding = np.full(2, 1e-16)
    _, minima = minimum_near(lambda _, t: np.nan * t, np.zeros(2), 1.0, rounding)
    assert minima.tolist() == [np.inf, np.inf]
