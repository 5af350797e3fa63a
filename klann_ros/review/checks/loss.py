"""What was lost on its way into the run."""

from collections.abc import Iterator

from klann_ros.log.wording import counted, verb
from klann_ros.review.finding import Finding, Severity
from klann_ros.review.recording import Recording, TopicRecording
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
                _meaning(topic, recording),
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


def _meaning(topic: TopicRecording, recording: Recording) -> str:
    """Return where the messages were lost, and what is known of why."""
    on_the_way = 'published and never reached the run: a shallow queue, or an overload'
    if not topic.dropped:
        return f'they were {on_the_way}'
    why = '; '.join(filter(None, (recording.harmed, recording.stopped)))
    why = why or 'its queue was full, or the disk refused them'
    elsewhere = (topic.lost or 0) - topic.dropped
    others = f', {elsewhere} were {on_the_way}' if elsewhere > 0 else ''
    return f'the recorder had received {topic.dropped} of them{others}. What it tells: {why}'


def _messages(number: int, topic: TopicRecording) -> str:
    return f'{counted(number, "message")} of {printable(topic.name)} {verb(number, "was", "were")}'
