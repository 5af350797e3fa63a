"""`klann_poses`: what it takes and refuses, and the numbers and shapes of its results."""

from dataclasses import replace
from fractions import Fraction
import math
import tracemalloc
from typing import Any

from hypothesis import given, settings, strategies as st
from klann_ros.kinematics import (
    KinematicsError,
    klann_poses,
    KlannGeometry,
    KlannLeg,
    Leg,
    linkage_poses,
    Reason,
)
from klann_ros.kinematics.batch.dyads import BLOCK_SIZE
from klann_ros.kinematics.batch.poses import feet, loop_errors
import numpy as np
import pytest
from sample_linkages import KNOWN, legs, NAMES

KERNELS = ['numpy', 'numba']
SEM104 = KlannGeometry.sem104()
PATENT = KlannGeometry.patent()
# Its crank does not turn fully.
STUCK = replace(SEM104, l_bc=0.33)
both_kernels = pytest.mark.parametrize('kernel', KERNELS)


def test_half_a_turn_is_plus_pi() -> None:
    # At a crank angle of 0 dyad 1 is stretched out along the x axis: B, C, D from left to right.
    for sign in (1, -1):
        lengths = {'l_ab': 0.25, 'l_bc': 0.5, 'l_dc': 0.25}
        pivots = {'x_d': 1.0, 'y_a': 0.0, 'x_e': 0.75, 'y_e': 0.25}
        geometry = KlannGeometry(**lengths, **pivots, assembly=(sign, 1))
        poses = klann_poses(geometry, [0.0, -0.0], angles=True)
        assert poses.reason.tolist() == [0, 0]
        np.testing.assert_array_equal(poses.angles[:, :2], [[0.0, math.pi]] * 2)


@both_kernels
@pytest.mark.parametrize('alpha', [math.nan, math.inf, -math.inf, 1e6 + 1e-9, -1e300])
def test_only_crank_angles_up_to_the_limit_have_a_pose(alpha: float, kernel: str) -> None:
    poses = klann_poses(SEM104, [1e6, alpha, -1e6], angles=True, points=True, kernel=kernel)
    assert poses.reason.tolist() == [Reason.SOLVED, Reason.CRANK_ANGLE, Reason.SOLVED]
    expected = [KlannLeg().closed_form(limit).h for limit in (1e6, -1e6)]
    np.testing.assert_allclose(poses.h[::2], expected, atol=1e-14)
    for array in (poses.h, poses.angles, poses.points):
        assert np.isnan(array[1]).all()


@both_kernels
def test_ends_that_coincide_are_too_close(kernel: str) -> None:
    geometry = KlannGeometry(l_ab=0.1, x_d=0.1, y_a=0.0, l_bc=0.35, l_dc=0.35)
    linkage = geometry.linkage.at_every_change_point('sign')
    poses = linkage_poses(linkage, [0.0, 1e-300, 1.0], kernel=kernel)
    assert poses.reason[0] == poses.reason[1] == Reason.DYAD_1_TOO_CLOSE
    assert poses.reason[2] != Reason.DYAD_1_TOO_CLOSE
    assert np.isnan(poses.h[:2]).all()


@both_kernels
@pytest.mark.parametrize('shape', [(), (0,), (1,), (7,), (2, 3), (3, 0, 2), (2, 3, 4)])
@pytest.mark.parametrize('count', [None, 0, 1, 2, 50])
def test_shapes_are_of_legs_and_angles(
    count: int | None, shape: tuple[int, ...], kernel: str
) -> None:
    alphas = np.linspace(0.0, 7.0, math.prod(shape)).reshape(shape)
    geometries = [SEM104, PATENT, STUCK] * 17
    legs = SEM104 if count is None else geometries[:count]
    poses = klann_poses(legs, alphas, angles=True, points=True, kernel=kernel)
    leading = shape if count is None else (count, *shape)
    assert poses.h.shape == (*leading, 2)
    assert poses.reason.shape == leading
    assert poses.reason.dtype == np.uint8
    assert poses.angles.shape == (*leading, 4)
    assert poses.points.shape == (*leading, 8, 2)
    for i, geometry in enumerate(geometries[: count or 0]):
        alone = klann_poses(geometry, alphas, angles=True, points=True, kernel=kernel)
        for name in ('h', 'reason', 'angles', 'points'):
            np.testing.assert_array_equal(getattr(poses, name)[i], getattr(alone, name))


