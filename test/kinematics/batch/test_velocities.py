"""Velocities, transmission angles and torques of many poses equal those of single poses."""

import math
from pathlib import Path
from typing import Any

from klann_ros.kinematics import (
    CrankAngleError,
    FourBar,
    klann_poses,
    KlannGeometry,
    KlannLeg,
    Leg,
    Linkage,
    linkage_from_file,
    linkage_poses,
    LinkageLeg,
    Reason,
    shipped_linkage,
    SingularPoseError,
    UnreachableError,
    Variants,
)
from klann_ros.kinematics.batch import blockwise
import numpy as np
import pytest
from sample_linkages import fresh, NAMES

ALPHAS = np.linspace(-7.0, 7.0, 211)
EVERYTHING = {'angles': True, 'points': True, 'transmission_angles': True, 'velocities': True}
FOLDER = Path(__file__).parents[1] / 'linkage'
WHERE = ['h_1', 'angles_1', 'points_1', 'transmission_angles']
ALL = [*WHERE, 'h', 'points', 'angles']


def _expected(leg: Leg[Any, Any], alpha: float) -> tuple[np.ndarray, float] | None:
    try:
        pose = leg.closed_form(alpha)
    except UnreachableError:
        return None
    motion = leg.velocity(pose, 1.0)
    values = [motion.h, motion.joints[1:], motion.points, pose.transmission_angles]
    values += [pose.h, pose.points, pose.x]
    # Near the end of an arc, not in a change point, everything is as large as it is uncertain.
    return np.concatenate([*map(np.ravel, values)]), 1e-12 / max(1e-3, min(pose.sines)) ** 2


# Dyads of pins, and of sliding joints.
@pytest.mark.parametrize(
    ('linkage', 'changes'),
    [
        (KlannGeometry().linkage, {'l_bc': [0.345, 0.35, -1.0]}),
        (linkage_from_file(FOLDER / 'press.yaml'), {'A-B': [0.9, 1.1, -1.0]}),
    ],
    ids=['klann', 'press'],
)
def test_many_linkages_have_each_their_own(linkage: Linkage, changes: Any) -> None:
    variants = Variants(linkage, changes)
    poses = linkage_poses(variants, ALPHAS, gradients=True, **EVERYTHING)
    for i in range(2):
        alone = linkage_poses(variants[i], ALPHAS, gradients=True, **EVERYTHING)
        for name, array in alone.arrays().items():
            np.testing.assert_allclose(poses.arrays()[name][i], array, rtol=0, atol=1e-12)
    assert (poses.reason[2] == Reason.REFUSED).all()
    assert all(np.isnan(array[2]).all() for array in poses.arrays().values())


# numba compiles a linkage for two seconds: pins, sliders, pins in slots, and coupled loops.
COMPILED = {'klann', 'slider_crank', 'quick_return', 'scotch_yoke', 'stephenson'}


@pytest.mark.parametrize('name', NAMES)
def test_each_is_that_of_the_leg(name: str) -> None:
    leg = fresh(name)
    expected = [_expected(leg, alpha) for alpha in ALPHAS.tolist()]
    n = len(leg.joint_names) - 1
    for kernel in ('numpy', 'numba') if name in COMPILED else ('numpy',):
        poses = linkage_poses(leg, ALPHAS, kernel=kernel, **EVERYTHING)
        columns = [np.reshape(getattr(poses, name), (len(ALPHAS), -1)) for name in ALL]
        for row, limits in zip(np.concatenate(columns, axis=1), expected, strict=True):
            if limits is None:
                assert np.isnan(row).all()
            else:
                leg_numbers, allowed = limits
                error = row - leg_numbers
                error[-n:] = np.remainder(error[-n:] + math.pi, 2 * math.pi) - math.pi
                assert (abs(error) <= allowed).all()


def test_a_singular_pose_has_no_velocity() -> None:
    bar = FourBar(2, 1, 2, 1, at_change_points='sign')
    poses = linkage_poses(bar, [0.0, 1.0, math.pi], velocities=True, transmission_angles=True)
    assert poses.reason.tolist() == [0, 0, 0]
    assert np.isnan(poses.h_1[:, 0]).tolist() == [True, False, True]
    assert not np.isnan(poses.transmission_angles).any()
    # Rounding decides beside it, too.
    for angle in (0.0, 3e-8):
        assert np.isnan(linkage_poses(bar, angle, velocities=True).h_1).all()
        with pytest.raises(SingularPoseError):
            bar.velocity(bar.closed_form(angle), 1.0)


def test_coupled_loops_that_do_not_converge_have_no_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blockwise, 'MAX_ITERATIONS', 1)
    poses = linkage_poses(shipped_linkage('stephenson'), ALPHAS)
    assert (poses.reason == Reason.LOOPS_1_OPEN).mean() > 0.9
    assert np.isnan(poses.h[poses.reason != 0]).all()


def test_the_torque_is_that_of_the_leg() -> None:
    leg = KlannLeg()
    force = (3.0, -40.0)
    poses = klann_poses(leg.geometry, ALPHAS, velocities=True)
    torques = poses.crank_torque(force)
    expected = [leg.crank_torque(leg.closed_form(alpha), force) for alpha in ALPHAS.tolist()]
    np.testing.assert_allclose(torques, expected, rtol=0, atol=1e-12)
    # A force of its own for each pose.
    many = np.stack([np.linspace(-1, 1, len(ALPHAS)), np.ones(len(ALPHAS))], axis=-1)
    np.testing.assert_allclose(
        poses.crank_torque(many), -(many * poses.h_1).sum(axis=-1), rtol=0, atol=1e-15
    )


def test_only_requested_quantities_are_present() -> None:
    poses = linkage_poses(KlannLeg(), ALPHAS)
    assert poses.h_1 is poses.angles_1 is poses.points_1 is poses.transmission_angles is None
    with pytest.raises(ValueError, match='velocities=True'):
        poses.crank_torque((0.0, 1.0))
    poses = linkage_poses(KlannLeg(), ALPHAS, velocities=True)
    assert poses.angles_1 is poses.points_1 is poses.angles is None
    assert not poses.h_1.flags.writeable
    with pytest.raises(ValueError, match=r'force is refused: its shape must be'):
        poses.crank_torque([1.0, 2.0, 3.0])


def test_any_shape_of_angles_and_none_at_all() -> None:
    poses = linkage_poses(KlannLeg(), ALPHAS[:210].reshape(2, 3, 35), **EVERYTHING)
    assert poses.points_1.shape == (2, 3, 35, 8, 2)
    assert linkage_poses(KlannLeg(), 1.0, velocities=True).h_1.shape == (2,)
    assert klann_poses([], [1.0, 2.0], **EVERYTHING).angles_1.shape == (0, 2, 4)
    assert linkage_poses([], [1.0], velocities=True).h_1.shape == (0, 1, 2)


@pytest.mark.parametrize('alphas', [np.zeros(3), [0.0, 1.0], (), range(3), np.zeros((2, 2))])
def test_one_angle_at_a_time_is_solved_and_the_error_names_the_bulk_solver(alphas: Any) -> None:
    for leg in (KlannLeg(), FourBar(0.18, 0.08, 0.2, 0.15), LinkageLeg(shipped_linkage('jansen'))):
        for call in (leg.solve, leg.closed_form):
            with pytest.raises(CrankAngleError) as caught:
                call(alphas)
            assert 'linkage_poses(leg, alphas)' in str(caught.value)
            assert 'klann_poses(geometry, alphas)' in str(caught.value)
