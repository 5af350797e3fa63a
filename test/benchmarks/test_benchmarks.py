"""Every benchmark runs to its end in its smallest form; its figures are for scripts/benchmark."""

import os
from pathlib import Path
import re

from domain import own_world
from fork_server import called, PYTHON
import pytest
from walk_runs import Walking
import yaml

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = sorted(path.stem for path in (ROOT / 'benchmarks').glob('*.py'))


def output_of(name: str, *arguments: str | Path, folder: Path) -> str:
    """Run a benchmark; return what it printed."""
    paths = [str(ROOT / 'scripts/support'), os.environ.get('PYTHONPATH', '')]
    with own_world(folder) as world:
        environment = {**os.environ, **world, 'PYTHONPATH': os.pathsep.join(filter(None, paths))}
        script = ROOT / 'benchmarks' / f'{name}.py'
        result = called(PYTHON, script, *arguments, environment=environment, patience=240.0)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.mark.slow
@pytest.mark.parametrize('name', BENCHMARKS)
def test_a_benchmark_runs_to_its_end_in_its_smallest_form(name: str, tmp_path: Path) -> None:
    output_of(name, '--smoke', folder=tmp_path)


def test_the_errors_of_a_recorded_odometry_are_those_of_its_definition(tmp_path: Path) -> None:
    # It is 2 % too long: the root mean square of a ramp is its end by the root of 3.
    pytest.importorskip('mujoco')
    run = Walking(scale=1.02).write(tmp_path / 'run')
    printed = output_of('odometry', '--run', run, folder=tmp_path)
    assert 'APE 1.16% of the path, RPE over 1 m 2.00 cm and 0.00 deg' in printed


@pytest.mark.slow
def test_ape_and_rpe_are_those_of_evo(tmp_path: Path) -> None:
    pytest.importorskip('mujoco')
    pytest.importorskip('evo')
    walks = tmp_path / 'walks'
    lines = output_of('odometry', '--smoke', '--evo', '--walks', walks, folder=tmp_path)
    for line in lines.splitlines():
        ours, evos = (
            [float(number) for number in re.findall(pattern, line)]
            for pattern in (r'E ([\d.]+) cm', r'evo ([\d.]+)')
        )
        # [cm]. Of two seconds there are few pairs, and those of evo have other lengths.
        assert ours == pytest.approx(evos[: len(ours)], rel=0.1, abs=0.1)


def test_the_compared_filter_measures_what_the_file_of_robot_localization_configures() -> None:
    """Velocities of odom and yaw rate of the IMU: 6, 7 and 11 of its 15 states."""
    text = (ROOT / 'config/ekf.yaml').read_text()
    parameters = yaml.safe_load(text)['/**/ekf_node']['ros__parameters']
    fused = {
        name: [k for k, is_fused in enumerate(parameters[f'{name}_config']) if is_fused]
        for name in ('odom0', 'imu0')
    }
    assert fused == {'odom0': [6, 7], 'imu0': [11]}
