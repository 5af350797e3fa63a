"""An effort beyond its limit stops a walker, an impact does not."""

from math import inf, nan
from pathlib import Path

from klann_ros.datasheet import data_sheet, peak_efforts
from klann_ros.robot import robot_of
from klann_ros.walker.faults import Fault, FaultKind
from klann_ros.walker.monitors import LoadMonitor
import pytest

CONFIG = Path(__file__).resolve().parents[2] / 'config'
DT = 0.01


def faults(efforts: list[float], max_effort: float = 10.0, dt: float = DT) -> list[Fault]:
    monitor = LoadMonitor('left_crank')
    readings = (monitor.read(effort, dt * k, max_effort) for k, effort in enumerate(efforts))
    return [fault for fault in readings if fault is not None]


@pytest.mark.parametrize('effort', [11.0, -11.0, inf])
def test_an_effort_that_lasts_is_an_overload(effort: float) -> None:
    assert faults([effort] * 50) == []
    (fault,) = faults([effort] * 60)
    assert fault.kind is FaultKind.OVERLOAD
    assert fault.joint == 'left_crank'
    assert 'beyond max_effort (10 N m)' in fault.text


def test_impacts_are_none() -> None:
    assert faults(([50.0] * 40 + [1.0]) * 10) == []
    assert faults([50.0] * 40 + [nan] + [50.0] * 40) == []
    assert faults([9.9] * 1000) == []


def test_without_a_limit_nothing_is_an_overload() -> None:
    assert faults([inf] * 1000, max_effort=0.0) == []


def test_after_a_reset_an_overload_needs_its_time_again() -> None:
    assert len(faults([11.0] * 120)) == 2


def test_readings_far_apart_are_not_all_overload() -> None:
    assert faults([11.0] * 4, dt=2.0) == []
    assert len(faults([11.0] * 7, dt=2.0)) == 1


def test_a_clock_that_goes_back_delays_it_only() -> None:
    monitor = LoadMonitor('left_crank')
    for k in range(20):
        assert monitor.read(11.0, 100.0 - k, 10.0) is None
    assert monitor.effort == 11.0


@pytest.mark.slow
def test_the_described_effort_is_that_of_describe() -> None:
    robot = robot_of(str(CONFIG / 'walker6_two_motors.yaml'))
    sheet = data_sheet(robot, speed=2.0, load=robot.body.mass * 9.80665 / 3.0)
    described = {crank.joint: crank.loaded.peak for crank in sheet.cranks if crank.loaded}
    assert peak_efforts(robot, 2.0) == pytest.approx(described)
    assert set(described) == {'left_crank', 'right_crank'}
    assert peak_efforts(robot_of('sem104')) == {}
