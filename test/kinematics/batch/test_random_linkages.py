"""The verdicts of `linkage_poses` on random linkages are those of single poses."""

from klann_ros.kinematics import (
    GeometryError,
    Linkage,
    linkage_from_text,
    linkage_poses,
    LinkageLeg,
    LoopsOpenError,
    reachable_arcs,
    Reason,
    shipped_linkage,
    tolerance_study,
    turns_fully,
    UnreachableError,
    Variants,
)
from klann_ros.kinematics.batch.results import open_loops, unreachable
from klann_ros.kinematics.batch.turn_clearance import turn_clearances
import numpy as np
import pytest
from random_linkages import random_linkage

both_kernels = pytest.mark.parametrize('kernel', ['numpy', 'numba'])
# The block of a slider-crank carries a rigid triangle: X-Y on the block, X-Z and Y-Z.
TRUSS = """
name: truss
pivots: {O: [0, 0], P: [0, 0]}
crank: crank
foot: Z
bodies:
  crank: {bars: [{from: O, to: A, length: 0.1}]}
  rod: {bars: [{from: A, to: X, length: 0.5}]}
  block:
    slides: {along: ground, from: P, to: X}
    bars: [{from: X, to: Y, length: 0.4, bend: 1.0}]
  left: {bars: [{from: X, to: Z, length: 0.3}]}
  right: {bars: [{from: Y, to: Z, length: 0.35}]}
start: {crank: 0.0, rod: 0.0, block: 0.6, left: 0.2, right: -0.8}
"""
ALPHAS = np.linspace(-7.0, 7.0, 25)


def varied(base: Linkage, seed: int, change: float = 0.15, count: int = 4) -> Variants:
    """Return linkages that differ in all numbers by some of them at most."""
    random = np.random.default_rng(seed)
    changes = {}
    for name, number in base.dimensions.items():
        changes[name] = number * (1.0 + random.uniform(-change, change, count))
    return Variants(base, changes)


def verdict(leg: LinkageLeg, alpha: float) -> int:
    """Return the reason of a single pose."""
    try:
        leg.closed_form(alpha)
    except UnreachableError as error:
        return unreachable(error.dyad, far=error.stretched)
    except LoopsOpenError as error:
        return open_loops(error.block)
    return Reason.SOLVED


def verdicts(variants: Variants, i: int) -> list[int]:
    """Return the reasons of one of some linkages, pose by pose."""
    try:
        leg = LinkageLeg(variants[i])
        return [verdict(leg, alpha) for alpha in ALPHAS.tolist()]
    except GeometryError:
        return [Reason.REFUSED] * len(ALPHAS)


# The foot of a seed's linkage may be on any body: other dyads then do not carry it.
@pytest.mark.slow
@pytest.mark.parametrize(
    ('kernel', 'coupled'), [('numpy', False), ('numba', False), ('numpy', True)]
)
def test_the_reasons_of_a_batch_are_those_of_single_poses(kernel: str, coupled: bool) -> None:
    solved = 0
    for seed in range(12):
        variants = varied(random_linkage(seed, coupled=coupled), seed)
        poses = linkage_poses(variants, ALPHAS, kernel=kernel)
        for i in range(len(variants)):
            assert poses.reason[i].tolist() == verdicts(variants, i), (seed, i)
        solved += int((poses.reason == Reason.SOLVED).sum())
        assert (np.isnan(poses.h[..., 0]) == (poses.reason != Reason.SOLVED)).all()
    assert solved > 100


@both_kernels
@pytest.mark.parametrize('name', ['trotbot', 'andrews'])
def test_a_dyad_that_does_not_carry_the_foot_decides_too(name: str, kernel: str) -> None:
    variants = varied(shipped_linkage(name), 0, 0.2, 10)
    reason = linkage_poses(variants, ALPHAS, kernel=kernel).reason
    assert 0 < np.count_nonzero(reason) < reason.size
    for i in range(len(variants)):
        assert reason[i].tolist() == verdicts(variants, i)


def test_all_numbers_of_a_pose_that_does_not_close_are_missing() -> None:
    variants = varied(shipped_linkage('andrews'), 0, 0.2, 10)
    options = {'angles': True, 'points': True, 'velocities': True, 'gradients': True}
    poses = linkage_poses(variants, ALPHAS, kernel='numpy', **options)
    is_open = poses.reason != Reason.SOLVED
    assert 0 < is_open.sum() < is_open.size
    for array in poses.arrays().values():
        missing = np.isnan(array).reshape(*is_open.shape, -1)
        assert (missing == is_open[..., None]).all()
    h = linkage_poses(variants, ALPHAS + 1e-6, kernel='numpy').h
    slope = (h - poses.h)[~is_open] / 1e-6
    np.testing.assert_allclose(slope, poses.h_1[~is_open], rtol=1e-3, atol=1e-6)


def test_a_study_counts_the_legs_that_jam_in_any_dyad() -> None:
    base = shipped_linkage('trotbot')
    study = tolerance_study(base, 0.06, samples=300, crank_angles=2)
    assert study.non_turning_fraction == pytest.approx(0.08, abs=0.03)
    assert (np.isnan(study.stride).mean()) == study.non_turning_fraction


def test_the_ends_of_a_dyad_that_stands_still_have_one_clearance() -> None:
    linkage = linkage_from_text(TRUSS, 'truss')
    assert reachable_arcs(linkage) == [(0.0, 2.0 * np.pi)]
    assert turns_fully(linkage)
    clearances = turn_clearances(Variants(linkage, {'X-Z': [0.3, 0.04, 0.76]}))
    # |X Y| = 0.4 within |0.3 - 0.35| and 0.3 + 0.35, and so on.
    np.testing.assert_allclose(clearances[:, 1], [0.25, -0.01, -0.01], atol=1e-15)
