"""Checks of users' numbers: the number for the computation, or an error of one line."""

from collections.abc import Sequence
import math
from numbers import Integral
from typing import Any

from klann_ros.kinematics.arrays import AnyArray, FloatArray
from klann_ros.sanitize.text import printable
from klann_ros.sanitize.units import warn_of_degrees
import numpy as np
from numpy.typing import ArrayLike

from .angles import number_or_nan, TURN
from .errors import GeometryError

# Beyond these the product of four lengths over- or underflows.
MIN_MAGNITUDE, MAX_MAGNITUDE = 1e-60, 1e60
_WORDS = {2: 'two', 4: 'four'}


def finite_number(name: str, argument: Any) -> float:
    """Return a number of a geometry as a float; a GeometryError for none, or one not finite."""
    number = number_or_nan(argument)
    if not math.isfinite(number):
        raise GeometryError(f'{name} = {argument!r} is refused: it must be a finite number')
    return number


def check_length(name: str, length: float, unit: str = ' m') -> None:
    """Refuse a length that is not > 0 with a GeometryError."""
    if length <= 0.0:
        raise GeometryError(f'{name} = {length:g}{unit} is refused: a length must be > 0')


def check_magnitude(name: str, length: float, unit: str = ' m') -> None:
    """Refuse a length whose products over- or underflow with a GeometryError."""
    if length != 0.0 and not MIN_MAGNITUDE <= abs(length) <= MAX_MAGNITUDE:
        limits = f'{MIN_MAGNITUDE:g} .. {MAX_MAGNITUDE:g}{unit}'
        raise GeometryError(f'{name} = {length:g}{unit} is refused: it must be within {limits}')


def positive_factor(argument: Any) -> float:
    """Return a scale factor; raises a GeometryError unless it is finite and > 0."""
    number = finite_number('factor', argument)
    if number <= 0.0:
        raise GeometryError(f'factor = {argument!r} is refused: it must be > 0')
    return number


def check_bend(name: str, angle: float) -> None:
    """Refuse a bend beyond a turn [rad] with a GeometryError: degrees, maximum likely."""
    if not abs(angle) <= TURN:
        raise GeometryError(
            f'{name} = {angle:g} rad is refused: a bend must be within +-2 pi rad; '
            f'if {angle:g} deg are meant, give {math.radians(angle):.6g} rad'
        )


def assembly_signs(assembly: Any, count: int) -> tuple[int, ...]:
    """Return an assembly mode as a tuple; a GeometryError unless all `count` are +1 or -1."""
    try:
        # By index, since a set has no order.
        mode = tuple(int(assembly[i]) for i in range(len(assembly)) if assembly[i] in (-1, 1))
        is_valid = len(mode) == len(assembly) == count
    except (TypeError, ValueError, LookupError):
        is_valid = False
    if not is_valid:
        number = 'one sign,' if count == 1 else f'{_WORDS.get(count, count)} signs, each'
        received = printable(repr(assembly), 100)
        raise GeometryError(f'assembly = {received} is refused: it must be {number} +1 or -1')
    return mode


def positive_setting(name: str, argument: Any, maximum: float = math.inf) -> float:
    """
    Return a positive setting of a solver, such as its tolerance [rad].

    A ValueError unless it is a finite number, > 0 and at most `maximum` [rad].
    """
    number = number_or_nan(argument)
    if not (math.isfinite(number) and 0.0 < number <= maximum):
        limit = '' if maximum == math.inf else f' and at most {maximum:g} rad'
        raise ValueError(f'{name} = {argument!r} is refused: it must be finite, > 0{limit}')
    return number


def choice(name: str, argument: Any, choices: Sequence[str]) -> str:
    """Return one of some texts; a GeometryError for anything else."""
    if argument not in choices:
        raise GeometryError(f'{name} = {argument!r} is refused: it must be {" or ".join(choices)}')
    return str(argument)


def check_rate(name: str, number: float) -> None:
    """Refuse a rate or an acceleration that is not a finite number with a ValueError."""
    # The fast path: nearly every rate is a float.
    if not math.isfinite(number if type(number) is float else number_or_nan(number)):
        raise ValueError(f'{name} = {number!r} is refused: it must be finite')


def real_array(name: str, numbers: ArrayLike) -> AnyArray:
    """Return an array of real numbers; a ValueError for anything else."""
    try:
        array = np.asarray(numbers)
        if array.dtype.kind == 'O':
            # None, which a cast would turn into NaN, is no float.
            array = np.asarray(np.frompyfunc(float, 1, 1)(array), dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        msg = f'{name} is refused: it must be an array of real numbers ({error})'
        raise ValueError(msg) from None
    if array.dtype.kind not in 'iuf':
        msg = f'{name} is refused: it must be an array of real numbers, not of {array.dtype}'
        raise ValueError(msg)
    return array


def whole_number(name: str, number: int, minimum: int) -> int:
    """Return a count; raises a ValueError unless it is a whole number >= minimum."""
    if isinstance(number, bool) or not isinstance(number, Integral) or number < minimum:
        msg = f'{name} = {number!r} is refused: it must be a whole number, at least {minimum}'
        raise ValueError(msg)
    return int(number)


def finite_angles(
    angles: Sequence[float] | FloatArray, names: str, role: str = 'guess'
) -> FloatArray:
    """
    Return an iterate of Newton-Raphson as an array, one angle for each name [rad].

    A ValueError for anything but as many finite numbers as names, which are parted by commas.
    """
    count = names.count(',') + 1
    try:
        x_1 = np.asarray(angles, dtype=np.float64)
    except (TypeError, ValueError):
        x_1 = np.empty(0)
    if x_1.shape != (count,) or not np.isfinite(x_1).all():
        many = 'one finite number' if count == 1 else f'{_WORDS.get(count, count)} finite numbers'
        raise ValueError(f'{role} = {angles!r} is refused: {names}, {many}')
    warn_of_degrees(role, x_1.tolist())
    return x_1


def finite_vector(name: str, coordinates: Sequence[float]) -> tuple[float, float]:
    """Return two finite numbers as floats; a ValueError for anything else."""
    try:
        x, y = map(number_or_nan, coordinates)
    except (TypeError, ValueError):
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ValueError(f'{name} = {coordinates!r} is refused: it must be two finite numbers')
    return x, y


def unit_vector(name: str, coordinates: Sequence[float]) -> tuple[float, float]:
    """Return the vector of length 1 in a direction (x, y); a ValueError if both are 0."""
    x, y = finite_vector(name, coordinates)
    scale = max(abs(x), abs(y))
    if scale == 0.0:
        raise ValueError(f'{name} = {coordinates!r} is refused: it has no length')
    # Scaled first: the length of a huge vector is infinite, that of a tiny one has few digits.
    x /= scale
    y /= scale
    length = math.hypot(x, y)
    return x / length, y / length
