"""Figures of a walker: distance, odometry error, crank lag and phase error."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import nan
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import TURN, unwrapped
from klann_ros.kinematics.arrays import FloatArray, IntArray
import numpy as np

from .recording import WalkRecording
from .times import merged, no_series, Series

# Smallest number of messages, and shortest distance [m], of a walk.
_MIN_WALK_MESSAGES = 10
_MIN_DISTANCE = 0.05
# Time in which a crank turns as its commanded velocities say, and longest time that one of them is
# known to hold [s].
_LAG_TIME = 1.0
_MAX_COMMAND_INTERVAL = 0.2


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
    return WalkFigures(walk.namespace, **_odometry_figures(walk), **_crank_figures(walk))


def _odometry_figures(walk: WalkRecording) -> dict[str, Any]:
    """Return the distance of a walk, and the errors of its odometry if the truth is known."""
    odometry = walk.odometry
    truth = walk.truth
    if len(truth) < _MIN_WALK_MESSAGES or len(odometry) < _MIN_WALK_MESSAGES:
        if len(odometry) < _MIN_WALK_MESSAGES:
            return {}
        return {'distance': _distance_travelled(odometry.values)}
    is_common = (odometry.stamps >= truth.stamps.min()) & (odometry.stamps <= truth.stamps.max())
    if np.count_nonzero(is_common) < _MIN_WALK_MESSAGES:
        return {'distance': _distance_travelled(truth.values)}
    true_poses = _interpolate(truth, odometry.stamps[is_common])
    errors = _relative_to(odometry.values[is_common]) - _relative_to(true_poses)
    position_errors = np.hypot(errors[:, 0], errors[:, 1])
    heading_errors = np.abs(np.unwrap(errors[:, 2]))
    worst = int(np.argmax(position_errors))
    return {
        'distance': _distance_travelled(true_poses),
        'odometry_error': float(position_errors[worst]),
        'heading_error': float(heading_errors.max()),
        'odometry_time': int(odometry.times[is_common][worst]),
    }


class _CrankLag(NamedTuple):
    """The lag of a crank behind its commands."""

    lags: FloatArray  # [rad]; 0 where its angle is unknown
    compared: Series  # the commands, or the states where velocities are commanded

    @property
    def worst(self) -> int:
        """Return the row with the largest lag."""
        return int(np.argmax(np.abs(self.lags)))


def _crank_figures(walk: WalkRecording) -> dict[str, Any]:
    """Return the largest lag and phase error of a walker's cranks."""
    crank_lags = []
    for joint, recorded in walk.states.items():
        if len(recorded) < _MIN_WALK_MESSAGES:
            continue
        state = replace(recorded, values=unwrapped(recorded.values))
        command = _positions(walk, joint, state)
        if len(command):
            begin = state.stamps.min()
            is_known = (command.stamps >= begin) & (command.stamps <= state.stamps.max())
            lags = _interpolate(state, command.stamps)[:, 0] - command.values[:, 0]
            # The angle of an encoder that wraps may start whole turns off.
            lags -= TURN * np.round(lags[is_known][:1] / TURN).sum()
            crank_lags.append(_CrankLag(np.where(is_known, lags, 0.0), command))
        velocities = _command_of(walk, walk.velocities, joint)
        if len(velocities) >= _MIN_WALK_MESSAGES:
            crank_lags.append(_CrankLag(_rotation_lags(velocities, state), state))
    if not crank_lags:
        return {}
    largest = max(crank_lags, key=lambda crank: abs(crank.lags[crank.worst]))
    figures: dict[str, Any] = {
        'crank_lag': float(abs(largest.lags[largest.worst])),
        'lag_time': int(largest.compared.times[largest.worst]),
    }
    first, *others = crank_lags
    stamps = first.compared.stamps
    others = [crank for crank in others if np.array_equal(crank.compared.stamps, stamps)]
    if others:
        max_errors = np.abs([crank.lags - first.lags for crank in others]).max(axis=0)
        worst = int(np.argmax(max_errors))
        figures['phase_error'] = float(max_errors[worst])
        figures['phase_time'] = int(first.compared.times[worst])
    return figures


