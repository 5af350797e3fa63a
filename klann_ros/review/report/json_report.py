"""A review as JSON, for machines."""

from dataclasses import asdict
import json
from typing import Any, BinaryIO

from klann_ros import __version__
from klann_ros.review.model.answers import Cause
from klann_ros.review.model.compare import Comparison
from klann_ros.review.model.review import Review, ReviewedLeg
from klann_ros.sanitize.outputs import finite

# Counts up when what stands in the report changes its meaning.
VERSION = 1


def save(review: Review, comparison: Comparison | None, file: BinaryIO) -> None:
    """Write the report to an open file."""
    file.write(report(review, comparison).encode())


def report(review: Review, comparison: Comparison | None = None) -> str:
    """Return the report: SI units, times in seconds from the start; null for unknown."""
    recording = review.recording
    content: dict[str, Any] = {
        'version': VERSION,
        'klann_ros': __version__,
        'path': recording.path,
        'files': [{'name': name, 'size': size} for name, size in recording.files],
        'start_time': recording.start / 1e9,
        'duration': recording.duration,
        'healthy': review.is_healthy,
        'topics': [asdict(topic) for topic in review.topics],
        'legs': [
            {
                'leg': leg.recording.title,
                'poses': len(leg.recording.poses),
                'judged_poses': len(leg.evaluated.poses) if leg.errors is not None else 0,
                'geometry_source': leg.recording.solver.source,
                **asdict(leg.figures),
                'crank_angles': _crank_angles(leg),
            }
            for leg in review.legs
        ],
        'walks': [asdict(walk) for walk in review.walks],
        'limits': asdict(review.limits),
        'findings': [
            {**asdict(finding), 'severity': finding.severity.name.lower()}
            for finding in review.findings
        ],
    }
    if comparison is not None:
        content['comparison'] = asdict(comparison)
    return json.dumps(finite(content), indent=2) + '\n'


def _crank_angles(leg: ReviewedLeg) -> dict[str, int | None]:
    """Return what became of what a leg was asked; None where the run does not tell."""
    found, left = leg.answers, leg.unanswered
    counts: dict[str, int | None] = {
        'before_the_first_answer': found.early,
        'asked': found.asked,
        'answered': found.asked - len(found.rows),
        'no_angle': len(found.of(Cause.NO_ANGLE)),
        'out_of_reach': len(found.of(Cause.OUT_OF_REACH)),
        'unanswered_in_gaps': left.in_gaps,
        'unanswered_while_unrecorded': left.unrecorded,
        'unanswered_by_lost_answers': left.lost,
        'unanswered_unexplained': left.unexplained,
        'after_the_last_answer': found.late,
    }
    return counts if len(leg.evaluated.cranks) else dict.fromkeys(counts)
