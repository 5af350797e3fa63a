"""A reviewed run: recording, figures and findings."""

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

from klann_ros.kinematics.arrays import FloatArray
from klann_ros.sanitize.text import printable, printable_line
import numpy as np

from .answers import Answers, Unanswered
from .limits import Limits
from .poses import leg_figures, LegFigures, PoseErrors
from .recording import LegRecording, RunRecording
from .topics import Gap, TopicFigures
from .walks import WalkFigures


def located(leg: str, text: str) -> str:
    """Return a text as a printable line, after its leg, if any."""
    return f'{printable(leg)}: {printable_line(text)}' if leg else printable_line(text)


class Severity(IntEnum):
    """Severity of a finding."""

    NOTE = 0  # information, no fault
    WARNING = 1  # a fault of the run
    ERROR = 2  # wrong data in the run


@dataclass(frozen=True)
class Finding:
    """A finding of a check."""

    check: str  #: name of the check
    severity: Severity
    text: str  #: description
    meaning: str  #: meaning or likely cause
    #: First occurrence, log time from the start of the run [s]; None for the whole run.
    time: float | None = None
    leg: str = ''  #: its leg; '' for the only one, or the whole run

    @property
    def is_fault(self) -> bool:
        """Return whether it counts for the exit code."""
        return self.severity > Severity.NOTE


@dataclass(frozen=True, eq=False)
class ReviewedLeg:
    """A leg of a reviewed run; `errors`, `answers` and `unanswered` are about `evaluated`."""

    recording: LegRecording  #: its whole recording
    evaluated: LegRecording  #: the part since the last change of its geometry
    errors: PoseErrors | None  #: errors against the solved poses; None for an unknown leg
    answers: Answers  #: its inputs, and their answers
    unanswered: Unanswered  #: inputs without an expected answer

    @cached_property
    def figures(self) -> LegFigures:
        """Return the figures of the evaluated part."""
        # A log may hold any number: overflow gives infinity or NaN.
        with np.errstate(over='ignore', invalid='ignore'):
            return leg_figures(self.evaluated, self.errors)

    def for_all_poses(self, values: FloatArray) -> FloatArray:
        """Return values of the evaluated poses for all poses; NaN for the others."""
        before = len(self.recording.poses) - len(values)
        unknown = np.full((before, *values.shape[1:]), np.nan)
        return np.concatenate([unknown, values]) if before else values


@dataclass(frozen=True, eq=False)
class Review:
    """A reviewed run."""

    recording: RunRecording
    legs: tuple[ReviewedLeg, ...]
    gaps: tuple[Gap, ...]  #: the gaps of each periodic topic, whatever their reason
    limits: Limits  #: the limits of the checks
    walks: tuple[WalkFigures, ...] = ()  #: figures of the walkers
    findings: tuple[Finding, ...] = ()  #: by falling severity

    @property
    def topics(self) -> tuple[TopicFigures, ...]:
        """Return its topics' figures."""
        return tuple(topic.figures for topic in self.recording.topics)

    def since_start(self, log_time: int) -> float:
        """Return a log time [ns] from the start of the run [s]."""
        return (int(log_time) - self.recording.start) / 1e9

    @property
    def is_healthy(self) -> bool:
        """Return whether there is no fault."""
        return not any(finding.is_fault for finding in self.findings)
