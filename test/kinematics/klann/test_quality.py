"""How good a pose is: how far from its singularities, and how well it transmits."""

from dataclasses import replace
import math

from hypothesis import assume, given, settings, strategies as st
from klann_ros.kinematics import KlannGeometry, KlannLeg, KlannPose, UnreachableError
from klann_ros.kinematics.klann.geometry import COORDINATES, LENGTHS
import numpy as np
import pytest
from strategies import crank_angles, legs


def solved(geometry: KlannGeometry, alpha: float) -> KlannPose:
    """Return a pose, or drop the example."""
    try:
        return KlannLeg(geometry).solve(alpha)
    except UnreachableError:
        assume(False)
        raise


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


@given(geometry=legs(), alpha=crank_angles)
def test_the_sines_are_those_of_the_transmission_angles(
    geometry: KlannGeometry, alpha: float
) -> None:
    pose = solved(geometry, alpha)
    np.testing.assert_allclose(pose.sines, np.sin(pose.transmission_angles), atol=1e-15)


@given(geometry=legs(), alpha=crank_angles)
def test_a_solved_pose_has_no_negative_clearance(geometry: KlannGeometry, alpha: float) -> None:
    pose = solved(geometry, alpha)
    assert pose.distance_to_singularity == min(pose.clearances)
    assert pose.distance_to_singularity >= -1e-12


@settings(max_examples=60)
@given(geometry=legs(change=0.5))
def test_the_singularity_is_at_the_ends_of_the_arcs(geometry: KlannGeometry) -> None:
    leg = KlannLeg(geometry)
    arcs = leg.reachable_arcs()
    assume(arcs != [(0.0, 2 * math.pi)])
    for start, end in arcs:
        # The very end may be rounded out of reach.
        inside = min(1e-11, (end - start) / 4)
        for alpha in (start + inside, end - inside):
            assert abs(leg.closed_form(alpha).distance_to_singularity) <= 1e-9


@given(geometry=legs(), alpha=crank_angles, factor=st.sampled_from([0.001, 3.0, 1000.0]))
def test_scaled_lengths_scale_the_clearances(
    geometry: KlannGeometry, alpha: float, factor: float
) -> None:
    pose = solved(geometry, alpha)
    assume(pose.distance_to_singularity > 1e-9)
    numbers = {name: factor * getattr(geometry, name) for name in LENGTHS + COORDINATES}
    scaled = solved(replace(geometry, **numbers), alpha)
    expected = np.multiply(pose.clearances, factor)
    np.testing.assert_allclose(scaled.clearances, expected, rtol=1e-9, atol=1e-11 * factor)
