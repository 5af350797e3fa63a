"""The walker of the manual's page "Your own walker", written to files and described."""

from pathlib import Path
import re

from klann_ros.robot import robot_of
from klann_ros.walker import Feet, Steering, walk_figures
import pytest

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'your_own_walker.md'


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
    assert steering.is_mirrored
    assert steering.turn_plan.is_possible
