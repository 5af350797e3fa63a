"""A review from a log's path to its findings: load, solve again, judge."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from klann_ros.log.errors import AnyPath
from klann_ros.log.reader import open_log
from klann_ros.review.load.load import load
from klann_ros.review.model.answering import answering
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.pose_errors import pose_errors
from klann_ros.review.model.recording import LegRecording, RunRecording
from klann_ros.review.model.review import Review, ReviewedLeg
from klann_ros.review.model.simulated_time import resolution
from klann_ros.review.model.unanswered import Silence, silences, unanswered
from klann_ros.review.model.walks import walk_figures
from klann_ros.robot import Robot
from klann_ros.sanitize.text import printable
import numpy as np

from .checks import Check, CHECKS, findings

# Is given what is being done, and how much of it is done, from 0 to 1.
Progress = Callable[[str, float], object]


def review_run(
    path: AnyPath,
    *,
    robot: Robot | None = None,
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
    robot : Robot, optional
        What the run is held against, legs and masses, instead of those that it tells.
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
    tell = progress or (lambda _, __: None)
    with open_log(path) as log:
        recording = load(log, robot, rates=rates, progress=lambda part: tell('reading', part))
    return reviewed(recording, limits or Limits(), tell)


def reviewed(
    recording: RunRecording,
    limits: Limits,
    tell: Progress = lambda _, __: None,
    checks: Sequence[Check] = CHECKS,
) -> Review:
    """Return the review of what a run holds, with what some checks find."""
    # A log may hold any number: what overflows is infinite, and what has no value is NaN.
    with np.errstate(over='ignore', invalid='ignore'):
        tick = resolution(recording.clock)
        quiet = tuple(one for topic in recording.topics for one in silences(topic, limits, tick))
        review = Review(
            recording,
            tuple(_reviewed(each, recording, quiet, tell) for each in recording.legs),
            quiet,
            limits,
            tuple(map(walk_figures, recording.walks)),
        )
        return replace(review, findings=findings(review, checks))


def _reviewed(
    leg: LegRecording, recording: RunRecording, quiet: Sequence[Silence], tell: Progress
) -> ReviewedLeg:
    evaluated, errors = leg.evaluated(), None
    if leg.solver.leg is not None and len(evaluated.poses):
        what = f'solving {printable(leg.title) or "the poses"} again'
        errors = pose_errors(evaluated, leg.solver.leg, partial(tell, what))
    answers = answering(evaluated)
    return ReviewedLeg(
        leg,
        evaluated,
        errors,
        answers,
        unanswered(recording, evaluated, answers, quiet),
    )
