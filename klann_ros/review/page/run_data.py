"""The data of a run in its page: topics, legs, walkers, and the texts of charts."""

from collections.abc import Iterable, Iterator
from math import degrees, isnan
from typing import Any

from klann_ros.kinematics.arrays import FloatArray
from klann_ros.review.model.recording import Walk
from klann_ros.review.model.review import Review, ReviewedLeg
from klann_ros.review.model.times import Series, time_steps
from klann_ros.review.model.topics import TopicRecording
from klann_ros.review.model.walks import body_paths, WalkFigures
from klann_ros.sanitize.text import printable, verb
import numpy as np
from numpy.typing import NDArray

from .leg_data import (
    foot_rows,
    leg_drawing,
    pack_angles,
    pack_floats,
    pack_times,
    pose_rows,
    thin_rows,
)

# What the ways of walking robots may take, of all numbers.
WALKS = 0.125


def chart_texts(leg: ReviewedLeg) -> dict[str, str]:
    """Return a sentence for each chart."""
    recording, figures = leg.recording, leg.figures
    names, slides = recording.solver.joint_names, np.array(recording.solver.slides)
    poses = recording.poses.values.T
    turning, sliding = (
        [name for name, one in zip(names, slides, strict=True) if one == kind]
        for kind in (False, True)
    )
    texts = {
        'path': f'The recorded foot covers {_metres(np.ptp(recording.feet.values, axis=0))}'
        if len(recording.feet)
        else 'No foot is recorded',
        'angles': _ranges(turning[1:], np.degrees(poses[~slides][1:]), 'deg'),
        'distances': _ranges(sliding, poses[slides], 'm'),
        'rates': _ranges(turning, _of(recording.rates.T, ~slides), 'rad/s'),
        'speeds': _ranges(sliding, _of(recording.rates.T, slides), 'm/s'),
        'iterations': _iterations(recording.iterations.values),
    }
    if leg.errors is not None and not isnan(figures.worst_transmission_angle):
        mu = degrees(figures.worst_transmission_angle)
        texts['residuals'] = f'The worst residual is {figures.worst_residual:.1e} m'
        texts['transmission'] = (
            f'The worst is {mu:.1f} deg from in line; solver_node warns below 20 deg by default'
        )
    return {name: f'{text}.' for name, text in texts.items()}


def _of(rates: FloatArray, which: NDArray[np.bool_]) -> FloatArray:
    """Return the rates of some joints; none where none are recorded."""
    return rates[which] if len(rates) else rates


def _iterations(most: FloatArray) -> str:
    known = most[np.isfinite(most)]
    return f'The solver reports {known.max():.0f} at most' if known.size else 'Nothing is recorded'


def _metres(size: FloatArray) -> str:
    return f'{size[0]:.4f} m in x and {size[1]:.4f} m in y'


def _ranges(names: Iterable[str], rows: Iterable[FloatArray], unit: str) -> str:
    found = list(_found(names, rows, unit))
    return '; '.join(found) if found else 'Nothing is recorded'


def _found(names: Iterable[str], rows: Iterable[FloatArray], unit: str) -> Iterator[str]:
    for name, values in zip(names, rows, strict=False):
        known = values[np.isfinite(values)]
        if known.size:
            yield f'{printable(name)} from {known.min():.4g} to {known.max():.4g} {unit}'


# Decades of the bins, 1 us to 1000 s, and bins of a decade.
FIRST, LAST, A_DECADE = -6, 3, 20


def timing(topic: TopicRecording) -> dict[str, Any]:
    """Return the histograms of a topic."""
    return {
        'name': printable(topic.name),
        'intervals': histogram(time_steps(topic.times)),
        'latencies': histogram(topic.latencies[~np.isnan(topic.latencies)]),
    }


