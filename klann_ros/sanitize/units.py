"""Warnings about numbers that look like millimetres or degrees."""

from collections.abc import Callable, Iterable, Mapping
from contextvars import ContextVar
from functools import lru_cache
from math import degrees, radians, tau
import warnings

from .text import printable_line

MAX_LENGTH = 20.0
"""A longer bar is legal, but probably given in millimetres [m]."""
_reports: list[Callable[[str], object]] = []  # the report of a program; empty in Python
# Whether `warn_of_degrees` does nothing, in this thread only.
omits_degrees = ContextVar('omits_degrees', default=False)


class UnitWarning(UserWarning):
    """A legal number, probably given in another unit."""


def warn_of_lengths(
    lengths: Mapping[str, float], advice: str = '', limit: float = MAX_LENGTH
) -> None:
    """Warn of the largest length [m] by its name, beyond a limit; `advice` is the remedy."""
    name = max(lengths, key=lambda key: abs(lengths[key]), default='')
    length = lengths.get(name, 0.0)
    if abs(length) > limit:
        advice = advice or f'write {length / 1000.0:.6g}'
        _warn(f'{name} = {length:.6g} is read as {length:.6g} m: if it is in mm, {advice}')


def warn_of_angle(name: str, angle: float) -> None:
    """Warn of an angle [rad] beyond a turn."""
    if abs(angle) > tau:
        meaning = f'{angle:.6g} rad ({degrees(angle):.6g} deg)'
        advice = f'if it is in degrees, write {radians(angle):.6g}'
        _warn(f'{name} = {angle:.6g} is read as {meaning}: {advice}')


def warn_of_degrees(name: str, angles: Iterable[float]) -> None:
    """Warn of angles [rad] that are whole numbers, and one of them beyond a turn."""
    numbers = [] if omits_degrees.get() else [float(angle) for angle in angles]
    if any(abs(number) > tau for number in numbers) and all(map(float.is_integer, numbers)):
        advice = 'in Python with klann_ros.kinematics.deg, 60 degrees are 60 * deg'
        if _reports:
            advice = 'if it is in degrees, convert it (60 deg are 1.0472 rad)'
        _warn(f'{name} beyond 2 pi, in whole numbers, is read in rad: {advice}')


def report_unit_warnings(report: Callable[[str], object]) -> None:
    """Report unit warnings of this process by a function, each text once, instead of Python's."""
    _reports[:] = [lru_cache(report)]


def _warn(text: str) -> None:
    line = printable_line(text)
    if _reports:
        _reports[0](line)
    else:
        # All warnings come from this line, so that each text is shown once in a process.
        warnings.warn(line, UnitWarning, stacklevel=1)
