"""`solve`: the closed form's pose, by warm-started Newton, on its assembly always."""

from collections.abc import Callable
from functools import partial
import math
from typing import Any

from four_bars import COURSE, four_bars, untimed
from hypothesis import assume, given
from klann_ros.kinematics import (
    FourBar,
    KlannGeometry,
    KlannLeg,
    Leg,
    LinkageLeg,
    UnreachableError,
)
from klann_ros.kinematics.linkage import leg as leg_module
import numpy as np
import pytest
from sample_linkages import allowed, apart, difference

AnyLeg = Leg[Any, Any]
Make = Callable[..., AnyLeg]
BAR = partial(FourBar, *COURSE)
PARALLELOGRAM = (0.300, 0.100, 0.300, 0.100)
# Its crank does not turn fully: 136.6 .. 194.5 deg cannot be reached.
STUCK = KlannGeometry(l_bc=0.33)
# B comes to D, and A to O4.
KLANN_KITE = KlannGeometry(l_ab=0.35, x_d=0.35, y_a=0.0, l_bc=0.4, l_dc=0.4, l_ef=0.5, l_fg=0.5)
KITE = (0.35, 0.35, 0.4, 0.4)
for_both = pytest.mark.parametrize('make', [KlannLeg, BAR], ids=['klann', 'four-bar'])


