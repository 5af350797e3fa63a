"""Whether a motor can turn a crank: by hand where one can, and by trying speeds where not."""

from collections.abc import Mapping
from math import inf, pi
from pathlib import Path
import re
from typing import Any

from hypothesis import given, strategies as st
from klann_ros.datasheet import data_sheet, Motor, motor_from, motor_from_file, MotorFileError
from klann_ros.datasheet.load import CrankLoad
from klann_ros.datasheet.motor import verdict
from klann_ros.robot import robot_of
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / 'config' / 'motor_example.yaml'
GOOD = {'stall_torque': 2.0, 'no_load_speed': 100.0, 'gear_ratio': 10.0, 'efficiency': 0.5}
ANGLES = 2.0 * pi * np.arange(8) / 8


def load(static_torque: list[float], squared: list[float]) -> CrankLoad:
    return CrankLoad(ANGLES[: len(static_torque)], np.array(static_torque), np.array(squared))


def test_the_line_is_that_of_the_gears_output() -> None:
    motor = Motor(**GOOD)
    # 2 N m by 10, half of it lost; 100 rad/s by 10.
    assert motor.output_stall_torque == 10.0
    assert motor.output_no_load_speed == 10.0
    assert [motor.torque(w) for w in (0.0, 5.0, 10.0)] == [10.0, 5.0, 0.0]


def test_the_motor_margin_is_available_over_required_torque() -> None:
    judged = verdict(Motor(**GOOD), load([2.0, -8.0], [0.0, 0.0]), 5.0)
    assert judged.margin == 2.5
    # Against the losses that help: 2 N m by 10 over a half.
    assert judged.braking_margin == 5.0
    # At the motor 2 / (10 / 2) and -8 / 10 / 2.
    assert judged.motor_rms == pytest.approx(np.sqrt((0.4**2 + 0.4**2) / 2))
    assert judged.fastest == pytest.approx(8.0)
    assert judged.turns


@pytest.mark.parametrize(
    ('static_torque', 'squared', 'speed', 'continuous', 'fault'),
    [
        ([2.0, 0.0], 0.0, 10.5, None, 'no faster than 10 rad/s'),
        ([2.0, 0.0], 0.0, 9.0, None, 'where 2 N m are needed'),
        # The other way round it needs the other torque.
        ([2.0, -8.0], 0.0, -5.0, None, 'gives 5 N m where 8 N m are needed'),
        ([2.0, -41.0], 0.0, 5.0, None, 'cannot hold back 41 N m'),
        ([2.0, 2.0], 0.0, 5.0, 0.3, 'overheats'),
        # At 9 rad/s inertia would help; it never gets there.
        ([12.0], -0.15, 9.0, None, 'no faster than 0 rad/s from standstill'),
    ],
)
def test_each_fault_is_reported(
    static_torque: list[float], squared: float, speed: float, continuous: float | None, fault: str
) -> None:
    motor = Motor(**GOOD, continuous_torque=continuous)
    judged = verdict(motor, load(static_torque, [squared] * len(static_torque)), speed)
    assert not judged.turns
    assert len(judged.faults) == 1
    assert fault in judged.faults[0]


def test_without_load_the_margin_is_unlimited() -> None:
    judged = verdict(Motor(**GOOD, continuous_torque=1.0), load([0.0], [0.0]), 5.0)
    assert (judged.margin, judged.braking_margin, judged.thermal_margin) == (inf, inf, inf)
    assert judged.fastest == 10.0
    assert judged.turns


numbers = st.floats(-15.0, 15.0)


@given(st.lists(st.tuples(numbers, st.floats(-0.5, 0.5)), min_size=1, max_size=8))
def test_the_fastest_is_the_first_speed_too_high(needs: list[tuple[float, float]]) -> None:
    motor = Motor(**(GOOD | {'stall_torque': 1.0, 'efficiency': 0.8}))
    fastest = verdict(motor, load(*map(list, zip(*needs, strict=True))), 1.0).fastest
    speeds = np.linspace(0.0, motor.output_no_load_speed, 2001)
    static_torque, squared = np.array(needs).T[:, :, None]
    torque = static_torque + squared * speeds**2
    is_driven = torque.max(axis=0) <= motor.torque(0.0) * (1.0 - speeds / speeds[-1]) + 1e-9
    is_held = -torque.min(axis=0) <= motor.holding_torque + 1e-9
    short = speeds[~(is_driven & is_held)]
    first = short[0] if short.size else speeds[-1]
    # An angle may be short between two speeds only.
    assert fastest <= first + 1e-6
    inside = (speeds < fastest - 1e-6) & ~(is_driven & is_held)
    assert not inside.any()


@pytest.mark.slow
def test_the_example_motor_turns_the_sem104_leg() -> None:
    motor = motor_from_file(str(EXAMPLE))
    robot = robot_of('sem104')
    judged = data_sheet(robot, motor=motor, samples=90).cranks[0].motor
    for factor, turns in ((0.999, True), (1.001, False)):
        speed = factor * judged.fastest
        assert data_sheet(robot, motor=motor, speed=speed, samples=90).motor_turns is turns


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'gear_ratio': ...}, 'gear_ratio missing'),
        ({'stall_torque': None}, 'stall_torque = None is refused'),
        ({'stall_torque': 10**400}, 'at most 1e+09'),
        ({'stall_torque': -1.0}, 'stall_torque = -1.0 is refused'),
        ({'stall_torque': 0}, 'stall_torque = 0 is refused'),
        ({'no_load_speed': 'fast'}, "no_load_speed = 'fast' is refused"),
        ({'no_load_speed': True}, 'no_load_speed = True is refused'),
        ({'efficiency': 80.0}, 'a part of 1; 80 % are 0.8'),
        ({'gear_ratio': 1e300}, 'at most 1e+09'),
        ({'no_load_speed': 5e-324}, 'at least 1e-09'),
        ({'continuous_torque': float('nan')}, 'continuous_torque = nan is refused'),
        ({'stal_torque': 1.0}, 'did you mean stall_torque?'),
        ({7: 1.0}, '7: no such key'),
        ({'x\x1b[31m': 1.0}, r'x\x1b[31m: no such key'),
    ],
)
def test_an_invalid_motor_is_refused_in_a_line(changes: Mapping[Any, Any], reason: str) -> None:
    content = {key: value for key, value in {**GOOD, **changes}.items() if value is not ...}
    with pytest.raises(ValueError, match=rf'^[^\n]*{re.escape(reason)}[^\n]*$'):
        motor_from(content)


def test_a_file_that_holds_no_motor_is_reported(tmp_path: Path) -> None:
    path = tmp_path / 'motor.yaml'
    path.write_text('- 1\n')
    with pytest.raises(MotorFileError, match=r'motor\.yaml holds no motor: it must be a mapping'):
        motor_from_file(str(path))
