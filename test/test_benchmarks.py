"""Every benchmark runs to its end in its smallest form; its figures are for scripts/benchmark."""

import os
from pathlib import Path
import subprocess
import sys

from domain import own_world
import pytest

ROOT = Path(__file__).resolve().parents[1]
BENCHMARKS = sorted(path.stem for path in (ROOT / 'benchmarks').glob('*.py'))


@pytest.mark.parametrize('name', BENCHMARKS)
def test_a_benchmark_runs_to_its_end_in_its_smallest_form(name: str, tmp_path: Path) -> None:
    folders = [str(ROOT / 'test'), str(ROOT / 'scripts/support')]
    paths = [*folders, os.environ.get('PYTHONPATH', '')]
    with own_world(tmp_path) as world:
        result = subprocess.run(
            [sys.executable, ROOT / 'benchmarks' / f'{name}.py', '--smoke'],
            env=os.environ | world | {'PYTHONPATH': os.pathsep.join(filter(None, paths))},
            capture_output=True,
            check=False,
            text=True,
            timeout=240,
        )
    assert result.returncode == 0, result.stdout + result.stderr
