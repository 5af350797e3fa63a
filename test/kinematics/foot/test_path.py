"""`foot_path`: the figures of a whole turn, of what there is of one, of any point; refusals."""

from dataclasses import FrozenInstanceError
import math
from typing import Any

from hypothesis import given, settings, strategies as st
from klann_ros.kinematics import (
    foot_path,
    FootPath,
    FourBar,
    KlannGeometry,
    KlannLeg,
    LinkageLeg,
    NoFootPathError,
    shipped_linkage,
    SingularPoseError,
)
from klann_ros.kinematics.klann import JOINTS
import numpy as np
import pytest
from strategies import legs

PRESETS = [KlannGeometry.sem104(), KlannGeometry.patent()]
PARTIAL = KlannGeometry(l_bc=0.33)


def path_of(geometry: KlannGeometry, **options: int) -> FootPath:
    return foot_path(KlannLeg(geometry), **options)


@pytest.mark.parametrize('geometry', PRESETS)
def test_the_figures_do_not_depend_on_the_samples(geometry: KlannGeometry) -> None:
    few, many = path_of(geometry), path_of(geometry, samples=1500)
    for name in ('x_range', 'y_range', 'length', 'area'):
        assert getattr(few, name) == pytest.approx(getattr(many, name), abs=1e-12), name


@pytest.mark.parametrize('geometry', PRESETS)
def test_no_pose_is_outside_the_ranges(geometry: KlannGeometry) -> None:
    path = path_of(geometry)
    leg = KlannLeg(geometry)
    feet = np.array([leg.solve(k * math.pi / 5000).h for k in range(10000)])
    for coordinates, (low, high) in zip(feet.T, (path.x_range, path.y_range), strict=True):
        assert low <= coordinates.min() + 1e-14
        assert coordinates.max() - 1e-14 <= high
        # The parabola at an extreme leaves 1e-7 between samples as dense.
        assert low == pytest.approx(coordinates.min(), abs=1e-6)
        assert high == pytest.approx(coordinates.max(), abs=1e-6)


def test_the_samples_are_the_legs_own_poses() -> None:
    leg = KlannLeg()
    path = foot_path(leg, samples=100)
    assert path.alphas.shape == (100,)
    for alpha, h, h_1 in zip(path.alphas, path.h, path.h_1, strict=True):
        pose = leg.solve(alpha)
        np.testing.assert_allclose(pose.h, h, rtol=0, atol=1e-14)
        np.testing.assert_allclose(leg.velocity(pose, 1.0).h, h_1, rtol=0, atol=1e-12)


@pytest.mark.parametrize('geometry', PRESETS)
def test_a_full_turn_closes(geometry: KlannGeometry) -> None:
    path = path_of(geometry)
    leg = KlannLeg(geometry)
    assert path.full_turn
    assert path.arcs == ((0.0, 2 * math.pi),)
    np.testing.assert_allclose(leg.solve(2 * math.pi).h, path.h[0], rtol=0, atol=1e-13)
    # What the foot moves over a turn adds up to nothing.
    np.testing.assert_allclose(path.h_1.mean(axis=0), 0.0, atol=1e-13)


def test_the_users_leg_keeps_its_last_pose() -> None:
    leg = KlannLeg()
    last_pose = leg.solve(1.0)
    foot_path(leg).crank_angles_at_x(0.6)
    assert leg.last is last_pose


def test_a_path_is_frozen() -> None:
    path = path_of(KlannGeometry())
    with pytest.raises(ValueError, match='read-only'):
        path.h[0] = 0.0
    with pytest.raises(FrozenInstanceError):
        path.h = path.h_1
    assert path != path_of(KlannGeometry())


@pytest.mark.slow
@settings(max_examples=15)
@given(geometry=legs(), factor=st.sampled_from([0.001, 3.0, 1000.0]))
def test_a_scaled_or_mirrored_leg_has_such_a_path(geometry: KlannGeometry, factor: float) -> None:
    path, scaled = path_of(geometry), path_of(geometry.scaled(factor))
    # Where an arc ends its own last digit moves the foot.
    tolerance = 1e-9 if path.full_turn else 1e-5
    assert scaled.stride == pytest.approx(
        factor * path.stride, rel=tolerance, abs=tolerance * factor
    )
    assert scaled.lift == pytest.approx(factor * path.lift, rel=tolerance, abs=tolerance * factor)
    mirrored = path_of(geometry.mirrored())
    assert mirrored.x_range == pytest.approx(path.x_range, abs=tolerance)
    assert mirrored.y_range == pytest.approx((-path.y_range[1], -path.y_range[0]), abs=tolerance)
    # Mirrored once in the plane and once by the crank's sense.
    assert mirrored.area == pytest.approx(path.area, rel=1e-6, abs=1e-9, nan_ok=True)


