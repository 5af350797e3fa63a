"""Encoders and motors of a walker's cranks, and zeros that are set while it stands."""

from math import pi

from klann_ros.gait import Steering
from klann_ros.robot import CrankDrive
from klann_ros.walker import CrankCommand, CrankDrives, Walker
import pytest

DT = 0.01


def test_readings_and_commands_are_those_of_each_crank() -> None:
    drives = CrankDrives({'left': CrankDrive(-4.0, -2.0, 0.3), 'right': CrankDrive()})
    readings = drives.measured({'right': (0.5, 1.0), 'left': (-2.0, None)})
    assert readings['left'] == (pytest.approx(0.2), None)
    assert readings['right'] == (0.5, 1.0)
    command = drives.commanded(CrankCommand((0.2, 0.5), (1.0, 2.0)))
    assert command.position == pytest.approx((-2.0, 0.5))
    assert command.velocity == pytest.approx((-2.0, 2.0))


class Standing:
    """A walker whose encoders do not move."""

    def __init__(self, steering: Steering, encoders: dict[str, float]) -> None:
        self.walker = Walker(steering)
        self.encoders = encoders
        self.now = 10.0

    def read(self, rate: float = 0.0, times: int = 10) -> None:
        for _ in range(times):
            self.now += DT
            encoders = {joint: (angle, rate) for joint, angle in self.encoders.items()}
            self.walker.feedback(self.walker.drives.measured(encoders), self.now)
            self.walker.controller.step(self.now)

    @property
    def angles(self) -> list[float]:
        return self.walker.controller.positions


def test_zero_is_set_of_all_cranks_or_of_one(steering: Steering) -> None:
    standing = Standing(steering, {'left_crank': 0.7, 'right_crank': 8.0})
    walker = standing.walker
    assert walker.set_zero() == 'not all cranks have given feedback'
    standing.read()
    assert walker.set_zero(['left_crank']) == ''
    assert standing.angles == pytest.approx([0.0, 8.0])
    standing.read()
    assert standing.angles == pytest.approx([0.0, 8.0])
    assert walker.set_zero() == ''
    standing.read()
    # A whole turn is no offset.
    assert standing.angles == pytest.approx([0.0, 2.0 * pi])
    assert walker.drives.zeros == (
        'cranks: {left_crank: {zero: 0.7000}, right_crank: {zero: 1.7168}}'
    )
    # The robot has moved by 7 mm in the estimate, as it stands otherwise than was thought.
    assert walker.odometry.travelled < 0.01
    # No encoder has jumped, and the set points are the new angles.
    assert not walker.controller.events
    assert walker.controller.lock.targets == pytest.approx(standing.angles)
    command = walker.drives.commanded(walker.controller.standstill)
    assert command.position == pytest.approx((0.7, 8.0))


def test_zero_is_not_set_while_it_moves(steering: Steering) -> None:
    standing = Standing(steering, {'left_crank': 0.7, 'right_crank': 0.0})
    standing.read(rate=0.5)
    assert standing.walker.set_zero() == 'it moves'
    standing.read()
    standing.walker.controller.command(0.1, 0.0, standing.now)
    standing.read()
    assert standing.walker.set_zero() == 'it moves'
    assert standing.walker.drives.drives['left_crank'].zero == 0.0


def test_a_new_zero_is_a_new_question_of_the_tilt(steering: Steering) -> None:
    standing = Standing(steering, {'left_crank': 0.7, 'right_crank': 0.0})
    standing.read()
    last_check = standing.walker.zero_check
    assert standing.walker.set_zero() == ''
    assert standing.walker.zero_check is not last_check
