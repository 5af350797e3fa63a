"""What was computed of a leg, and what the engine makes of it as it turns the leg, agree."""

import math

from klann_ros.robot import robot_of
from klann_ros.twin import agreement
import pytest


# Of each kind one: a leg, many loops, two pulled to one point, slides, an arc, springs.
@pytest.mark.parametrize(
    ('name', 'rate'),
    [
        ('sem104', 2.0),
        ('sem104', 2 * math.pi),
        ('jansen', 2 * math.pi),
        ('ghassaei', 2 * math.pi),
        ('quick_return', 2 * math.pi),
        ('peaucellier', 2.0),
        ('andrews', 2.0),
    ],
)
def test_foot_torque_and_reactions_are_those_of_the_engine(name: str, rate: float) -> None:
    found = agreement(robot_of(name), rate, samples=100)
    assert found.foot <= 1e-6
    assert found.torque_as_moved <= 1e-4
    assert found.reactions <= 1e-4


@pytest.mark.parametrize('rate', [2.0, 2 * math.pi])
def test_the_servo_of_the_model_turns_the_leg_evenly_and_feels_its_torque(rate: float) -> None:
    found = agreement(robot_of('sem104'), rate, samples=100)
    assert found.ripple <= 2e-4
    assert found.torque <= 5e-3
