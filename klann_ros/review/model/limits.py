"""What is still all right: the limits of the checks, and a file to change them."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import inf
import sys
from typing import Any

from klann_ros.log.errors import LogError
from klann_ros.sanitize.files import read_plain
from klann_ros.sanitize.text import printable_line
from klann_ros.sanitize.yaml_text import LONGEST, parse


class LimitsFileError(LogError):
    """A file that holds no limits; the text says why."""


@dataclass(frozen=True)
class Limits:
    """
    The limits of the checks; each is the greatest value that is no finding.

    Attributes
    ----------
    gap_periods, gap_time : float
        A silence on a topic is a gap if it is longer than so many periods, and than this [s].
    start_time : float
        A silence that begins so soon after its topic's first message is no gap: nodes start [s].
    stale_time : float
        A topic is stale if it ends so long before the run does [s].
    latency : float
        Time from publishing to receiving that one message in a hundred may exceed [s].
    clock_offset : float
        Difference of a stamp from the time of publishing, in the median [s].
    closure : float
        By how much the loops of a recorded pose may not close [m].
    angle : float
        Difference of an angle from the one solved again [rad], for a dyad that is not singular.
    foot : float
        Distance of point_h from the foot of its pose [m].
    crank_jump : float
        Change of the crank angle from one input to the next [rad].
    path_drift : float
        Distance between the foot's paths in the first and the last part of the run [m].
    crank_lag, phase : float
        Difference of a walker's crank from its command, and of two cranks' distance from what was
        commanded [rad].
    odometry : float
        Distance of odometry from the ground truth, as a part of the way.
    torque : float
        Difference of a crank's effort from the torque that the masses of its legs take, as a part
        of the greatest such torque in the run; besides what is not known of the motion.
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


# YAML knows integers that are larger.
_LARGEST = sys.float_info.max
NAMES = tuple(field.name for field in fields(Limits))


def limits_from_file(path: str) -> Limits:
    """
    Return the limits in a YAML file: a mapping of those that are to be others.

    Raises
    ------
    LimitsFileError
        The file cannot be read, or holds no limits.

    """
    try:
        return limits_from(parse(read_plain(path, LONGEST)))
    except OSError as error:
        raise LimitsFileError(f'{path} cannot be read: {error.strerror}') from error
    except ValueError as error:
        raise LimitsFileError(f'{path} holds no limits: {printable_line(error)}') from error


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
