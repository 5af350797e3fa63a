"""A review from a log's path to its findings: load, solve again, judge."""

from collections.abc import Callable
from dataclasses import replace

from klann_ros.kinematics import AnyLeg
from klann_ros.log.errors import AnyPath
from klann_ros.log.reader import open_log
from klann_ros.untrusted.text import printable
import numpy as np

from .answering import answering
from .checks.all_checks import findings
from .figures import leg_figures
from .limits import Limits
from .loading.load import load
from .recording import LegRecording
from .resolved import resolve
from .reviewed import Review, ReviewedLeg
from .topic_figures import topic_figures

# Is given what is being done, and how much of it is done, from 0 to 1.
Progress = Callable[[str, float], object]


def review_run(
    path: AnyPath,
    *,
    given: AnyLeg | None = None,
    limits: Limits | None = None,
    rates: str = '',
    progress: Progress | None = None,
) -> Review:
    """
    Review a run.

    Parameters
    ----------
    path : str or path
        A run's folder, or a file of any recorder's.
    given : Leg, optional
        What to hold the run against, instead of the legs that it tells.
    limits : Limits, optional
        What is still all right.
    rates : str
        Whether the velocities of the joints are wanted: 'f8' as they are, 'f4' in half the memory,
        '' not at all.
    progress : callable, optional
        Is called now and then.

    Raises
    ------
    NotALogError
        The path is no log that can be read.

    """
    tell = progress or _tell_nobody
    with open_log(path) as log:
        recording = load(log, given, rates=rates, progress=lambda part: tell('reading', part))
    review = Review(
        recording,
        tuple(map(topic_figures, recording.topics)),
        tuple(_judged(leg, tell) for leg in recording.legs),
        limits or Limits(),
    )
    return replace(review, findings=findings(review))


def _judged(recording: LegRecording, tell: Progress) -> ReviewedLeg:
    judged, leg, resolved = recording.judged(), recording.solver.leg, None
    if leg is not None and len(judged.poses):
        what = f'solving {printable(recording.title) or "the poses"} again'
        resolved = resolve(judged, leg, lambda done, of: tell(what, done / of))
    figures = leg_figures(judged, resolved)
    # A log may hold any number.
    with np.errstate(over='ignore', invalid='ignore'):
        return ReviewedLeg(recording, judged, resolved, figures, answering(judged))


def _tell_nobody(_: str, __: float) -> None:
    pass
