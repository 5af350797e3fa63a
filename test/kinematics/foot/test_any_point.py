"""The path of any point of a leg, and the coupler curve of a four-bar."""

import math

from klann_ros.kinematics import (
    foot_path,
    FourBar,
    KlannGeometry,
    KlannLeg,
    LinkageLeg,
    shipped_linkage,
)
from klann_ros.kinematics.klann import JOINTS
import numpy as np
import pytest

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
def test_a_body_point_is_placed_by_its_first_bar_and_side(
    name: str, body: str, ends: str, place: tuple[float, float]
) -> None:
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
    more = linkage.with_coupler_point('gamma', 0.1, 0.2, 'Q')
    assert more.structure.points == (*linkage.structure.points, 'Q')
    assert list(more.dimensions.items())[: len(linkage.dimensions)] == [
        *linkage.dimensions.items()
    ]
    own, other = LinkageLeg(linkage).solve(1.0), LinkageLeg(more).solve(1.0)
    assert other.x == pytest.approx(own.x, abs=1e-15)
    np.testing.assert_allclose(other.points[:-1], own.points, rtol=0, atol=1e-15)
    assert more.varied({'l_bc': 0.36}).mirrored().scaled(2.0).structure.foot == 'Q'
    assert LinkageLeg(linkage.with_foot('G')).solve(1.0).h == pytest.approx(own.points[6])
