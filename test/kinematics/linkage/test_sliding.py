"""Bodies that slide: the textbooks' closed forms, and what cannot be put together."""

import math
from pathlib import Path

from klann_ros.kinematics import (
    Linkage,
    linkage_from_text,
    linkage_poses,
    LinkageLeg,
    shipped_linkage,
    UnreachableError,
)
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
SLIDER, SLOT, CROSSED, COUPLED = (
    Path(__file__).with_name(f'{name}.yaml').read_text(encoding='utf-8')
    for name in ('offset_slider', 'slot', 'crossed', 'coupled')
)
ALPHAS = np.linspace(-7.0, 7.0, 701)
# Rounding of numbers that take at most 50 operations here.
DIGITS = {'rtol': 0.0, 'atol': 1e-12}


def motions(linkage: Linkage) -> tuple[Array, Array, Array]:
    """Return the coordinates over some turns, and their first and second derivatives."""
    leg = LinkageLeg(linkage)
    rows = []
    for alpha in ALPHAS.tolist():
        pose = leg.solve(alpha)
        motion = leg.acceleration(pose, 1.0, 0.0)
        rows.append((pose.x, motion.velocity.joints[1:], motion.joints[1:]))
    x, first, second = (np.array(column) for column in zip(*rows, strict=True))
    return x, first, second


def test_an_offset_slider_crank_is_the_textbooks() -> None:
    r, rod, e = 0.05, 0.15, 0.02
    linkage = shipped_linkage('slider_crank').varied({'A-B': r, 'B-C': rod})
    text = SLIDER.replace('P: [0, 0]', f'P: [0, {e}]')
    x, first, second = motions(linkage_from_text(text, 'test'))
    assert linkage.dimensions['A-B'] == r
    # x = r cos a + w, w^2 = l^2 - (r sin a - e)^2 and its derivatives.
    c = np.cos(ALPHAS)
    s = np.sin(ALPHAS)
    up = r * s - e
    w = np.sqrt(rod**2 - up**2)
    w_1 = -up * r * c / w
    w_2 = (-(r**2) * c**2 + up * r * s - w_1**2) / w
    np.testing.assert_allclose(x[:, 1], r * c + w, **DIGITS)
    np.testing.assert_allclose(first[:, 1], -r * s + w_1, **DIGITS)
    np.testing.assert_allclose(second[:, 1], -r * c + w_2, **DIGITS)
    np.testing.assert_allclose(x[:, 0], np.arcsin(-up / rod), **DIGITS)
    np.testing.assert_allclose(first[:, 0], -r * c / w, **DIGITS)


def test_the_quick_return_is_the_textbooks() -> None:
    linkage = shipped_linkage('quick_return')
    x, first, second = motions(linkage)
    d, r, arm, link, level = 0.2, 0.1, 0.4, 0.15, 0.4
    c = np.cos(ALPHAS)
    s = np.sin(ALPHAS)
    distance = np.sqrt(d**2 + r**2 + 2 * d * r * s)
    phi = np.arctan2(d + r * s, r * c)
    phi_1 = r * (r + d * s) / distance**2
    phi_2 = d * r * c * (d**2 - r**2) / distance**4
    for computed, expected in (
        (x[:, 0], phi),
        (first[:, 0], phi_1),
        (second[:, 0], phi_2),
        (x[:, 1], distance),
        (first[:, 1], d * r * c / distance),
        (second[:, 1], -d * r * s / distance - (d * r * c) ** 2 / distance**3),
    ):
        np.testing.assert_allclose(computed, expected, **DIGITS)
    # The ram is an offset slider-crank that the arm drives.
    up = arm * np.sin(phi) - level
    w = np.sqrt(link**2 - up**2)
    w_1 = -up * arm * np.cos(phi) / w
    np.testing.assert_allclose(x[:, 3], arm * np.cos(phi) - w, **DIGITS)
    np.testing.assert_allclose(first[:, 3], (-arm * np.sin(phi) - w_1) * phi_1, **DIGITS)


