"""The textbook's equations of the Klann leg, and the linkage that it is: one and the same."""

import math
from math import cos, sin

from hypothesis import given, strategies as st
import klann_equations as equations
from klann_ros.kinematics import KlannGeometry, KlannLeg
import numpy as np
import pytest
from strategies import crank_angles, legs

states = st.tuples(*[st.floats(-math.pi, math.pi)] * 4)


@given(geometry=legs(), alpha=crank_angles, x=states)
def test_it_has_textbook_equations(
    geometry: KlannGeometry, alpha: float, x: tuple[float, ...]
) -> None:
    linkage = geometry.linkage
    for computed, expected in (
        (linkage.f(alpha, x), equations.f(geometry, alpha, x)),
        (linkage.phi(alpha, x), equations.phi(geometry, x)),
        (linkage.f_alpha(alpha, x), f_alpha(geometry, alpha)),
        (linkage.points(alpha, x), equations.points(geometry, alpha, x)),
    ):
        np.testing.assert_allclose(computed, expected, rtol=0, atol=4e-15)


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


def test_the_patent_leg_takes_the_printed_pose() -> None:
    geometry = KlannGeometry.patent()
    printed = np.array([
        [1.599, 0.750], [1.331, 0.750], [0.741, 0.750], [1.009, 0.574],
        [1.366, 1.366], [0.866, 1.500], [0.232, 0.866], [0.000, 0.000],
    ])  # fmt: skip
    pose = KlannLeg(geometry).solve(math.pi)
    np.testing.assert_allclose(pose.points, printed - [1.599, 0.574], rtol=0, atol=1e-14)
    pivots = (geometry.x_d, geometry.y_a, geometry.x_e, geometry.y_e)
    assert pivots == (-0.59, 0.176, -0.233, 0.792)
    assert geometry.assembly == (-1, -1)
    assert geometry.angle_bcg < 0
    assert geometry.angle_fgh < 0
