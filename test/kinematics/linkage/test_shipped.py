"""The shipped linkages, against constructions that share no line with the package."""

import cmath
import math

from hypothesis import given, strategies as st
from klann_ros.kinematics import KlannLeg, LinkageLeg, shipped_linkage, shipped_linkages
import numpy as np
import pytest
from scipy.optimize import fsolve

TURN = [math.radians(k) for k in range(360)]


def places(leg: LinkageLeg, alpha: float) -> dict[str, complex]:
    """Return the points by name."""
    points = leg.solve(alpha).points
    return {
        name: complex(*p) for name, p in zip(leg.linkage.structure.points, points, strict=True)
    }


def circles(p: complex, q: complex, r_p: float, r_q: float, side: int) -> complex:
    """Return where two circles meet, to the left (+1) or the right (-1) of the way from p to q."""
    d = abs(q - p)
    at_p = math.acos((d * d + r_p * r_p - r_q * r_q) / (2 * d * r_p))
    return p + r_p * (q - p) / d * cmath.exp(1j * side * at_p)


def jansen(m: float) -> dict[str, complex]:
    """Construct Jansen's leg by circles, in cm."""
    z, y = 0j, -38.0 - 7.8j
    x = z + 15.0 * cmath.exp(1j * m)
    w = circles(y, x, 41.5, 50.0, +1)
    u = circles(y, x, 39.3, 61.9, -1)
    v = circles(y, w, 40.1, 55.8, +1)
    t = circles(v, u, 39.4, 36.7, -1)
    s = circles(u, t, 49.0, 65.7, +1)
    return {'Z': z, 'Y': y, 'X': x, 'W': w, 'V': v, 'U': u, 'T': t, 'S': s}


def chebyshev_lambda(crank: float) -> dict[str, complex]:
    """Construct Chebyshev's lambda by circles, in cm: P continues BC by its own length."""
    b = 10.0 * cmath.exp(1j * crank)
    c = circles(-20.0, b, 25.0, 25.0, +1)
    return {'A': 0j, 'D': -20.0 + 0j, 'B': b, 'C': c, 'P': 2.0 * c - b}


@pytest.mark.parametrize('build', [jansen, chebyshev_lambda])
def test_circles_construct_the_same_points_over_a_turn(build) -> None:
    leg = LinkageLeg(shipped_linkage(build.__name__))
    for alpha in TURN:
        expected = build(alpha)
        found = places(leg, alpha)
        assert found.keys() == expected.keys()
        assert max(abs(found[name] - 0.01 * expected[name]) for name in found) <= 1e-14


def test_fsolve_finds_the_same_stephenson_over_a_turn() -> None:
    """The points are the unknowns, the lengths the equations: no angle, no loop, no Jacobian."""
    a, b, e = 0j, 120 + 0j, 180 + 200j
    bars = [('F', 'G', 115), ('A', 'C', 160), ('B', 'D', 160)]
    bars += [('C', 'D', 80), ('C', 'G', 75), ('D', 'G', 70)]
    leg = LinkageLeg(shipped_linkage('stephenson'))
    guess = (
        1000 * leg.solve(0.0).points[[leg.linkage.structure.points.index(name) for name in 'GCD']]
    )

    def misfits(coordinates: np.ndarray, alpha: float) -> list[float]:
        points = dict(zip('GCD', coordinates.view(complex), strict=True))
        points |= {'A': a, 'B': b, 'E': e, 'F': e + 25 * cmath.exp(1j * alpha)}
        return [abs(points[p] - points[q]) - length for p, q, length in bars]

    for alpha in TURN:
        guess = fsolve(misfits, guess.ravel(), args=(alpha,), xtol=1e-12)
        found = places(leg, alpha)
        expected = dict(zip('GCD', guess.view(complex), strict=True))
        assert max(abs(1000 * found[name] - expected[name]) for name in 'GCD') <= 1e-10
        # P is on the coupler: 60 mm from C, 60 deg clockwise from CD.
        along = (expected['D'] - expected['C']) / 80
        p = expected['C'] + 60 * cmath.exp(-1j * math.radians(60)) * along
        assert abs(1000 * found['P'] - p) <= 1e-10


@pytest.mark.parametrize('direction', [1, -1])
def test_the_klann_file_is_the_klann_leg(direction: int) -> None:
    general, special = LinkageLeg(shipped_linkage('klann')), KlannLeg()
    assert general.linkage.joint_names == ('alpha', 'gamma', 'beta', 'delta', 'theta')
    assert general.linkage.assembly == special.geometry.assembly
    order = [general.linkage.structure.points.index(letter) for letter in 'ABCDEFGH']
    for k in range(3600):
        alpha = math.radians(direction * k / 10)
        one, other = general.solve(alpha), special.solve(alpha)
        np.testing.assert_allclose(one.x, other.x, rtol=0, atol=1e-12)
        np.testing.assert_allclose(one.h, other.h, rtol=0, atol=1e-12)
        np.testing.assert_allclose(one.coefficients, other.coefficients, rtol=0, atol=1e-12)
        if k % 100 == 0:
            np.testing.assert_allclose(one.points[order], other.points, rtol=0, atol=1e-12)
            for name in ('sines', 'clearances', 'condition'):
                np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-10)
            # SEM 104 measures delta + theta outside the joint F.
            mu_1, mu_2 = other.transmission_angles
            np.testing.assert_allclose(one.transmission_angles, (mu_1, math.pi - mu_2))


def test_the_klann_file_has_the_textbooks_equations_and_iterates() -> None:
    general, special = LinkageLeg(shipped_linkage('klann')), KlannLeg()
    guess = np.radians([15.0, 60.0, 45.0, 60.0])
    found = general.newton(math.radians(60.0), guess)
    expected = special.newton(math.radians(60.0), guess)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)


def test_the_four_bar_file_is_the_courses_example() -> None:
    pose = LinkageLeg(shipped_linkage('four_bar')).solve(math.radians(60.0))
    np.testing.assert_allclose(np.degrees(pose.x), [21.557634918, 72.137650451], atol=1e-9)
    assert math.degrees(pose.transmission_angles[0]) == pytest.approx(50.580015533, abs=1e-9)


@pytest.mark.parametrize('name', shipped_linkages())
@given(alpha=st.floats(-100.0, 100.0))
def test_every_shipped_linkage_closes_at_any_angle(name: str, alpha: float) -> None:
    leg = LEGS[name]
    pose = leg.solve(alpha)
    assert pose.residual <= 1e-14
    again = leg.solve(alpha + 2 * math.pi)
    np.testing.assert_allclose(again.points, pose.points, rtol=0, atol=1e-12)


@pytest.mark.parametrize('name', shipped_linkages())
def test_every_shipped_crank_has_one_arc_the_whole_turn(name: str) -> None:
    assert LEGS[name].reachable_arcs() == [(0.0, 2 * math.pi)]


def test_jansens_foot_has_its_flat_step() -> None:
    leg = LinkageLeg(shipped_linkage('jansen'))
    feet = np.array([leg.solve(alpha).h for alpha in TURN])
    low = feet[feet[:, 1] < feet[:, 1].min() + 0.01]
    # More than a third of the turn within 1 cm of the ground.
    assert len(low) > 120
    assert np.ptp(low[:, 0]) > 0.4


LEGS = {name: LinkageLeg(shipped_linkage(name)) for name in shipped_linkages()}
