"""Quantities as people write them: a number, and a unit that is converted into another one."""

from collections.abc import Mapping
from functools import cache
from math import isfinite, isinf, nan
from pathlib import Path
import re
from typing import Any
import unicodedata

from .yaml_text import parse_file

MAX_QUANTITY = 64
"""Longest text of a quantity [characters]."""

# The size of a unit in m, g, s and rad, and the number of its dimension, 0 of a number.
Unit = tuple[float, int]


def read_quantity(text: str, unit: str) -> float | None:
    """
    Return a quantity as a number in a unit; None where it is none, NaN of another dimension.

    A number alone is in the unit. A decimal comma, grouped thousands, a true minus, a fraction, a
    multiple of π, a power of ten, minutes of arc, and a symbol with an equals sign before it are
    legal. A unit is a product of names with prefixes and powers. An angle in rad is a number, as
    in SI.
    """
    patterns = unit_table()['patterns']
    plain = tidy(text) if len(text) <= 4 * MAX_QUANTITY else ''
    match = re.fullmatch(patterns['quantity'], re.sub(patterns['arc'], _degrees, plain))
    if len(plain) > MAX_QUANTITY or not match:
        return None
    sign, digits, pi, denominator, exponent, name = match.groups(default='')
    name = f'{pi} {name}'.strip()
    if groups := re.fullmatch(patterns['grouped'], digits):
        digits = re.sub('[., ]', '', groups[1]) + (groups[3] or '')
    try:
        number = float(f'{sign}{digits.replace(",", ".") or 1}e{exponent or 0}')
        number /= float(denominator or 1)
    except (ValueError, ZeroDivisionError):
        return None
    factor = conversion_factor(name, unit) if name else 1.0
    if factor is None or not isfinite(number) or isinf(number * factor):
        return None
    return number * factor


def conversion_factor(name: str, unit: str) -> float | None:
    """Return the size of a unit in another one; None if unknown, NaN of another dimension."""
    asked = _read_unit(tidy(unit), _units())
    reading = _read_unit(tidy(name), _units())
    if not reading or not asked:
        return None
    return reading[0] / asked[0] if reading[1] == asked[1] else nan


def si_size(name: str) -> float | None:
    """Return the size of a unit in SI units; None if unknown."""
    reading = _read_unit(tidy(name), _units())
    return reading[0] if reading else None


def tidy(text: str) -> str:
    """Return a text in small letters, with plain signs and spaces, and powers after carets."""
    # Mega, before its letter is small.
    decomposed = unicodedata.normalize('NFD', re.sub('M(?=[NWJ])', 'mega', text).lower())
    for pattern, replacement in unit_table()['tidy'].items():
        decomposed = re.sub(pattern, replacement, decomposed)
    return decomposed.strip()


@cache
def unit_table() -> dict[str, Any]:
    """Return the content of units.yaml."""
    content: dict[str, Any] = parse_file(Path(__file__).with_name('units.yaml'))
    return content


@cache
def _units() -> dict[str, Unit]:
    """Return the units by their names, without prefixes."""
    units: dict[str, Unit] = {}
    for names, dimension in unit_table()['base'].items():
        units |= dict.fromkeys(names.split(), (1.0, dimension))
    for names, definition in unit_table()['units'].items():
        factor, _, name = str(definition).partition(' ')
        size, dimension = _read_unit(name, units) or (nan, 0)
        units |= dict.fromkeys(names.split(), (float(factor) * size, dimension))
    return units


def _read_unit(text: str, units: Mapping[str, Unit]) -> Unit | None:
    """Return a product of units; None where it is none."""
    size, dimension = 1.0, 0
    # Of the product, and of each open parenthesis.
    signs = [1]
    end = 0
    while end < len(text):
        factor = re.compile(unit_table()['patterns']['factor']).match(text, end)
        if not factor:
            return None
        operator, opened, name, power, symbol, closed = factor.groups()
        unit = _look_up(name or symbol, units)
        sign = -signs[-1] if operator == '/' else signs[-1]
        signs += [sign] * len(opened)
        if not unit or len(closed) >= len(signs):
            return None
        exponent = sign * int((power or '1').strip('()'))
        size *= unit[0] ** exponent
        dimension += exponent * unit[1]
        signs = signs[: -len(closed) or None]
        end = factor.end()
    return (size, dimension) if len(signs) == 1 else None


def _look_up(name: str, units: Mapping[str, Unit]) -> Unit | None:
    """Return the unit of a name, or of a prefix and a name."""
    for prefix, factor in unit_table()['prefixes'].items():
        if name.startswith(prefix) and name.removeprefix(prefix) in units:
            size, dimension = units[name.removeprefix(prefix)]
            return factor * size, dimension
    return None


def _degrees(match: re.Match[str]) -> str:
    """Return degrees, minutes and seconds as decimal degrees."""
    numbers = [text.replace(',', '.') for text in match.groups(default='0')]
    whole, minutes, seconds = map(float, numbers)
    return f'{whole + minutes / 60.0 + seconds / 3600.0} deg'
