"""A review for other programs: JSON, and poses as CSV, arrays and data frames."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
import json
from math import isnan
from typing import Any, BinaryIO, TYPE_CHECKING

from klann_ros import __version__
from klann_ros.cli import harmless, write_table
from klann_ros.kinematics.arrays import FloatArray, IntArray
from klann_ros.missing_package import install_command
from klann_ros.review.model.answers import Cause
from klann_ros.review.model.compare import Comparison
from klann_ros.review.model.review import Review, ReviewedLeg
from klann_ros.sanitize.text import finite, printable
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

# Version of the report; it counts up when a key changes its meaning.
VERSION = 1


def save_json(review: Review, comparison: Comparison | None, file: BinaryIO) -> None:
    """Write the report to an open file: SI units, times from the start; null for unknown."""
    recording = review.recording
    findings = []
    for finding in review.findings:
        findings.append({**asdict(finding), 'severity': finding.severity.name.lower()})
    content: dict[str, Any] = {
        'version': VERSION,
        'klann_ros': __version__,
        'path': recording.path,
        'files': [{'name': name, 'size': size} for name, size in recording.files],
        'start_time': recording.start / 1e9,
        'duration': recording.duration,
        'healthy': review.is_healthy,
        'topics': [*map(asdict, review.topics)],
        'legs': [*map(_leg_content, review.legs)],
        'walks': [*map(asdict, review.walks)],
        'limits': asdict(review.limits),
        'findings': findings,
    }
    if comparison is not None:
        content['comparison'] = asdict(comparison)
    file.write(f'{json.dumps(finite(content), indent=2)}\n'.encode())


def _leg_content(leg: ReviewedLeg) -> dict[str, Any]:
    return {
        'leg': leg.recording.title,
        'poses': len(leg.recording.poses),
        'judged_poses': len(leg.evaluated.poses) if leg.errors is not None else 0,
        'geometry_source': leg.recording.solver.source,
        **asdict(leg.figures),
        'crank_angles': _crank_angles(leg),
    }


def _crank_angles(leg: ReviewedLeg) -> dict[str, int | None]:
    """Return the counts of a leg's inputs by their answers; None for unknown."""
    answers = leg.answers
    unanswered = leg.unanswered
    counts: dict[str, int | None] = {
        'before_the_first_answer': answers.early,
        'asked': answers.asked,
        'answered': answers.asked - len(answers.rows),
        'no_angle': len(answers.of(Cause.NO_ANGLE)),
        'out_of_reach': len(answers.of(Cause.OUT_OF_REACH)),
        'unanswered_in_gaps': unanswered.in_gaps,
        'unanswered_while_unrecorded': unanswered.unrecorded,
        'unanswered_by_lost_answers': unanswered.lost,
        'unanswered_unexplained': unanswered.unexplained,
        'after_the_last_answer': answers.late,
    }
    return counts if len(leg.evaluated.cranks) else dict.fromkeys(counts)


# Rows formatted at once.
_BLOCK = 16384
_NS = 10**9


class NoPandasError(ImportError):
    """A data frame that cannot be made; the text gives the remedy."""


def save_csv(review: Review, file: BinaryIO) -> None:
    """
    Write every pose of every leg to an open file.

    A row has the leg (of a run with several), log time and stamp, the angles, the velocities, the
    foot H, and the errors against the solved pose. Unknown values are empty fields; reading a
    number gives the same double.
    """
    write_table(_rows(review), file)


def _rows(review: Review) -> Iterator[Sequence[str]]:
    units = _units(review.legs)
    has_titles = len(review.legs) > 1
    yield [*['leg'] * has_titles, 'log_time [s]', 'stamp [s]', *_heads(units)]
    for leg in review.legs:
        poses = leg.recording.poses
        titles = [harmless(printable(leg.recording.title))] * has_titles
        columns = _columns(leg, units)
        for begin in range(0, len(poses), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            times = _seconds(poses.times[block])
            stamps = _seconds(poses.stamps[block])
            table = np.column_stack([column[block] for column in columns]).tolist()
            for time, stamp, numbers in zip(times, stamps, table, strict=True):
                yield [*titles, time, stamp, *('' if isnan(x) else repr(x) for x in numbers)]


def pose_arrays(leg: ReviewedLeg) -> dict[str, NDArray[Any]]:
    """
    Return the poses of a leg as columns, by their names and units.

    Log time and stamp are in nanoseconds; then come the angles, the velocities (of a review with
    `rates`), the foot H, and the errors against the solved pose; NaN for unknown values.
    """
    poses = leg.recording.poses
    times: dict[str, NDArray[Any]] = {'log_time [ns]': poses.times, 'stamp [ns]': poses.stamps}
    units = _units([leg])
    return times | dict(zip(_heads(units), _columns(leg, units), strict=True))


def pose_frame(review: Review) -> 'pd.DataFrame':
    """
    Return the poses of all legs as a pandas DataFrame, one row a pose.

    Its columns are those of `pose_arrays`, after the time from the start of the run and, of a run
    with several legs, the leg.

    Raises
    ------
    NoPandasError
        pandas is not installed.

    """
    try:
        import pandas as pd  # noqa: PLC0415 - optional, and slow to import
    except ModuleNotFoundError:
        remedy = install_command('pandas', 'pandas')
        raise NoPandasError(f'a data frame needs pandas: {remedy}') from None
    frames = []
    for leg in review.legs:
        frame = pd.DataFrame(pose_arrays(leg), copy=True)
        since = (leg.recording.poses.times - review.recording.start) / 1e9
        frame.insert(0, 'time [s]', since)
        if len(review.legs) > 1:
            frame.insert(0, 'leg', leg.recording.title)
        frames.append(frame)
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()


def _units(legs: Iterable[ReviewedLeg]) -> dict[str, str]:
    units: dict[str, str] = {}
    for leg in legs:
        solver = leg.recording.solver
        for joint, slides in zip(solver.joint_names, solver.slides, strict=True):
            units.setdefault(joint, 'm' if slides else 'rad')
    return units


def _heads(units: Mapping[str, str]) -> list[str]:
    return [
        *(f'{joint} [{unit}]' for joint, unit in units.items()),
        *(f'{joint}_rate [{unit}/s]' for joint, unit in units.items()),
        'h_x [m]',
        'h_y [m]',
        'residual [m]',
        'angle_error [rad]',
    ]


def _columns(leg: ReviewedLeg, joints: Iterable[str]) -> list[FloatArray]:
    """Return the columns; NaN for joints of other legs."""
    recording = leg.recording
    names = recording.solver.joint_names
    unknown = np.broadcast_to(np.nan, len(recording.poses))
    errors = [unknown, unknown]
    if leg.errors is not None:
        residuals = leg.for_all_poses(leg.errors.residuals)
        errors = [residuals, leg.for_all_poses(leg.errors.angle_errors)]
    angles = dict(zip(names, recording.poses.values.T, strict=True))
    # There are none unless requested.
    rates = dict(zip(names, recording.rates.T, strict=False))
    columns = [angles.get(joint, unknown) for joint in joints]
    columns += [rates.get(joint, unknown) for joint in joints]
    return [*columns, *recording.paired_feet().T, *errors]


def _seconds(times: IntArray) -> list[str]:
    """Return times [ns] as seconds, to the last digit."""
    return [
        f'{"-" if time < 0 else ""}{abs(time) // _NS}.{abs(time) % _NS:09d}'
        for time in times.tolist()
    ]
