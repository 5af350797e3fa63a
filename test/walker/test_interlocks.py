"""An emergency stop latches, its silence too; what is disabled stands until it is enabled."""

from klann_ros.gait import Steering
from klann_ros.walker.controller import Interlocks, WalkController
from klann_ros.walker.faults import FaultKind, FaultLatch
from klann_ros.walker.settings import ControllerSettings
import pytest


@pytest.fixture
def interlocks() -> Interlocks:
    return Interlocks()


@pytest.fixture
def latch(interlocks: Interlocks) -> FaultLatch:
    return interlocks.latch


def test_an_emergency_stop_that_was_never_heard_stops_nothing(
    latch: FaultLatch, interlocks: Interlocks
) -> None:
    interlocks.check(1e9, 1.0)
    assert latch.fault is None


def test_a_pressed_emergency_stop_trips_again_until_it_is_released(
    latch: FaultLatch, interlocks: Interlocks
) -> None:
    interlocks.take_e_stop(is_pressed=False, now=0.0)
    interlocks.check(0.5, 1.0)
    assert latch.fault is None
    interlocks.take_e_stop(is_pressed=True, now=0.5)
    for _ in range(2):
        interlocks.check(0.6, 1.0)
        assert latch.fault.kind is FaultKind.E_STOP
        assert latch.fault.text == 'e_stop is pressed'
        latch.reset()
    interlocks.take_e_stop(is_pressed=False, now=0.7)
    interlocks.check(0.8, 1.0)
    assert latch.fault is None


def test_a_released_emergency_stop_leaves_the_fault(
    latch: FaultLatch, interlocks: Interlocks
) -> None:
    interlocks.take_e_stop(is_pressed=True, now=0.0)
    interlocks.check(0.0, 1.0)
    interlocks.take_e_stop(is_pressed=False, now=0.1)
    interlocks.check(0.1, 1.0)
    assert latch.fault is not None
    assert '~/reset_fault' in interlocks.enable()


@pytest.mark.parametrize(('timeout', 'stops'), [(1.0, True), (2.5, False), (0.0, False)])
def test_silence_once_heard_stops(
    latch: FaultLatch, interlocks: Interlocks, timeout: float, stops: bool
) -> None:
    interlocks.take_e_stop(is_pressed=False, now=5.0)
    interlocks.check(7.0, timeout)
    assert (latch.fault is not None) == stops
    if latch.fault:
        assert latch.fault.text == 'e_stop has been silent for 2.0 s'


def test_a_pause_of_the_process_is_no_silence(latch: FaultLatch, interlocks: Interlocks) -> None:
    interlocks.pause(1.0)
    interlocks.check(9.0, 1.0)
    assert latch.fault is None
    interlocks.take_e_stop(is_pressed=False, now=9.0)
    interlocks.pause(60.0)
    interlocks.check(60.5, 1.0)
    assert latch.fault is None
    interlocks.check(61.5, 1.0)
    assert latch.fault is not None


def test_a_controller_that_was_paused_excuses_the_silence_of_the_pause_alone(
    steering: Steering,
) -> None:
    controller = WalkController(steering, ControllerSettings(e_stop_timeout=1.0))
    controller.keep_alive(10.0)
    controller.interlocks.take_e_stop(is_pressed=False, now=10.0)
    controller.keep_alive(15.0)
    assert controller.latch.fault is None
    for k in range(1, 12):
        controller.keep_alive(15.0 + 0.1 * k)
        assert (controller.latch.fault is not None) == (k > 10)


def test_what_is_disabled_is_enabled_on_request(interlocks: Interlocks) -> None:
    assert interlocks.hold_reason == ''
    interlocks.is_enabled = False
    assert interlocks.hold_reason == 'disabled: ~/enable permits motion'
    assert interlocks.enable() == ''
    assert interlocks.hold_reason == ''
    interlocks.is_active = False
    assert interlocks.hold_reason == 'inactive: it commands nothing'


def test_a_fault_refuses_to_enable(latch: FaultLatch, interlocks: Interlocks) -> None:
    interlocks.is_enabled = False
    interlocks.take_e_stop(is_pressed=True, now=0.0)
    interlocks.check(0.0, 1.0)
    assert interlocks.enable() == 'e_stop is pressed; call ~/reset_fault'
    assert not interlocks.is_enabled
    latch.reset()
    assert interlocks.enable() == ''
