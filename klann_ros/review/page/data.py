"""The data of a run in its page: legs, walkers and topics, thinned out and packed in base64."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from math import degrees, isnan
from typing import Any

from klann_ros.kinematics import AnyLeg
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray, IndexArray, IntArray
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.poses import linkage_foot_path
from klann_ros.review.model.recording import WalkRecording
from klann_ros.review.model.review import Review, ReviewedLeg
from klann_ros.review.model.times import Series, time_steps
from klann_ros.review.model.topics import TopicRecording
from klann_ros.review.model.walks import body_paths, WalkFigures
from klann_ros.sanitize.text import printable, verb
from klann_ros.web import leg_shape
import numpy as np
from numpy.typing import ArrayLike, NDArray

Packed = dict[str, Any]

# The largest of 32 bits, and the mark of a missing number.
_MAX_INT32 = 2**31 - 1
_MISSING = -(2**31)
# Bytes of a number in the page, before base64.
_NUMBER_SIZE = 4
# Share of the paths of walkers in all numbers.
_WALK_SHARE = 0.125


def run_data(review: Review, max_bytes: float) -> dict[str, Any]:
    """Return the data of a run, whose rows have at most `max_bytes` before base64."""
    walks = _walks(review, _WALK_SHARE * max_bytes)
    share = max_bytes * (1.0 - _WALK_SHARE * bool(walks)) / max(len(review.legs), 1)
    return {
        'path': printable(review.recording.path),
        'duration': review.recording.duration,
        'legs': [_leg_data(leg, review, share) for leg in review.legs],
        'walks': walks,
        'topics': [timing(topic) for topic in review.recording.topics],
        'marks': [finding.time for finding in review.findings if finding.time is not None],
    }


def pack_floats(numbers: NDArray[Any]) -> Packed:
    """Pack numbers as float32; NaN stays NaN."""
    with np.errstate(over='ignore'):
        return _packed('f32', numbers.astype('<f4'))


def pack_times(seconds: FloatArray) -> Packed:
    """Pack times to the microsecond, or to 2^-31 of the longest."""
    return _scaled(seconds, max(1e-6, float(seconds.max(initial=0.0)) / _MAX_INT32))


def pack_angles(radians: FloatArray) -> Packed:
    """Pack angles modulo a turn, to 2^-32 of it: 1.5e-9 rad, less than 1e-8 of any length."""
    with np.errstate(invalid='ignore', over='ignore'):
        turns = radians / TURN
        # With more turns, a double has no fraction.
        fractions = np.where(np.abs(turns) <= _MAX_INT32, turns - np.round(turns), np.nan)
        return _scaled(fractions * TURN, TURN / 2.0**32)


def pack_turns(radians: FloatArray) -> Packed:
    """Pack the whole turns that `pack_angles` omits."""
    with np.errstate(invalid='ignore', over='ignore'):
        return _scaled(np.round(radians / TURN), 1.0)


def _scaled(numbers: FloatArray, scale: float) -> Packed:
    with np.errstate(invalid='ignore', over='ignore'):
        counts = np.round(numbers / scale)
        is_valid = np.abs(counts) <= _MAX_INT32 + 1.0
    counts = np.where(is_valid, np.clip(counts, -_MAX_INT32, _MAX_INT32), _MISSING)
    return {**_packed('i32', counts.astype('<i4')), 'scale': scale}


def _packed(kind: str, array: NDArray[Any]) -> Packed:
    return {'kind': kind, 'data': b64encode(array.tobytes()).decode('ascii')}


def thin_rows(
    count: int, columns: Sequence[FloatArray], max_rows: int, needed: ArrayLike = ()
) -> IndexArray:
    """
    Return the rows to keep of `count`, sorted: about `max_rows`, and those that are needed.

    Half of them are evenly spaced. The others hold the extremes of each column, shape (count,), in
    equal parts of the run, so that no peak gets lost.
    """
    if count <= max_rows:
        return np.arange(count)
    half = max(max_rows // 2, 2)
    even = np.linspace(0, count - 1, half).astype(np.intp)
    parts = max(half // (2 * max(len(columns), 1)), 1)
    rows = [even, np.asarray(needed, dtype=np.intp)]
    for column in columns:
        rows.append(_maxima(column, parts))
        rows.append(_maxima(-column, parts))
    return np.asarray(np.unique(np.concatenate(rows)))


def _maxima(column: FloatArray, parts: int) -> IndexArray:
    """Return the row of the largest value of each part, without NaN."""
    size = -(-len(column) // parts)
    numbers = np.where(np.isnan(column), -np.inf, column)
    whole = len(numbers) // size
    table = numbers[slice(whole * size)].reshape(whole, size)
    rows: IndexArray = np.arange(whole) * size + table.argmax(axis=1)
    remainder = numbers[slice(whole * size, None)]
    return np.append(rows, whole * size + remainder.argmax()) if remainder.size else rows


def _leg_data(leg: ReviewedLeg, review: Review, max_bytes: float) -> dict[str, Any]:
    recording = leg.recording
    solver = recording.solver
    start = review.recording.start
    rows = _pose_rows if len(recording.poses) else _foot_rows
    return {
        'title': printable(recording.title),
        'joints': list(map(printable, solver.joint_names)),
        'slides': solver.slides,
        'shape': drawing_data(solver.leg) if solver.leg is not None else None,
        # Before that it had another shape, and is not drawn [s].
        'since': (solver.leg_time - start) / 1e9 if solver.leg_time else 0.0,
        'rows': rows(leg, review, max_bytes),
        'iterations': {
            'times': pack_times((recording.iterations.times - start) / 1e9),
            'most': pack_floats(recording.iterations.values[:, 0]),
        },
        'texts': chart_texts(leg),
    }


def drawing_data(leg: AnyLeg) -> dict[str, Any]:
    """Return a leg's shape, with the foot path of the geometry and whether it is closed."""
    path = linkage_foot_path(leg.linkage)
    if path is None:
        return {**leg_shape(leg), 'path': None}
    return {**leg_shape(leg), 'path': _packed_columns(path.h), 'closed': path.full_turn}