def histogram(seconds: NDArray[Any]) -> dict[str, Any]:
    """
    Return how many times fall into each bin, and a sentence about them.

    A bin k holds 10^(FIRST + k / A_DECADE) and what is longer, up to the next; the first and the
    last that are not empty are the ends of `counts`. Above LAST all are in the last bin.
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
    half, most, longest = (1e3 * float(s) for s in np.percentile(seconds, [50.0, 99.0, 100.0]))
    are = verb(below, 'is', 'are')
    rest = f'; {below} {are} below 1 µs or negative, and not drawn' if below else ''
    if len(seconds) == 1:
        return f'The only one is {longest:.4g} ms{rest}.'
    return (
        f'Half of {len(seconds)} are up to {half:.4g} ms, 99 % up to {most:.4g} ms, '
        f'the longest is {longest:.4g} ms{rest}.'
    )


def run_data(review: Review, most_bytes: float) -> dict[str, Any]:
    """
    Return the data of a run.

    Parameters
    ----------
    review : Review
        The run.
    most_bytes : float
        What the rows of all legs may take, before base64; see `kept_rows`.

    """
    walks = walks_data(review, WALKS * most_bytes)
    share = most_bytes * (1.0 - WALKS * bool(walks)) / max(len(review.legs), 1)
    return {
        'path': printable(review.recording.path),
        'duration': review.recording.duration,
        'legs': [_leg(leg, review, share) for leg in review.legs],
        'walks': walks,
        'topics': [timing(topic) for topic in review.recording.topics],
        'marks': [finding.time for finding in review.findings if finding.time is not None],
    }


def _leg(leg: ReviewedLeg, review: Review, most_bytes: float) -> dict[str, Any]:
    recording = leg.recording
    solver, start = recording.solver, review.recording.start
    rows = pose_rows if len(recording.poses) else foot_rows
    return {
        'title': printable(recording.title),
        'joints': list(map(printable, solver.joint_names)),
        'slides': solver.slides,
        'shape': leg_drawing(solver.leg) if solver.leg is not None else None,
        # Before that it had another shape, and is not drawn [s].
        'since': (solver.leg_time - start) / 1e9 if solver.leg_time else 0.0,
        'rows': rows(leg, review, most_bytes),
        'iterations': {
            'times': pack_times((recording.iterations.times - start) / 1e9),
            'most': pack_floats(recording.iterations.values[:, 0]),
        },
        'texts': chart_texts(leg),
    }


# A time, x, y and yaw, four bytes each, before base64.
_SIZE = 16


def walks_data(review: Review, most_bytes: float) -> list[dict[str, Any]]:
    """
    Return the ways of the robots of a run.

    Parameters
    ----------
    review : Review
        The run.
    most_bytes : float
        What all of them may take, before base64; see `kept_rows`.

    """
    found = zip(review.recording.walks, review.walks, strict=True)
    told = [(walk, figures, body_paths(walk)) for walk, figures in found]
    most = int(most_bytes / (_SIZE * max(1, sum(len(lines) for *_, lines in told))))
    start = review.recording.start
    return [
        {
            'title': printable(walk.namespace),
            'text': _text(walk, figures),
            'lines': [
                {'name': name, **_line(series, start, most)} for name, series in lines.items()
            ],
        }
        for walk, figures, lines in told
        if lines
    ]


def _line(series: Series, start: int, most: int) -> dict[str, Any]:
    x, y, yaw = series.values.T
    rows = thin_rows(len(series), [x, y], most)
    return {
        'times': pack_times((series.times[rows] - start) / 1e9),
        'at': [pack_floats(x[rows]), pack_floats(y[rows])],
        'yaw': pack_angles(yaw[rows]),
    }


def _text(walk: Walk, figures: WalkFigures) -> str:
    name = printable(walk.namespace)
    who = f'The robot {name}' if name else 'The robot'
    if isnan(figures.distance):
        return f'{who} stays where it is'
    if isnan(figures.odometry_error):
        return f'{who} goes {figures.distance:.2f} m'
    return (
        f'{who} goes {figures.distance:.2f} m; odometry is up to {figures.odometry_error:.3f} m '
        f'off the ground truth, and {degrees(figures.heading_error):.1f} deg'
    )
