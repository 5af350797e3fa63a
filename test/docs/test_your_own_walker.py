"""The walker of the manual's page "Your own walker", and its package in examples/my_walker."""

from pathlib import Path
import re
import subprocess
import sys

from klann_ros.gait import Feet, Steering, Twist2D, walk_figures
from klann_ros.robot import robot_of
import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / 'docs' / 'your_own_walker.md'
EXAMPLE = ROOT / 'examples' / 'my_walker'


def test_the_walker_of_the_page_stands_walks_and_turns(tmp_path: Path) -> None:
    leg, walker = re.findall(r'```yaml\n(.*?)```', PAGE.read_text(), re.DOTALL)
    (tmp_path / 'desk_leg.yaml').write_text(leg)
    file = tmp_path / 'desk_walker.yaml'
    file.write_text(walker)
    robot = robot_of(str(file))
    walk = walk_figures(robot, samples=180)
    assert walk.warnings == []
    assert walk.stable_fraction == 1.0
    assert walk.speed == pytest.approx(0.057, abs=0.001)
    steering = Steering(Feet(robot))
    left, right = (steering.rates(Twist2D(0.05, yaw_rate)) for yaw_rate in (0.02, -0.02))
    assert left == pytest.approx((right.right, right.left))
    assert steering.turn_plan.is_possible


def test_the_example_package_has_the_files_of_the_page_and_is_built_by_colcon(
    tmp_path: Path,
) -> None:
    pytest.importorskip('colcon_core')
    leg, walker = re.findall(r'```yaml\n(.*?)```', PAGE.read_text(), re.DOTALL)
    build = [sys.executable, '-m', 'colcon', '--log-base', 'log', 'build', '--paths', EXAMPLE]
    subprocess.run(build, cwd=tmp_path, check=True)
    share = tmp_path / 'install' / 'my_walker' / 'share' / 'my_walker'
    assert (share / 'config' / 'desk_leg.yaml').read_text() == leg
    assert (share / 'config' / 'desk_walker.yaml').read_text() == walker
    assert (share / 'launch' / 'walk.launch.py').is_file()
    assert len(robot_of(str(share / 'config' / 'desk_walker.yaml')).legs) == 8
