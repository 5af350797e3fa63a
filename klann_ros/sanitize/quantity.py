"""Quantities as people write them: a number, and a unit that is converted into another one."""

from collections.abc import Mapping
from functools import cache
from math import isfinite, isinf, nan
from pathlib import Path
import re
from typing import Any, NamedTuple
import unicodedata

from .yaml_text import parse_file

MAX_QUANTITY = 64
"""Longest text of a quantity [characters]."""

# Sign, number (a space may stand before three digits), denominator, power of ten, unit.
NUMBER = re.compile(
    r'([+-]?) ?((?:\d(?:[\d.,]| (?=\d{3}(?!\d)))*|[.,]\d+)) ?(?:/ ?(\d+) ?)?'
    r'(?:(?:e|[x*·×] ?10 ?(?:\^|\*\*)?) ?\(?([+-]?\d{1,3})\)?)? ?(.*)',
    re.ASCII | re.IGNORECASE,
)
# Thousands in groups, the decimal separator another one.
GROUPED = re.compile(r'([1-9]\d{0,2}([ .,])\d{3}(?:\2\d{3})*)(?:(?!\2)([.,]\d*))?', re.ASCII)
# Degrees, minutes and seconds of arc.
SEXAGESIMAL = re.compile(
    r"""(\d+) ?[°º˚] ?([0-5]?\d(?:[.,]\d+)?) ?'(?: ?([0-5]?\d(?:[.,]\d+)?) ?")?""", re.ASCII
)
# The symbol before a number, such as `x =`.
SYMBOL = re.compile('^[^=≈≅~<>]*[=≈≅~] ?')
# Operator, parentheses, name and its power, or a sign without one, parentheses.
FACTOR = re.compile(
    r' ?(?:([*·⋅×./-]) ?)?(\(*) ?(?:([A-Za-zµμ]+)(?:(?: ?(?:\^|\*\*) ?)?(\([+-]?\d\)|[+-]?\d))?'
    r"""|([°º˚'"π])) ?(\)*)""",
    re.ASCII,
)
# Marks of direction and joints of words, which are not seen.
UNSEEN = re.compile('[\u00ad\u200b-\u200f\u2060\ufeff]')
SUPERSCRIPT = re.compile('[⁺⁻]?[⁰¹²³⁴⁵⁶⁷⁸⁹]+')
EXPONENTS = str.maketrans('⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻', '0123456789+-')
# Minus sign and en dash, typographic quotes and primes.
TYPED = str.maketrans('\u2212\u2013\u2019\u2032\u201d\u2033', '--\'\'""')


class Unit(NamedTuple):
    """A unit: its size in m, g, s and rad, and the number of its dimension, 0 of a number."""

    size: float
    dimension: int


def read_quantity(text: str, unit: str = '') -> float | None:
    """
    Return a quantity as a number in a unit; None where it is none, NaN of another dimension.

    A number alone is in the unit. A decimal comma, grouped thousands, a true minus, a fraction, a
    power of ten, minutes of arc, and a symbol with an equals sign before it are legal. A unit is a
    product of names with prefixes and powers. An angle in rad is a number, as in SI.
    """
    plain = tidy(text) if len(text) <= 4 * MAX_QUANTITY else ''
    if len(plain) > MAX_QUANTITY:
        return None
    match = NUMBER.fullmatch(SEXAGESIMAL.sub(_degrees, SYMBOL.sub('', plain)))
    if not match:
        return None
    sign, digits, denominator, exponent, name = match.groups()
    try:
        number = float(f'{sign}{_decimal(digits)}e{exponent or 0}') / float(denominator or 1)
    except (ValueError, ZeroDivisionError):
        return None
    factor = conversion_factor(name, unit) if name else 1.0
    if factor is None or not isfinite(number) or isinf(number * factor):
        return None
    return number * factor


