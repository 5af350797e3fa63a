"""Limits of the checks, and the YAML file that changes them."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import inf
import sys
from typing import Any

from klann_ros.log.errors import LogError
from klann_ros.sanitize.yaml_text import content_of_file


class LimitsFileError(LogError):
    """A file without valid limits; the text gives the reason."""


@dataclass(frozen=True)
class Limits:
    """The limits of the checks: the largest values without a finding."""

    gap_periods: float = 5.0  #: a longer interval is a gap [median intervals]
    gap_time: float = 0.05  #: if it is longer than this as well [s]
    start_time: float = 0.3  #: no gap begins this early in a topic: nodes start [s]
    stale_time: float = 2.0  #: a topic that ends earlier than this before the run is stale [s]
    latency: float = 0.1  #: time from publishing to receiving, 99th percentile [s]
    clock_offset: float = 0.5  #: median difference of a stamp from the time of publishing [s]
    closure: float = 1e-9  #: closure error of a recorded pose [m]
    #: Difference of an angle from the solved one, times the sine of the transmission angle [rad].
    angle: float = 1e-9
    foot: float = 1e-9  #: distance of point_h from the foot of its pose [m]
    crank_jump: float = 0.35  #: change of the crank angle from one input to the next [rad]
    path_drift: float = 1e-3  #: of the foot path from the first to the last part of the run [m]
    #: Difference of a crank's effort from the torque that the masses of its legs take, as a part
    #: of the largest such torque in the run; three standard errors come on top.
    torque: float = 0.1
    crank_lag: float = 0.35  #: difference of a walker's crank from its command [rad]
    phase: float = 0.2  #: and of the phase of two cranks [rad]
    odometry: float = 0.05  #: distance of odometry from the ground truth, as a part of the way
    compare_path: float = 1e-6  #: difference of two runs' feet at the same crank angle [m]
    compare_angle: float = 1e-6  #: and of their angles [rad]
    compare_length: float = 0.0  #: of two geometries, in each length [m] and angle [rad]

    def max_interval(self, period: float) -> float:
        """Return the longest interval that is no gap, for a period [s]."""
        return max(self.gap_periods * period, self.gap_time)


# YAML knows integers that are larger.
_LARGEST = sys.float_info.max
NAMES = tuple(field.name for field in fields(Limits))


def limits_from_file(path: str) -> Limits:
    """
    Return the limits in a YAML file: a mapping of those that differ from the defaults.

    Raises
    ------
    LimitsFileError
        The file cannot be read, or holds no limits.

    """
    return content_of_file(path, limits_from, 'limits', LimitsFileError)


def limits_from(content: Any) -> Limits:
    """Return the limits in a mapping; a ValueError for anything but limits and numbers >= 0."""
    if not isinstance(content, Mapping):
        raise ValueError('it must be a mapping, such as "gap_time: 0.2"')  # noqa: TRY004 - as all
    unknown = sorted(map(str, content.keys() - set(NAMES)))
    if unknown:
        raise ValueError(f'{", ".join(unknown)}: no such limit; there are {", ".join(NAMES)}')
    for name, value in content.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and 0 <= value < inf):
            raise ValueError(f'{name} = {value!r} is refused: it must be a number >= 0')
    return Limits(**{name: float(min(value, _LARGEST)) for name, value in content.items()})
