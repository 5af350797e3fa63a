"""What a review finds in a run, short enough to be compared as a whole."""

from pathlib import Path
from typing import Any

from klann_ros.review.model.review import Review
from klann_ros.review.reviewing import review_run


def checks(review: Review) -> list[str]:
    """Return which checks found something, the gravest first."""
    return [finding.check for finding in review.findings]


def moments(review: Review) -> list[tuple[str, float | None]]:
    """Return which checks found something, and when [s], to the millisecond."""
    return [
        (finding.check, None if finding.time is None else round(finding.time, 3))
        for finding in review.findings
    ]


def found(run: Path, **options: Any) -> list[str]:
    """Return the findings of a run as they are printed."""
    return [f'{finding.check}: {finding.text}' for finding in review_run(run, **options).findings]
