"""The textbook's equations of the Klann leg, and the linkage that it is: one and the same."""

import cmath
from collections.abc import Sequence
import math
from math import cos, sin

from hypothesis import assume, given, strategies as st
import klann_equations as equations
from klann_ros.kinematics import KlannGeometry, KlannLeg, UnreachableError
from klann_ros.kinematics.klann import LENGTHS
import numpy as np
import pytest
from strategies import crank_angles, legs

states = st.tuples(*[st.floats(-math.pi, math.pi)] * 4)


@given(geometry=legs(), alpha=crank_angles, x=states)
def test_the_linkage_has_the_textbooks_equations_and_points(
    geometry: KlannGeometry, alpha: float, x: tuple[float, ...]
) -> None:
    linkage = geometry.linkage
    for found, expected in (
        (linkage.f(alpha, x), equations.f(geometry, alpha, x)),
        (linkage.phi(alpha, x), equations.phi(geometry, x)),
        (linkage.f_alpha(alpha, x), f_alpha(geometry, alpha)),
        (linkage.points(alpha, x), equations.points(geometry, alpha, x)),
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=4e-15)


@given(geometry=legs(), alpha=crank_angles)
def test_the_acceleration_solves_the_loops_differentiated_twice(
    geometry: KlannGeometry, alpha: float
) -> None:
    leg = KlannLeg(geometry)
    try:
        pose = leg.solve(alpha)
    except UnreachableError:
        assume(False)
    assume(min(pose.sines) > 0.1)
    phi = equations.phi(geometry, pose.x)
    part = f_2(geometry, alpha, pose.x, pose.coefficients)
    second = leg.acceleration(pose, 1.0, 0.0).joints[1:]
    scale = 1e-13 * (1.0 + abs(part).max())
    np.testing.assert_allclose(phi @ second, -part, rtol=1e-10, atol=scale)


@given(geometry=legs(), alpha=crank_angles, x=states)
def test_the_points_have_every_bend(
    geometry: KlannGeometry, alpha: float, x: tuple[float, ...]
) -> None:
    a, b, c, d, e, f, g, h = equations.points(geometry, alpha, x)
    # Where the loops are open, BC and FG are not where their bodies are.
    lengths = [math.dist(p, q) for p, q in [(a, b), (d, c), (c, g), (e, f), (g, h)]]
    expected = [getattr(geometry, name) for name in LENGTHS if name not in ('l_bc', 'l_fg')]
    np.testing.assert_allclose(lengths, expected, rtol=0, atol=1e-13)
    directions = [complex(*(g - c)), complex(*(h - g))]
    turned = [geometry.angle_bcg - x[0], -x[3] - geometry.angle_fgh]
    for direction, angle in zip(directions, turned, strict=True):
        assert math.sin(cmath.phase(direction) - angle) == pytest.approx(0.0, abs=1e-12)


def test_every_name_of_the_textbook_is_there() -> None:
    leg = KlannLeg()
    pose = leg.solve(1.0)
    assert pose.joints == (pose.alpha, pose.gamma, pose.beta, pose.delta, pose.theta)
    motion = leg.velocity(pose, 2.0)
    names = (motion.alpha, motion.gamma, motion.beta, motion.delta, motion.theta)
    assert motion.joints == names
    assert leg.joint_names == ('alpha', 'gamma', 'beta', 'delta', 'theta')


@pytest.mark.parametrize('kind', [int, np.float32, np.float64, np.int64, np.array])
def test_any_kind_of_number_is_an_angle(kind: type) -> None:
    leg = KlannLeg()
    leg.solve(1.9)
    pose = leg.solve(kind(2))
    np.testing.assert_allclose(pose.x, leg.closed_form(2.0).x, rtol=0, atol=1e-15)
    assert {type(value) for value in pose.joints} == {float}


def f_alpha(geometry: KlannGeometry, alpha: float) -> np.ndarray:
    """Return df/dalpha, shape (4,) [m/rad]: only the loop A-B-C-D holds the crank."""
    return np.array([-geometry.l_ab * sin(alpha), geometry.l_ab * cos(alpha), 0.0, 0.0])


def f_2(
    geometry: KlannGeometry,
    alpha: float,
    x: Sequence[float],
    x_1: Sequence[float],
) -> np.ndarray:
    """
    Return the part of d2f/dalpha2 without second derivatives of x, shape (4,) [m/rad^2].

    Every cosine and sine of f becomes -(dphi/dalpha)^2 times itself; `x_1` is dx/dalpha.
    """
    g = geometry
    gamma, beta, delta, theta = x
    bent = gamma - g.angle_bcg
    bc, dc, cg = -g.l_bc * x_1[0] ** 2, -g.l_dc * x_1[1] ** 2, -g.l_cg * x_1[0] ** 2
    ef, fg = -g.l_ef * x_1[2] ** 2, -g.l_fg * x_1[3] ** 2
    return np.array(
        [
            -g.l_ab * cos(alpha) + bc * cos(gamma) - dc * cos(beta),
            -g.l_ab * sin(alpha) - bc * sin(gamma) - dc * sin(beta),
            ef * cos(delta) + fg * cos(theta) - cg * cos(bent) - dc * cos(beta),
            ef * sin(delta) - fg * sin(theta) + cg * sin(bent) - dc * sin(beta),
        ]
    )
