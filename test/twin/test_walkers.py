"""The shipped walkers walk in the engine as their files say."""

from functools import cache
import math
from pathlib import Path
from typing import NamedTuple

from klann_ros.kinematics import linkage_poses
from klann_ros.robot import Robot, robot_of
from klann_ros.twin import robot_mjcf
import mujoco
import numpy as np
from numpy.typing import NDArray
import pytest

ROOT = Path(__file__).resolve().parents[2]
Array = NDArray[np.float64]


class Walk(NamedTuple):
    """Where a walker was over a turn of its crank, after it had settled."""

    seconds: Array
    places: Array
    up: Array
    pitch: Array

    @property
    def speed(self) -> float:
        return float(
            (self.places[-1, 0] - self.places[0, 0]) / (self.seconds[-1] - self.seconds[0])
        )

    @property
    def tilt(self) -> float:
        return math.degrees(np.arccos(self.up.clip(-1.0, 1.0)).max())


@cache
def walker(number: int) -> Robot:
    return robot_of(str(ROOT / 'config' / f'walker{number}.yaml'))


@cache
def walked(number: int, rate: float, settle: float = 2.0, time_step: float = 0.0) -> Walk:
    model = mujoco.MjModel.from_xml_string(robot_mjcf(walker(number), time_step=time_step))
    data = mujoco.MjData(model)
    data.ctrl[:] = rate
    rows = []
    for step in range(int((settle + 2 * math.pi / rate) / model.opt.timestep)):
        mujoco.mj_step(model, data)
        if data.time >= settle and step % 20 == 0:
            axes = data.body('base_link').xmat.reshape(3, 3)
            rows.append([data.time, *data.body('base_link').xpos, axes[2, 2], -axes[2, 0]])
    table = np.array(rows)
    return Walk(table[:, 0], table[:, 1:4], table[:, 4], np.degrees(np.arcsin(table[:, 5])))


def predicted(robot: Robot) -> float:
    """Return how far a turn of the crank moves a body on its lowest three feet [m/rad]."""
    cranks = np.linspace(0.0, 2 * np.pi, 721)[:-1]
    feet = np.array(
        [
            leg.mount.transform(linkage_poses(leg.linkage, leg.crank_angles(cranks)).h)
            for leg in robot.legs
        ]
    )
    rates = (np.roll(feet, -1, 1) - np.roll(feet, 1, 1))[..., 0] / (2 * (cranks[1] - cranks[0]))
    lowest = np.argsort(feet[..., 2], axis=0)[:3]
    return float(-np.take_along_axis(rates, lowest, 0).mean())


def test_six_legs_walk_at_the_speed_of_their_stance() -> None:
    expected = predicted(walker(6))
    assert expected == pytest.approx(0.1501, rel=0.005)
    assert walked(6, 1.0).speed == pytest.approx(expected, rel=0.04)


def test_six_legs_walk_level() -> None:
    walk = walked(6, 1.0)
    assert np.abs(walk.pitch).max() <= 0.7
    assert walk.tilt <= 1.0
    assert np.ptp(walk.places[:, 2]) == pytest.approx(0.019, abs=0.001)


def test_six_legs_go_straight() -> None:
    walk = walked(6, 1.0)
    assert abs(walk.places[-1, 1] - walk.places[0, 1]) <= 0.02


def test_four_legs_waddle_slowly_and_tip_over_fast() -> None:
    slow = walked(4, 1.0, settle=1.0, time_step=1e-3)
    assert slow.speed > 0.1
    assert 20.0 <= slow.tilt <= 30.0
    assert walked(4, 2.0, settle=0.5, time_step=1e-3).tilt >= 90.0
