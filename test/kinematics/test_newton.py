"""`newton`: the courses' iteration, and the reason when it fails."""

import math
import pickle
from typing import Any, NamedTuple

import four_bar_equations
from four_bars import COURSE
from hypothesis import given, strategies as st
import klann_equations
from klann_ros.kinematics import (
    CrankAngleError,
    FourBar,
    KlannGeometry,
    KlannLeg,
    Leg,
    NotConvergedError,
    SingularPoseError,
    UnreachableError,
)
import numpy as np
import pytest


class Case(NamedTuple):
    leg: Leg[Any, Any]
    equations: Any
    guess: list[float]
    refusal: str
    # At this angle the loops of this leg do not close.
    stuck: Leg[Any, Any]
    out_of_reach: float


CASES = [
    Case(
        KlannLeg(),
        klann_equations,
        [0.2, 1.0, 0.7, 1.0],
        'four finite numbers',
        KlannLeg(KlannGeometry(l_bc=0.33)),
        math.radians(170.0),
    ),
    Case(
        FourBar(*COURSE),
        four_bar_equations,
        [0.3, 1.2],
        'theta3, theta4, two finite numbers',
        FourBar(0.3, 0.2, 0.25, 0.15),
        math.pi,
    ),
]
for_both = pytest.mark.parametrize('case', CASES, ids=['klann', 'four-bar'])


def test_every_degree_converges_from_the_books_guess() -> None:
    leg = KlannLeg()
    guess = np.radians([15.0, 60.0, 45.0, 60.0])
    for k in range(360):
        end = leg.newton(math.radians(k), guess)[-1]
        assert np.sin(end - leg.closed_form(math.radians(k)).x) == pytest.approx(0, abs=1e-11)


@for_both
@given(numbers=st.tuples(*[st.floats(-3.0, 3.0)] * 4))
def test_it_ends_at_a_root_or_gives_the_reason_with_its_iterates(
    case: Case, numbers: tuple[float, ...]
) -> None:
    guess = numbers[: len(case.guess)]
    try:
        iterates = case.leg.newton(1.0, guess)
    except NotConvergedError as error:
        iterates = error.iterates
        assert error.reason in str(error)
    else:
        assert np.abs(case.equations.f(case.leg.geometry, 1.0, iterates[-1])).max() < 1e-12
    assert iterates.shape[1] == len(guess)
    assert tuple(iterates[0]) == guess


def test_the_guess_decides_the_assembly_of_the_end() -> None:
    ends = [FourBar(*COURSE).newton(1.0, guess)[-1] for guess in ([0.3, 1.2], [-1.2, -2.0])]
    signs = [math.copysign(1.0, math.sin(theta4 - theta3)) for theta3, theta4 in ends]
    assert signs == [1.0, -1.0]


@for_both
def test_convergence_errors_carry_the_iterates(case: Case) -> None:
    size = len(case.guess)
    with pytest.raises(NotConvergedError, match='after 20 iterations') as caught:
        case.stuck.newton(case.out_of_reach, case.guess, max_iterations=20)
    assert caught.value.iterates.shape == (21, size)
    with pytest.raises(NotConvergedError, match='Phi is singular') as caught:
        case.leg.newton(1.0, [0.0] * size)
    assert caught.value.iterates.tolist() == [[0.0] * size]


@for_both
@pytest.mark.parametrize('guess', [[0.1], [0.1, math.nan], [[0.0] * 4], [0.0] * 3, 'abc', None])
def test_an_invalid_guess_is_refused(case: Case, guess: Any) -> None:
    with pytest.raises(ValueError, match=case.refusal):
        case.leg.newton(1.0, guess)


@pytest.mark.parametrize('count', [-1, 2.5, '3', True])
def test_an_invalid_count_of_iterations_is_refused(count: Any) -> None:
    with pytest.raises(ValueError, match=r'max_iterations = .* it must be a whole number'):
        KlannLeg().newton(1.0, CASES[0].guess, max_iterations=count)


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
