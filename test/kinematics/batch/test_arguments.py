"""`klann_poses`: what it takes, what it refuses, and where it puts its results."""

from dataclasses import replace
from fractions import Fraction

from klann_ros.kinematics import klann_poses, KlannGeometry, KlannLeg
from klann_ros.kinematics.batch.dyads import BLOCK_SIZE
import numpy as np
import pytest

SEM104, PATENT = KlannGeometry.sem104(), KlannGeometry.patent()
# Its crank does not turn fully.
STUCK = replace(SEM104, l_bc=0.33)
both_kernels = pytest.mark.parametrize('kernel', ['numpy', 'numba'])


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
    before = alphas.copy()
    poses = klann_poses(SEM104, alphas, angles=True, points=True)
    assert not any(
        array.flags.writeable for array in (poses.h, poses.reason, poses.angles, poses.points)
    )
    np.testing.assert_array_equal(alphas, before)
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


@pytest.mark.parametrize('geometries', [None, 3.0, [SEM104, None], KlannLeg(), {'l_ab': 1.0}])
def test_geometries_must_be_geometries(geometries: object) -> None:
    with pytest.raises(TypeError, match='is refused: it must be a KlannGeometry'):
        klann_poses(geometries, 1.0)
