"""What was computed of a leg, and what the engine makes of it as it turns the leg, agree."""

from functools import cache
import math

from klann_ros.robot import robot_of
from klann_ros.twin import Agreement, agreement
import pytest


@cache
def turned(name: str) -> Agreement:
    """Return how far they agree at a turn a second; `benchmarks/twin.py` does so of all legs."""
    return agreement(robot_of(name), 2 * math.pi, samples=100)


# A leg, many loops, slides, springs.
@pytest.mark.parametrize('name', ['sem104', 'jansen', 'quick_return', 'andrews'])
def test_foot_torque_and_reactions_are_those_of_the_engine(name: str) -> None:
    found = turned(name)
    assert found.foot <= 3e-6
    assert found.torque_as_moved <= 2e-4
    assert found.reactions <= 2e-4


@pytest.mark.parametrize('name', ['sem104', 'jansen', 'quick_return'])
def test_the_servo_of_the_model_turns_the_leg_evenly_and_feels_its_torque(name: str) -> None:
    assert turned(name).ripple <= 2e-4
    assert turned(name).torque <= 5e-3
