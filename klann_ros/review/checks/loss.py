"""What was lost on its way into the run."""

from collections.abc import Iterator

from klann_ros.log.wording import counted, verb
from klann_ros.review.finding import Finding, Severity
from klann_ros.review.recording import TopicRecording
from klann_ros.review.reviewed import Review
from klann_ros.untrusted.text import printable


def check(review: Review) -> Iterator[Finding]:
    """Yield the topics of which messages are missing by their sequence numbers."""
    recording = review.recording
    for topic in recording.topics:
        if topic.lost:
            yield Finding(
                'lost',
                Severity.WARNING,
                f'{_messages(topic.lost, topic)} lost',
                'they were published and never reached the run: a shallow queue, or an overload',
                None if topic.lost_at is None else recording.since_start(topic.lost_at),
            )
        if topic.early:
            yield Finding(
                'lost',
                Severity.WARNING,
                f'{_messages(topic.early, topic)} sent before the recorder heard their publishers',
                'who publishes at once does not wait for discovery (crank_node: min_subscribers)',
            )
        # One may leave at the end; who leaves before may have taken something along.
        if topic.left > 1 and topic.lost is not None:
            name = printable(topic.name)
            yield Finding(
                'lost',
                Severity.NOTE,
                f'{counted(topic.left, "publisher")} of {name} left during the run',
                'of what each sent last, and of those that nobody heard, nothing is known',
            )


def _messages(number: int, topic: TopicRecording) -> str:
    return f'{counted(number, "message")} of {printable(topic.name)} {verb(number, "was", "were")}'
