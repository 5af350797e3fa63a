"""Warnings about numbers that look like millimetres or degrees."""

from collections.abc import Callable, Mapping
from math import degrees, radians, tau
from typing import Any
import warnings

from .text import printable_line

MAX_LENGTH = 20.0
"""A longer bar is legal, but probably given in millimetres [m]."""


class UnitWarning(UserWarning):
    """A legal number, probably given in another unit."""


def warn_of_lengths(lengths: Mapping[str, float], advice: str = '') -> None:
    """Warn of the largest of lengths [m] by name, if it is beyond 20 m; `advice`: the remedy."""
    name = max(lengths, key=lambda key: abs(lengths[key]), default='')
    value = lengths.get(name, 0.0)
    if abs(value) > MAX_LENGTH:
        advice = advice or f'write {value / 1000.0:.6g}'
        _warn(f'{name} = {value:.6g} is read as {value:.6g} m: if it is in mm, {advice}')


def warn_of_angle(name: str, value: float) -> None:
    """Warn of an angle [rad] beyond a turn."""
    if abs(value) > tau:
        read = f'{value:.6g} rad ({degrees(value):.6g} deg)'
        advice = f'if it is in degrees, write {radians(value):.6g}'
        _warn(f'{name} = {value:.6g} is read as {read}: {advice}')


def report_unit_warnings(report: Callable[[str], object]) -> None:
    """Report unit warnings of this process by a function; others are shown as before."""
    show = warnings.showwarning

    def show_warning(message: Any, category: type[Warning], *others: Any, **named: Any) -> None:
        if issubclass(category, UnitWarning):
            report(str(message))
        else:
            show(message, category, *others, **named)

    warnings.showwarning = show_warning


def _warn(text: str) -> None:
    # All come from this line, so that each text is shown once in a process.
    warnings.warn(printable_line(text), UnitWarning, stacklevel=1)
