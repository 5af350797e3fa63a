"""A reviewed run as the page's scripts have it: numbers and names, no words."""

from typing import Any

from klann_ros.review.reviewed import Review, ReviewedLeg
from klann_ros.untrusted.text import printable

from . import packed
from .chart_texts import chart_texts
from .leg_rows import foot_rows, pose_rows
from .leg_shape import leg_shape
from .timing import timing


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
    share = most_bytes / max(len(review.legs), 1)
    return {
        'path': printable(review.recording.path),
        'duration': review.recording.duration,
        'legs': [_leg(leg, review, share) for leg in review.legs],
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
        'shape': leg_shape(solver.leg) if solver.leg is not None else None,
        # Before that it had another shape, and is not drawn [s].
        'since': (solver.leg_time - start) / 1e9 if solver.leg_time else 0.0,
        'rows': rows(leg, review, most_bytes),
        'iterations': {
            'times': packed.times((recording.iterations.times - start) / 1e9),
            'most': packed.floats(recording.iterations.values[:, 0]),
        },
        'texts': chart_texts(leg),
    }