def _packed_columns(table: FloatArray) -> list[Packed]:
    return [pack_floats(column) for column in table.T]


def _pose_rows(leg: ReviewedLeg, review: Review, max_bytes: float) -> dict[str, Any]:
    """Return a leg's poses, with foot, velocities, residual and transmission angles of each."""
    poses = leg.recording.poses
    rates = leg.recording.rates
    count = len(poses)
    feet = leg.recording.paired_feet()
    residuals = np.full(count, np.nan)
    mu = np.empty((count, 0))
    if leg.errors is not None:
        residuals = leg.for_all_poses(leg.errors.residuals)
        mu = leg.for_all_poses(leg.errors.transmission_angles)
    has_rates = rates.size > 0 and bool(np.isfinite(rates).any())
    columns = [*poses.values.T[1:], *feet.T, residuals, *mu.T]
    columns += list(rates.T) if has_rates else []
    # Beside the columns: time, whole turns of the crank, and their fraction.
    max_rows = int(max_bytes / (_NUMBER_SIZE * (3 + len(columns))))
    gaps = _gaps(poses.times, review.limits)
    rows = thin_rows(count, columns, max_rows, [*gaps, *(gaps + 1), *_finding_rows(leg, review)])
    angles = poses.values[rows]
    packed_angles = []
    for column, slides in zip(angles.T, leg.recording.solver.slides, strict=True):
        packed_angles.append(pack_floats(column) if slides else pack_angles(column))
    return {
        'of': count,
        'times': pack_times((poses.times[rows] - review.recording.start) / 1e9),
        'turns': pack_turns(angles[:, 0]),
        'angles': packed_angles,
        'rates': _packed_columns(rates[rows]) if has_rates else None,
        'foot': _packed_columns(feet[rows]),
        'residuals': pack_floats(residuals[rows]),
        'transmission': _packed_columns(mu[rows]),
        # The rows before gaps.
        'gaps': np.searchsorted(rows, gaps).tolist(),
    }


def _foot_rows(leg: ReviewedLeg, review: Review, max_bytes: float) -> dict[str, Any]:
    feet = leg.recording.feet
    columns = list(feet.values.T)
    rows = thin_rows(len(feet), columns, int(max_bytes / (3 * _NUMBER_SIZE)))
    return {
        'of': len(feet),
        'times': pack_times((feet.times[rows] - review.recording.start) / 1e9),
        'foot': _packed_columns(feet.values[rows]),
        'gaps': [],
    }


def _gaps(times: IntArray, limits: Limits) -> IndexArray:
    """Return the rows before gaps, by the limits of the check."""
    steps = time_steps(times)
    if not steps.size:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(steps > limits.max_interval(float(np.median(steps))))


def _finding_rows(leg: ReviewedLeg, review: Review) -> IndexArray:
    """Return the poses at the times of findings, which the page links to."""
    seconds = [finding.time for finding in review.findings if finding.time is not None]
    moments = review.recording.start + np.array(seconds) * 1e9
    times = leg.recording.poses.times
    return np.minimum(np.searchsorted(times, moments), len(times) - 1)


def chart_texts(leg: ReviewedLeg) -> dict[str, str]:
    """Return a sentence for each chart."""
    recording = leg.recording
    figures = leg.figures
    names = np.array(recording.solver.joint_names, dtype=object)
    slides = np.array(recording.solver.slides)
    turning = names[~slides].tolist()
    sliding = names[slides].tolist()
    poses = recording.poses.values.T
    # No rates are recorded, or those of all joints.
    rates = recording.rates.T
    iterations = recording.iterations.values[np.isfinite(recording.iterations.values)]
    foot = 'No foot is recorded'
    if len(recording.feet):
        x, y = 1e3 * np.ptp(recording.feet.values, axis=0)
        foot = f'The recorded foot covers {x:.1f} mm in x and {y:.1f} mm in y'
    texts = {
        'path': foot,
        'angles': _ranges(turning[1:], np.degrees(poses[~slides][1:]), 'deg'),
        'distances': _ranges(sliding, 1e3 * poses[slides], 'mm'),
        'rates': _ranges(turning, np.degrees(rates[~slides] if len(rates) else rates), 'deg/s'),
        'speeds': _ranges(sliding, 1e3 * (rates[slides] if len(rates) else rates), 'mm/s'),
        'iterations': f'The solver reports {iterations.max():.0f} at most'
        if iterations.size
        else 'Nothing is recorded',
    }
    if leg.errors is not None and not isnan(figures.worst_transmission_angle):
        mu = degrees(figures.worst_transmission_angle)
        texts['residuals'] = f'The worst residual is {1e3 * figures.worst_residual:.1e} mm'
        texts['transmission'] = (
            f'The worst is {mu:.1f} deg from in line; solver_node warns below 20 deg by default'
        )
    return {name: f'{text}.' for name, text in texts.items()}


