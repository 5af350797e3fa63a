"""The two kernels, and how one is chosen."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

from klann_ros import kinematics
from klann_ros.kinematics import klann_poses, KlannGeometry, linkage_poses, shipped_linkage
import numpy as np
import pytest

PACKAGE = Path(kinematics.__file__).parents[1]
SOLVE = """
import sys
from klann_ros.kinematics import klann_poses, KlannGeometry
import numpy as np
loaded = 'numba' in sys.modules
poses = klann_poses(KlannGeometry(), np.zeros(200_000), kernel={kernel!r}{wanted})
print(loaded, 'numba' in sys.modules, poses.h[0].tolist())
"""
H = '[0.92382725'


def solve(kernel: str | None, wanted: str = '') -> str:
    return SOLVE.format(kernel=kernel, wanted=wanted)


def run(script: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a script with a copy of the package, and whatever else is in a folder."""
    if not (folder / 'klann_ros').exists():
        for name in ('__init__.py', 'kinematics', 'sanitize'):
            copy = shutil.copytree if (PACKAGE / name).is_dir() else shutil.copy
            (folder / 'klann_ros').mkdir(exist_ok=True)
            copy(PACKAGE / name, folder / 'klann_ros' / name)
    return subprocess.run(
        [sys.executable, '-c', script],
        check=False,
        capture_output=True,
        text=True,
        cwd=folder,
        env=os.environ | {'PYTHONPATH': str(folder), **variables},
    )


def test_both_kernels_agree_to_the_last_digits_on_the_course_leg() -> None:
    alphas = np.linspace(-20.0, 20.0, 10_001)
    numpy, numba = (
        klann_poses(KlannGeometry(), alphas, kernel=kernel).h for kernel in ('numpy', 'numba')
    )
    np.testing.assert_allclose(numpy, numba, rtol=0, atol=4 * np.spacing(1.0))


@pytest.mark.parametrize('kernel', ['numpy', 'numba'])
@pytest.mark.parametrize('name', ['klann', 'stephenson'])
def test_h_is_the_same_whatever_else_is_requested(name: str, kernel: str) -> None:
    linkage, alphas = shipped_linkage(name), np.linspace(0.0, 6.0, 1001)
    alone = linkage_poses(linkage, alphas, kernel=kernel)
    more = linkage_poses(linkage, alphas, angles=True, points=True, kernel=kernel)
    np.testing.assert_array_equal(alone.h, more.h)
    np.testing.assert_array_equal(alone.h, more.points[:, linkage.foot])
    if kernel == 'numpy':
        moving = linkage_poses(linkage, alphas, velocities=True, kernel=kernel)
        np.testing.assert_array_equal(alone.h, moving.h)


@pytest.mark.parametrize('kernel', ['cuda', '', 1])
def test_an_unknown_kernel_is_refused(kernel: object) -> None:
    with pytest.raises(ValueError, match=f"^kernel = {kernel!r} is refused: .* 'numba' or None"):
        klann_poses(KlannGeometry(), 1.0, kernel=kernel)


@pytest.mark.parametrize(
    'error', ['ImportError("NumPy is too new")', 'AttributeError("np.bool8")']
)
def test_without_a_working_numba_numpy_does_it(error: str, tmp_path: Path) -> None:
    (tmp_path / 'numba.py').write_text(f'raise {error}', encoding='utf-8')
    done = run(solve(None) + solve('numba'), tmp_path)
    assert done.stdout.startswith(f'False False {H}')
    assert done.returncode == 1
    assert "kernel = 'numba' is refused: numba cannot be used here (" in done.stderr


def test_numba_needs_no_place_for_its_cache(tmp_path: Path) -> None:
    nowhere = tmp_path / 'file'
    nowhere.touch()
    run('import klann_ros', tmp_path)
    # A file where the folder would be: this stops root, too.
    cache = tmp_path / 'klann_ros' / 'kinematics' / 'batch' / '__pycache__'
    shutil.rmtree(cache, ignore_errors=True)
    cache.touch()
    variables = {'HOME': f'{nowhere}', 'XDG_CACHE_HOME': f'{nowhere}/x'}
    done = run(solve('numba'), tmp_path, **variables)
    assert done.stderr == ''
    assert done.stdout.startswith(f'False True {H}')


def test_a_kernel_is_cached_once_for_all_processes_and_rebuilt_if_broken(tmp_path: Path) -> None:
    cache = tmp_path / 'cache'
    folders = {'NUMBA_CACHE_DIR': f'{cache}', 'XDG_CACHE_HOME': f'{cache}'}
    # Several results, whose order in the source must not depend on the hashes.
    script = solve('numba', ', angles=True, velocities=True')
    run(script, tmp_path, PYTHONHASHSEED='1', **folders)
    kept = list(cache.rglob('*.nb*'))
    assert kept
    for file in kept:
        file.write_bytes(b'')
    done = run(script, tmp_path, PYTHONHASHSEED='2', **folders)
    assert done.stderr == ''
    assert done.stdout.startswith(f'False True {H}')
    assert len([*cache.rglob('kernel_*.py')]) == 1