def test_the_quick_return_takes_twice_as_long_out_as_back() -> None:
    # The arm turns back where the crank is square to it: 180 deg +- 2 asin(r/d), with d = 2 r.
    x, first, _ = motions(shipped_linkage('quick_return'))
    leg = LinkageLeg(shipped_linkage('quick_return'))
    for alpha in (math.radians(210.0), math.radians(330.0)):
        assert leg.solve(alpha).coefficients[0] == pytest.approx(0.0, abs=1e-15)
    turn = np.abs(ALPHAS - math.pi) < math.pi
    share = np.count_nonzero(first[turn, 0] > 0.0) / np.count_nonzero(turn)
    assert share == pytest.approx(2 / 3, abs=0.005)
    assert x.shape == (701, 4)


def test_the_scotch_yoke_is_a_cosine() -> None:
    x, first, second = motions(shipped_linkage('scotch_yoke'))
    c, s = 0.08 * np.cos(ALPHAS), 0.08 * np.sin(ALPHAS)
    for columns, (yoke, pin) in zip((x, first, second), ((c, s), (-s, c), (-c, -s)), strict=True):
        np.testing.assert_allclose(columns[:, 0], yoke, **DIGITS)
        np.testing.assert_allclose(columns[:, 1], pin, **DIGITS)


def test_a_piston_out_of_reach_is_reported_with_its_shortfall() -> None:
    linkage = linkage_from_text(SLIDER.replace('P: [0, 0]', 'P: [0, 0.12]'), 'test')
    leg = LinkageLeg(linkage)
    # The rod of 0.15 ends where the crank's pin is 0.15 from the line.
    (start, end), *_ = leg.reachable_arcs()
    low = math.asin((0.12 - 0.15) / 0.05)
    assert start == pytest.approx(low % (2 * math.pi), abs=1e-9)
    assert end - start == pytest.approx(math.pi - 2 * low, abs=1e-9)
    with pytest.raises(UnreachableError) as caught:
        leg.solve(math.radians(-90.0))
    assert caught.value.shortfall == pytest.approx(0.02)
    assert 'B is 0.02 m further from the line of piston than BC is long' in str(caught.value)
    poses = linkage_poses(linkage, [math.radians(-90.0), 0.0])
    assert poses.reason.tolist() == [2, 0]
    assert np.isnan(poses.h[0]).all()


def test_a_slot_that_passes_its_pivot_too_far_off_is_reported() -> None:
    leg = LinkageLeg(linkage_from_text(SLOT, 'test'))
    reason = r'B is 0\.05 m nearer to O than the line along arm'
    with pytest.raises(UnreachableError, match=reason):
        leg.solve(math.radians(-90.0))
    assert leg.solve(0.0).residual < 1e-15


def test_a_line_on_a_line_and_a_coupled_one_are_solved() -> None:
    for text in (CROSSED, COUPLED):
        leg = LinkageLeg(linkage_from_text(text, 'test'))
        for alpha in ALPHAS.tolist():
            pose = leg.solve(alpha)
            assert pose.residual <= 1e-14
            closed = leg.closed_form(alpha)
            np.testing.assert_allclose(pose.x, closed.x, rtol=0, atol=1e-11)
            np.testing.assert_allclose(pose.coefficients, closed.coefficients, rtol=0, atol=1e-8)
        poses = linkage_poses(leg.linkage, ALPHAS)
        assert not poses.reason.any()
        assert poses.h[-1] == pytest.approx(leg.solve(float(ALPHAS[-1])).h, abs=1e-12)


def test_a_start_has_distances_in_the_units_of_the_file() -> None:
    in_mm = SLIDER + 'units: {length: mm}'
    for metres, millimetres in (('0.05', '50'), ('0.15', '150'), ('0.17', '170')):
        in_mm = in_mm.replace(metres, millimetres)
    expected = pytest.approx(linkage_from_text(SLIDER, 'test').start, abs=1e-12)
    assert linkage_from_text(in_mm, 'test').start == expected
