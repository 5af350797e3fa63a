"""
The code of examples/esp32_driver, compiled for this machine; as a process, a board with motors.

    python motor_board.py LIBRARY DESCRIPTOR LOG TIMEOUT

The process reads and writes the lines of a serial port on the descriptor, and writes a row to the
log every 10 ms: the time, the rates of the shafts and the duties of the bridges.
"""

import ctypes
from math import exp, tau
import os
from pathlib import Path
import shutil
import subprocess
import sys
from time import monotonic, sleep

ROOT = Path(__file__).resolve().parents[2]
SKETCH = ROOT / 'examples' / 'esp32_driver'
SHIM = ROOT / 'test' / 'examples' / 'motor_board.cpp'
COMPILER = shutil.which('g++') or shutil.which('c++')
COUNTS_PER_TURN, FULL_RATE, MAX_RATE = 8384.0, 8.0, 3.0
GAINS = (0.1, 0.5)
TIMEOUT = 0.5
# Time constant of a motor [s], and periods of the control and of the lines [s].
LAG, PERIOD, LINE_PERIOD = 0.05, 0.005, 0.01
# The counters of a board wrap 2 s after its start.
FIRST_MICROS, FIRST_COUNTER = 2**32 - 2_000_000, 2**31 - 500


def compiled(folder: Path) -> Path:
    """Compile the sketch's headers to a library of this machine."""
    library = folder / 'motor_board.so'
    warnings = ('-std=c++11', '-Wall', '-Wextra', '-Werror')
    command = [str(COMPILER), '-shared', '-fPIC', *warnings, f'-I{SKETCH}', str(SHIM)]
    subprocess.run([*command, '-o', str(library)], check=True)
    return library


class Board:
    """The functions of the library, with their types."""

    def __init__(self, library: Path) -> None:
        self._library = ctypes.CDLL(str(library))
        pointer, number, micros = ctypes.c_void_p, ctypes.c_float, ctypes.c_uint32
        for name, result, arguments in (
            ('motor_new', pointer, [number] * 6),
            ('motor_command', None, [pointer, number, micros]),
            ('motor_update', number, [pointer, ctypes.c_int32, micros]),
            ('motor_angle', ctypes.c_double, [pointer]),
            ('motor_rate', number, [pointer]),
            ('quadrature', ctypes.c_int, [ctypes.c_uint8] * 2),
            ('reader_new', pointer, []),
            ('reader_take', ctypes.c_char_p, [pointer, ctypes.c_char]),
            ('rates_of', ctypes.c_int, [ctypes.c_char_p, pointer, ctypes.c_int]),
            ('angles_line', ctypes.c_int, [pointer, ctypes.c_int, micros, pointer, ctypes.c_int]),
        ):
            function = getattr(self._library, name)
            function.restype, function.argtypes = result, arguments
            setattr(self, name, function)

    def rates(self, line: bytes, count: int) -> list[float] | None:
        numbers = (ctypes.c_float * count)()
        return list(numbers) if self.rates_of(line, numbers, count) else None

    def line(self, micros: int, angles: list[float], size: int = 96) -> bytes:
        text = ctypes.create_string_buffer(size)
        numbers = (ctypes.c_double * len(angles))(*angles)
        length = self.angles_line(text, size, micros, numbers, len(angles))
        return text.raw[:length]


class Motor:
    """The control of a motor, and a motor with a first-order lag and an encoder."""

    def __init__(
        self,
        board: Board,
        *,
        counts_per_turn: float = COUNTS_PER_TURN,
        full_rate: float = FULL_RATE,
        timeout: float = TIMEOUT,
    ) -> None:
        self._board = board
        given = counts_per_turn, full_rate, MAX_RATE, *GAINS, timeout
        self._control = board.motor_new(*given)
        # The shaft: its true rate at full voltage [rad/s], and the true counts of its turn.
        self.full_rate = full_rate
        self.counts_per_turn = counts_per_turn
        self.rate = 0.0
        self.true_angle = 0.0
        self.duty = 0.0
        self.counter = FIRST_COUNTER

    @property
    def angle(self) -> float:
        return float(self._board.motor_angle(self._control))

    def command(self, rate: float, micros: int) -> None:
        self._board.motor_command(self._control, rate, micros % 2**32)

    def update(self, micros: int, dt: float) -> float:
        """Turn for a time [s], then control."""
        self.rate += (self.duty * self.full_rate - self.rate) * (1.0 - exp(-dt / LAG))
        self.true_angle += self.rate * dt
        self.counter = FIRST_COUNTER + round(self.true_angle * self.counts_per_turn / tau)
        signed = (self.counter + 2**31) % 2**32 - 2**31
        self.duty = float(self._board.motor_update(self._control, signed, micros % 2**32))
        return self.duty


def main() -> None:
    board = Board(Path(sys.argv[1]))
    port = int(sys.argv[2])
    os.set_blocking(port, False)
    timeout = float(sys.argv[4])
    motors = [
        Motor(
            board,
            counts_per_turn=sign * COUNTS_PER_TURN,
            full_rate=sign * FULL_RATE,
            timeout=timeout,
        )
        for sign in (1.0, -1.0)
    ]
    reader = board.reader_new()
    start = last = monotonic()
    sent = 0.0
    with Path(sys.argv[3]).open('w', buffering=1) as log:
        while True:
            now = monotonic()
            micros = FIRST_MICROS + round((now - start) * 1e6)
            _take(board, reader, port, motors, micros)
            for motor in motors:
                motor.update(micros, now - last)
            last = now
            if now - sent >= LINE_PERIOD:
                sent = now
                _send(port, board.line(micros % 2**32, [motor.angle for motor in motors]))
                rates, duties = zip(*((motor.rate, motor.duty) for motor in motors), strict=True)
                print(now, *rates, *duties, file=log)
            sleep(PERIOD)


def _take(board: Board, reader: int, port: int, motors: list[Motor], micros: int) -> None:
    try:
        received = os.read(port, 4096)
    except OSError:
        # Nothing to read, or nobody at the other end.
        return
    for byte in received:
        line = board.reader_take(reader, bytes([byte]))
        rates = board.rates(line, len(motors)) if line else None
        for motor, rate in zip(motors, rates or [], strict=False):
            motor.command(rate, micros)


def _send(port: int, line: bytes) -> None:
    try:
        os.write(port, line)
    except OSError:
        # Nobody reads.
        return


if __name__ == '__main__':
    main()
