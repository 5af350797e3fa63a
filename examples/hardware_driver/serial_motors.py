"""
Motors of a board on a serial port; this module needs pyserial.

The line protocol, of which examples/esp32_driver is the other end:

    R 0.500 -0.500*3B            to the board: rates of the shafts [rad/s]
    S 1234567 0.1250 3.1416*02   from the board: time [us, modulo 2^32], angles of the shafts [rad]

A line ends with a line feed. The two digits are the exclusive or of all bytes before the star, as
in NMEA 0183: a line with another sum is dropped, as a lost digit would change a rate.
"""

from collections.abc import Sequence
from contextlib import suppress
from functools import reduce
from math import inf
from operator import xor
from time import monotonic
from typing import Any

from motors import MotorReading
from serial import Serial, SerialTimeoutException

BAUD_RATE = 115200
# The clock of a board may be slower than ours by this part.
CLOCK_DRIFT = 1e-4


class SerialMotors:
    """Motors of a board on a serial port."""

    def __init__(self, port: str, count: int) -> None:
        self._name, self._count = port, count
        self._port: Any = None
        self._received = b''
        # Time of the board since its first line [s], its last counter [us], and our time at its 0.
        self._board_time = 0.0
        self._counter: int | None = None
        self._offset = inf

    def connect(self) -> None:
        """Open the port; an OSError says why it cannot be opened."""
        self._port = Serial(self._name, BAUD_RATE, timeout=0.0, write_timeout=0.1)
        self.write_rates([0.0] * self._count)

    def write_rates(self, rates: Sequence[float]) -> None:
        """Send a line; an OSError says that the port is gone."""
        # A board that is busy misses a line; one that hangs stands by its own timeout.
        with suppress(SerialTimeoutException):
            self._port.write(line_of(['R', *(f'{rate:.4f}' for rate in rates)]))

    def read_angles(self) -> MotorReading | None:
        """Return the last whole measurement among the lines received since the last call."""
        *lines, self._received = (self._received + self._port.read(4096)).split(b'\n')
        reading = None
        for line in lines:
            words = words_of(line)
            if len(words) == self._count + 2 and words[0] == 'S':
                with suppress(ValueError):
                    time = self._measurement_time(int(words[1]))
                    reading = MotorReading(time, [float(word) for word in words[2:]])
        return reading

    def _measurement_time(self, counter: int) -> float:
        """Return the time of a measurement: of all lines the quickest tells the board's clock."""
        last_counter = counter if self._counter is None else self._counter
        elapsed = (counter - last_counter) % 2**32 / 1e6
        self._counter = counter
        self._board_time += elapsed
        # A line is never early, only late.
        offset = monotonic() - self._board_time
        self._offset = min(self._offset + CLOCK_DRIFT * elapsed, offset)
        return self._board_time + self._offset


def line_of(words: Sequence[str]) -> bytes:
    """Return a line of the protocol."""
    text = ' '.join(words)
    return f'{text}*{reduce(xor, text.encode(), 0):02X}\n'.encode()


def words_of(line: bytes) -> list[str]:
    """Return the words of a line; none if its sum is wrong."""
    text, _, total = line.strip().partition(b'*')
    is_whole = total == b'%02X' % reduce(xor, text, 0)
    return text.decode('ascii', 'replace').split() if is_whole else []
