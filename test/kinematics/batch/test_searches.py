"""Roots and minima of many functions at once: against those that are known."""

from klann_ros.kinematics.batch.searches import last_kept, least_near
import numpy as np
import pytest

ENDS = np.array([0.3, 1e-7, 0.999999, 0.5, 0.7])


def falling(which: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return functions that are lost at ENDS: smooth, steep, a jump, one that ends, a root."""
    end = ENDS[which]
    with np.errstate(invalid='ignore'):
        values = [
            end - at**3 / end**2,
            np.tanh(50.0 * (end - at)),
            np.where(at <= end, 1.0, -1.0),
            np.where(at <= end, 0.3, -np.inf),
            np.sqrt(end - at),
        ]
    return np.choose(which, values)


def test_the_last_argument_that_keeps_is_found_to_rounding() -> None:
    found = last_kept(falling, np.zeros(5), np.ones(5))
    assert found == pytest.approx(ENDS, rel=4e-16, abs=2e-16)
    assert (np.nan_to_num(falling(np.arange(5), found), nan=-1.0) >= 0.0).all()


def test_smooth_functions_cost_few_calls() -> None:
    calls = []

    def function(which: np.ndarray, at: np.ndarray) -> np.ndarray:
        calls.append(len(which))
        return np.cos(at) - at * (1.0 + which)

    last_kept(function, np.zeros(3), np.ones(3))
    assert sum(calls) < 3 * 15


def test_what_is_lost_at_its_start_is_lost_there() -> None:
    assert last_kept(lambda _, at: -1.0 - at, np.zeros(1), np.ones(1)).tolist() == [0.0]


def test_functions_of_every_shape_are_least_where_they_are() -> None:
    places = np.array([0.31, -0.77, 0.05, 0.999, 0.5])

    def function(which: np.ndarray, at: np.ndarray) -> np.ndarray:
        x, k = at - places[which, None], which[:, None]
        shapes = [x**2, np.abs(x), np.sqrt(np.abs(x)), np.expm1(x) - x, x**4 + np.maximum(x, 0.0)]
        return np.choose(k, shapes)

    at, least = least_near(function, np.zeros(5), 1.0, np.full(5, 1e-16))
    assert at == pytest.approx(places, abs=1e-3)
    assert least == pytest.approx(0.0, abs=3e-4)
    assert least[[0, 3, 4]] == pytest.approx(0.0, abs=1e-14)
    assert least[1] == pytest.approx(0.0, abs=1e-8)


def test_what_is_nowhere_a_number_is_least_nowhere() -> None:
    _, least = least_near(
        lambda _, at: np.full(at.shape, np.nan), np.zeros(2), 1.0, np.full(2, 1e-16)
    )
    assert least.tolist() == [np.inf, np.inf]
