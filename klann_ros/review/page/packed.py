"""Columns of numbers as they stand in the page: little-endian, in base64."""

from base64 import b64encode
from math import pi
from typing import Any

from klann_ros.review.model.times import Floats
import numpy as np
from numpy.typing import NDArray

Packed = dict[str, Any]

# The greatest of 32 bits, and what stands for a number that there is none of.
_MOST = 2**31 - 1
_NONE = -(2**31)
_TURN = 2.0 * pi


def floats(values: NDArray[Any]) -> Packed:
    """Return numbers to the seventh digit; NaN stays what it is."""
    with np.errstate(over='ignore'):
        return _packed('f32', values.astype('<f4'))


def times(seconds: Floats) -> Packed:
    """Return times to the microsecond, or to 2^-31 of the longest."""
    longest = float(seconds.max(initial=0.0))
    return _scaled(seconds, max(1e-6, longest / _MOST))


def angles(radians: Floats) -> Packed:
    """Return angles modulo a turn, to 2^-32 of it: 1.5e-9 rad, less than 1e-8 of any length."""
    with np.errstate(invalid='ignore', over='ignore'):
        parts = radians / _TURN
        # Of more turns than these no double tells the part.
        parts = np.where(np.abs(parts) <= _MOST, parts - np.round(parts), np.nan)
        return _scaled(parts * _TURN, _TURN / 2.0**32)


def turns(radians: Floats) -> Packed:
    """Return the whole turns that `angles` leaves out."""
    with np.errstate(invalid='ignore', over='ignore'):
        return _scaled(np.round(radians / _TURN), 1.0)


def _scaled(values: Floats, scale: float) -> Packed:
    with np.errstate(invalid='ignore', over='ignore'):
        counts = np.round(values / scale)
        known = np.abs(counts) <= _MOST + 1.0
    counts = np.where(known, np.clip(counts, -_MOST, _MOST), _NONE)
    packed = _packed('i32', counts.astype('<i4'))
    return {**packed, 'scale': scale}


def _packed(kind: str, array: NDArray[Any]) -> Packed:
    return {'kind': kind, 'data': b64encode(array.tobytes()).decode('ascii')}
