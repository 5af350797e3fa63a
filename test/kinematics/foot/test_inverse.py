"""Which crank angles put the foot where it is wanted: all of them, and no others."""

import math
from typing import Any

from hypothesis import assume, given, settings, strategies as st
from klann_ros.kinematics import foot_path, klann_poses, KlannGeometry, KlannLeg
from klann_ros.kinematics.foot.inverse import distinct
from klann_ros.kinematics.foot.track import Y
import numpy as np
import pytest
from strategies import legs

PRESETS = [KlannGeometry.sem104(), KlannGeometry.patent()]
TURN = 2 * math.pi
fractions = st.floats(0.0, 1.0)


def reachable(leg: KlannLeg, progress: float) -> float:
    """Return the crank angle that is `progress` (0 .. 1) of the way through all reachable arcs."""
    arcs = leg.reachable_arcs()
    arc = min(int(progress * len(arcs)), len(arcs) - 1)
    share = progress * len(arcs) - arc
    start, end = arcs[arc]
    return start + (end - start) * (0.001 + 0.998 * share)


def apart(alpha: float, beta: float) -> float:
    return abs(math.remainder(alpha - beta, TURN))


def test_0_and_a_turn_are_one_angle() -> None:
    assert distinct([TURN - 1e-13, 1.0, 0.0, 1.0 + 1e-13]) == [0.0, 1.0]


@pytest.mark.slow
@settings(max_examples=30)
@given(geometry=legs(), progress=fractions, axis=st.sampled_from([0, 1]))
def test_the_angles_of_a_foots_coordinate_hold_its_own_and_are_as_many_as_its_crossings(
    geometry: KlannGeometry, progress: float, axis: int
) -> None:
    leg = KlannLeg(geometry)
    path = foot_path(leg)
    pose = leg.solve(reachable(leg, progress))
    coordinate = pose.h[axis]
    assume(abs(leg.velocity(pose, 1.0).h[axis]) > 1e-3)
    angles = (path.crank_angles_at_x, path.crank_angles_at_height)[axis](coordinate)
    assert min(apart(angle, pose.alpha) for angle in angles) <= 1e-10
    assert angles == sorted(angles)
    assert all(0.0 <= angle < TURN for angle in angles)
    for angle in angles:
        # The last digit of a crank angle moves the foot that much.
        solution = leg.solve(angle)
        limit = 1e-10 + 1e-14 / min(solution.sines) ** 2
        assert solution.h[axis] == pytest.approx(coordinate, abs=limit)
    feet = klann_poses(geometry, np.arange(4001) * (TURN / 4000)).h[:, axis]
    # Not near an extreme, where samples cannot tell.
    inner = feet[1:-1]
    extremes = inner[(inner - feet[:-2]) * (feet[2:] - inner) <= 0.0]
    if path.full_turn and abs(extremes - coordinate).min(initial=1.0) > 1e-3:
        assert len(angles) == np.count_nonzero((feet[1:] > coordinate) != (feet[:-1] > coordinate))


@pytest.mark.parametrize('geometry', [*PRESETS, KlannGeometry(l_bc=0.33)])
def test_an_extreme_gives_its_one_angle_and_none_beyond(geometry: KlannGeometry) -> None:
    leg = KlannLeg(geometry)
    path = foot_path(leg)
    for axis, (crank_angles_at, (low, high)) in enumerate(
        [(path.crank_angles_at_x, path.x_range), (path.crank_angles_at_height, path.y_range)]
    ):
        for end in (low, high):
            (angle,) = crank_angles_at(end)
            assert leg.solve(angle).h[axis] == pytest.approx(end, abs=1e-15)
        assert crank_angles_at(low - 1e-12) == crank_angles_at(high + 1e-12) == []


def test_the_ends_of_an_arc_are_included() -> None:
    leg = KlannLeg(KlannGeometry(l_bc=0.33))
    path = foot_path(leg)
    for k, end in ((0, path.arcs[0][0]), (-1, path.arcs[0][1])):
        angles = path.crank_angles_at_x(path.h[k, 0])
        assert min(apart(angle, end) for angle in angles) <= 1e-11
        for angle in angles:
            leg.solve(angle)