def _positions(walk: WalkRecording, joint: str, state: Series) -> Series:
    """Return the commanded angles of a crank; of trajectories those up to the next one."""
    command = _command_of(walk, walk.commands, joint)
    if len(command) >= _MIN_WALK_MESSAGES:
        stamps = np.where(command.stamps == 0, _stamps(state, command.times), command.stamps)
        return replace(command, stamps=stamps)
    parts: list[Series] = []
    next_start = state.stamps.max()
    for plan in reversed(walk.trajectories):
        if joint in plan.joints:
            start = plan.start or int(_stamps(state, np.array([plan.time]))[0])
            is_followed = plan.times <= next_start - start
            stamps = start + plan.times[is_followed]
            angles = plan.positions[is_followed, plan.joints.index(joint)]
            times = plan.time + plan.times[is_followed]
            parts.append(Series(times, stamps, angles[:, None]).finite())
            next_start = start
    return merged(parts, 1)


def _command_of(walk: WalkRecording, commands: Mapping[str, Series], joint: str) -> Series:
    """Return the commands of a crank; without names they are in the order of the states."""
    number = str([*walk.states].index(joint))
    if number in commands and len(commands) == len(walk.states):
        return commands[number]
    return commands.get(joint, no_series(1))


def _rotation_lags(velocities: Series, state: Series) -> FloatArray:
    """Return the rotation within a time at each state, less the commanded one [rad]."""
    start = int(state.stamps[0])
    times = np.maximum.accumulate(state.stamps - start) / 1e9
    commanded = np.maximum.accumulate(_stamps(state, velocities.times) - start) / 1e9
    steps = np.diff(commanded)
    angles = np.concatenate([[0.0], np.cumsum(velocities.values[:-1, 0] * steps)])
    # A driver stops the crank while its commands pause.
    is_pause = (steps > _MAX_COMMAND_INTERVAL) & (velocities.values[:-1, 0] != 0.0)
    paused = np.concatenate([[0.0], np.cumsum(is_pause * steps)])
    lags = state.values[:, 0] - np.interp(times, commanded, angles)
    begins = times - _LAG_TIME
    lags -= np.interp(begins, times, lags)
    is_known = (begins >= max(times[0], commanded[0])) & (times <= commanded[-1])
    is_known &= np.interp(times, commanded, paused) == np.interp(begins, commanded, paused)
    return np.where(is_known, lags, 0.0)


def _stamps(state: Series, times: IntArray) -> IntArray:
    """Return log times by the clock of the stamps of a series [ns]."""
    start = int(state.times[0])
    offsets = np.interp(
        (times - start) / 1e9, (state.times - start) / 1e9, (state.stamps - state.times) / 1e9
    )
    return np.asarray(times + np.round(offsets * 1e9).astype(np.int64))


def body_paths(walk: WalkRecording) -> dict[str, Series]:
    """Return the paths by 'odometry' and 'ground truth', relative to their common start."""
    paths = {'odometry': walk.odometry, 'ground truth': walk.truth}
    paths = {name: series for name, series in paths.items() if len(series) >= _MIN_WALK_MESSAGES}
    if not paths:
        return {}
    begin = np.array([max(int(series.stamps.min()) for series in paths.values())])
    for name, series in paths.items():
        start = _interpolate(series, begin)[0]
        paths[name] = replace(series, values=_relative_to(series.values, start))
    return paths


def _interpolate(series: Series, stamps: IntArray) -> FloatArray:
    order = np.argsort(series.stamps, kind='stable')
    start = series.stamps[order[0]]
    known_times = (series.stamps[order] - start) / 1e9
    times = (stamps - start) / 1e9
    columns = [np.interp(times, known_times, column) for column in series.values[order].T]
    return np.column_stack(columns)


def _relative_to(poses: FloatArray, start: FloatArray | None = None) -> FloatArray:
    """Return poses (x, y, yaw) relative to one, or to the first."""
    start = poses[0] if start is None else start
    x, y, yaw = (poses - start).T
    cosine = np.cos(start[2])
    sine = np.sin(start[2])
    return np.column_stack([cosine * x + sine * y, cosine * y - sine * x, yaw])


def _distance_travelled(poses: FloatArray) -> float:
    """Return the length of a path; NaN below the sway of a body."""
    # A subset of the poses, as the noise of each adds up.
    samples = np.vstack([poses[:: max(1, len(poses) // 200)], poses[-1:]])
    length = float(np.hypot(*np.diff(samples[:, :2], axis=0).T).sum())
    return length if length >= _MIN_DISTANCE else nan
