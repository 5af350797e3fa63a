"""What was lost on its way into the run."""

from collections.abc import Iterator

from klann_ros.review.finding import Finding, Severity
from klann_ros.review.reviewed import Review


def check(review: Review) -> Iterator[Finding]:
    """Yield the topics of which messages are missing by their sequence numbers."""
    recording = review.recording
    for topic in recording.topics:
        if topic.lost:
            yield Finding(
                'lost',
                Severity.WARNING,
                f'{topic.lost} messages of {topic.name} were lost',
                'they were published and never reached the run: a shallow queue, or an overload',
                None if topic.lost_at is None else recording.since_start(topic.lost_at),
            )
