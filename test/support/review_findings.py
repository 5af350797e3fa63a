"""What a review finds in a run, short enough to be compared as a whole."""

from pathlib import Path
import re
from typing import Any

from klann_ros.review.model.review import located, Review
from klann_ros.review.reviewing import review_run

# One of something, and not one of several: 1 messages, 1 poses were.
PLURAL = re.compile(r'(?<![\d.])1 (?!of )(?:\w+ )?(?:\w+[^s\d\W]s|feet|were|are|have|do)\b')


def checks(review: Review) -> list[str]:
    """Return the checks that found something, the gravest first; none has a plural of one."""
    assert [f.text for f in review.findings if PLURAL.search(f'{f.text} {f.meaning}')] == []
    return [finding.check for finding in review.findings]


def moments(review: Review) -> list[tuple[str, float | None]]:
    """Return the checks that found something, and their times [s], to the millisecond."""
    checks(review)
    return [
        (finding.check, None if finding.time is None else round(finding.time, 3))
        for finding in review.findings
    ]


def timed(review: Review) -> list[str]:
    """Return the findings of a review as lines of check, time [s], leg and text."""
    pairs = zip(moments(review), review.findings, strict=True)
    return [
        f'{check} {"" if time is None else time}'.rstrip() + f': {located(f.leg, f.text)}'
        for (check, time), f in pairs
    ]


def found(run: Path, **options: Any) -> list[str]:
    """Return the findings of a run as they are printed."""
    review = review_run(run, **options)
    return [f'{check}: {f.text}' for check, f in zip(checks(review), review.findings, strict=True)]


def are_alike(lines: list[str], expected: list[str]) -> bool:
    """Return whether lines are those expected, where three dots stand for any text."""
    patterns = [re.escape(line).replace(r'\.\.\.', '.*') for line in expected]
    return len(lines) == len(patterns) and all(map(re.fullmatch, patterns, lines))
