"""A reviewed run: what it holds, its figures, and what is wrong with it."""

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np

from .answering import Answering
from .figures import leg_figures, LegFigures
from .limits import Limits
from .pose_errors import PoseErrors
from .recording import LegRecording, RunRecording
from .times import Floats
from .topics import TopicFigures
from .unanswered import Silence, Unanswered
from .walks import WalkFigures


class Severity(IntEnum):
    """How grave it is."""

    NOTE = 0  # worth knowing, and no fault
    WARNING = 1  # the run is not what it should be
    ERROR = 2  # what the run says is wrong


@dataclass(frozen=True)
class Finding:
    """
    Something that is wrong with a run.

    Attributes
    ----------
    check : str
        Which check found it.
    severity : Severity
        How grave it is.
    text : str
        What it is.
    meaning : str
        What it means for whoever reads it.
    time : float or None
        When it was first seen, from the start of the run by the clock of the log [s]; None for
        the run as a whole.
    leg : str
        Of which leg it is; '' for the only one, or the run as a whole.

    """

    check: str
    severity: Severity
    text: str
    meaning: str
    time: float | None = None
    leg: str = ''

    @property
    def is_fault(self) -> bool:
        """Return whether it counts for the exit code."""
        return self.severity > Severity.NOTE


@dataclass(frozen=True, eq=False)
class ReviewedLeg:
    """
    A leg of a reviewed run.

    Attributes
    ----------
    recording : LegRecording
        All that the run says of it.
    evaluated : LegRecording
        The part of it that its geometry holds for.
    errors : PoseErrors or None
        How far that part is from its poses solved again; None where the run does not tell the leg.
    answering : Answering
        What it was asked in that part, and what came of it.
    unanswered : Unanswered
        Which of that should have an answer and has none.

    """

    recording: LegRecording
    evaluated: LegRecording
    errors: PoseErrors | None
    answering: Answering
    unanswered: Unanswered

    @cached_property
    def figures(self) -> LegFigures:
        """Return its figures."""
        # A log may hold any number: what overflows is infinite, and what has no value is NaN.
        with np.errstate(over='ignore', invalid='ignore'):
            return leg_figures(self.evaluated, self.errors)

    def for_all_poses(self, values: Floats) -> Floats:
        """Return values of the evaluated poses for all recorded ones; NaN for the others."""
        before = len(self.recording.poses) - len(values)
        unknown = np.full((before, *values.shape[1:]), np.nan)
        return np.concatenate([unknown, values]) if before else values


@dataclass(frozen=True, eq=False)
class Review:
    """
    A reviewed run.

    Attributes
    ----------
    recording : RunRecording
        What it holds.
    legs : tuple of ReviewedLeg
        Its legs.
    silences : tuple of Silence
        When each topic that has a period said nothing, whatever the reason.
    limits : Limits
        What it was held against.
    walks : tuple of WalkFigures
        How robots walked.
    findings : tuple of Finding
        What is wrong with it, the gravest first.

    """

    recording: RunRecording
    legs: tuple[ReviewedLeg, ...]
    silences: tuple[Silence, ...]
    limits: Limits
    walks: tuple[WalkFigures, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def topics(self) -> tuple[TopicFigures, ...]:
        """Return its topics' figures."""
        return tuple(topic.figures for topic in self.recording.topics)

    @property
    def is_healthy(self) -> bool:
        """Return whether nothing is wrong."""
        return not any(finding.is_fault for finding in self.findings)
