"""The shipped linkages, against constructions that share no line with the package."""

import cmath
from collections.abc import Callable
from functools import cache, partial
import math
from typing import Any

from klann_ros.kinematics import KlannLeg, LinkageLeg, shipped_linkage, shipped_linkages
import numpy as np
import pytest
from scipy.optimize import fsolve

TURN = [math.radians(k) for k in range(360)]
# Cranks that do not turn fully, and where they do [rad]: law of cosines, links in line.
FOLDED, STRETCHED = math.acos(4 / 5), math.acos(-1 / 5)
TOGETHER = math.acos((20**2 + 12**2 - 22**2) / (2 * 20 * 12))
REACHING = math.acos((25**2 + 25**2 - 40**2) / (2 * 25 * 25))
ROCKING = {
    'chebyshev': [(FOLDED, STRETCHED), (2 * math.pi - STRETCHED, 2 * math.pi - FOLDED)],
    'roberts': [(2 * math.pi - TOGETHER, 2 * math.pi + TOGETHER)],
    'peaucellier': [(math.pi + REACHING, 3 * math.pi - REACHING)],
}


@cache
def arcs(name: str) -> list[tuple[float, float]]:
    """Return where a crank turns; to find it takes longer than any number of poses."""
    return LEGS[name].reachable_arcs()


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


# Constructions of the points at a crank angle, in cm: by circles, and where bodies slide by
# Pythagoras.


def jansen(m: float) -> dict[str, complex]:
    z, y = 0j, -38.0 - 7.8j
    x = z + 15.0 * cmath.exp(1j * m)
    w = circles(y, x, 41.5, 50.0, +1)
    u = circles(y, x, 39.3, 61.9, -1)
    v = circles(y, w, 40.1, 55.8, +1)
    t = circles(v, u, 39.4, 36.7, -1)
    s = circles(u, t, 49.0, 65.7, +1)
    return {'Z': z, 'Y': y, 'X': x, 'W': w, 'V': v, 'U': u, 'T': t, 'S': s}


def strider(crank: float) -> dict[str, complex]:
    j1 = 4.0 * cmath.exp(1j * crank)
    points = {'J0': 0j, 'J1': j1}
    # The left foot hangs on the right bar, the right foot on the left one.
    for side, hip, knee, elbow, end in (
        (-1, 'J2', 'J3', 'J9', 'J10'),
        (1, 'J6', 'J7', 'J5', 'J11'),
    ):
        points[hip] = 11.0 * side + 8j
        points[knee] = circles(points[hip], j1, 5.0, 14.0, side)
        along = (j1 - points[knee]) / 14.0
        points[elbow] = j1 + 6.0 * along
        points[end] = points[elbow] - 1j * side * along
    points['J4'] = circles(points['J3'], points['J11'], 13.0, 10.0, -1)
    points['J8'] = circles(points['J7'], points['J10'], 13.0, 10.0, +1)
    return points


def trotbot(crank: float) -> dict[str, complex]:
    j0, j3 = 0j, -7 + 6j
    j1 = 4.0 * cmath.exp(1j * crank)
    j2 = circles(j3, j1, 8.0, 6.0, +1)
    j8 = circles(j1, j2, 3.0, 7.55, +1)
    j9 = j1 + (j1 - j2) / 6.0
    j4 = j3 + 2.0 * (j3 - j2) / 8.0
    j5 = circles(j4, j1, 6.0, 11.0, -1)
    j6 = j5 + 2.0 * (j5 - j4) / 6.0
    j7 = circles(j6, j8, 8.0, 9.0, -1)
    j10 = j8 + (9.0 - 2.64) * (j7 - j8) / 9.0
    j11 = circles(j10, j9, 2.55, 7.2, -1)
    j13 = (j6 + j7) / 2.0
    j14 = j10 + (j10 - j11) / 2.55
    j12, j15 = j11 + (j11 - j10) / 2.55, circles(j13, j14, 3.8, 3.7, -1)
    places = (j0, j1, j2, j3, j4, j5, j6, j7, j8, j9, j10, j11, j12, j13, j14, j15)
    return {f'J{number}': place for number, place in enumerate(places)}


def ghassaei(crank: float) -> dict[str, complex]:
    b, c = -53.0 * cmath.exp(0.085j), 26.0 * cmath.exp(1j * crank)
    d, f = circles(b, c, 77.0, 56.0, +1), circles(b, c, 77.0, 56.0, -1)
    e = b + (d - b) * cmath.exp(2.97j)
    return {'O': 0j, 'B': b, 'C': c, 'D': d, 'E': e, 'F': f, 'G': circles(e, f, 75.0, 75.0, -1)}