@both_kernels
@pytest.mark.parametrize('count', [BLOCK_SIZE - 1, BLOCK_SIZE, BLOCK_SIZE + 1, 2 * BLOCK_SIZE + 3])
def test_where_blocks_end_does_not_matter(count: int, kernel: str) -> None:
    alphas = np.linspace(-9.0, 9.0, count)
    poses = klann_poses(STUCK, alphas, angles=True, kernel=kernel)
    for k in (0, BLOCK_SIZE - 2, count // 2, count - 1):
        alone = klann_poses(STUCK, alphas[k], angles=True, kernel=kernel)
        np.testing.assert_array_equal(poses.h[k], alone.h)
        np.testing.assert_array_equal(poses.angles[k], alone.angles)
        assert poses.reason[k] == alone.reason
    repeated = klann_poses([STUCK] * count, alphas[:2], kernel=kernel)
    np.testing.assert_array_equal(repeated.h, np.broadcast_to(poses.h[:2], (count, 2, 2)))
    np.testing.assert_array_equal(repeated.reason, np.broadcast_to(poses.reason[:2], (count, 2)))


@both_kernels
def test_progress_is_reported_to_the_end(kernel: str) -> None:
    calls: list[tuple[int, int]] = []
    alphas = np.zeros(3 * BLOCK_SIZE)
    klann_poses([SEM104, STUCK], alphas, progress=lambda *now: calls.append(now), kernel=kernel)
    assert len(calls) > 3
    assert calls == sorted(set(calls))
    assert {total for _, total in calls} == {6 * BLOCK_SIZE}
    assert calls[-1] == (6 * BLOCK_SIZE, 6 * BLOCK_SIZE)


@both_kernels
def test_memory_does_not_grow_with_the_poses(kernel: str) -> None:
    alphas = np.linspace(0.0, 100.0, 400_000)
    out = np.empty((400_000, 2))
    klann_poses(STUCK, alphas[:1], kernel=kernel)

    def beyond_results(count: int) -> int:
        tracemalloc.start()
        poses = klann_poses(STUCK, alphas[:count], out=out[:count], kernel=kernel)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak - poses.reason.nbytes

    assert beyond_results(400_000) < 2_000_000
    assert beyond_results(400_000) < 1.1 * beyond_results(100_000)


@pytest.mark.parametrize(
    'alphas',
    [
        [1, 2],
        (1.0, Fraction(2)),
        np.array([1, 2], dtype=np.int8),
        np.array([1.0, 2.0], dtype=np.float32),
        np.array([1.0, 2.0], dtype=np.longdouble),
        np.array([1.0, 2.0], dtype='>f8'),
        np.array([2.0, 9.0, 1.0])[::-2],
        range(1, 3),
    ],
)
def test_every_kind_of_real_numbers_is_taken(alphas: object) -> None:
    expected = klann_poses(SEM104, np.array([1.0, 2.0])).h
    np.testing.assert_array_equal(klann_poses(SEM104, alphas).h, expected)


def test_any_iterable_of_geometries_is_taken() -> None:
    expected = klann_poses([SEM104, PATENT], 1.0).h
    np.testing.assert_array_equal(klann_poses(iter((SEM104, PATENT)), 1.0).h, expected)


def test_the_results_are_read_only_and_the_input_is_left_alone() -> None:
    alphas = np.linspace(0.0, 1.0, 5)
    original = alphas.copy()
    poses = klann_poses(SEM104, alphas, angles=True, points=True)
    for array in (poses.h, poses.reason, poses.angles, poses.points):
        assert not array.flags.writeable
    np.testing.assert_array_equal(alphas, original)
    assert alphas.flags.writeable


@both_kernels
@pytest.mark.parametrize('count', [None, 3])
def test_out_is_filled_and_returned(count: int | None, kernel: str) -> None:
    alphas = np.linspace(0.0, 6.0, 12).reshape(3, 4)
    geometries = STUCK if count is None else [STUCK] * count
    shape = (3, 4, 2) if count is None else (count, 3, 4, 2)
    out = np.full(shape, 7.0)
    poses = klann_poses(geometries, alphas, out=out, kernel=kernel)
    assert poses.h is out
    assert out.flags.writeable
    np.testing.assert_array_equal(out, klann_poses(geometries, alphas, kernel=kernel).h)


@both_kernels
def test_out_may_be_a_view(kernel: str) -> None:
    alphas = np.linspace(0.0, 6.0, 100)
    expected = klann_poses([STUCK, SEM104], alphas, kernel=kernel).h
    table = np.full((2, 200, 5), 7.0)
    klann_poses([STUCK, SEM104], alphas, out=table[:, ::-2, 3:0:-2], kernel=kernel)
    np.testing.assert_array_equal(table[:, ::-2, 3:0:-2], expected)
    assert (table[:, ::2] == 7.0).all()
    assert (table[:, :, ::2] == 7.0).all()


def test_out_may_overwrite_the_crank_angles() -> None:
    alphas = np.linspace(0.0, 6.0, 3 * BLOCK_SIZE)
    expected = klann_poses(SEM104, alphas).h
    table = np.empty((alphas.size, 2))
    table[:, 1] = alphas
    np.testing.assert_array_equal(klann_poses(SEM104, table[:, 1], out=table).h, expected)


THREE = [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ('alphas', 'out', 'text'),
    [
        (THREE, np.empty((4, 2)), r'out is refused: its shape must be \(3, 2\), not \(4, 2\)'),
        (THREE, np.empty((2, 3)), r'out is refused: its shape must be \(3, 2\)'),
        (THREE, np.empty((3, 2), dtype=np.float32), 'an array of float64, not float32'),
        (THREE, np.empty((3, 2), dtype='>f8'), 'out is refused: .* an array of float64'),
        (THREE, [[0.0, 0.0]] * 3, 'an array of float64, not list'),
        (THREE, np.broadcast_to(0.0, (3, 2)), 'it is read-only'),
        (np.zeros((3, 4)), np.empty((4, 5, 2))[:3, :4], 'its strides .* without a copy'),
        *(
            (alphas, None, '^alphas is refused: it must be an array of real numbers')
            for alphas in (
                '1.0', ['1', '2'], [1j], [True], [[1.0], [1.0, 2.0]], [10**400], object(),
            )
        ),
    ],
)  # fmt: skip
def test_invalid_arrays_are_refused(alphas: object, out: object, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        klann_poses(SEM104, alphas, out=out)


@settings(max_examples=2 * len(NAMES))
@given(leg=legs(), data=st.data())
def test_loops_are_those_of_the_leg(leg: Leg[Any, Any], data: st.DataObject) -> None:
    n = len(leg.joint_names)
    row = st.lists(st.floats(-7.0, 7.0), min_size=n, max_size=n)
    given_angles = np.array(data.draw(st.lists(row, min_size=1, max_size=5)))
    expected = [np.linalg.norm(leg.f(alpha, x)) for alpha, *x in given_angles.tolist()]
    limit = 1e-13 * max(1.0, *expected)
    np.testing.assert_allclose(loop_errors(leg, given_angles), expected, atol=limit)


@pytest.mark.parametrize('name', NAMES)
def test_feet_of_solved_poses_are_theirs(name: str) -> None:
    leg = KNOWN[name]
    poses = []
    for alpha in np.linspace(-4.0, 4.0, 41):
        try:
            poses.append(leg.closed_form(alpha))
        except KinematicsError:
            continue
    assert len(poses) > 5
    given_angles = np.array([[pose.crank_angle, *pose.x] for pose in poses])
    np.testing.assert_allclose(feet(leg, given_angles), [pose.h for pose in poses], atol=1e-12)
    assert loop_errors(leg, given_angles).max() < 1e-9


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_an_angle_that_is_not_finite_gives_nan(name: str, value: float) -> None:
    leg = KNOWN[name]
    given_angles = np.zeros((2, len(leg.joint_names)))
    given_angles[1, :] = value
    assert np.isnan(loop_errors(leg, given_angles)).tolist() == [False, True]
    assert np.isnan(feet(leg, given_angles)).any(axis=1).tolist() == [False, True]
