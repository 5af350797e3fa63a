"""The C++ code of examples/esp32_driver on this machine: rate loops, watchdog and lines."""

from itertools import pairwise
from math import inf, nan, tau
from pathlib import Path

from motor_board import Board, COUNTS_PER_TURN, FIRST_MICROS, FULL_RATE, MAX_RATE, Motor
import pytest

# Period of the control [us].
PERIOD = 5000
START = FIRST_MICROS


@pytest.fixture(scope='module')
def board(library: Path) -> Board:
    return Board(library)


def run(motor: Motor, seconds: float, start: int = START, rate: float | None = None) -> int:
    """Turn a motor, commanded all the while unless the rate is None; return the time [us]."""
    end = start + round(seconds * 1e6)
    for micros in range(start, end, PERIOD):
        if rate is not None:
            motor.command(rate, micros)
        motor.update(micros, PERIOD / 1e6)
    return end


@pytest.mark.parametrize('rate', [1.0, -1.0, 0.2])
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_shaft_turns_as_commanded_over_the_wraps_of_its_counters(
    board: Board, rate: float, sign: float
) -> None:
    # A motor that is mounted the other way: both of its signs are negative.
    motor = Motor(board, counts_per_turn=sign * COUNTS_PER_TURN, full_rate=sign * FULL_RATE)
    run(motor, 10.0, rate=rate)
    assert motor.rate == pytest.approx(rate, abs=0.05)
    assert motor.angle == pytest.approx(motor.true_angle, abs=tau / COUNTS_PER_TURN)
    assert motor.angle == pytest.approx(10.0 * rate, abs=0.1)


def test_without_commands_the_bridge_is_off_and_stays_off(board: Board) -> None:
    motor = Motor(board)
    now = run(motor, 1.0, rate=1.0)
    # The command that was given last is valid for its timeout, and no longer.
    now = run(motor, 0.45, now)
    assert motor.duty > 0.0
    now = run(motor, 0.1, now)
    assert motor.duty == 0.0
    # After a wrap of the clock the command would be young again.
    for micros in range(now, now + 2**32 + 10**6, 400_000):
        assert motor.update(micros, 0.4) == 0.0
    assert abs(motor.rate) < 1e-9


def test_nothing_turns_before_the_first_command(board: Board) -> None:
    motor = Motor(board)
    run(motor, 1.0)
    assert motor.true_angle == 0.0


def test_zero_switches_the_bridge_off_whatever_the_encoder_counts(board: Board) -> None:
    # The leads are swapped, and the encoder is not: the loop would drive itself.
    motor = Motor(board)
    now = run(motor, 0.2, rate=1.0)
    motor.counts_per_turn = -COUNTS_PER_TURN
    now = run(motor, 0.2, now, rate=1.0)
    run(motor, 1.0, now, rate=0.0)
    assert motor.duty == 0.0
    assert abs(motor.rate) < 1e-6


@pytest.mark.parametrize('rate', [nan, inf, -inf])
def test_a_rate_that_is_no_number_is_no_command(board: Board, rate: float) -> None:
    motor = Motor(board)
    now = run(motor, 1.0, rate=1.0)
    run(motor, 0.6, now, rate=rate)
    assert motor.duty == 0.0


def test_a_command_is_limited_and_a_blocked_shaft_winds_nothing_up(board: Board) -> None:
    motor = Motor(board)
    now = run(motor, 1.0, rate=100.0)
    assert motor.rate == pytest.approx(MAX_RATE, abs=0.1)
    motor.full_rate = 0.0
    now = run(motor, 20.0, now, rate=MAX_RATE)
    assert motor.duty <= 1.0
    motor.full_rate = FULL_RATE
    now = run(motor, 1.0, now, rate=1.0)
    assert motor.rate == pytest.approx(1.0, abs=0.3)


def test_a_loaded_motor_keeps_its_rate(board: Board) -> None:
    motor = Motor(board)
    motor.full_rate = 0.7 * FULL_RATE
    run(motor, 10.0, rate=1.0)
    assert motor.rate == pytest.approx(1.0, abs=0.05)


def test_a_quadrature_encoder_counts_both_ways_and_ignores_impossible_steps(
    board: Board,
) -> None:
    states = [0, 1, 3, 2, 0]
    assert [board.quadrature(a, b) for a, b in pairwise(states)] == [1] * 4
    assert [board.quadrature(a, b) for a, b in pairwise(reversed(states))] == [-1] * 4
    assert [board.quadrature(state, state) for state in range(4)] == [0] * 4
    assert [board.quadrature(state, 3 - state) for state in range(4)] == [0] * 4


def test_the_two_ends_of_the_line_understand_one_another(board: Board) -> None:
    pytest.importorskip('serial')
    from driver_modules import serial_motors as motors

    line = motors.line_of(['R', '0.5000', '-0.2500']).rstrip()
    assert board.rates(line, 2) == [0.5, -0.25]
    words = motors.words_of(board.line(4_294_967_295, [0.125, -3.14159]))
    assert words == ['S', '4294967295', '0.12500', '-3.14159']
    # No byte can be lost or changed without notice.
    for index, byte in enumerate(line):
        head, tail = line[:index], line[index:][1:]
        changed = head + bytes([byte ^ 1]) + tail
        assert board.rates(head + tail, 2) is None
        assert board.rates(changed, 2) is None
        assert motors.words_of(changed) == []
    # Noise whose sum is right by chance is no text.
    assert motors.words_of(b'S \xc3\x28*%02X' % (0x53 ^ 0x20 ^ 0xC3 ^ 0x28))[0] == 'S'
    for count in (1, 3):
        assert board.rates(line, count) is None


def test_a_line_that_is_too_long_is_dropped(board: Board) -> None:
    reader = board.reader_new()
    lines = [board.reader_take(reader, bytes([byte])) for byte in b'x' * 500 + b'\r\nR 1*1\n']
    assert [line for line in lines if line] == [b'R 1*1']
    assert board.line(0, [1.0, 2.0], 20) == b''
