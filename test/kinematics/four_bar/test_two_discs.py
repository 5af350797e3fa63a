"""The task with two discs at the end of SEM 104, lecture 7, and the example that solves it."""

import os
from pathlib import Path
import re
import subprocess
import sys

from fork_server import called, PACKAGE, PYTHON
from klann_ros.kinematics import FourBar
import numpy as np
import pytest

EXAMPLE = Path(__file__).resolve().parents[3] / 'examples' / 'two_discs.py'
PNG = b'\x89PNG\r\n\x1a\n'


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the example, which is no part of the package, with the package that is tested."""
    return called(PYTHON, EXAMPLE, *arguments)


def test_the_example_prints_angles_and_differences_and_draws(tmp_path: Path) -> None:
    pytest.importorskip('matplotlib')
    picture = tmp_path / 'discs.png'
    result = run('--step', 5, '--plot', picture)
    assert (result.returncode, result.stderr) == (0, '')
    lines = result.stdout.splitlines()
    (start, bar, disc, *_), *_ = ([float(word) for word in line.split()] for line in lines[2:-1])
    expected = FourBar(0.500, 0.100, 0.500, 0.120).closed_form(0.0).x
    assert [start, bar, disc] == pytest.approx([0.0, *np.degrees(expected)], abs=5e-5)
    assert len(lines) == 2 + 13 + 1
    assert float(re.fullmatch(r'greatest difference: (\S+) rad', lines[-1])[1]) < 1e-12
    assert picture.read_bytes().startswith(PNG)


def test_the_example_reports_that_matplotlib_is_missing(tmp_path: Path) -> None:
    (tmp_path / 'matplotlib.py').write_text('raise ImportError("none here")\n')
    paths = os.pathsep.join([str(tmp_path), PACKAGE, os.environ.get('PYTHONPATH', '')])
    result = subprocess.run(
        [sys.executable, EXAMPLE, '--plot', tmp_path / 'discs.png'],
        env=os.environ | {'PYTHONPATH': paths},
        capture_output=True,
        check=False,
        text=True,
        timeout=60,
    )
    assert result.returncode == 1
    assert result.stderr == '--plot needs matplotlib: pip install matplotlib\n'
    assert 'greatest difference' in result.stdout


def test_the_example_reports_a_file_that_it_cannot_write(tmp_path: Path) -> None:
    pytest.importorskip('matplotlib')
    result = run('--plot', tmp_path / 'no' / 'folder.png')
    assert result.returncode == 1
    assert re.fullmatch(r'\S+folder\.png cannot be written: .*\n', result.stderr)


@pytest.mark.parametrize('step', ['0', 'far'])
def test_the_example_refuses_an_invalid_step(step: str) -> None:
    result = run('--step', step)
    assert result.returncode == 2
    assert 'argument --step' in result.stderr
