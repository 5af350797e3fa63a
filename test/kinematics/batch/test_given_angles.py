"""Angles that are given: their loops and feet are those of the leg, pose by pose."""

from typing import Any

from hypothesis import given, settings, strategies as st
from klann_ros.kinematics import KinematicsError, Leg
from klann_ros.kinematics.batch.poses import feet, loop_errors
from mechanisms import KNOWN, legs, NAMES
import numpy as np
import pytest


@settings(max_examples=2 * len(NAMES))
@given(leg=legs(), data=st.data())
def test_loops_are_those_of_the_leg(leg: Leg[Any, Any], data: st.DataObject) -> None:
    n = len(leg.joint_names)
    row = st.lists(st.floats(-7.0, 7.0), min_size=n, max_size=n)
    given_angles = np.array(data.draw(st.lists(row, min_size=1, max_size=5)))
    expected = [np.linalg.norm(leg.f(alpha, x)) for alpha, *x in given_angles.tolist()]
    limit = 1e-13 * max(1.0, *expected)
    np.testing.assert_allclose(loop_errors(leg, given_angles), expected, atol=limit)


@pytest.mark.parametrize('name', NAMES)
def test_feet_of_solved_poses_are_theirs(name: str) -> None:
    leg, poses = KNOWN[name], []
    for alpha in np.linspace(-4.0, 4.0, 41):
        try:
            poses.append(leg.closed_form(alpha))
        except KinematicsError:
            continue
    assert len(poses) > 5
    given_angles = np.array([[pose.crank_angle, *pose.x] for pose in poses])
    np.testing.assert_allclose(feet(leg, given_angles), [pose.h for pose in poses], atol=1e-12)
    assert loop_errors(leg, given_angles).max() < 1e-9


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_an_angle_that_is_not_finite_gives_nan(name: str, value: float) -> None:
    leg = KNOWN[name]
    given_angles = np.zeros((2, len(leg.joint_names)))
    given_angles[1, :] = value
    assert np.isnan(loop_errors(leg, given_angles)).tolist() == [False, True]
    assert np.isnan(feet(leg, given_angles)).any(axis=1).tolist() == [False, True]
