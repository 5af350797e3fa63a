"""The numbers that SEM 104 and the patent print."""

import math

from klann_ros.kinematics import KlannGeometry, KlannLeg
import numpy as np
import pytest

ALPHA = math.radians(60.0)
GUESS = np.radians([15.0, 60.0, 45.0, 60.0])
# x_2, x_3 and x_4 of lecture 7 [deg]; x_5 and x_6 repeat x_4.
PRINTED = [
    [10.5138, 67.0074, 36.7323, 45.7048],
    [10.6570, 67.3283, 34.4691, 45.7564],
    [10.6570, 67.3283, 34.4634, 45.7220],
    [10.6570, 67.3283, 34.4634, 45.7220],
]
ROOT = np.radians([10.659455241249857, 67.32948352084568, 34.46397311984116, 45.72293552846574])
H = (0.7960057379415449, -0.3037627502892032)


def test_the_printed_iterates_come_out_digit_for_digit_from_the_guess_to_the_root() -> None:
    iterates = KlannLeg().newton(ALPHA, GUESS)
    # The lecture rounds to 4 decimals in radians and converts to degrees then.
    as_printed = np.round(np.degrees(np.round(iterates, 4)), 4)
    assert as_printed[1:5].tolist() == PRINTED
    assert iterates[0].tolist() == GUESS.tolist()
    for x in (iterates[-1], KlannLeg().solve(ALPHA).x, KlannLeg().closed_form(ALPHA).x):
        np.testing.assert_allclose(x, ROOT, rtol=0, atol=1e-15)
    for pose in (KlannLeg().solve(ALPHA), KlannLeg().closed_form(ALPHA)):
        np.testing.assert_allclose(pose.h, H, rtol=0, atol=1e-15)


def test_the_leg_of_sem_104_has_the_measured_ranges() -> None:
    poses = [KlannLeg().closed_form(math.radians(k / 10)) for k in range(3600)]
    feet = np.array([pose.h for pose in poses])
    np.testing.assert_allclose(feet.min(axis=0), [0.43590, -0.31879], atol=5e-6)
    np.testing.assert_allclose(feet.max(axis=0), [0.92686, -0.01873], atol=5e-6)
    first, second = np.degrees([pose.transmission_angles for pose in poses]).T
    np.testing.assert_allclose([first.min(), first.max()], [31.19, 156.15], atol=5e-3)
    np.testing.assert_allclose([second.min(), second.max()], [59.03, 128.05], atol=5e-3)


def test_the_condition_number_is_that_of_phi_in_mm() -> None:
    conditions = [KlannLeg().closed_form(math.radians(k)).condition for k in range(360)]
    np.testing.assert_allclose([min(conditions), max(conditions)], [4.06, 14.97], atol=5e-3)


def test_the_patent_leg_takes_the_printed_pose() -> None:
    geometry = KlannGeometry.patent()
    printed = np.array(
        [
            [1.599, 0.750],
            [1.331, 0.750],
            [0.741, 0.750],
            [1.009, 0.574],
            [1.366, 1.366],
            [0.866, 1.500],
            [0.232, 0.866],
            [0.000, 0.000],
        ]
    )
    pose = KlannLeg(geometry).solve(math.pi)
    np.testing.assert_allclose(pose.points, printed - [1.599, 0.574], rtol=0, atol=1e-14)
    assert (geometry.x_d, geometry.y_a, geometry.x_e, geometry.y_e) == (
        -0.59,
        0.176,
        -0.233,
        0.792,
    )
    assert geometry.assembly == (-1, -1)
    assert geometry.angle_bcg < 0
    assert geometry.angle_fgh < 0


def test_the_patent_foot_has_the_known_stride_and_lift() -> None:
    leg = KlannLeg(KlannGeometry.patent())
    feet = np.array([leg.solve(math.radians(k / 2)).h for k in range(720)])
    stride, lift = np.ptp(feet, axis=0)
    assert stride == pytest.approx(1.009, abs=5e-4)
    assert lift == pytest.approx(0.527, abs=5e-4)


def test_the_textbook_legs_nearest_singularity_is_dyad_1_stretched() -> None:
    poses = [KlannLeg().closed_form(math.radians(k / 10)) for k in range(3600)]
    nearest = min(poses, key=lambda pose: pose.distance_to_singularity)
    # BD reaches 481.39 of BC + DC = 490 mm.
    assert nearest.distance_to_singularity == pytest.approx(0.490 - 0.48139, abs=5e-6)
    assert nearest.clearances[0] == nearest.distance_to_singularity
    assert nearest.alpha == pytest.approx(math.pi - math.atan2(0.09, 0.35), abs=1e-3)
