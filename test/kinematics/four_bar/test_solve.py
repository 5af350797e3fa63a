"""`FourBar.solve`: the closed form's pose, by warm-started Newton, on its assembly always."""

import math

from four_bars import allowed, apart, COURSE, crank_angles, difference, four_bars, untimed
from hypothesis import assume, given, settings, strategies as st
from klann_ros.kinematics import CrankAngleError, FourBar, UnreachableError
from klann_ros.kinematics.linkage import leg as leg_module
import numpy as np
import pytest

DISCS = (0.500, 0.100, 0.500, 0.120)
# Coupler and rocker fail to meet around theta2 = 180 deg.
SHORT = (0.300, 0.200, 0.250, 0.150)
PARALLELOGRAM = (0.300, 0.100, 0.300, 0.100)


@pytest.mark.parametrize('direction', [1, -1])
@pytest.mark.parametrize('assembly', [1, -1])
@pytest.mark.parametrize('lengths', [COURSE, DISCS])
def test_a_turn_agrees_with_the_closed_form(
    lengths: tuple[float, ...], assembly: int, direction: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    bar = FourBar(*lengths, assembly)
    angles = [math.radians(direction * k / 2) for k in range(721)]
    expected = [bar.closed_form(theta2) for theta2 in angles]
    bar.solve(angles[0])
    monkeypatch.setattr(leg_module, 'initial_guess', None)  # calling it raises TypeError
    poses = [bar.solve(theta2) for theta2 in angles]
    assert max(map(difference, poses, expected)) <= 1e-12
    assert max(pose.residual for pose in poses) <= 1e-15
    assert {pose.iterations for pose in poses} <= {1, 2, 3, 4}


def test_the_iterates_are_those_of_the_courses_newton() -> None:
    bar, step = FourBar(*COURSE), 0.3
    last = bar.solve(1.0)
    guess = [x + step * c for x, c in zip(last.x, last.coefficients, strict=True)]
    iterates = bar.newton(1.0 + step, guess)
    pose = bar.solve(1.0 + step)
    assert pose.iterations in (len(iterates) - 1, len(iterates))
    np.testing.assert_allclose(pose.x, iterates[-1], rtol=0, atol=1e-15)


@settings(max_examples=200)
@given(bar=four_bars(), angles=st.lists(crank_angles, min_size=2, max_size=12))
def test_after_jumps_of_any_size_the_pose_is_the_closed_forms(
    bar: FourBar, angles: list[float]
) -> None:
    for theta2 in angles:
        try:
            expected = bar.closed_form(theta2)
        except UnreachableError as error:
            assume(error.shortfall > 1e-12)
            before = bar.last
            with pytest.raises(UnreachableError) as caught:
                bar.solve(theta2)
            assert caught.value.args == error.args
            assert bar.last is before
        else:
            # With A at O4 but for rounding, a kite's coupler and rocker point anywhere.
            assume(expected.z > 1e-12)
            pose = bar.solve(theta2)
            assert difference(pose, expected) <= allowed(expected)
            assert pose.theta2 == theta2


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


@pytest.mark.parametrize('degrees', [30, 79, 90, 120, 180])
def test_a_jump_is_split_and_needs_no_closed_form(
    degrees: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for start in range(0, 360, 10):
        bar = FourBar(*COURSE)
        bar.solve(math.radians(start))
        expected = bar.closed_form(math.radians(start + degrees))
        with monkeypatch.context() as patch:
            patch.setattr(leg_module, 'initial_guess', None)
            pose = bar.solve(math.radians(start + degrees))
        assert difference(pose, expected) <= 1e-12


@pytest.mark.parametrize('max_crank_step', [1e-9, 1e-3, 10.0])
def test_any_max_crank_step_stays_on_the_assembly(max_crank_step: float) -> None:
    bar = FourBar(*COURSE, max_crank_step=max_crank_step)
    for k in range(200):
        theta2 = 2.399963 * k
        assert difference(bar.solve(theta2), bar.closed_form(theta2)) <= 1e-11


def test_an_unreachable_angle_says_what_is_missing_and_leaves_the_last_pose() -> None:
    bar = FourBar(*SHORT)
    before = bar.solve(1.0)
    with pytest.raises(UnreachableError, match=r'A and O4 are .* further apart than AB') as caught:
        bar.solve(math.pi)
    error = caught.value
    assert (error.alpha, error.dyad, error.stretched) == (math.pi, 1, True)
    assert error.names == ('A', 'O4', 'AB', 'O4B')
    assert error.shortfall == pytest.approx(0.5 - 0.4, abs=1e-15)
    assert bar.last is before


def test_a_rhombus_says_that_its_ends_coincide() -> None:
    bar = FourBar(1.0, 1.0, 1.0, 1.0)
    assert bar.reachable_arcs() == [(0.0, 2 * math.pi)]
    with pytest.raises(UnreachableError) as caught:
        bar.solve(0.0)
    assert str(caught.value).endswith(
        'dyad 1 does not close, A and O4 coincide, and the pose is not definite'
    )


def test_beyond_a_change_point_the_sign_is_kept_and_not_the_motion() -> None:
    bar = FourBar(2.0, 1.0, 2.0, 1.0)
    for k in range(1, 360):
        pose = bar.solve(math.radians(k))
        assert math.sin(pose.theta4 - pose.theta3) > -1e-7
        # Of a parallelogram the coupler stays along the ground.
        assert (abs(pose.theta3) < 1e-7) is (k <= 180)


def test_it_says_what_it_is_made_of() -> None:
    bar = FourBar(*COURSE)
    assert repr(bar) == f'FourBar({bar.geometry!r})'


def test_too_close_is_said_as_well() -> None:
    with pytest.raises(UnreachableError, match=r'closer together than \|AB - O4B\|'):
        FourBar(0.3, 0.25, 0.4, 0.2).solve(0.0)


@pytest.mark.parametrize('value', [math.nan, math.inf, 1.1e6, None, 'abc', '1', b'1', [1.0, 2.0]])
@pytest.mark.parametrize(
    'method', ['solve', 'closed_form', 'transmission_angle', 'mechanical_advantage']
)
def test_what_is_no_angle_is_refused_and_changes_nothing(method: str, value: object) -> None:
    bar = FourBar(*COURSE)
    before = bar.solve(1.0)
    with pytest.raises(CrankAngleError, match='finite and within'):
        getattr(bar, method)(value)
    assert bar.last is before


def test_reset_forgets_the_warm_start() -> None:
    bar = FourBar(*COURSE)
    bar.solve(1.0)
    bar.reset()
    assert bar.last is None


@pytest.mark.parametrize('assembly', [1, -1])
def test_a_parallelogram_is_one_on_one_side_and_crossed_on_the_other(assembly: int) -> None:
    bar = FourBar(*PARALLELOGRAM, assembly)
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
        assert pose.residual <= 1e-15


def test_a_rhombus_folded_onto_its_ground_comes_back_the_same() -> None:
    # The tangent leads straight through, with A at O4, into the other assembly.
    for theta2 in (7e-20, -7e-20, 1e-13):
        bar = FourBar(1.0, 1.0, 1.0, 1.0, -1)
        first = bar.solve(theta2)
        bar.solve(theta2 - 0.25)
        assert difference(bar.solve(theta2), first) <= 1e-12


@pytest.mark.parametrize('theta2', [1e-11, -1e-9, 1e-6, 1e-3])
def test_a_kite_keeps_its_digits_where_a_comes_close_to_o4(theta2: float) -> None:
    bar = FourBar(0.35, 0.35, 0.4, 0.4)
    assert bar.closed_form(theta2).residual < 1e-15
    assert difference(bar.solve(theta2), bar.closed_form(theta2)) <= 1e-9


def test_a_kite_closes_nowhere_where_a_is_o4() -> None:
    with pytest.raises(UnreachableError, match='A and O4 coincide') as caught:
        FourBar(0.35, 0.35, 0.4, 0.4).solve(0.0)
    assert caught.value.shortfall == 0.0


def test_rounding_does_not_open_a_linkage_folded_back_in_line() -> None:
    """The rocker reaches back over the coupler: in some sizes it is a digit too short."""
    for size in range(1, 200):
        pose = FourBar(*(0.1 * size * length for length in (4, 3, 2, 3))).solve(0.0)
        assert abs(pose.theta3) == pytest.approx(math.pi, abs=1e-6)
        assert abs(pose.theta4) == pytest.approx(math.pi, abs=1e-6)
