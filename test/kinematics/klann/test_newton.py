"""`KlannLeg.newton`: the textbook's iteration, told honestly when it fails."""

import math
import pickle
from typing import Any

from hypothesis import given, strategies as st
import klann_equations as equations
from klann_ros.kinematics import (
    CrankAngleError,
    KlannGeometry,
    KlannLeg,
    NotConvergedError,
    SingularPoseError,
    UnreachableError,
)
import numpy as np
import pytest

GUESS = [0.2, 1.0, 0.7, 1.0]


def test_every_degree_converges_from_the_books_guess() -> None:
    leg = KlannLeg()
    guess = np.radians([15.0, 60.0, 45.0, 60.0])
    for k in range(360):
        end = leg.newton(math.radians(k), guess)[-1]
        assert np.sin(end - leg.closed_form(math.radians(k)).x) == pytest.approx(0, abs=1e-11)


@given(guess=st.tuples(*[st.floats(-3.0, 3.0)] * 4))
def test_it_ends_at_a_root_or_says_why_with_its_iterates(guess: tuple[float, ...]) -> None:
    leg = KlannLeg()
    try:
        iterates = leg.newton(1.0, guess)
    except NotConvergedError as error:
        iterates = error.iterates
        assert error.reason in str(error)
    else:
        assert np.abs(equations.f(leg.geometry, 1.0, iterates[-1])).max() < 1e-12
    assert iterates.shape[1] == 4
    assert tuple(iterates[0]) == guess


def test_an_angle_out_of_reach_carries_the_iterates() -> None:
    leg = KlannLeg(KlannGeometry(l_bc=0.33))
    with pytest.raises(NotConvergedError, match='after 20 iterations') as caught:
        leg.newton(math.radians(170.0), GUESS, max_iterations=20)
    assert caught.value.iterates.shape == (21, 4)


def test_a_singular_guess_is_said() -> None:
    with pytest.raises(NotConvergedError, match='Phi is singular') as caught:
        KlannLeg().newton(1.0, [0.0, 0.0, 0.0, 0.0])
    assert caught.value.iterates.tolist() == [[0.0, 0.0, 0.0, 0.0]]


@pytest.mark.parametrize('guess', [[0.1], [0.1, 0.2, 0.3, math.nan], [[0.0] * 4], 'abc', None])
def test_a_guess_that_is_none_is_refused(guess: list[float]) -> None:
    with pytest.raises(ValueError, match='four finite numbers'):
        KlannLeg().newton(1.0, guess)


@pytest.mark.parametrize(
    'error',
    [
        CrankAngleError(math.inf, 1e6),
        UnreachableError(1.0, 2, 0.01, False, ('E', 'G', 'EF', 'FG')),
        NotConvergedError(1.0, np.zeros((1, 4)), 'because'),
        SingularPoseError(1.0),
    ],
)
def test_errors_survive_pickling_with_their_text(error: Exception) -> None:
    assert str(pickle.loads(pickle.dumps(error))) == str(error)  # noqa: S301 - our own bytes


def test_newton_takes_no_angle_that_is_none() -> None:
    with pytest.raises(CrankAngleError):
        KlannLeg().newton(math.inf, GUESS)


@pytest.mark.parametrize('count', [-1, 2.5, '3', True])
def test_a_count_of_iterations_that_is_none_is_refused(count: Any) -> None:
    with pytest.raises(ValueError, match=r'max_iterations = .* it must be a whole number'):
        KlannLeg().newton(1.0, GUESS, max_iterations=count)
