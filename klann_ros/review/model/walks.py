"""Figures of a walker: distance, odometry error, crank lag and phase error."""

from dataclasses import dataclass, replace
from math import nan
from typing import Any

from klann_ros.kinematics.arrays import FloatArray, IntArray
import numpy as np

from .recording import WalkRecording
from .times import Series

# Smallest number of messages, and shortest distance [m], of a walk.
_MIN_MESSAGES, _MIN_DISTANCE = 10, 0.05


@dataclass(frozen=True)
class WalkFigures:
    """Figures of a walker, with the log times of the largest ones [ns]; NaN for unknown."""

    namespace: str
    distance: float = nan  #: travelled, by the ground truth or else by odometry [m]
    #: Distance from the ground truth, both relative to their start [m].
    odometry_error: float = nan
    heading_error: float = nan  #: difference of the headings [rad]
    crank_lag: float = nan  #: difference of a crank from its command [rad]
    phase_error: float = nan  #: error of the phase between two cranks [rad]
    odometry_time: int | None = None
    lag_time: int | None = None
    phase_time: int | None = None


def walk_figures(walk: WalkRecording) -> WalkFigures:
    """Return the figures of a walker."""
    return WalkFigures(walk.namespace, **_odometry(walk), **_cranks(walk))


def _odometry(walk: WalkRecording) -> dict[str, Any]:
    odometry, truth = walk.odometry, walk.truth
    if len(truth) < _MIN_MESSAGES or len(odometry) < _MIN_MESSAGES:
        few = len(odometry) < _MIN_MESSAGES
        return {} if few else {'distance': _distance_travelled(odometry.values)}
    within = (odometry.stamps >= truth.stamps.min()) & (odometry.stamps <= truth.stamps.max())
    if np.count_nonzero(within) < _MIN_MESSAGES:
        return {'distance': _distance_travelled(truth.values)}
    there = _interpolate(truth, odometry.stamps[within])
    apart = _relative_to(odometry.values[within]) - _relative_to(there)
    distance = np.hypot(apart[:, 0], apart[:, 1])
    heading = np.abs(np.unwrap(apart[:, 2]))
    worst = int(np.argmax(distance))
    return {
        'distance': _distance_travelled(there),
        'odometry_error': float(distance[worst]),
        'heading_error': float(heading.max()),
        'odometry_time': int(odometry.times[within][worst]),
    }


def _cranks(walk: WalkRecording) -> dict[str, Any]:
    behind: list[tuple[FloatArray, Series]] = []
    for joint, command in walk.commands.items():
        state = walk.states.get(joint)
        if state is None or len(state) < _MIN_MESSAGES or len(command) < _MIN_MESSAGES:
            continue
        within = (command.stamps >= state.stamps.min()) & (command.stamps <= state.stamps.max())
        lag = _interpolate(state, command.stamps)[:, 0] - command.values[:, 0]
        behind.append((np.where(within, lag, 0.0), command))
    if not behind:
        return {}
    lag, command = max(behind, key=lambda each: float(np.abs(each[0]).max()))
    worst = int(np.argmax(np.abs(lag)))
    found: dict[str, Any] = {
        'crank_lag': float(np.abs(lag[worst])),
        'lag_time': int(command.times[worst]),
    }
    (first, base), *others = behind
    same = [lag for lag, each in others if np.array_equal(each.stamps, base.stamps)]
    if same:
        apart = np.abs(np.array(same) - first).max(axis=0)
        worst = int(np.argmax(apart))
        found |= {'phase_error': float(apart[worst]), 'phase_time': int(base.times[worst])}
    return found


def body_paths(walk: WalkRecording) -> dict[str, Series]:
    """Return the paths by 'odometry' and 'ground truth', relative to their common start."""
    paths = {'odometry': walk.odometry, 'ground truth': walk.truth}
    paths = {name: series for name, series in paths.items() if len(series) >= _MIN_MESSAGES}
    if not paths:
        return {}
    begin = np.array([max(int(series.stamps.min()) for series in paths.values())])
    return {
        name: replace(series, values=_relative_to(series.values, _interpolate(series, begin)[0]))
        for name, series in paths.items()
    }


def _interpolate(series: Series, stamps: IntArray) -> FloatArray:
    order = np.argsort(series.stamps, kind='stable')
    at = (series.stamps[order] - series.stamps[order[0]]) / 1e9
    asked = (stamps - series.stamps[order[0]]) / 1e9
    columns = [np.interp(asked, at, column) for column in series.values[order].T]
    return np.column_stack(columns)


def _relative_to(poses: FloatArray, start: FloatArray | None = None) -> FloatArray:
    """Return poses (x, y, yaw) relative to one, or to the first."""
    start = poses[0] if start is None else start
    x, y, yaw = (poses - start).T
    cosine, sine = np.cos(start[2]), np.sin(start[2])
    return np.column_stack([cosine * x + sine * y, cosine * y - sine * x, yaw])


def _distance_travelled(poses: FloatArray) -> float:
    """Return the length of a path; NaN below the sway of a body."""
    # A subset of the poses, as the noise of each adds up.
    some = np.vstack([poses[:: max(1, len(poses) // 200)], poses[-1:]])
    length = float(np.hypot(*np.diff(some[:, :2], axis=0).T).sum())
    return length if length >= _MIN_DISTANCE else nan
