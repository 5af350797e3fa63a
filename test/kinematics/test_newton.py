"""The courses' Newton-Raphson: f, Phi, iterates, when it stops, and the reason when it fails."""

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
    LinkageLeg,
    NotConvergedError,
    shipped_linkage,
    SingularPoseError,
    UnreachableError,
)
import numpy as np
import pytest


class Case(NamedTuple):
    leg: Leg[Any, Any]
    equations: Any
    guess: list[float]
    # A leg whose loops do not close at an angle.
    stuck: Leg[Any, Any]
    out_of_reach: float


STUCK_LEG = KlannLeg(KlannGeometry(l_bc=0.33))
STUCK_BAR = FourBar(0.3, 0.2, 0.25, 0.15)
CASES = [
    Case(KlannLeg(), klann_equations, [0.2, 1.0, 0.7, 1.0], STUCK_LEG, math.radians(170.0)),
    Case(FourBar(*COURSE), four_bar_equations, [0.3, 1.2], STUCK_BAR, math.pi),
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
def test_it_ends_at_a_root_or_gives_the_reason(case: Case, numbers: tuple[float, ...]) -> None:
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
    for guess, sign in (([0.3, 1.2], 1.0), ([-1.2, -2.0], -1.0)):
        theta3, theta4 = FourBar(*COURSE).newton(1.0, guess)[-1]
        assert math.copysign(1.0, math.sin(theta4 - theta3)) == sign


@for_both
def test_convergence_errors_carry_the_iterates(case: Case) -> None:
    size = len(case.guess)
    with pytest.raises(NotConvergedError, match='after 20 iterations') as caught:
        case.stuck.newton(case.out_of_reach, case.guess, max_iterations=20)
    assert caught.value.iterates.shape == (21, size)
    with pytest.raises(NotConvergedError, match='Phi is singular') as caught:
        case.leg.newton(1.0, [0.0] * size)
    assert caught.value.iterates.tolist() == [[0.0] * size]


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


# What a textbook writes down of it.

ALPHA = math.radians(60.0)
KLANN = KlannLeg(), np.radians([15.0, 60.0, 45.0, 60.0])
BAR = FourBar(180.0, 80.0, 200.0, 150.0), np.radians([15.0, 80.0])


def test_the_lectures_example_ends_at_its_root() -> None:
    # docs/test_theory.py has the printed iterates.
    root = [10.659455241249857, 67.32948352084568, 34.46397311984116, 45.72293552846574]
    leg, guess = KLANN
    h = [0.7960057379415449, -0.3037627502892032]
    np.testing.assert_allclose(leg.newton(ALPHA, guess)[-1], np.radians(root), rtol=0, atol=1e-15)
    for pose in (leg.solve(ALPHA), leg.closed_form(ALPHA)):
        np.testing.assert_allclose(pose.x, np.radians(root), rtol=0, atol=1e-15)
        np.testing.assert_allclose(pose.h, h, rtol=0, atol=1e-15)


@pytest.mark.parametrize(('leg', 'guess'), [KLANN, BAR], ids=['klann', 'four-bar'])
def test_a_run_is_its_iterates_f_phi_and_corrections(leg: KlannLeg, guess: np.ndarray) -> None:
    run = leg.iterations(ALPHA, guess)
    assert (run.x == leg.newton(ALPHA, guess)).all()
    assert run.names == leg.joint_names[1:]
    for k, x in enumerate(run.x):
        assert (run.f[k] == leg.f(ALPHA, x)).all()
        assert (run.phi[k] == leg.phi(ALPHA, x)).all()
        assert run.residuals[k] == np.abs(run.f[k]).max()
        if k < len(run.x) - 1:
            np.testing.assert_allclose(run.corrections[k], leg.correction(ALPHA, x), atol=1e-14)
    for array in (run.x, run.f, run.phi):
        with pytest.raises(ValueError, match='read-only'):
            array[0] = 0.0
    lines = str(run).splitlines()
    assert len(lines) == 2 + len(run.x)
    end = 1 + len(guess)
    assert [*map(float, lines[2].split()[1:end])] == pytest.approx(np.degrees(guess))


def test_a_distance_is_shown_as_one() -> None:
    leg = LinkageLeg(shipped_linkage('slider_crank'))
    run = leg.iterations(0.3, [0.0, 0.2])
    assert run.units == ('rad', 'm')
    lines = str(run).splitlines()
    assert lines[0].startswith('rod, piston [deg, m], f, corrections')
    last = [*map(float, lines[-1].split()[1:3])]
    assert last == pytest.approx([math.degrees(run.x[-1, 0]), run.x[-1, 1]], abs=1e-5)


def test_it_stops_where_the_course_does() -> None:
    bar, guess = BAR
    for residual in (1e-4, 1e-5, 50.0, 1.5):
        run = bar.iterations(ALPHA, guess, residual=residual)
        below = run.residuals < residual
        assert below.tolist() == [False] * (len(run.x) - 1) + [True]
    # A guess that is good enough is the answer.
    assert len(bar.newton(ALPHA, guess, residual=100.0)) == 1


@pytest.mark.parametrize('tolerance', [1e-1, 1e-3, 1e-5, 1e-9])
def test_it_stops_at_the_first_small_correction(tolerance: float) -> None:
    leg, guess = KLANN
    run = leg.iterations(ALPHA, guess, tolerance=tolerance)
    small = np.abs(run.corrections).max(axis=1) <= tolerance
    assert small.tolist() == [False] * (len(small) - 1) + [True]
    closed_run = leg.iterations(ALPHA, guess, tolerance=tolerance, residual=1e-12)
    assert len(closed_run.x) >= len(run.x)
    assert closed_run.residuals[-1] < 1e-12


def test_a_stop_that_is_not_reached_is_reported() -> None:
    bar, guess = BAR
    with pytest.raises(
        NotConvergedError, match=r'\|f\| is not below 1e-05( m)? after 2'
    ) as caught:
        bar.newton(ALPHA, guess, residual=1e-5, max_iterations=2)
    assert caught.value.iterates.shape == (3, 2)


def test_an_angle_without_any_assembly_is_reported() -> None:
    bar = FourBar(0.3, 0.25, 0.2, 0.24)
    with pytest.raises(NotConvergedError, match=r'at this crank angle it closes in no assembly$'):
        bar.newton(math.pi, [0.1, 0.2])
    # It could have converged here.
    with pytest.raises(NotConvergedError, match=r'after 1 iterations$'):
        bar.newton(1.0, [0.1, 0.2], max_iterations=1)


def test_a_singular_estimate_has_no_correction() -> None:
    with pytest.raises(SingularPoseError):
        FourBar(2, 1, 2, 1).correction(0.0, [0.0, 0.0])
