"""A run as CSV, for spreadsheets and pandas: one row a pose, units in the header."""

from collections.abc import Iterator, Mapping, Sequence
import csv
from io import TextIOWrapper
from typing import Any, BinaryIO, TextIO

from klann_ros.review.pairing import pairs
from klann_ros.review.reviewed import Review, ReviewedLeg
from klann_ros.untrusted.text import printable
import numpy as np

# So many rows are made to text at once.
_BLOCK = 16384
_NS = 10**9
_FORMULA = ('=', '+', '-', '@')


def save(review: Review, file: BinaryIO) -> None:
    """
    Write every pose of every leg to an open file.

    A row has the leg (of a run with several), log time and stamp, the angles, the velocities, the
    foot H, and what came of solving the pose again. What a run does not tell is an empty field;
    numbers are written so that reading them gives the same doubles.
    """
    text = TextIOWrapper(file, newline='', encoding='utf-8')
    _write(review, text)
    text.flush()
    # The file is its opener's to close.
    text.detach()


def _write(review: Review, file: TextIO) -> None:
    writer = csv.writer(file, lineterminator='\n')
    units: dict[str, str] = {}
    for leg in review.legs:
        solver = leg.recording.solver
        for joint, slides in zip(solver.joint_names, solver.slides, strict=True):
            units.setdefault(joint, 'm' if slides else 'rad')
    joints = list(units)
    several = len(review.legs) > 1
    writer.writerow(_header(units, several=several))
    for leg in review.legs:
        title = [_cell(leg.recording.title)] if several else []
        for rows in _blocks(leg, joints):
            writer.writerows([*title, *row] for row in rows)


def _header(units: Mapping[str, str], *, several: bool) -> list[str]:
    return [
        *(['leg'] if several else []),
        'log_time [s]',
        'stamp [s]',
        *(f'{joint} [{unit}]' for joint, unit in units.items()),
        *(f'{joint}_rate [{unit}/s]' for joint, unit in units.items()),
        'h_x [m]',
        'h_y [m]',
        'residual [m]',
        'angle_error [rad]',
    ]


def _blocks(leg: ReviewedLeg, joints: Sequence[str]) -> Iterator[list[list[str]]]:
    recording, poses = leg.recording, leg.recording.poses
    count = len(poses)
    places = [joints.index(joint) for joint in recording.solver.joint_names]
    feet = np.full((count, 2), np.nan)
    of_feet, of_poses = pairs(recording.feet.stamps, poses.stamps)
    feet[of_poses] = recording.feet.values[of_feet]
    unjudged = count - len(leg.judged.poses)
    for begin in range(0, count, _BLOCK):
        rows = slice(begin, min(begin + _BLOCK, count))
        angles, rates = np.full((2, rows.stop - begin, len(joints)), np.nan)
        angles[:, places] = poses.values[rows]
        if len(recording.rates):
            rates[:, places] = recording.rates[rows]
        numbers = np.hstack([angles, rates, feet[rows], _judgement(leg, rows, unjudged)])
        times = zip(_seconds(poses.times[rows]), _seconds(poses.stamps[rows]), strict=True)
        yield [
            [*both, *map(_text, values)]
            for both, values in zip(times, numbers.tolist(), strict=True)
        ]


def _judgement(leg: ReviewedLeg, rows: slice, unjudged: int) -> np.ndarray[Any, Any]:
    """Return residuals and angle errors of some poses; NaN for those that were not judged."""
    found = np.full((rows.stop - rows.start, 2), np.nan)
    first = max(rows.start, unjudged)
    if leg.resolved is not None and first < rows.stop:
        judged = slice(first - unjudged, rows.stop - unjudged)
        those = slice(first - rows.start, None)
        found[those, 0] = leg.resolved.residuals[judged]
        found[those, 1] = leg.resolved.angle_errors[judged]
    return found


def _cell(text: str) -> str:
    """
    Return a name as a spreadsheet may show it: on one line, and never computed.

    No name that ROS takes begins with a sign that begins a formula.
    """
    shown = printable(text)
    return f"'{shown}" if shown.startswith(_FORMULA) else shown


def _seconds(times: np.ndarray[Any, Any]) -> list[str]:
    """Return times [ns] as seconds, to the last digit."""
    return [
        f'{"-" if time < 0 else ""}{abs(time) // _NS}.{abs(time) % _NS:09d}'
        for time in times.tolist()
    ]


def _text(value: float) -> str:
    return '' if value != value else repr(value)  # noqa: PLR0124 - NaN is not itself
