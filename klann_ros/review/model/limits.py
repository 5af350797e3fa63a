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
    """
    The limits of the checks: the largest values without a finding.

    Attributes
    ----------
    gap_periods, gap_time : float
        An interval without messages is a gap above this number of periods, and this time [s].
    start_time : float
        No gap begins within this time of the topic's first message: nodes start [s].
    stale_time : float
        A topic that ends earlier than this before the run is stale [s].
    latency : float
        Time from publishing to receiving, 99th percentile [s].
    clock_offset : float
        Difference of a stamp from the time of publishing, in the median [s].
    closure : float
        Closure error of a recorded pose [m].
    angle : float
        Difference of an angle from the solved one [rad], times the sine of the transmission angle.
    foot : float
        Distance of point_h from the foot of its pose [m].
    crank_jump : float
        Change of the crank angle from one input to the next [rad].
    path_drift : float
        Distance between the foot's paths in the first and the last part of the run [m].
    crank_lag, phase : float
        Difference of a walker's crank, and of the phase of two cranks, from the command [rad].
    odometry : float
        Distance of odometry from the ground truth, as a part of the way.
    torque : float
        Difference of a crank's effort from the torque that the masses of its legs take, as a part
        of the largest such torque in the run; three standard errors come on top.
    compare_path, compare_angle : float
        Differences of two runs at the same crank angle: of the feet [m], of the angles [rad].
    compare_length : float
        Difference of two geometries, in each of their lengths [m] and angles [rad].

    """

    gap_periods: float = 5.0
    gap_time: float = 0.05
    start_time: float = 0.3
    stale_time: float = 2.0
    latency: float = 0.1
    clock_offset: float = 0.5
    closure: float = 1e-9
    angle: float = 1e-9
    foot: float = 1e-9
    crank_jump: float = 0.35
    path_drift: float = 1e-3
    torque: float = 0.1
    crank_lag: float = 0.35
    phase: float = 0.2
    odometry: float = 0.05
    compare_path: float = 1e-6
    compare_angle: float = 1e-6
    compare_length: float = 0.0

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
