"""From the path of a log to its review: load, solve, check."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from klann_ros.log import open_log
from klann_ros.log.errors import AnyPath
from klann_ros.review.load.load import load
from klann_ros.review.model.answers import match_answers, unanswered
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.poses import pose_errors
from klann_ros.review.model.recording import LegRecording, RunRecording
from klann_ros.review.model.review import Review, ReviewedLeg
from klann_ros.review.model.times import resolution
from klann_ros.review.model.topics import find_gaps, Gap
from klann_ros.review.model.walks import walk_figures
from klann_ros.robot import Robot
from klann_ros.sanitize.text import printable
import numpy as np

from .checks import Check, CHECKS

# Gets the name of the current step, and its progress from 0 to 1.
Progress = Callable[[str, float], object]


def review_run(
    path: AnyPath,
    *,
    robot: Robot | None = None,
    limits: Limits | None = None,
    rates: str = '',
    keep_solved: bool = False,
    progress: Progress | None = None,
) -> Review:
    """
    Review a run.

    Parameters
    ----------
    path : str or path
        A run's folder, or a file of any recorder's.
    robot : Robot, optional
        Reference legs and masses, instead of those in the run.
    limits : Limits, optional
        Limits of the checks.
    rates : str
        Type of the joint velocities: 'f8', 'f4' for half the memory, '' for none.
    keep_solved : bool
        Whether the solved poses stay in memory, which spares `annotate` to solve them again.
    progress : callable, optional
        Called during the review.

    Raises
    ------
    NotALogError
        The path is no readable log.

    """
    report = progress or (lambda _, __: None)
    with open_log(path) as log:
        recording = load(log, robot, rates=rates, progress=lambda part: report('reading', part))
    return review_recording(recording, limits or Limits(), report, keep_solved=keep_solved)


def review_recording(
    recording: RunRecording,
    limits: Limits,
    report: Progress = lambda _, __: None,
    checks: Sequence[Check] = CHECKS,
    *,
    keep_solved: bool = False,
) -> Review:
    """Return the review of a recording, with the findings of some checks."""
    # A log may hold any number: overflow gives infinity or NaN.
    with np.errstate(over='ignore', invalid='ignore'):
        tick = resolution(recording.clock)
        gaps = tuple(gap for topic in recording.topics for gap in find_gaps(topic, limits, tick))
        review = Review(
            recording,
            tuple(
                _review_leg(leg, recording, gaps, report, keep_solved) for leg in recording.legs
            ),
            gaps,
            limits,
            tuple(map(walk_figures, recording.walks)),
        )
        findings = [finding for check in checks for finding in check(review)]
        findings.sort(key=lambda finding: -finding.severity)
        return replace(review, findings=tuple(findings))


def _review_leg(
    leg: LegRecording,
    recording: RunRecording,
    gaps: Sequence[Gap],
    report: Progress,
    keep_solved: bool,
) -> ReviewedLeg:
    evaluated = leg.evaluated()
    errors = None
    if leg.solver.leg is not None and len(evaluated.poses):
        progress = partial(report, f'solving {printable(leg.title) or "the poses"} again')
        errors = pose_errors(evaluated, leg.solver.leg, progress, keep=keep_solved)
    answers = match_answers(evaluated)
    return ReviewedLeg(
        leg, evaluated, errors, answers, unanswered(recording, evaluated, answers, gaps)
    )
