"""The way of a robot that walks, as the page has it: seen from above."""

from math import degrees, isnan
from typing import Any

from klann_ros.review.model.recording import Series, Walk
from klann_ros.review.model.review import Review
from klann_ros.review.model.walks import WalkFigures, ways
from klann_ros.sanitize.text import printable

from . import packed
from .leg_data import kept_rows

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
    told = [(walk, figures, ways(walk)) for walk, figures in found]
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
    rows = kept_rows(len(series), [x, y], most)
    return {
        'times': packed.times((series.times[rows] - start) / 1e9),
        'at': [packed.floats(x[rows]), packed.floats(y[rows])],
        'yaw': packed.angles(yaw[rows]),
    }


def _text(walk: Walk, figures: WalkFigures) -> str:
    name = printable(walk.namespace)
    who = f'The robot {name}' if name else 'The robot'
    if isnan(figures.way):
        return f'{who} stays where it is'
    if isnan(figures.odometry_error):
        return f'{who} goes {figures.way:.2f} m'
    return (
        f'{who} goes {figures.way:.2f} m; odometry is up to {figures.odometry_error:.3f} m '
        f'off the ground truth, and {degrees(figures.heading_error):.1f} deg'
    )