def _ranges(names: Iterable[str], rows: Iterable[FloatArray], unit: str) -> str:
    ranges = []
    for name, row in zip(names, rows, strict=False):
        numbers = row[np.isfinite(row)]
        if numbers.size:
            limits = f'from {numbers.min():.4g} to {numbers.max():.4g} {unit}'
            ranges.append(f'{printable(name)} {limits}')
    return '; '.join(ranges) if ranges else 'Nothing is recorded'


# Decades of the bins, 1 us to 1000 s, and bins of a decade.
FIRST = -6
LAST = 3
A_DECADE = 20


def timing(topic: TopicRecording) -> dict[str, Any]:
    """Return the histograms of a topic."""
    return {
        'name': printable(topic.name),
        'intervals': histogram(time_steps(topic.times)),
        'latencies': histogram(topic.latencies[~np.isnan(topic.latencies)]),
    }


def histogram(seconds: NDArray[Any]) -> dict[str, Any]:
    """
    Return the number of times in each bin, and a sentence about them.

    Bin k begins at 10^(FIRST + k / A_DECADE); `counts` begins and ends with a bin that is not
    empty. Times above LAST are in the last bin.
    """
    positive = seconds[seconds >= 10.0**FIRST]
    bins = np.floor((np.log10(positive) - FIRST) * A_DECADE).astype(np.intp)
    last = (LAST - FIRST) * A_DECADE - 1
    counts = np.bincount(np.clip(bins, 0, last), minlength=1)
    filled = np.flatnonzero(counts)
    begin, end = (int(filled[0]), int(filled[-1]) + 1) if filled.size else (0, 0)
    return {
        'first': begin,
        'counts': counts[slice(begin, end)].tolist(),
        'text': _sentence(seconds, len(seconds) - len(positive)),
    }


def _sentence(seconds: NDArray[Any], below: int) -> str:
    if not len(seconds):
        return 'There is none.'
    p50, p99, longest = (1e3 * np.percentile(seconds, [50.0, 99.0, 100.0])).tolist()
    undrawn = ''
    if below:
        are = verb(below, 'is', 'are')
        undrawn = f'; {below} {are} below 1 µs or negative, and not drawn'
    if len(seconds) == 1:
        return f'The only one is {longest:.4g} ms{undrawn}.'
    return (
        f'Half of {len(seconds)} are up to {p50:.4g} ms, 99 % up to {p99:.4g} ms, '
        f'the longest is {longest:.4g} ms{undrawn}.'
    )


def _walks(review: Review, max_bytes: float) -> list[dict[str, Any]]:
    paths_of_walks = [body_paths(walk) for walk in review.recording.walks]
    # A row has a time, x, y and yaw.
    row_size = 4 * _NUMBER_SIZE
    path_count = sum(map(len, paths_of_walks))
    max_rows = int(max_bytes / (row_size * max(1, path_count)))
    start = review.recording.start
    walks = []
    for walk, figures, paths in zip(
        review.recording.walks, review.walks, paths_of_walks, strict=True
    ):
        if paths:
            title = printable(walk.namespace)
            lines = [{'name': n, **_line(path, start, max_rows)} for n, path in paths.items()]
            walks.append({'title': title, 'text': _walk_text(walk, figures), 'lines': lines})
    return walks


def _line(series: Series, start: int, max_rows: int) -> dict[str, Any]:
    x, y, yaw = series.values.T
    rows = thin_rows(len(series), [x, y], max_rows)
    return {
        'times': pack_times((series.times[rows] - start) / 1e9),
        'at': [pack_floats(x[rows]), pack_floats(y[rows])],
        'yaw': pack_angles(yaw[rows]),
    }


def _walk_text(walk: WalkRecording, figures: WalkFigures) -> str:
    name = printable(walk.namespace)
    robot = f'The robot {name}' if name else 'The robot'
    if isnan(figures.distance):
        return f'{robot} stays where it is'
    if isnan(figures.odometry_error):
        return f'{robot} goes {figures.distance:.2f} m'
    return (
        f'{robot} goes {figures.distance:.2f} m; odometry is up to {figures.odometry_error:.3f} m '
        f'off the ground truth, and {degrees(figures.heading_error):.1f} deg'
    )
