"""Whole turns in bulk have the feet of single poses, and the extremes of all of them."""

from klann_ros.kinematics import linkage_poses, shipped_linkage, Variants
from klann_ros.kinematics.batch.turns import whole_turns
import numpy as np
import pytest

COUNT = 96
KERNELS = ['numpy', 'numba']


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize('name', ['klann', 'slider_crank'])
def test_a_turn_has_the_poses_of_the_batch(name: str, kernel: str) -> None:
    legs = random_legs(name, 400)
    turns = whole_turns(legs, COUNT, box=True, kernel=kernel)
    poses = linkage_poses(legs, alphas(COUNT), velocities=True, points=True, kernel='numpy')
    assert np.array_equal(turns.missing, (poses.reason != 0).mean(axis=1))
    assert np.count_nonzero(turns.missing == 0.0) > 0
    for of_turns, of_batch in ((turns.h, poses.h), (turns.h_1, poses.h_1)):
        expected = np.moveaxis(of_batch, 2, 0)
        assert np.allclose(of_turns, expected, rtol=1e-7, atol=1e-10, equal_nan=True)
    turning = np.flatnonzero(turns.missing == 0.0)
    expected = np.ptp(poses.points[turning], axis=(1, 2)).T
    assert np.allclose(turns.box[:, turning], expected, rtol=1e-9)


@pytest.mark.parametrize('kernel', KERNELS)
def test_the_worst_transmission_angle_is_that_of_many_more_angles(kernel: str) -> None:
    legs = random_legs('klann', 200)
    turns = whole_turns(legs, COUNT, kernel=kernel)
    turning = np.flatnonzero(turns.missing == 0.0)
    dense = linkage_poses(legs, alphas(20 * COUNT), transmission_angles=True).transmission_angles
    worst = np.minimum(dense, np.pi - dense)[turning].min(axis=(1, 2))
    # Legs that jam between the angles have NaN.
    is_finite = np.isfinite(worst)
    assert np.count_nonzero(is_finite) > 50
    assert np.abs(turns.transmission_angle[turning] - worst)[is_finite].max() < 2e-3


@pytest.mark.parametrize('kernel', KERNELS)
def test_a_singular_pose_has_no_derivative_in_a_turn(kernel: str) -> None:
    # A parallelogram is in line at 0 and at half a turn; up to there its coupler is translated.
    changes = {'O4.x': [0.18], 'O2-A': [0.08], 'A-B': [0.18], 'O4-B': [0.08]}
    four_bar = shipped_linkage('four_bar')
    # Along the tangent it is translated all the way round.
    turns = whole_turns(Variants(four_bar, changes), COUNT, kernel=kernel)
    assert np.hypot(*turns.h_1)[0] == pytest.approx(0.08, rel=1e-9)
    variants = Variants(four_bar.at_every_change_point('sign'), changes)
    turns = whole_turns(variants, COUNT, kernel=kernel)
    assert turns.transmission_angle[0] < 1e-6
    speed = np.hypot(*turns.h_1)[0]
    half = COUNT // 2
    assert np.flatnonzero(np.isnan(speed)).tolist() == [0, half]
    assert speed[1:half] == pytest.approx(0.08, rel=1e-6)


def random_legs(name: str, count: int) -> Variants:
    linkage = shipped_linkage(name)
    random = np.random.default_rng(5)
    changes = {
        dimension: value * random.uniform(0.85, 1.15, count)
        for dimension, value in linkage.dimensions.items()
    }
    return Variants(linkage, changes)


def alphas(count: int) -> np.ndarray:
    return np.arange(count) * (2.0 * np.pi / count)
