"""The two kernels, and how one is chosen."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

from klann_ros import kinematics
from klann_ros.kinematics import klann_poses, KlannGeometry, linkage_poses, shipped_linkage
from klann_ros.kinematics.batch import kernels
import numpy as np
import pytest

PACKAGE = Path(kinematics.__file__).parents[1]
# Several results, whose order in the source must not depend on the hashes.
SOLVE = """
import sys
from klann_ros.kinematics import klann_poses, KlannGeometry
loaded = 'numba' in sys.modules
poses = klann_poses(KlannGeometry(), [0.0], kernel='numba', angles=True, velocities=True)
print(loaded, 'numba' in sys.modules, poses.h[0].tolist())
"""
SOLVED = 'False True [0.92382725'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a copy of the package."""
    ignore = shutil.ignore_patterns('__pycache__')
    for name in ('kinematics', 'sanitize'):
        shutil.copytree(PACKAGE / name, tmp_path / 'klann_ros' / name, ignore=ignore)
    for name in ('__init__.py', 'lazy_face.py'):
        shutil.copy(PACKAGE / name, tmp_path / 'klann_ros')
    return tmp_path


def solve(folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run the script with the package in a folder."""
    return subprocess.run(
        [sys.executable, '-c', SOLVE],
        check=False,
        capture_output=True,
        text=True,
        cwd=folder,
        env=os.environ | {'PYTHONPATH': str(folder), **variables},
    )


def test_both_kernels_agree_to_the_last_digits_on_the_course_leg() -> None:
    alphas = np.linspace(-20.0, 20.0, 10_001)
    numpy = klann_poses(KlannGeometry(), alphas, kernel='numpy').h
    numba = klann_poses(KlannGeometry(), alphas, kernel='numba').h
    np.testing.assert_allclose(numpy, numba, rtol=0, atol=4 * np.spacing(1.0))


def test_both_kernels_have_the_same_gradients() -> None:
    alphas = np.linspace(0.1, 6.3, 57)
    linkage = shipped_linkage('klann')
    numpy = linkage_poses(linkage, alphas, kernel='numpy', gradients=True)
    numba = linkage_poses(linkage, alphas, kernel='numba', gradients=True)
    np.testing.assert_allclose(numba.h_gradient, numpy.h_gradient, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize('kernel', ['numpy', 'numba'])
@pytest.mark.parametrize('name', ['klann', 'stephenson'])
def test_h_is_the_same_whatever_else_is_requested(name: str, kernel: str) -> None:
    linkage = shipped_linkage(name)
    alphas = np.linspace(0.0, 6.0, 1001)
    alone = linkage_poses(linkage, alphas, kernel=kernel)
    more = linkage_poses(linkage, alphas, angles=True, points=True, kernel=kernel)
    np.testing.assert_array_equal(alone.h, more.h)
    np.testing.assert_array_equal(alone.h, more.points[:, linkage.foot])
    if kernel == 'numpy':
        moving = linkage_poses(linkage, alphas, velocities=True, kernel=kernel)
        np.testing.assert_array_equal(alone.h, moving.h)


@pytest.mark.parametrize(
    'error', ['ImportError("NumPy is too new")', 'AttributeError("np.bool8")']
)
def test_numpy_does_it_without_numba(
    error: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / 'numba.py').write_text(f'raise {error}', encoding='utf-8')
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, 'numba', raising=False)
    monkeypatch.setattr(kernels, '_numba_problem', kernels._numba_problem.__wrapped__)
    assert kernels.choose_kernel(None, 200_000) is kernels.NumpyKernel
    with pytest.raises(
        ValueError, match=r"kernel = 'numba' is refused: numba cannot be used here"
    ):
        klann_poses(KlannGeometry(), 1.0, kernel='numba')


@pytest.mark.slow
def test_numba_needs_no_place_for_its_cache(folder: Path) -> None:
    nowhere = folder / 'file'
    nowhere.touch()
    # A file where the folder would be: this stops root, too.
    (folder / 'klann_ros' / 'kinematics' / 'batch' / '__pycache__').touch()
    done = solve(folder, HOME=f'{nowhere}', XDG_CACHE_HOME=f'{nowhere}/x')
    assert done.stderr == ''
    assert done.stdout.startswith(SOLVED)


@pytest.mark.slow
def test_a_kernel_is_cached_once_for_all_processes_and_rebuilt_if_broken(folder: Path) -> None:
    cache = folder / 'cache'
    folders = {'NUMBA_CACHE_DIR': f'{cache}', 'XDG_CACHE_HOME': f'{cache}'}
    solve(folder, PYTHONHASHSEED='1', **folders)
    kept = list(cache.rglob('*.nb*'))
    assert kept
    for file in kept:
        file.write_bytes(b'')
    done = solve(folder, PYTHONHASHSEED='2', **folders)
    assert done.stderr == ''
    assert done.stdout.startswith(SOLVED)
    assert len([*cache.rglob('kernel_*.py')]) == 1
