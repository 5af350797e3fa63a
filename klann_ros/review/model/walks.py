"""A robot that walks: what it was told, what its cranks did, and where it thinks it is."""

from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np

from .recording import Series, Walk
from .times import Floats

# Fewer messages, or a shorter way [m], tell nothing.
_LEAST, _SHORTEST = 10, 0.05


@dataclass(frozen=True)
class WalkFigures:
    """
    How a robot walked; NaN for what the run does not tell.

    Attributes
    ----------
    namespace : str
        Whose figures they are.
    way : float
        Length of its way: in truth, or else by odometry [m].
    odometry_error : float
        Largest distance of odometry from the truth, both from where they began [m].
    heading_error : float
        Largest difference of the headings [rad].
    crank_lag : float
        Largest difference of a crank from its command [rad].
    phase_error : float
        Largest difference of two cranks' distance from what was commanded [rad].
    odometry_time, lag_time, phase_time : int or None
        Log times of these largest ones [ns].

    """

    namespace: str
    way: float = nan
    odometry_error: float = nan
    heading_error: float = nan
    crank_lag: float = nan
    phase_error: float = nan
    odometry_time: int | None = None
    lag_time: int | None = None
    phase_time: int | None = None


def walk_figures(walk: Walk) -> WalkFigures:
    """Return how a robot walked."""
    return WalkFigures(walk.namespace, **_odometry(walk), **_cranks(walk))


def _odometry(walk: Walk) -> dict[str, Any]:
    told, truth = walk.odometry, walk.truth
    if len(truth) < _LEAST or len(told) < _LEAST:
        return {'way': _way(told.values)} if len(told) >= _LEAST else {}
    within = (told.stamps >= truth.stamps.min()) & (told.stamps <= truth.stamps.max())
    if np.count_nonzero(within) < _LEAST:
        return {'way': _way(truth.values)}
    there = _at(truth, told.stamps[within])
    apart = _from_start(told.values[within]) - _from_start(there)
    distance = np.hypot(apart[:, 0], apart[:, 1])
    heading = np.abs(np.unwrap(apart[:, 2]))
    worst = int(np.argmax(distance))
    return {
        'way': _way(there),
        'odometry_error': float(distance[worst]),
        'heading_error': float(heading.max()),
        'odometry_time': int(told.times[within][worst]),
    }


def _cranks(walk: Walk) -> dict[str, Any]:
    """Return how far cranks were from their commands, and from each other's."""
    behind: dict[str, tuple[Floats, Series]] = {}
    for joint, command in walk.commands.items():
        state = walk.states.get(joint)
        if state is None or len(state) < _LEAST or len(command) < _LEAST:
            continue
        within = (command.stamps >= state.stamps.min()) & (command.stamps <= state.stamps.max())
        lag = np.where(within, _at(state, command.stamps)[:, 0] - command.values[:, 0], 0.0)
        behind[joint] = lag, command
    if not behind:
        return {}
    found: dict[str, Any] = {}
    lag, command = max(behind.values(), key=lambda each: float(np.abs(each[0]).max()))
    worst = int(np.argmax(np.abs(lag)))
    found |= {'crank_lag': float(np.abs(lag[worst])), 'lag_time': int(command.times[worst])}
    (first, base), *others = behind.values()
    same = [lag for lag, each in others if np.array_equal(each.stamps, base.stamps)]
    if same:
        apart = np.abs(np.array(same) - first).max(axis=0)
        worst = int(np.argmax(apart))
        found |= {'phase_error': float(apart[worst]), 'phase_time': int(base.times[worst])}
    return found


def ways(walk: Walk) -> dict[str, Series]:
    """
    Return where a robot was, seen from where it was when all that tell it had begun.

    By who tells it: 'odometry', and 'ground truth' where there is one.
    """
    told = {'odometry': walk.odometry, 'ground truth': walk.truth}
    told = {name: series for name, series in told.items() if len(series) >= _LEAST}
    if not told:
        return {}
    begin = np.array([max(int(series.stamps.min()) for series in told.values())])
    return {
        name: Series(
            series.times, series.stamps, _from_start(series.values, _at(series, begin)[0])
        )
        for name, series in told.items()
    }


def _at(series: Series, stamps: 'np.ndarray[tuple[int], np.dtype[np.int64]]') -> Floats:
    """Return the values between those of a series, by their stamps."""
    order = np.argsort(series.stamps, kind='stable')
    at = (series.stamps[order] - series.stamps[order[0]]) / 1e9
    asked = (stamps - series.stamps[order[0]]) / 1e9
    columns = [np.interp(asked, at, column) for column in series.values[order].T]
    return np.column_stack(columns)


def _from_start(poses: Floats, start: Floats | None = None) -> Floats:
    """Return poses (x, y, yaw) as seen from one, or from the first."""
    start = poses[0] if start is None else start
    x, y, yaw = (poses - start).T
    cosine, sine = np.cos(start[2]), np.sin(start[2])
    return np.column_stack([cosine * x + sine * y, cosine * y - sine * x, yaw])


def _way(poses: Floats) -> float:
    """Return the length of a way; what is shorter than a body sways is none."""
    # Noise of each pose adds up: so many of them are looked at.
    some = np.vstack([poses[:: max(1, len(poses) // 200)], poses[-1:]])
    way = float(np.hypot(*np.diff(some[:, :2], axis=0).T).sum())
    return way if way >= _SHORTEST else nan