def watt_six_bar(crank: float) -> dict[str, complex]:
    a, q = cmath.exp(1j * crank), 1.875 + 0j
    c = circles(a, q, 2.3125, 2.3125, +1)
    d = a + 4.6875 * (c - a) / 2.3125
    e = circles(d, -a, 3.8125, 4.6875, -1)
    along = (e - d) / 3.8125
    s = d + 1.75 * along
    return {'O': 0j, 'A': a, 'A2': -a, 'Q': q, 'C': c, 'D': d, 'E': e, 'S': s, 'P': s + 1j * along}


def hoecken(crank: float) -> dict[str, complex]:
    a, o4 = 10.0 * cmath.exp(1j * crank), 22.0 + 0j
    b = circles(a, o4, 28.0, 28.0, +1)
    return {'O2': 0j, 'O4': o4, 'A': a, 'B': b, 'P': 2.0 * b - a}


def walker_four_bar(crank: float) -> dict[str, complex]:
    m, h = 4.0 * cmath.exp(1j * crank), -6.5 + 4.7j
    k = circles(h, m, 5.0, 8.0, -1)
    f = k + 10.0 * (k - m) / 8.0 * cmath.exp(1j * math.radians(97.0))
    return {'O': 0j, 'H': h, 'M': m, 'K': k, 'F': f}


def walker_six_bar(crank: float) -> dict[str, complex]:
    m, h = 4.0 * cmath.exp(1j * crank), -6.0 + 6.0j
    k = circles(h, m, 6.0, 8.0, -1)
    q, p = m + (k - m) / 4.0, k + (k - h) / 3.0
    return {'O': 0j, 'H': h, 'M': m, 'K': k, 'Q': q, 'P': p, 'F': circles(p, q, 9.0, 11.0, -1)}


def klann_variant(numbers: tuple[Any, ...], crank: float) -> dict[str, complex]:
    rider, rockers, leg, pivots = numbers
    (lower, upper), (m_c, c_d, bend), (d_e, d_f, knee) = pivots, rider, leg
    m = 3.0 * cmath.exp(1j * crank)
    c = circles(lower, m, rockers[0], m_c, -1)
    d = c + c_d * (c - m) / m_c * cmath.exp(1j * math.radians(bend))
    e = circles(upper, d, rockers[1], d_e, +1)
    f = d + d_f * (d - e) / d_e * cmath.exp(-1j * math.radians(knee))
    return {'O': 0j, 'A': lower, 'B': upper, 'M': m, 'C': c, 'D': d, 'E': e, 'F': f}


# Rider, rockers, leg and pivots of the patent's leg, and of three of LEGO.
KLANN_VARIANTS = {
    'klann_patent': (
        *((6.604, 5.844, 12.83), (3.589, 5.795)),
        *((10.037, 10.036, 30.0), (6.6 - 1.97j, 2.6 + 6.9j)),
    ),
    'klann_lego': ((7, 6, 0), (4, 6), (10, 10, 29), (7 - 2j, 3 + 7j)),
    'klann_long_legs': ((7, 6, 0), (4, 6), (10, 14, 29), (7 - 2j, 3 + 7j)),
    'klann_high_step': ((6, 7, 0), (4, 6), (10, 14, 29), (6 - 2j, 3 + 7j)),
}


def andrews(crank: float) -> dict[str, complex]:
    a, b = -6.934 - 0.227j, -3.635 + 3.273j
    f = 0.7 * cmath.exp(1j * crank)
    e = circles(b, f, 3.5, 2.8, -1)
    g, h = circles(a, e, 4.0, 2.0, +1), circles(a, e, 4.0, 2.0, -1)
    # D is 1.8 cm along the third body, and 2 cm to the left of it.
    d = b + (1.8 + 2j) * (e - b) / abs(e - b)
    return {'O': 0j, 'A': a, 'B': b, 'F': f, 'E': e, 'D': d, 'G': g, 'H': h}


def chebyshev(phi: float) -> dict[str, complex]:
    a, o2 = 25.0 * cmath.exp(1j * phi), 20.0 + 0j
    b = circles(o2, a, 25.0, 10.0, +1)
    return {'O1': 0j, 'O2': o2, 'A': a, 'B': b, 'P': (a + b) / 2.0}


def roberts(crank: float) -> dict[str, complex]:
    b, c = 20.0 + 0j, 12.0 * cmath.exp(1j * crank)
    d = circles(b, c, 12.0, 10.0, -1)
    return {'A': 0j, 'B': b, 'C': c, 'D': d, 'P': circles(c, d, 12.0, 12.0, -1)}