def test_part_of_a_turn_is_an_open_path_with_its_ends() -> None:
    path = path_of(PARTIAL)
    ((start, end),) = path.arcs
    assert not path.full_turn
    assert math.isnan(path.area)
    assert path.alphas[0] == pytest.approx(start, abs=1e-11)
    assert path.alphas[-1] == pytest.approx(end, abs=1e-11)
    assert (np.diff(path.alphas) > 0).all()
    assert path.length == pytest.approx(path_of(PARTIAL, samples=3000).length, rel=1e-7)


def test_every_arc_is_part_of_the_path() -> None:
    geometry = KlannGeometry(l_dc=0.07)
    arcs = KlannLeg(geometry).reachable_arcs()
    path = path_of(geometry)
    assert len(arcs) > 1
    assert path.arcs == tuple(arcs)
    leg = KlannLeg(geometry)
    for start, end in arcs:
        for k in range(1, 100):
            x, y = leg.solve(start + (end - start) * k / 100).h
            assert path.x_range[0] <= x + 1e-12
            assert y - 1e-12 <= path.y_range[1]


# The foot is lowest just beside the end of an arc.
LOWEST_BESIDE_AN_END = KlannGeometry(
    l_ab=0.11405520677397718,
    l_bc=0.31470052257808917,
    l_dc=0.16198398582353474,
    l_cg=0.441545700184766,
    l_ef=0.307593594983953,
    l_fg=0.2839156271678619,
    l_gh=0.3999230823494247,
    x_d=0.39259632958224,
    y_a=0.0972650124568092,
    x_e=0.21634191112893408,
    y_e=0.175398987289455,
    assembly=(-1, -1),
)


def test_an_extreme_beside_the_end_of_an_arc_is_found() -> None:
    leg = KlannLeg(LOWEST_BESIDE_AN_END)
    path = foot_path(leg)
    start, _ = path.arcs[0]
    lowest = min(leg.solve(start + 1e-7 * k).h[1] for k in range(1, 5000))
    assert lowest < path.h[0, 1] - 1e-5
    assert path.y_range[0] == pytest.approx(lowest, abs=1e-9)


@pytest.mark.parametrize('name', ['chebyshev_lambda', 'jansen'])
def test_other_legs_have_a_path_and_a_stance(name: str) -> None:
    leg = LinkageLeg(shipped_linkage(name))
    path = foot_path(leg)
    assert path.full_turn
    # Both are known for a foot that is on the ground for more than half a turn, and level there.
    assert path.stance().duty_factor > 0.5
    assert path.stance().straightness < 0.05
    for angle in path.crank_angles_at_x(sum(path.x_range) / 2):
        assert leg.solve(angle).h[0] == pytest.approx(sum(path.x_range) / 2, abs=1e-13)


def test_an_ellipse_has_its_figures(ellipse: Any) -> None:
    path = foot_path(ellipse(0.5, 0.5))
    assert path.x_range == pytest.approx((0.5, 1.5), abs=1e-15)
    assert path.length == pytest.approx(math.pi, rel=1e-15)
    assert path.area == pytest.approx(math.pi / 4, rel=1e-15)
    path = foot_path(ellipse(0.3, -0.2))
    assert (path.stride, path.lift) == pytest.approx((0.6, 0.4), rel=1e-15)
    assert path.area == pytest.approx(-math.pi * 0.06, rel=1e-14)


def test_a_half_circle_has_its_figures_up_to_its_singular_ends(half_circle: Any) -> None:
    path = foot_path(half_circle)
    assert path.stride == pytest.approx(1.0, abs=1e-12)
    assert path.y_range == pytest.approx((0.0, 0.5), abs=1e-6)
    assert path.length == pytest.approx(math.pi / 2, rel=1e-6)


