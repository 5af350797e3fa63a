"""Simulated time: which of a run's times are those of /clock, and when that stood still."""

from collections.abc import Iterator

import numpy as np

from .recording import Series
from .times import Floats, Hole, median

CLOCK = '/clock'
# Log times are those of /clock if both agree so far, in the median [s].
_SAME = 0.5
# A pause of the simulation: time that advances less than this part of the log's, for so long [s].
_SLOW, _LONG = 0.1, 0.05


def is_time_of_log(clock: Series) -> bool:
    """Return whether the log times are simulated, as those of `ros2 bag record --use-sim-time`."""
    return bool(len(clock)) and abs(median((clock.times - clock.stamps) / 1e9)) < _SAME


def is_simulated(series: Series, clock: Series) -> bool:
    """Return whether the stamps of a series are nearer to /clock than to the log times."""
    if not (len(series) and len(clock)) or is_time_of_log(clock):
        return False
    return abs(median(offsets(series, clock))) < abs(median((series.stamps - series.times) / 1e9))


def offsets(series: Series, clock: Series) -> Floats:
    """Return how far the stamps of a series are ahead of /clock at their log times [s]."""
    start, zero = int(clock.times[0]), int(clock.stamps[0])
    since, shown = (clock.times - start) / 1e9, (clock.stamps - zero) / 1e9
    found: Floats = (series.stamps - zero) / 1e9 - np.interp(
        (series.times - start) / 1e9, since, shown
    )
    return found


def resolution(clock: Series) -> float:
    """Return by how much log times advance at once where they are simulated; else 0 [s]."""
    if len(clock) < 2 or not is_time_of_log(clock):
        return 0.0
    return median(np.diff(clock.stamps) / 1e9)


def pauses(clock: Series) -> Iterator[Hole]:
    """Yield from when to when simulated time stood still, log times [ns]."""
    passed, shown = (np.diff(times) / 1e9 for times in (clock.times, clock.stamps))
    stood = (shown <= 0.0) | ((passed > _LONG) & (shown < _SLOW * passed))
    for row in np.flatnonzero(stood).tolist():
        yield int(clock.times[row]), int(clock.times[row + 1])
