"""Checks of users' values: the value for the computation, or an error of one line."""

from collections.abc import Sequence
import math
from numbers import Integral, Real
from typing import Any

from klann_ros.kinematics.arrays import FloatArray
from klann_ros.sanitize.text import printable
import numpy as np

from .angles import number_or_nan, TURN
from .errors import GeometryError

# Beyond these the product of four lengths over- or underflows.
MIN_MAGNITUDE, MAX_MAGNITUDE = 1e-60, 1e60
_WORDS = {2: 'two', 4: 'four'}


def finite(name: str, value: Any) -> float:
    """Return a number of a geometry as a float; a GeometryError for none, or one not finite."""
    number = number_or_nan(value)
    if not math.isfinite(number):
        raise GeometryError(f'{name} = {value!r} is refused: it must be a finite number')
    return number


def positive(name: str, length: float) -> None:
    """Refuse a length that is not > 0 [m] with a GeometryError."""
    if length <= 0.0:
        raise GeometryError(f'{name} = {length:g} m is refused: a length must be > 0')


def representable(name: str, value: float) -> None:
    """Refuse a number whose products over- or underflow with a GeometryError."""
    if value != 0.0 and not MIN_MAGNITUDE <= abs(value) <= MAX_MAGNITUDE:
        limits = f'{MIN_MAGNITUDE:g} .. {MAX_MAGNITUDE:g} m'
        raise GeometryError(f'{name} = {value:g} m is refused: it must be within {limits}')


def factor(value: Any) -> float:
    """Return a scale factor; raises a GeometryError unless it is finite and > 0."""
    number = finite('factor', value)
    if number <= 0.0:
        raise GeometryError(f'factor = {value!r} is refused: it must be > 0')
    return number


def bend(name: str, angle: float) -> None:
    """Refuse a bend beyond a turn [rad] with a GeometryError: degrees, maximum likely."""
    if not abs(angle) <= TURN:
        raise GeometryError(
            f'{name} = {angle:g} rad is refused: a bend must be within +-2 pi rad; '
            f'if {angle:g} deg are meant, give {math.radians(angle):.6g} rad'
        )


def signs(assembly: Any, count: int) -> tuple[int, ...]:
    """Return an assembly mode as a tuple; a GeometryError unless all `count` are +1 or -1."""
    try:
        # By place, since a set has no first.
        found = tuple(int(assembly[i]) for i in range(len(assembly)) if assembly[i] in (-1, 1))
        whole = len(found) == len(assembly) == count
    except (TypeError, ValueError, LookupError):
        whole = False
    if not whole:
        many = 'one sign,' if count == 1 else f'{_WORDS.get(count, count)} signs, each'
        shown = printable(repr(assembly), 100)
        raise GeometryError(f'assembly = {shown} is refused: it must be {many} +1 or -1')
    return found


def setting(name: str, value: float, maximum: float = math.inf) -> float:
    """Return a solver's setting [rad]; a ValueError unless it is finite, > 0 and <= maximum."""
    if not (isinstance(value, Real) and 0.0 < value <= maximum and value < math.inf):
        limit = '' if maximum == math.inf else f' and at most {maximum:g} rad'
        raise ValueError(f'{name} = {value!r} is refused: it must be finite, > 0{limit}')
    return float(value)


def rate(name: str, value: float) -> None:
    """Refuse a rate or an acceleration that is not a finite number with a ValueError."""
    # The fast path: nearly every rate is a float.
    if not math.isfinite(value if type(value) is float else number_or_nan(value)):
        raise ValueError(f'{name} = {value!r} is refused: it must be finite')


def count(name: str, value: int, minimum: int) -> int:
    """Return a count; raises a ValueError unless it is a whole number >= minimum."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < minimum:
        msg = f'{name} = {value!r} is refused: it must be a whole number, at least {minimum}'
        raise ValueError(msg)
    return int(value)


def guess(value: Sequence[float] | FloatArray, names: str, what: str = 'guess') -> FloatArray:
    """
    Return an iterate of Newton-Raphson as an array, one angle for each name [rad].

    A ValueError for anything but as many finite numbers as names, which are parted by commas.
    """
    count = names.count(',') + 1
    try:
        x_1 = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        x_1 = np.empty(0)
    if x_1.shape != (count,) or not np.isfinite(x_1).all():
        many = 'one finite number' if count == 1 else f'{_WORDS.get(count, count)} finite numbers'
        raise ValueError(f'{what} = {value!r} is refused: {names}, {many}')
    return x_1


def vector(name: str, values: Sequence[float]) -> tuple[float, float]:
    """Return two finite numbers as floats; a ValueError for anything else."""
    try:
        x, y = map(number_or_nan, values)
    except (TypeError, ValueError):
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ValueError(f'{name} = {values!r} is refused: it must be two finite numbers')
    return x, y


def unit(name: str, values: Sequence[float]) -> tuple[float, float]:
    """Return a direction (x, y) of length 1; a ValueError where it has none."""
    x, y = vector(name, values)
    largest = max(abs(x), abs(y))
    if largest == 0.0:
        raise ValueError(f'{name} = {values!r} is refused: it has no length')
    # Made about 1 long first, so that no square is too large or too small for a float.
    x, y = x / largest, y / largest
    return x / math.hypot(x, y), y / math.hypot(x, y)