@pytest.mark.parametrize('arcs', [[], [(1.0, 2.0)]], ids=['no arc', 'an arc without a pose'])
def test_a_leg_that_reaches_nothing_has_no_path(half_circle: Any, arcs: Any) -> None:
    half_circle.reachable_arcs = lambda: arcs
    with pytest.raises(NoFootPathError, match='reaches no crank angle'):
        foot_path(half_circle)


def test_a_singular_sample_leaves_no_area(ellipse: Any) -> None:
    leg = ellipse(0.5, 0.25)
    velocity = leg.velocity

    def velocity_but_for_a_quarter(pose: Any, rate: float) -> Any:
        if pose.crank_angle == math.pi / 2:
            raise SingularPoseError(pose.crank_angle)
        return velocity(pose, rate)

    leg.velocity = velocity_but_for_a_quarter
    path = foot_path(leg)
    assert path.full_turn
    assert math.isnan(path.area)
    assert math.isnan(path.length)


BAR = FourBar(0.18, 0.08, 0.2, 0.15)


def test_a_four_bars_foot_is_b() -> None:
    path = foot_path(BAR)
    expected = [BAR.closed_form(alpha).points[2] for alpha in path.alphas.tolist()]
    np.testing.assert_allclose(path.h, expected, rtol=0, atol=1e-14)
    # There and back: where it turns the quadrature loses digits.
    assert path.length == pytest.approx(2 * 0.15 * BAR.rocker_limits.swing, rel=1e-5)


def test_chebyshevs_coupler_curve_is_the_path_of_the_shipped_foot() -> None:
    shipped = foot_path(LinkageLeg(shipped_linkage('chebyshev_lambda')))
    curve = foot_path(FourBar(0.2, 0.1, 0.25, 0.25), point=('theta3', 0.5, 0.0))
    assert (curve.stride, curve.length) == pytest.approx((shipped.stride, shipped.length))


@pytest.mark.parametrize('name', ['B', 'C', 'F', 'G', 'H'])
def test_every_point_that_moves_has_its_path(name: str) -> None:
    leg = KlannLeg(KlannGeometry.patent())
    place = 'ABCDEFGH'.index(name)
    path = foot_path(leg, point=name)
    expected = [leg.closed_form(alpha).points[place] for alpha in path.alphas.tolist()]
    np.testing.assert_allclose(path.h, expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ('name', 'body', 'ends', 'place'),
    [
        *(
            ('klann', *pair, (0.13, -0.07))
            for pair in zip(JOINTS, ['AB', 'BC', 'DC', 'EF', 'FG'], strict=True)
        ),
        ('klann', 'gamma', 'BC', (0.0, 0.0)),
        ('stephenson', 'epsilon', 'CD', (0.13, -0.07)),
        ('four_bar', 'theta3', 'AB', (-0.1, 0.0)),
    ],
)
def test_a_body_point_is_placed_by_its_bar(name: str, body: str, ends: str, place: Any) -> None:
    leg, (u, v) = LinkageLeg(shipped_linkage(name)), place
    places = [leg.linkage.structure.points.index(end) for end in ends]
    path = foot_path(leg, point=(body, u, v), samples=64)
    assert path.full_turn
    for alpha, h in zip(path.alphas.tolist(), path.h, strict=True):
        start, end = leg.solve(alpha).points[places]
        along = (end - start) / math.dist(end, start)
        left = np.array([-along[1], along[0]])
        np.testing.assert_allclose(h, start + u * along + v * left, rtol=0, atol=1e-11)


def test_a_linkage_with_a_point_more_is_the_same_otherwise() -> None:
    linkage = KlannGeometry().linkage
    longer = linkage.with_coupler_point('gamma', 0.1, 0.2, 'Q')
    assert longer.structure.points == (*linkage.structure.points, 'Q')
    assert longer.dimensions | linkage.dimensions == longer.dimensions
    assert [*longer.dimensions][: len(linkage.dimensions)] == [*linkage.dimensions]
    pose, longer_pose = LinkageLeg(linkage).solve(1.0), LinkageLeg(longer).solve(1.0)
    assert longer_pose.x == pytest.approx(pose.x, abs=1e-15)
    np.testing.assert_allclose(longer_pose.points[:-1], pose.points, rtol=0, atol=1e-15)
    assert longer.varied({'l_bc': 0.36}).mirrored().scaled(2.0).structure.foot == 'Q'
    assert LinkageLeg(linkage.with_foot('G')).solve(1.0).h == pytest.approx(pose.points[6])
