"""Walkers to test, each made once."""

from pathlib import Path

from klann_ros.gait import Feet, Steering
from klann_ros.robot import robot_of
import pytest

CONFIG = Path(__file__).resolve().parents[2] / 'config'


@pytest.fixture(scope='session')
def two_motors() -> Feet:
    return Feet(robot_of(str(CONFIG / 'walker6_two_motors.yaml')))


@pytest.fixture(scope='session')
def one_motor() -> Feet:
    return Feet(robot_of(str(CONFIG / 'walker6.yaml')))


@pytest.fixture(scope='session')
def steering(two_motors: Feet) -> Steering:
    return Steering(two_motors)