def peaucellier(crank: float) -> dict[str, complex]:
    q = 25.0 + 0j
    b = q + 25.0 * cmath.exp(1j * crank)
    a, c = circles(0j, b, 65.0, 25.0, +1), circles(0j, b, 65.0, 25.0, -1)
    return {'O': 0j, 'Q': q, 'B': b, 'A': a, 'C': c, 'D': a + c - b}


def chebyshev_lambda(crank: float) -> dict[str, complex]:
    b = 10.0 * cmath.exp(1j * crank)
    c = circles(-20.0, b, 25.0, 25.0, +1)
    return {'A': 0j, 'D': -20.0 + 0j, 'B': b, 'C': c, 'P': 2.0 * c - b}


def slider_crank(crank: float) -> dict[str, complex]:
    b = 5.0 * cmath.exp(1j * crank)
    return {'A': 0j, 'B': b, 'C': b.real + math.sqrt(15.0**2 - b.imag**2) + 0j}


def quick_return(crank: float) -> dict[str, complex]:
    a, level = 20j, 40.0
    b = a + 10.0 * cmath.exp(1j * crank)
    d = 40.0 * b / abs(b)
    e = d.real - math.sqrt(15.0**2 - (level - d.imag) ** 2) + 1j * level
    return {'O': 0j, 'A': a, 'P': 1j * level, 'B': b, 'D': d, 'E': e}


def scotch_yoke(crank: float) -> dict[str, complex]:
    b = 8.0 * cmath.exp(1j * crank)
    return {'A': 0j, 'B': b, 'C': b.real + 0j, 'E': b.real + 20.0 + 0j}


CONSTRUCTED: dict[str, Callable[[float], dict[str, complex]]] = {
    build.__name__: build
    for build in (
        *(slider_crank, quick_return, scotch_yoke),
        *(jansen, chebyshev_lambda, chebyshev, hoecken, roberts, peaucellier, strider, trotbot),
        *(ghassaei, walker_four_bar, walker_six_bar, watt_six_bar, andrews),
    )
} | {name: partial(klann_variant, numbers) for name, numbers in KLANN_VARIANTS.items()}


@pytest.mark.parametrize('name', CONSTRUCTED)
def test_circles_construct_the_same_points(name: str) -> None:
    leg, build = LinkageLeg(shipped_linkage(name)), CONSTRUCTED[name]
    (start, end), *_ = arcs(name)
    # Where a crank does not turn fully, its arc but for the singular ends.
    ends = 0.0 if end - start == 2 * math.pi else 0.01
    for alpha in np.linspace(start + ends, end - ends, 361).tolist():
        expected = build(alpha)
        found = places(leg, alpha)
        assert found.keys() == expected.keys()
        assert max(abs(found[point] - 0.01 * expected[point]) for point in found) <= 1e-13


def test_every_shipped_linkage_is_constructed_without_the_package() -> None:
    # The courses' two, their own legs, and the one that is solved by its lengths.
    others = {'four_bar', 'klann', 'stephenson'}
    assert CONSTRUCTED.keys() | others == set(shipped_linkages())


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


def test_the_klann_file_is_the_klann_leg() -> None:
    general, special = LinkageLeg(shipped_linkage('klann')), KlannLeg()
    assert general.linkage.joint_names == special.joint_names
    assert general.linkage.assembly == special.geometry.assembly
    order = [general.linkage.structure.points.index(letter) for letter in 'ABCDEFGH']
    for alpha in TURN[::10]:
        one, other = general.solve(alpha), special.solve(alpha)
        for name in ('x', 'h', 'coefficients', 'sines', 'clearances', 'condition'):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-12)
        np.testing.assert_allclose(one.points[order], other.points, rtol=0, atol=1e-12)
        # SEM 104 measures delta + theta outside the joint F.
        mu_1, mu_2 = other.transmission_angles
        np.testing.assert_allclose(one.transmission_angles, (mu_1, math.pi - mu_2))


def test_the_four_bar_file_is_the_courses_example() -> None:
    pose = LinkageLeg(shipped_linkage('four_bar')).solve(math.radians(60.0))
    np.testing.assert_allclose(np.degrees(pose.x), [21.557634918, 72.137650451], atol=1e-9)
    assert math.degrees(pose.transmission_angles[0]) == pytest.approx(50.580015533, abs=1e-9)


@pytest.mark.parametrize('name', shipped_linkages())
def test_a_crank_turns_fully_but_between_rockers(name: str) -> None:
    expected, digits = ROCKING.get(name, [(0.0, 2 * math.pi)]), 1e-9 if name in ROCKING else 0.0
    np.testing.assert_allclose(arcs(name), expected, rtol=0, atol=digits)


LEGS = {name: LinkageLeg(shipped_linkage(name)) for name in shipped_linkages()}
