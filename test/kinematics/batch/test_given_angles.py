"""Angles that are given: their loops and feet are those of the leg, pose by pose."""

from pathlib import Path

from hypothesis import given, settings, strategies as st
import klann_ros
from klann_ros.kinematics import (
    KinematicsError,
    KlannGeometry,
    KlannLeg,
    linkage_from_file,
    LinkageLeg,
)
from klann_ros.kinematics.batch.poses import feet, loop_errors
import numpy as np
import pytest
from strategies import legs

LINKAGES = sorted((Path(klann_ros.__file__).parent / 'linkages').glob('*.yaml'))
LEGS = [KlannLeg(), KlannLeg(KlannGeometry.patent())] + [
    LinkageLeg(linkage_from_file(path)) for path in LINKAGES
]
NAMES = ['klann', 'patent', *(path.stem for path in LINKAGES)]
angles = st.floats(-7.0, 7.0)


def rows(leg):
    one = st.lists(angles, min_size=len(leg.joint_names), max_size=len(leg.joint_names))
    return st.lists(one, min_size=1, max_size=5).map(np.array)


def check(leg, given_angles) -> None:
    expected = [leg.residual(alpha, x) for alpha, *x in given_angles.tolist()]
    scale = max(1.0, *expected)
    np.testing.assert_allclose(loop_errors(leg, given_angles), expected, atol=1e-13 * scale)


@pytest.mark.parametrize('leg', LEGS, ids=NAMES)
@settings(max_examples=25)
@given(data=st.data())
def test_loops_are_those_of_the_leg(leg, data) -> None:
    check(leg, data.draw(rows(leg)))


@settings(max_examples=25)
@given(legs(), st.data())
def test_loops_are_those_of_any_klann_leg(geometry, data) -> None:
    leg = KlannLeg(geometry)
    check(leg, data.draw(rows(leg)))


@pytest.mark.parametrize('leg', LEGS, ids=NAMES)
def test_feet_of_solved_poses_are_theirs(leg) -> None:
    poses = []
    for alpha in np.linspace(-4.0, 4.0, 41):
        try:
            poses.append(leg.closed_form(alpha))
        except KinematicsError:
            continue
    assert len(poses) > 5
    given_angles = np.array([[pose.alpha, *pose.x] for pose in poses])
    np.testing.assert_allclose(feet(leg, given_angles), [pose.h for pose in poses], atol=1e-12)
    assert loop_errors(leg, given_angles).max() < 1e-9


@pytest.mark.parametrize('leg', LEGS, ids=NAMES)
@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_an_angle_that_is_not_finite_gives_nan(leg, value) -> None:
    given_angles = np.zeros((2, len(leg.joint_names)))
    given_angles[1, :] = value
    assert np.isnan(loop_errors(leg, given_angles)).tolist() == [False, True]
    assert np.isnan(feet(leg, given_angles)).any(axis=1).tolist() == [False, True]
