"""`KlannLeg.solve`: the closed form's pose, by warm-started Newton, on the right branch always."""

import math

from klann_ros.kinematics import (
    CrankAngleError,
    KlannGeometry,
    KlannLeg,
    UnreachableError,
)
from klann_ros.kinematics.linkage import leg as leg_module
from mechanisms import difference
import numpy as np
import pytest

PRESETS = [KlannGeometry.sem104(), KlannGeometry.patent()]


@pytest.mark.parametrize('direction', [1, -1])
@pytest.mark.parametrize('geometry', PRESETS)
def test_it_agrees_with_the_closed_form_at_every_tenth_of_a_degree(
    geometry: KlannGeometry, direction: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    alphas = [math.radians(direction * k / 10) for k in range(3601)]
    expected = [KlannLeg(geometry).closed_form(alpha) for alpha in alphas]
    leg = KlannLeg(geometry)
    leg.solve(alphas[0])
    monkeypatch.setattr(leg_module, 'initial_guess', None)  # calling it raises TypeError
    poses = [leg.solve(alpha) for alpha in alphas]
    assert max(map(difference, poses, expected)) <= 1e-11
    assert {pose.iterations for pose in poses} <= {1, 2, 3, 4}
    assert max(math.dist(p.h, q.h) for p, q in zip(poses, expected, strict=True)) <= 1e-14
    assert max(pose.residual for pose in poses) <= 1e-14


def test_the_iterates_are_those_of_the_full_newton() -> None:
    leg = KlannLeg()
    last = leg.solve(1.0)
    step = 0.3
    guess = [x + step * c for x, c in zip(last.x, last.coefficients, strict=True)]
    iterates = leg.newton(1.0 + step, guess)
    pose = leg.solve(1.0 + step)
    assert pose.iterations in (len(iterates) - 1, len(iterates))
    np.testing.assert_allclose(pose.x, iterates[-1], rtol=0, atol=1e-15)


@pytest.mark.parametrize('degrees', [30, 79, 90, 120, 180, 10 * 360 + 30])
def test_a_jump_is_split_and_needs_no_closed_form(
    degrees: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for start in range(0, 360, 10):
        leg = KlannLeg()
        leg.solve(math.radians(start))
        expected = leg.closed_form(math.radians(start + degrees))
        with monkeypatch.context() as patch:
            patch.setattr(leg_module, 'initial_guess', None)
            pose = leg.solve(math.radians(start + degrees))
        assert difference(pose, expected) <= 1e-11


def test_a_jump_across_an_arc_that_cannot_be_reached_stays_on_the_branch() -> None:
    geometry = KlannGeometry(l_bc=0.33)  # cannot reach 136.6 .. 194.5 deg
    leg = KlannLeg(geometry)
    for alpha in (2.3, 3.5, 2.3, 3.45, 2.38):
        assert difference(leg.solve(alpha), leg.closed_form(alpha)) <= 1e-10


def test_a_huge_max_crank_step_still_stays_on_the_branch() -> None:
    leg = KlannLeg(max_crank_step=10.0)
    for k in range(200):
        alpha = 2.399963 * k
        assert difference(leg.solve(alpha), leg.closed_form(alpha)) <= 1e-11


@pytest.mark.parametrize('alpha', [math.nan, math.inf, -math.inf, 1.1e6, -1e308, '1', b'1'])
@pytest.mark.parametrize('method', ['solve', 'closed_form'])
def test_an_angle_that_is_none_is_refused_and_changes_nothing(method: str, alpha: float) -> None:
    leg = KlannLeg()
    before = leg.solve(1.0)
    with pytest.raises(CrankAngleError, match='finite and within') as caught:
        getattr(leg, method)(alpha)
    assert caught.value.alpha is alpha
    assert leg.last is before


def test_an_unreachable_angle_names_the_dyad_and_what_is_missing() -> None:
    geometry = KlannGeometry(l_bc=0.33)
    leg = KlannLeg(geometry)
    before = leg.solve(1.0)
    alpha = math.radians(170.0)
    bx, by = 0.12 * math.cos(alpha), 0.09 + 0.12 * math.sin(alpha)
    missing = math.hypot(0.35 - bx, by) - (0.33 + 0.14)
    with pytest.raises(UnreachableError, match='dyad 1 does not close, B and D are') as caught:
        leg.solve(alpha)
    error = caught.value
    assert (error.alpha, error.dyad, error.stretched) == (alpha, 1, True)
    assert error.shortfall == pytest.approx(missing, abs=1e-15)
    assert '170.000 deg' in str(error)
    assert leg.last is before


def test_the_second_dyad_is_named_too() -> None:
    geometry = KlannGeometry(l_ef=0.12)
    with pytest.raises(UnreachableError, match='dyad 2 does not close, E and G are') as caught:
        for k in range(360):
            KlannLeg(geometry).solve(math.radians(k))
    assert caught.value.dyad == 2
    assert caught.value.shortfall > 0


def test_reset_forgets_the_warm_start() -> None:
    leg = KlannLeg()
    leg.solve(1.0)
    leg.reset()
    assert leg.last is None


@pytest.mark.parametrize('name', ['tolerance', 'max_crank_step'])
@pytest.mark.parametrize('value', [0.0, -1.0, math.nan, math.inf])
def test_settings_that_make_no_sense_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f'{name} = .* must be finite, > 0'):
        KlannLeg(**{name: value})


def test_a_tolerance_that_would_answer_unreachable_angles_is_refused() -> None:
    with pytest.raises(ValueError, match=r'at most 0\.001 rad'):
        KlannLeg(tolerance=0.1)


@pytest.mark.parametrize('geometry', [{}, 0, '', {'l_ab': 1.0}, KlannGeometry])
def test_a_geometry_that_is_none_is_refused(geometry: object) -> None:
    with pytest.raises(TypeError, match='must be a KlannGeometry'):
        KlannLeg(geometry)


@pytest.mark.parametrize('alpha', [None, 'abc', 1j, [1.0, 2.0], np.array([1.0, 2.0]), 10**400])
@pytest.mark.parametrize('method', ['solve', 'closed_form'])
def test_what_is_no_number_is_no_angle(method: str, alpha: object) -> None:
    with pytest.raises(CrankAngleError, match='is refused'):
        getattr(KlannLeg(), method)(alpha)


@pytest.mark.parametrize('max_crank_step', [5e-324, 1e-9, 1e-3])
def test_a_small_max_crank_step_costs_no_more_than_a_closed_form(max_crank_step: float) -> None:
    leg = KlannLeg(max_crank_step=max_crank_step)
    leg.solve(0.0)
    assert leg.solve(3.0).iterations <= 2


KITE = KlannGeometry(l_ab=0.35, x_d=0.35, y_a=0.0, l_bc=0.4, l_dc=0.4, l_ef=0.5, l_fg=0.5)


@pytest.mark.parametrize('alpha', [1e-11, -1e-9, 1e-6, 1e-3])
def test_a_kite_keeps_its_digits_where_b_comes_close_to_d(alpha: float) -> None:
    leg = KlannLeg(KITE)
    assert leg.closed_form(alpha).residual < 1e-15
    assert difference(leg.solve(alpha), leg.closed_form(alpha)) <= 1e-9


def test_it_says_what_it_is_made_of() -> None:
    assert repr(KlannLeg(KITE)) == f'KlannLeg({KITE!r})'


@pytest.mark.parametrize('name', ['tolerance', 'max_crank_step'])
@pytest.mark.parametrize('value', ['a', '1e-6', None, [1e-6]])
def test_a_setting_that_is_no_number_is_refused(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=f'{name} = .* is refused: it must be finite, > 0'):
        KlannLeg(**{name: value})


def test_a_kite_closes_nowhere_where_b_is_d() -> None:
    with pytest.raises(UnreachableError, match='B and D coincide') as caught:
        KlannLeg(KITE).solve(0.0)
    assert caught.value.shortfall == 0.0


def test_a_long_foot_costs_the_angles_no_digit() -> None:
    leg, short = KlannLeg(KlannGeometry(l_gh=1e6)), KlannLeg()
    for k in range(100):
        assert difference(leg.solve(k / 50), short.solve(k / 50)) == 0.0
