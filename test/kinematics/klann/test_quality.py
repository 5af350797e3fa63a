"""How good a pose is: how far from its singularities, and how well it transmits."""

import math

from klann_ros.kinematics import KlannLeg
import numpy as np
import pytest


def test_the_textbook_legs_nearest_singularity_is_dyad_1_stretched() -> None:
    poses = [KlannLeg().closed_form(math.radians(k / 10)) for k in range(3600)]
    nearest = min(poses, key=lambda pose: pose.distance_to_singularity)
    # BD reaches 481.39 of BC + DC = 490 mm.
    assert nearest.distance_to_singularity == pytest.approx(0.490 - 0.48139, abs=5e-6)
    assert nearest.clearances[0] == nearest.distance_to_singularity
    assert nearest.alpha == pytest.approx(math.pi - math.atan2(0.09, 0.35), abs=1e-3)


def test_clearances_are_what_the_lengths_leave() -> None:
    pose = KlannLeg().solve(1.0)
    _, b, _, d, e, _, g, _ = pose.points
    bd, eg = math.dist(b, d), math.dist(e, g)
    expected = min(0.49 - bd, bd - 0.21), min(0.63 - eg, eg - 0.09)
    np.testing.assert_allclose(pose.clearances, expected, rtol=0, atol=1e-15)
