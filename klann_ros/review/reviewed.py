"""A reviewed run: what it holds, its figures, and what is wrong with it."""

from dataclasses import dataclass

from .answering import Answering
from .figures import LegFigures
from .finding import Finding
from .limits import Limits
from .recording import LegRecording, Recording
from .resolved import Resolved
from .topic_figures import TopicFigures


@dataclass(frozen=True, eq=False)
class ReviewedLeg:
    """
    A leg of a reviewed run.

    Attributes
    ----------
    recording : LegRecording
        All that the run says of it.
    judged : LegRecording
        The part of it that its geometry holds for.
    resolved : Resolved or None
        That part solved again; None where the run does not tell the leg.
    figures : LegFigures
        Its figures.
    answering : Answering
        What it was asked in that part, and what came of it.

    """

    recording: LegRecording
    judged: LegRecording
    resolved: Resolved | None
    figures: LegFigures
    answering: Answering


@dataclass(frozen=True, eq=False)
class Review:
    """
    A reviewed run.

    Attributes
    ----------
    recording : Recording
        What it holds.
    topics : tuple of TopicFigures
        Its topics' figures.
    legs : tuple of ReviewedLeg
        Its legs.
    limits : Limits
        What it was held against.
    findings : tuple of Finding
        What is wrong with it, the gravest first.

    """

    recording: Recording
    topics: tuple[TopicFigures, ...]
    legs: tuple[ReviewedLeg, ...]
    limits: Limits
    findings: tuple[Finding, ...] = ()

    @property
    def is_healthy(self) -> bool:
        """Return whether nothing is wrong."""
        return not any(finding.is_fault for finding in self.findings)
