"""The walkers of the manual's pages: the printed one, and the own one with its package."""

from pathlib import Path
import re
import subprocess
import sys

from klann_ros.datasheet import data_sheet
from klann_ros.design.requirements import requirements_from_file
from klann_ros.gait import Feet, Steering, Twist2D, walk_figures
from klann_ros.robot import robot_of
import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / 'docs' / 'your_own_walker.md'
EXAMPLE = ROOT / 'examples' / 'my_walker'


def test_the_walker_of_the_page_stands_walks_and_turns() -> None:
    (head,) = re.findall(r'```yaml\n(.*?)```', PAGE.read_text(), re.DOTALL)
    file = EXAMPLE / 'config' / 'desk_walker.yaml'
    assert file.read_text().startswith(head)
    robot = robot_of(str(file))
    walk = walk_figures(robot, samples=180)
    assert walk.warnings == []
    assert walk.stable_fraction == 1.0
    assert walk.speed == pytest.approx(0.057, abs=0.001)
    steering = Steering(Feet(robot))
    left, right = (steering.rates(Twist2D(0.05, yaw_rate)) for yaw_rate in (0.02, -0.02))
    assert left == pytest.approx((right.right, right.left))
    assert steering.turn_plan.is_possible


def test_the_printed_walker_of_its_page_is_that_of_the_example_and_its_motor_turns_it() -> None:
    page = (ROOT / 'docs' / 'printed_walker.md').read_text()
    (shown,) = re.findall(r'```yaml\n(.*?)```', page, re.DOTALL)
    folder = ROOT / 'examples' / 'requirements'
    lines = (folder / 'printed_walker.yaml').read_text().splitlines()
    assert {*shown.splitlines()} <= {*lines}
    requirements = requirements_from_file(str(folder / 'printed_walker.yaml'))
    robot = robot_of(str(ROOT / 'config' / 'printed_walker.yaml'))
    # Of a robot of 0.6 kg on four feet.
    mass = robot.body.mass + sum(body.mass for leg in robot.legs for body in leg.masses.bodies)
    assert 0.55 < mass < 0.6
    sheet = data_sheet(
        robot, speed=requirements.speed, load=requirements.load, motor=requirements.motor
    )
    assert min(crank.motor.margin for crank in sheet.cranks) > 2.0
    assert walk_figures(robot, samples=180).warnings == []


@pytest.mark.slow
def test_the_example_package_is_built_by_colcon_with_its_walker_and_launch_file(
    tmp_path: Path,
) -> None:
    pytest.importorskip('colcon_core')
    build = [sys.executable, '-m', 'colcon', '--log-base', 'log', 'build', '--paths', EXAMPLE]
    subprocess.run(build, cwd=tmp_path, check=True)
    share = tmp_path / 'install' / 'my_walker' / 'share' / 'my_walker'
    assert (share / 'launch' / 'walk.launch.py').is_file()
    assert len(robot_of(str(share / 'config' / 'desk_walker.yaml')).legs) == 8
