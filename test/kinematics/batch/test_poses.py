"""`klann_poses`: the closed form's numbers, in the shapes that were asked for."""

from dataclasses import replace
import math
import tracemalloc

from klann_ros.kinematics import klann_poses, KlannGeometry, KlannLeg, Reason
from klann_ros.kinematics.batch.dyads import BLOCK_SIZE
import numpy as np
import pytest

KERNELS = ['numpy', 'numba']
SEM104, PATENT = KlannGeometry.sem104(), KlannGeometry.patent()
# Its crank does not turn fully.
STUCK = replace(SEM104, l_bc=0.33)
both_kernels = pytest.mark.parametrize('kernel', KERNELS)


def test_half_a_turn_is_plus_pi() -> None:
    # At a crank angle of 0 dyad 1 is stretched out along the x axis: B, C, D from left to right.
    for sign in (1, -1):
        geometry = KlannGeometry(
            l_ab=0.25,
            x_d=1.0,
            y_a=0.0,
            l_bc=0.5,
            l_dc=0.25,
            x_e=0.75,
            y_e=0.25,
            assembly=(sign, 1),
        )
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
    poses = klann_poses(geometry, [0.0, 1e-300, 1.0], kernel=kernel)
    assert poses.reason[0] == poses.reason[1] == Reason.DYAD_1_TOO_CLOSE
    assert poses.reason[2] != Reason.DYAD_1_TOO_CLOSE
    assert np.isnan(poses.h[:2]).all()


@both_kernels
@pytest.mark.parametrize('shape', [(), (0,), (1,), (7,), (2, 3), (3, 0, 2), (2, 3, 4)])
@pytest.mark.parametrize('count', [None, 0, 1, 2, 50])
def test_the_shape_is_that_of_legs_and_angles(
    count: int | None, shape: tuple[int, ...], kernel: str
) -> None:
    alphas = np.linspace(0.0, 7.0, math.prod(shape)).reshape(shape)
    geometries = [SEM104, PATENT, STUCK] * 17
    given = SEM104 if count is None else geometries[:count]
    poses = klann_poses(given, alphas, angles=True, points=True, kernel=kernel)
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
    whole = klann_poses(STUCK, alphas, angles=True, kernel=kernel)
    for k in (0, BLOCK_SIZE - 2, count // 2, count - 1):
        alone = klann_poses(STUCK, alphas[k], angles=True, kernel=kernel)
        np.testing.assert_array_equal(whole.h[k], alone.h)
        np.testing.assert_array_equal(whole.angles[k], alone.angles)
        assert whole.reason[k] == alone.reason
    many = klann_poses([STUCK] * count, alphas[:2], kernel=kernel)
    np.testing.assert_array_equal(many.h, np.broadcast_to(whole.h[:2], (count, 2, 2)))
    np.testing.assert_array_equal(many.reason, np.broadcast_to(whole.reason[:2], (count, 2)))


@both_kernels
def test_progress_is_reported_to_the_end(kernel: str) -> None:
    calls: list[tuple[int, int]] = []
    klann_poses(
        [SEM104, STUCK],
        np.zeros(3 * BLOCK_SIZE),
        progress=lambda *now: calls.append(now),
        kernel=kernel,
    )
    done = [now[0] for now in calls]
    assert len(done) > 3
    assert done == sorted(set(done))
    assert {now[1] for now in calls} == {6 * BLOCK_SIZE}
    assert calls[-1] == (6 * BLOCK_SIZE, 6 * BLOCK_SIZE)


@both_kernels
def test_memory_does_not_grow_with_the_poses(kernel: str) -> None:
    alphas, out = np.linspace(0.0, 100.0, 400_000), np.empty((400_000, 2))
    klann_poses(STUCK, alphas[:1], kernel=kernel)

    def beyond_results(count: int) -> int:
        tracemalloc.start()
        poses = klann_poses(STUCK, alphas[:count], out=out[:count], kernel=kernel)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak - poses.reason.nbytes

    assert beyond_results(400_000) < 2_000_000
    assert beyond_results(400_000) < 1.1 * beyond_results(100_000)
