"""Dead points are where the driver's reach ends; the limits of the rocker are where it turns."""

import math

import four_bar_equations as equations
from four_bars import COURSE, four_bars, untimed
from hypothesis import assume, example, given
from klann_ros.kinematics import FourBar, UnreachableError
import pytest
from sample_linkages import apart

# Nothing turns fully: 500 + 300 > 400 + 350 mm.
TRIPLE = (0.500, 0.300, 0.400, 0.350)


def reversed_bar(bar: FourBar) -> FourBar:
    """Return the linkage seen from its rocker, whose angle is pi - theta4."""
    ground, crank, coupler, rocker = bar.geometry.lengths
    return FourBar(ground, rocker, coupler, crank)


def closes(bar: FourBar, angle: float) -> bool:
    try:
        bar.closed_form(angle)
    except UnreachableError:
        return False
    return True


def away_from_change_points(bar: FourBar) -> None:
    """Drop the linkages whose reach ends so near to 0 or pi that rounding hides it."""
    l_1, l_2, l_3, l_4 = bar.geometry.lengths
    for margin in (l_1 + l_2 - l_3 - l_4, l_1 + l_4 - l_2 - l_3, l_1 + l_3 - l_2 - l_4):
        assume(abs(margin) > 1e-3)


@pytest.mark.parametrize('driver', ['crank', 'rocker'])
@untimed
@given(bar=four_bars())
@example(FourBar(*TRIPLE))
@example(FourBar(3.0, 4.0, 1.0, 4.0))
@example(FourBar(*COURSE))
@example(FourBar(*TRIPLE, -1))
def test_the_dead_points_of_a_driver_are_where_its_reach_ends(driver: str, bar: FourBar) -> None:
    away_from_change_points(bar)
    of_crank = driver == 'crank'
    points = bar.dead_points(driver)
    driven = bar if of_crank else reversed_bar(bar)
    arcs = driven.reachable_arcs()
    assert (points == []) is (arcs == [(0.0, 2 * math.pi)])
    if of_crank and points:
        ends = sorted(math.remainder(end, 2 * math.pi) for arc in arcs for end in arc)
        assert [point.angle for point in points] == pytest.approx(ends, abs=1e-11)
    for point in points:
        step = math.copysign(1e-7, point.angle)
        inward = step if (point.kind == 'stretched') is not of_crank else -step
        for angle, inside in ((point.angle + inward, True), (point.angle - inward, False)):
            assert closes(driven, angle if of_crank else math.pi - angle) is inside


@untimed
@given(bar=four_bars())
def test_each_dead_point_is_a_pose_with_two_links_in_line(bar: FourBar) -> None:
    away_from_change_points(bar)
    for driver in ('crank', 'rocker'):
        for point in bar.dead_points(driver):
            x = (point.theta3, point.theta4)
            size = max(bar.geometry.lengths)
            f = equations.f(bar.geometry, point.theta2, x)
            assert abs(f).max() <= 1e-14 * size
            assert point.driver == driver
            assert point.angle == (point.theta2 if driver == 'crank' else point.theta4)
            # theta4 points from O4 to B: coupler and rocker are stretched where it is opposite.
            across = point.theta4 + math.pi if driver == 'crank' else point.theta2
            in_line = apart(across, point.theta3) < 1e-9
            assert in_line is (point.kind == 'stretched')
            assert in_line or apart(across, point.theta3 + math.pi) < 1e-9


@untimed
@given(bar=four_bars())
@example(FourBar(*COURSE))
@example(FourBar(*COURSE, -1))
def test_the_rocker_stands_still_at_its_limits_in_this_assembly(bar: FourBar) -> None:
    away_from_change_points(bar)
    for point in bar.dead_points('rocker'):
        pose = bar.solve(point.theta2)
        assume(math.sin(pose.transmission_angle) > 1e-2)
        assert apart(pose.theta4, point.theta4) < 1e-10
        assert pose.coefficients[1] == pytest.approx(0.0, abs=1e-10)
        assert abs(bar.mechanical_advantage(point.theta2)) > 1e9


@untimed
@given(bar=four_bars())
def test_the_other_assembly_has_the_mirrored_dead_points(bar: FourBar) -> None:
    mirrored = FourBar(*bar.geometry.lengths, bar.geometry.mirrored().assembly)
    for driver in ('crank', 'rocker'):
        ours = sorted((point.kind, -point.angle) for point in bar.dead_points(driver))
        theirs = sorted((point.kind, point.angle) for point in mirrored.dead_points(driver))
        assert ours == theirs


def test_a_triple_rocker_has_four_dead_points() -> None:
    bar = FourBar(*TRIPLE)
    mirrored = FourBar(*TRIPLE, -1)
    assert bar.grashof.type_ == mirrored.grashof.type_ == 'triple rocker'
    dead_points = bar.dead_points('both')
    assert [point.driver for point in dead_points] == ['crank', 'crank', 'rocker', 'rocker']
    of_rocker = bar.dead_points('rocker') + mirrored.dead_points('rocker')
    assert sorted(dead_points[2:]) == sorted(of_rocker)


def test_a_crank_rocker_has_dead_points_of_its_rocker_only() -> None:
    bar = FourBar(*COURSE)
    assert bar.dead_points() == []
    assert [point.kind for point in bar.dead_points('rocker')] == ['stretched', 'folded']


def test_change_points_are_not_dead_points() -> None:
    for lengths in ((0.3, 0.1, 0.3, 0.1), (0.1, 0.1, 0.3, 0.3), (1.0, 1.0, 1.0, 1.0)):
        bar = FourBar(*lengths)
        assert bar.dead_points('crank') == bar.dead_points('rocker') == []


@pytest.mark.parametrize('assembly', [1, -1])
def test_the_limits_of_a_crank_rocker_are_those_of_its_turn(assembly: int) -> None:
    bar = FourBar(*COURSE, assembly)
    turn = [bar.solve(math.radians(k / 10)).theta4 for k in range(3600)]
    limits = bar.rocker_limits
    ends = sorted([limits.stretched.theta4, limits.folded.theta4])
    assert ends == pytest.approx([min(turn), max(turn)], abs=1e-6)
    assert limits.swing == pytest.approx(max(turn) - min(turn), abs=1e-6)


def test_the_time_ratio_is_that_of_the_strokes() -> None:
    bar = FourBar(*COURSE)
    rates = [bar.velocity(bar.solve(math.radians(k / 10)), 1.0).theta4 for k in range(3600)]
    forth = sum(rate > 0 for rate in rates)
    slow = max(forth, 3600 - forth)
    quick = min(forth, 3600 - forth)
    assert bar.rocker_limits.time_ratio == pytest.approx(slow / quick, rel=2e-3)
    assert math.isnan(FourBar(*TRIPLE).rocker_limits.time_ratio)


def test_a_rocker_that_turns_fully_has_no_limits() -> None:
    limits = FourBar(1.0, 3.0, 4.0, 4.0).rocker_limits
    assert (limits.stretched, limits.folded) == (None, None)
    assert limits.swing == 2 * math.pi


def test_a_triple_rocker_swings_through_the_ground_or_away_from_it() -> None:
    for lengths in (TRIPLE, (0.35, 0.4, 0.3, 0.5), (0.4, 0.35, 0.5, 0.3)):
        bar = FourBar(*lengths)
        start, end = reversed_bar(bar).reachable_arcs()[0]
        assert bar.rocker_limits.swing == pytest.approx(end - start, abs=1e-11)