def conversion_factor(name: str, unit: str) -> float | None:
    """Return the size of a unit in another one; None if unknown, NaN of another dimension."""
    asked = _read_unit('' if unit == '1' else tidy(unit), _units())
    # One divided by a unit; the stop of an abbreviation.
    name = re.sub(r'^1 ?(?=/)|(?<=[A-Za-z])\.$', '', tidy(name))
    folded_name = folded(name)
    for word, sign in unit_table()['words'].items():
        folded_name = folded_name.replace(word, sign)
    factor = None
    for reading in (_read_unit(name, _units()), _read_unit(folded_name, _folded_units())):
        if reading and asked and reading.dimension == asked.dimension:
            return reading.size / asked.size
        factor = nan if reading else factor
    return factor


def tidy(text: str) -> str:
    """Return a text with plain signs and spaces, and powers after carets."""
    text = UNSEEN.sub('', text).translate(TYPED).replace("''", '"')
    text = SUPERSCRIPT.sub(lambda match: f'^{match[0].translate(EXPONENTS)}', text)
    return ' '.join(text.split())


def folded(text: str) -> str:
    """Return a text without accents, in small letters."""
    decomposed = unicodedata.normalize('NFD', text.lower())
    return ''.join(c for c in decomposed if not unicodedata.combining(c))


@cache
def unit_table() -> dict[str, Any]:
    """Return the content of units.yaml."""
    content: dict[str, Any] = parse_file(Path(__file__).with_name('units.yaml'))
    return content


@cache
def _units() -> dict[str, Unit]:
    """Return the units by their names, without prefixes."""
    table = unit_table()
    units: dict[str, Unit] = {}
    for names, dimension in table['base'].items():
        units |= dict.fromkeys(names.split(), Unit(1.0, dimension))
    for names, definition in table['units'].items():
        factor, _, name = str(definition).partition(' ')
        unit = _read_unit(name, units)
        if unit is None:
            raise ValueError(f'units.yaml: {definition} is no unit')
        units |= dict.fromkeys(names.split(), unit._replace(size=float(factor) * unit.size))
    return units


@cache
def _folded_units() -> dict[str, Unit]:
    return {folded(name): unit for name, unit in _units().items()}


def _read_unit(text: str, units: Mapping[str, Unit]) -> Unit | None:
    """Return a product of units; None where it is none."""
    size = 1.0
    dimension = 0
    # Of the product, and of each open parenthesis.
    signs = [1]
    end = 0
    while end < len(text):
        factor = FACTOR.match(text, end)
        if not factor:
            return None
        operator, opened, name, power, symbol, closed = factor.groups()
        unit = _look_up(name or symbol, units)
        sign = -signs[-1] if operator == '/' else signs[-1]
        signs += [sign] * len(opened)
        if not unit or len(closed) >= len(signs):
            return None
        exponent = sign * int((power or '1').strip('()'))
        size *= unit.size**exponent
        dimension += exponent * unit.dimension
        open_count = len(signs) - len(closed)
        del signs[open_count:]
        end = factor.end()
    return Unit(size, dimension) if len(signs) == 1 else None


def _look_up(name: str, units: Mapping[str, Unit]) -> Unit | None:
    """Return the unit of a name, or of a prefix and a name."""
    for prefix, factor in unit_table()['prefixes'].items():
        unit = units.get(name.removeprefix(prefix))
        if unit and name.startswith(prefix):
            return unit._replace(size=factor * unit.size)
    return None


def _degrees(match: re.Match[str]) -> str:
    """Return degrees, minutes and seconds as decimal degrees."""
    numbers = [text.replace(',', '.') for text in match.groups(default='0')]
    whole, minutes, seconds = map(float, numbers)
    return f'{whole + minutes / 60.0 + seconds / 3600.0} deg'


def _decimal(number: str) -> str:
    """Return a number with a decimal point and without the separators of thousands."""
    if re.search('[., ].*[., ]| ', number):
        groups = GROUPED.fullmatch(number)
        if not groups:
            raise ValueError(number)
        number = re.sub('[., ]', '', groups[1]) + (groups[3] or '')
    return number.replace(',', '.')
