"""`FourBar.newton`: the course's iteration, told honestly when it fails."""

import math

import four_bar_equations as equations
from four_bars import COURSE, untimed
from hypothesis import given, strategies as st
from klann_ros.kinematics import CrankAngleError, FourBar, NotConvergedError
import numpy as np
import pytest


@untimed
@given(guess=st.tuples(*[st.floats(-3.0, 3.0)] * 2))
def test_it_ends_at_a_root_or_says_why_with_its_iterates(guess: tuple[float, float]) -> None:
    bar = FourBar(*COURSE)
    try:
        iterates = bar.newton(1.0, guess)
    except NotConvergedError as error:
        iterates = error.iterates
        assert error.reason in str(error)
    else:
        assert np.abs(equations.f(bar.geometry, 1.0, iterates[-1])).max() < 1e-12
    assert iterates.shape[1] == 2
    assert tuple(iterates[0]) == guess


def test_it_goes_on_until_the_equations_are_closed_as_well() -> None:
    """A correction below the tolerance is not enough."""
    bar, limits = FourBar(*COURSE), {'tolerance': 1.0, 'max_iterations': 20}
    rough, closed = (bar.newton(1.0, [0.3, 1.2], residual=r, **limits) for r in (None, 1e-12))
    assert len(rough) == 2 < len(closed)
    assert abs(bar.f(1.0, closed[-1])).max() < 1e-12


def test_the_guess_decides_the_assembly_of_the_end() -> None:
    bar = FourBar(*COURSE)
    ends = [bar.newton(1.0, guess)[-1] for guess in ([0.3, 1.2], [-1.2, -2.0])]
    signs = [math.copysign(1.0, math.sin(theta4 - theta3)) for theta3, theta4 in ends]
    assert signs == [1.0, -1.0]


def test_an_angle_out_of_reach_carries_the_iterates() -> None:
    bar = FourBar(0.3, 0.2, 0.25, 0.15)
    with pytest.raises(NotConvergedError, match='after 20 iterations') as caught:
        bar.newton(math.pi, [0.2, 1.0], max_iterations=20)
    assert caught.value.iterates.shape == (21, 2)


def test_a_singular_guess_is_said() -> None:
    with pytest.raises(NotConvergedError, match='Phi is singular'):
        FourBar(*COURSE).newton(1.0, [0.0, 0.0])


@pytest.mark.parametrize('guess', [[0.1], [0.1, math.nan], [[0.0] * 2], [0.0] * 4, 'abc', None])
def test_a_guess_that_is_none_is_refused(guess: object) -> None:
    with pytest.raises(ValueError, match='theta3, theta4, two finite numbers'):
        FourBar(*COURSE).newton(1.0, guess)


def test_newton_takes_no_angle_that_is_none() -> None:
    with pytest.raises(CrankAngleError):
        FourBar(*COURSE).newton(math.inf, [0.3, 1.2])