@pytest.mark.parametrize(
    ('make', 'limit'),
    [
        (KlannLeg, 1e-11),
        (partial(KlannLeg, KlannGeometry.patent()), 1e-11),
        *((partial(BAR, sign), 1e-12) for sign in (1, -1)),
        *((partial(FourBar, 0.5, 0.1, 0.5, 0.12, sign), 1e-12) for sign in (1, -1)),
    ],
)
def test_a_turn_and_back_is_the_closed_form(
    make: Make, limit: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    alphas = [math.radians(k / 2) for k in range(721)]
    expected = [make().closed_form(alpha) for alpha in alphas]
    leg = make()
    leg.solve(alphas[0])
    monkeypatch.setattr(leg_module, 'initial_guess', None)  # calling it raises TypeError
    for turn in (expected, expected[::-1]):
        poses = [leg.solve(pose.crank_angle) for pose in turn]
        assert max(map(difference, poses, turn)) <= limit
        assert {pose.iterations for pose in poses} <= {1, 2, 3, 4}
        assert max(math.dist(p.h, q.h) for p, q in zip(poses, turn, strict=True)) <= 1e-14
        assert max(pose.residual for pose in poses) <= 1e-3 * limit


@for_both
def test_the_iterates_are_those_of_the_full_newton(make: Make) -> None:
    leg = make()
    step = 0.3
    last = leg.solve(1.0)
    guess = [x + step * c for x, c in zip(last.x, last.coefficients, strict=True)]
    iterates = leg.newton(1.0 + step, guess)
    pose = leg.solve(1.0 + step)
    assert pose.iterations in (len(iterates) - 1, len(iterates))
    np.testing.assert_allclose(pose.x, iterates[-1], rtol=0, atol=1e-15)


@pytest.mark.parametrize('degrees', [30, 79, 90, 120, 180, 10 * 360 + 30])
@pytest.mark.parametrize(('make', 'limit'), [(KlannLeg, 1e-11), (BAR, 1e-12)])
def test_a_jump_is_split_and_needs_no_closed_form(
    make: Make, limit: float, degrees: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for start in range(0, 360, 30):
        leg = make()
        leg.solve(math.radians(start))
        expected = leg.closed_form(math.radians(start + degrees))
        with monkeypatch.context() as patch:
            patch.setattr(leg_module, 'initial_guess', None)
            pose = leg.solve(math.radians(start + degrees))
        assert difference(pose, expected) <= limit


@for_both
@pytest.mark.parametrize('max_crank_step', [1e-9, 1e-3, 10.0])
def test_any_max_crank_step_stays_on_the_assembly(make: Make, max_crank_step: float) -> None:
    leg = make(max_crank_step=max_crank_step)
    for k in range(200):
        alpha = 2.399963 * k
        assert difference(leg.solve(alpha), leg.closed_form(alpha)) <= 1e-11


@pytest.mark.parametrize('max_crank_step', [5e-324, 1e-9, 1e-3])
def test_a_small_max_crank_step_costs_no_more_than_a_closed_form(max_crank_step: float) -> None:
    leg = KlannLeg(max_crank_step=max_crank_step)
    leg.solve(0.0)
    assert leg.solve(3.0).iterations <= 2


def test_a_long_foot_costs_the_angles_no_digit() -> None:
    leg, short = KlannLeg(KlannGeometry(l_gh=1e6)), KlannLeg()
    for k in range(100):
        assert difference(leg.solve(k / 50), short.solve(k / 50)) == 0.0


B_AT_170 = 0.12 * math.cos(math.radians(170.0)), 0.09 + 0.12 * math.sin(math.radians(170.0))


BD_AT_170 = math.dist(B_AT_170, (0.35, 0.0))
FAR_AT_170 = r'170\.000 deg\) .*dyad 1 does not close, B and D are .* further apart than BC'
FAR, CLOSE = (
    'A and O4 are .* further apart than AB',
    r'A and O4 are .* closer together than \|AB - O4B\|',
)


@pytest.mark.parametrize(
    ('leg', 'degrees', 'names', 'shortfall', 'text'),
    [
        (KlannLeg(STUCK), 170.0, ('B', 'D', 'BC', 'DC'), BD_AT_170 - (0.33 + 0.14), FAR_AT_170),
        (FourBar(0.3, 0.2, 0.25, 0.15), 180.0, ('A', 'O4', 'AB', 'O4B'), 0.5 - 0.4, FAR),
        (FourBar(0.3, 0.25, 0.4, 0.2), 0.0, ('A', 'O4', 'AB', 'O4B'), 0.2 - 0.05, CLOSE),
    ],
)
def test_an_unreachable_angle_has_its_shortfall_and_leaves_the_last_pose(
    leg: AnyLeg, degrees: float, names: tuple[str, ...], shortfall: float, text: str
) -> None:
    last_pose = leg.solve(1.0)
    alpha = math.radians(degrees)
    with pytest.raises(UnreachableError, match=text) as caught:
        leg.solve(alpha)
    error = caught.value
    assert (error.alpha, error.dyad, error.stretched) == (alpha, 1, 'further' in text)
    assert error.names == names
    assert error.shortfall == pytest.approx(shortfall, abs=1e-15)
    assert leg.last is last_pose


def test_the_second_dyad_is_named_too() -> None:
    geometry = KlannGeometry(l_ef=0.12)
    with pytest.raises(UnreachableError, match='dyad 2 does not close, E and G are') as caught:
        for k in range(360):
            KlannLeg(geometry).solve(math.radians(k))
    assert caught.value.dyad == 2
    assert caught.value.shortfall > 0


@pytest.mark.parametrize(
    ('leg', 'ends'),
    [
        (LinkageLeg(KLANN_KITE.linkage.at_every_change_point('sign')), 'B and D'),
        (FourBar(*KITE, at_change_points='sign'), 'A and O4'),
        (FourBar(1.0, 1.0, 1.0, 1.0, at_change_points='sign'), 'A and O4'),
    ],
)
def test_ends_of_a_dyad_that_coincide_leave_no_definite_pose(leg: AnyLeg, ends: str) -> None:
    text = f'dyad 1 does not close, {ends} coincide, and the pose is not definite$'
    with pytest.raises(UnreachableError, match=text) as caught:
        leg.solve(0.0)
    assert caught.value.shortfall == 0.0


@pytest.mark.parametrize('alpha', [1e-11, -1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize('make', [partial(KlannLeg, KLANN_KITE), partial(FourBar, *KITE)])
def test_a_kite_keeps_its_digits_where_the_ends_come_close(make: Make, alpha: float) -> None:
    leg = make()
    assert leg.closed_form(alpha).residual < 1e-15
    assert difference(leg.solve(alpha), leg.closed_form(alpha)) <= 1e-9


@pytest.mark.parametrize('assembly', [1, -1])
def test_a_nearly_singular_pose_costs_the_next_one_no_digits(assembly: int) -> None:
    bar = FourBar(4.0, 6.0, 0.4, 3.0, assembly)
    start, end = bar.reachable_arcs()[0]
    for k in range(1, 20):
        bar.solve(start + 1e-15 * k)
        theta2 = start + (end - start) * k / 20
        assert difference(bar.solve(theta2), bar.closed_form(theta2)) <= 1e-13


@untimed
@given(bar=four_bars())
def test_the_very_ends_of_the_reach_are_solved(bar: FourBar) -> None:
    arcs = bar.reachable_arcs()
    assume(arcs != [(0.0, 2 * math.pi)])
    for theta2 in (end for arc in arcs for end in arc):
        pose = bar.solve(theta2)
        assert pose.residual <= 1e-14 * max(bar.geometry.lengths)
        assert math.sin(pose.transmission_angle) < 1e-2


@pytest.mark.parametrize('assembly', [1, -1])
def test_by_its_sign_a_parallelogram_is_one_on_one_side_alone(assembly: int) -> None:
    bar = FourBar(*PARALLELOGRAM, assembly, at_change_points='sign')
    for k in range(-179, 180, 2):
        pose = bar.solve(math.radians(k))
        parallel = apart(pose.theta4, pose.theta2) < 1e-9 and apart(pose.theta3, 0.0) < 1e-9
        assert parallel is (k * assembly > 0)


@pytest.mark.parametrize('lengths', [PARALLELOGRAM, (0.1, 0.3, 0.1, 0.3), (0.7, 0.1, 0.5, 0.3)])
def test_a_change_point_is_passed_and_not_refused(lengths: tuple[float, ...]) -> None:
    bar = FourBar(*lengths)
    for k in range(-720, 721, 90):
        pose = bar.solve(math.radians(k))
        assert difference(pose, bar.closed_form(math.radians(k))) <= allowed(pose)
        assert pose.residual <= 1e-14


def test_a_rhombus_folded_onto_its_ground_comes_back_the_same() -> None:
    assert FourBar(1.0, 1.0, 1.0, 1.0).reachable_arcs() == [(0.0, 2 * math.pi)]
    # The tangent leads straight through, with A at O4, into the other assembly.
    for theta2 in (7e-20, -7e-20, 1e-13):
        bar = FourBar(1.0, 1.0, 1.0, 1.0, -1)
        first = bar.solve(theta2)
        bar.solve(theta2 - 0.25)
        assert difference(bar.solve(theta2), first) <= 1e-12


def test_rounding_does_not_open_a_linkage_folded_back_in_line() -> None:
    """The rocker reaches back over the coupler: in some sizes it is a digit too short."""
    for size in range(1, 200):
        pose = FourBar(*(0.1 * size * length for length in (4, 3, 2, 3))).solve(0.0)
        assert abs(pose.theta3) == pytest.approx(math.pi, abs=1e-6)
        assert abs(pose.theta4) == pytest.approx(math.pi, abs=1e-6)


@for_both
def test_a_leg_shows_its_geometry_and_forgets_its_last_pose(make: Make) -> None:
    leg = make()
    assert repr(leg) == f'{type(leg).__name__}({leg.geometry!r})'
    leg.solve(1.0)
    leg.reset()
    assert leg.last is None