def test_an_ellipse_gives_the_arc_cosines(ellipse: Any) -> None:
    path = foot_path(ellipse(0.5, 0.25))
    for x in (-0.49, -0.2, 0.0, 0.3, 0.499999):
        alpha = math.acos(x / 0.5)
        assert path.crank_angles_at_x(1.0 + x) == pytest.approx([alpha, TURN - alpha], abs=1e-12)
    assert path.crank_angles_at_x(1.5) == pytest.approx([0.0], abs=1e-12)
    assert path.crank_angles_at_height(-2.0) == pytest.approx([0.0, math.pi], abs=1e-12)


def test_two_extremes_between_two_samples_are_found(wavy: Any) -> None:
    # x = sin u (1 + k cos u) is 0 at u = 0 and pi, and for k > 1 at cos u = -1/k as well.
    few = foot_path(wavy(0.9995), samples=32)
    assert few.crank_angles_at_x(0.0) == pytest.approx([0.1, math.pi + 0.1], abs=1e-5)
    many = foot_path(wavy(1.0005), samples=32)
    u = math.acos(-1 / 1.0005)
    expected = [0.1, u + 0.1, math.pi + 0.1, TURN - u + 0.1]
    assert many.crank_angles_at_x(0.0) == pytest.approx(expected, abs=1e-9)


def test_a_singular_end_is_solved_to_the_last_digits(half_circle: Any) -> None:
    path = foot_path(half_circle)
    for y in (1e-3, 0.1, 0.4999):
        alpha = math.sqrt(0.25 - y * y)
        expected = sorted([6.0 - alpha, (6.0 + alpha) % TURN])
        assert path.crank_angles_at_height(y) == pytest.approx(expected, abs=1e-12)


def test_the_second_derivative_along_an_arc_is_the_slope_of_the_first(half_circle: Any) -> None:
    (track,) = foot_path(half_circle)._tracks
    for t in (0.5, 1.2, 2.0):
        up, down = (track.value_t(Y, t + step, 1) for step in (1e-5, -1e-5))
        assert track.value_t(Y, t, 2) == pytest.approx((up - down) / 2e-5, rel=1e-6)


@settings(max_examples=20)
@given(geometry=legs(), progress=fractions, x=st.floats(-2.0, 2.0), y=st.floats(-2.0, 2.0))
def test_the_nearest_angle_of_a_foot_is_its_own_and_no_sample_is_nearer_to_a_point(
    geometry: KlannGeometry, progress: float, x: float, y: float
) -> None:
    leg = KlannLeg(geometry)
    path = foot_path(leg)
    pose = leg.solve(reachable(leg, progress))
    nearest = path.nearest_crank_angle((x, y))
    assert nearest.distance <= np.hypot(*(path.h - (x, y)).T).min() + 1e-12
    # Near the end of an arc the last digit of the angle counts.
    foot = leg.solve(nearest.alpha)
    limit = 1e-12 + 1e-14 / max(1e-8, min(foot.sines))
    assert math.dist(foot.h, (x, y)) == pytest.approx(nearest.distance, abs=limit)
    assume(min(pose.sines) > 1e-3)
    assume(math.hypot(*leg.velocity(pose, 1.0).h) > 1e-3)
    at_foot = path.nearest_crank_angle(pose.h)
    assert at_foot.distance <= 1e-12
    assert min(apart(tie, pose.alpha) for tie in at_foot.ties) <= 1e-9
    assert at_foot.alpha == at_foot.ties[0]


def test_all_ties_are_returned(ellipse: Any) -> None:
    path = foot_path(ellipse(0.5, 0.25))
    nearest = path.nearest_crank_angle((1.0, -2.0))
    assert nearest.distance == pytest.approx(0.25, abs=1e-15)
    assert nearest.ties == pytest.approx((math.pi / 2, 3 * math.pi / 2), abs=1e-9)
    assert path.nearest_crank_angle((3.0, -2.0)).distance == pytest.approx(1.5, abs=1e-15)
