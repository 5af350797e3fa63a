"""A review as JSON, for machines."""

from collections.abc import Mapping
from dataclasses import asdict
import json
from math import isfinite
from pathlib import Path
from typing import Any

from klann_ros import __version__
from klann_ros.review.comparing import Comparison
from klann_ros.review.reviewed import Review

# Counts up when what stands in the report changes its meaning.
VERSION = 1


def save(review: Review, comparison: Comparison | None, path: str) -> None:
    """
    Save the report.

    Raises
    ------
    OSError
        The file cannot be written.

    """
    Path(path).write_text(report(review, comparison), encoding='utf-8')


def report(review: Review, comparison: Comparison | None = None) -> str:
    """Return the report: SI units, times in seconds from the start; null for what is unknown."""
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
                'judged_poses': len(leg.judged.poses) if leg.resolved is not None else 0,
                **asdict(leg.figures),
            }
            for leg in review.legs
        ],
        'limits': review.limits.as_dict(),
        'findings': [
            {**asdict(finding), 'severity': finding.severity.name.lower()}
            for finding in review.findings
        ],
    }
    if comparison is not None:
        content['comparison'] = comparison.as_dict()
    return json.dumps(finite(content), indent=2) + '\n'


def finite(value: Any) -> Any:
    """Return a value that JSON can hold: it knows neither NaN nor infinity."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return value
