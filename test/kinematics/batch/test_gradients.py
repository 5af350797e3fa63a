"""Derivatives by every dimension: differences of poses, and two methods that agree."""

from collections.abc import Callable
import copy
import math

from klann_ros.kinematics import (
    FourBar,
    klann_poses,
    KlannGeometry,
    KlannLeg,
    linkage_poses,
    LinkagePoses,
    shipped_linkage,
    shipped_linkages,
    SingularPoseError,
    Variants,
)
import numpy as np
import pytest
from sample_linkages import fresh, NAMES

ALPHAS = np.linspace(0.1, 6.3, 57)
STEP = 1e-6
EVERYTHING = dict.fromkeys(['angles', 'points', 'transmission_angles', 'gradients'], True)


def check_differences(
    poses: LinkagePoses,
    foot: int,
    changed: Callable[[str, float], LinkagePoses],
    where: np.ndarray | bool = True,
) -> None:
    """Compare derivatives with central differences, away from singular poses."""
    np.testing.assert_array_equal(poses.h_gradient, poses.points_gradient[..., foot, :, :])
    regular = (np.sin(poses.transmission_angles) > 0.1).all(axis=-1) & (poses.reason == 0)
    regular &= where
    assert regular.mean() > 0.1
    for k, name in enumerate(poses.dimension_names):
        up, down = (changed(name, step) for step in (STEP, -STEP))
        for quantity in ('angles', 'points'):
            slopes = (getattr(up, quantity) - getattr(down, quantity))[regular] / (2.0 * STEP)
            turn = math.pi / STEP
            # Across the end of (-pi, pi] an angle changes by a whole turn.
            slopes -= turn * np.round(slopes / turn) if quantity == 'angles' else 0.0
            gradient = getattr(poses, f'{quantity}_gradient')[regular][..., k]
            np.testing.assert_allclose(gradient, slopes, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize('name', shipped_linkages())
def test_they_are_differences_of_poses(name: str) -> None:
    linkage = shipped_linkage(name)
    poses = linkage_poses(linkage, ALPHAS, **EVERYTHING)
    assert poses.dimension_names == tuple(linkage.dimensions)

    def changed(name: str, step: float) -> LinkagePoses:
        varied = linkage.varied({name: linkage.dimensions[name] + step})
        return linkage_poses(varied, ALPHAS, angles=True, points=True)

    # Other dimensions have no change points: their signs stay, from the start on.
    signs = [linkage.signs(alpha) for alpha in ALPHAS.tolist()]
    where = np.array([sign == linkage.assembly for sign in signs])
    if linkage.change_points:
        where &= (np.sin(poses.transmission_angles) > 0.3).all(axis=-1)
    check_differences(poses, linkage.foot, changed, where)


def test_they_are_differences_for_500_random_legs() -> None:
    base = KlannGeometry.sem104().linkage
    rng = np.random.default_rng(7)
    numbers = {name: v * rng.uniform(0.8, 1.2, 500) for name, v in base.dimensions.items()}

    def changed(name: str, step: float) -> LinkagePoses:
        other = Variants(base, {**numbers, name: numbers[name] + step})
        return linkage_poses(other, [2.5], angles=True, points=True)

    poses = linkage_poses(Variants(base, numbers), [2.5], **EVERYTHING)
    check_differences(poses, base.foot, changed)


@pytest.mark.parametrize('name', NAMES)
def test_one_pose_has_the_same(name: str) -> None:
    leg = fresh(name)
    poses = linkage_poses(leg, ALPHAS, angles=True, gradients=True)
    for k in np.flatnonzero(np.isfinite(poses.h_gradient[:, 0, 0]))[::9]:
        pose = leg.closed_form(ALPHAS[k])
        gradient = leg.gradient(pose)
        assert gradient.dimension_names == poses.dimension_names
        allowed = 1e-10 / min(pose.sines) ** 3
        for quantity in ('angles_gradient', 'h_gradient'):
            expected = getattr(poses, quantity)[k]
            np.testing.assert_allclose(getattr(gradient, quantity), expected, atol=allowed)
    again = copy.deepcopy(leg)
    np.testing.assert_array_equal(again.gradient(pose).h_gradient, gradient.h_gradient)


def test_a_singular_pose_has_no_gradient() -> None:
    bar = FourBar(0.1, 0.05, 0.1, 0.05)
    with pytest.raises(SingularPoseError):
        bar.gradient(bar.closed_form(0.0))
    with pytest.raises(ValueError, match='another linkage'):
        bar.gradient(KlannLeg().solve(1.0))


@pytest.mark.parametrize('name', ['klann', 'jansen', 'quick_return', 'stephenson', 'trotbot'])
def test_those_of_the_velocity_are_their_slopes(name: str) -> None:
    linkage = shipped_linkage(name)
    step = 1e-5
    poses = linkage_poses(linkage, ALPHAS, velocities=True, gradients=True)
    up, down = (linkage_poses(linkage, ALPHAS + s, gradients=True) for s in (step, -step))
    slopes = (up.h_gradient - down.h_gradient) / (2.0 * step)
    size = 1.0 + np.nanmax(np.abs(slopes))
    np.testing.assert_allclose(poses.h_1_gradient, slopes, rtol=0, atol=1e-7 * size)


def test_a_singular_pose_and_an_unreachable_one_have_none() -> None:
    poses = linkage_poses(shipped_linkage('chebyshev'), ALPHAS, gradients=True)
    gone = poses.reason != 0
    assert gone.any()
    assert np.isnan(poses.h_gradient[gone]).all()
    assert np.isfinite(poses.h_gradient[~gone]).all()
    folded = linkage_poses(FourBar(0.1, 0.05, 0.1, 0.05), [0.0, 1.0], gradients=True)
    assert np.isnan(folded.h_gradient).all(axis=(1, 2)).tolist() == [True, False]


def test_unrequested_gradients_are_absent() -> None:
    poses = klann_poses(KlannGeometry(), ALPHAS, gradients=True)
    assert poses.angles_gradient is poses.points_gradient is poses.h_1_gradient is None
    assert not poses.h_gradient.flags.writeable
    assert klann_poses(KlannGeometry(), ALPHAS).dimension_names == ()
