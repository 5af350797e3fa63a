"""What is said of a run among many: one row, the same whoever made it."""

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, fields
import json
from math import isfinite
from typing import Any

from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.report.json_report import finite
from klann_ros.sanitize.text import printable, printable_line

OK, FINDINGS, UNREADABLE = 'ok', 'findings', 'unreadable'
EXIT_CODES = {OK: 0, FINDINGS: 1, UNREADABLE: 2}


@dataclass(frozen=True)
class Row:
    """
    A run among many; None for what it does not tell.

    Attributes
    ----------
    run : str
        Its path.
    verdict : str
        'ok', 'findings' or 'unreadable'.
    reason : str
        The gravest finding, or why it cannot be read; '' where there is nothing to say.
    errors, warnings, notes, allowed : int
        How many findings of each severity; allowed ones are in no other number.
    start_time, duration : float
        When it began [s since the epoch], and how long it is [s].
    size, modified : int
        Of its files together [bytes], and the latest time of writing [ns since the epoch].
    messages, topics, legs, poses : int
        What is in it.
    lost : int
        Messages that never reached it, as far as is known.
    longest_gap : float
        On any topic [s].
    turns : float
        Net turns of a crank, the largest of all legs.
    stride, lift : float
        Of the foot's path, the largest of all legs [m].
    worst_residual, worst_angle_error, worst_foot_error : float
        Largest of all legs [m, rad, m].
    worst_transmission_angle : float
        Least of all legs [rad].
    findings : str
        All of them as a JSON list.
    settings : str
        What it was held against, as a fingerprint.

    """

    run: str
    verdict: str
    reason: str = ''
    errors: int = 0
    warnings: int = 0
    notes: int = 0
    allowed: int = 0
    start_time: float | None = None
    duration: float | None = None
    size: int | None = None
    modified: int | None = None
    messages: int | None = None
    topics: int | None = None
    legs: int | None = None
    poses: int | None = None
    lost: int | None = None
    longest_gap: float | None = None
    turns: float | None = None
    stride: float | None = None
    lift: float | None = None
    worst_residual: float | None = None
    worst_angle_error: float | None = None
    worst_foot_error: float | None = None
    worst_transmission_angle: float | None = None
    findings: str = '[]'
    settings: str = ''

    @property
    def exit_code(self) -> int:
        """Return what `review` would end with for this run alone."""
        return EXIT_CODES[self.verdict]


NAMES = tuple(field.name for field in fields(Row))
# By their kinds, for tables that have types.
TEXTS = frozenset({'run', 'verdict', 'reason', 'findings', 'settings'})
COUNTS = frozenset(field.name for field in fields(Row) if 'int' in str(field.type))


def unreadable_row(path: str, reason: object, **known: Any) -> Row:
    """Return the row of a run that nothing can be said of."""
    shown = printable(path)
    # The row tells it already.
    words = printable_line(reason).removeprefix(f'{shown} ')
    return Row(shown, UNREADABLE, words, **known)


def reviewed_row(
    path: str, review: Review, found: Iterable[Finding], allowed: frozenset[str], **known: Any
) -> Row:
    """Return the row of a reviewed run; `allowed` are the checks whose findings do not count."""
    findings = list(found)
    counted = [each for each in findings if each.check not in allowed]
    faults = sorted((each for each in counted if each.is_fault), key=lambda each: -each.severity)
    recording, legs = review.recording, review.legs
    values: dict[str, Any] = {
        'run': printable(path),
        'verdict': FINDINGS if faults else OK,
        'reason': _line(faults[0]) if faults else '',
        'errors': _count(counted, Severity.ERROR),
        'warnings': _count(counted, Severity.WARNING),
        'notes': _count(counted, Severity.NOTE),
        'allowed': len(findings) - len(counted),
        'start_time': recording.start / 1e9,
        'duration': recording.duration,
        'messages': sum(topic.count for topic in review.topics),
        'topics': len(review.topics),
        'legs': len(legs),
        'poses': sum(len(leg.recording.poses) for leg in legs),
        'lost': sum(topic.lost or 0 for topic in review.topics),
        'longest_gap': _most(topic.longest_gap for topic in review.topics),
        'turns': _of_legs(legs, 'turns', lambda found: max(found, key=abs)),
        **{name: _of_legs(legs, name, max) for name in _LARGEST},
        'worst_transmission_angle': _of_legs(legs, 'worst_transmission_angle', min),
        'findings': json.dumps([_told(each, allowed) for each in findings], ensure_ascii=False),
    }
    return Row(**values, **known)


_LARGEST = ('stride', 'lift', 'worst_residual', 'worst_angle_error', 'worst_foot_error')


def _count(findings: Iterable[Finding], severity: Severity) -> int:
    return sum(each.severity == severity for each in findings)


def _line(finding: Finding) -> str:
    leg = f'{printable(finding.leg)}: ' if finding.leg else ''
    return printable_line(f'{finding.check}: {leg}{finding.text}')


def _told(finding: Finding, allowed: frozenset[str]) -> dict[str, Any]:
    severity = 'allowed' if finding.check in allowed else finding.severity.name.lower()
    told = {**asdict(finding), 'severity': severity, 'text': printable_line(finding.text)}
    return dict(finite(told))


def _of_legs(
    legs: Iterable[ReviewedLeg], name: str, chosen: Callable[[list[float]], float]
) -> float | None:
    known = [value for leg in legs if isfinite(value := getattr(leg.figures, name))]
    return chosen(known) if known else None


def _most(values: Iterable[float]) -> float | None:
    return max((value for value in values if isfinite(value)), default=None)
