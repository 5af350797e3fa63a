"""The numbers that SEM 104 and the patent print."""

import math

from klann_ros.kinematics import KlannGeometry, KlannLeg
import numpy as np

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
