"""Whether the log is whole: damage, what was lost on its way, and what a review needs."""

from collections.abc import Iterator

from klann_ros.log.errors import REFUSED
from klann_ros.review.model.recording import RunRecording
from klann_ros.review.model.review import Finding, Review, Severity
from klann_ros.review.model.topics import TopicRecording
from klann_ros.robot.file import preset_names
from klann_ros.sanitize.text import counted, printable, printable_line, verb

_MOST_PROBLEMS = 3
# So many of what the recorder told are repeated.
_MOST_TOLD = 10


def check_container(review: Review) -> Iterator[Finding]:
    """Yield what is wrong with the log as a log."""
    recording = review.recording
    if recording.problems:
        shown = '; '.join(recording.problems[:_MOST_PROBLEMS])
        more = len(recording.problems) - _MOST_PROBLEMS
        also = f'; and {more} more' if more > 0 else ''
        meaning = 'what is judged is what could be read; `recover` makes a whole run of it'
        what = 'the log is damaged'
        if all(REFUSED in problem for problem in recording.problems):
            meaning = 'the rest is judged; a machine with more memory can read all of it'
            what = 'part of the log is refused'
        yield Finding('container', Severity.ERROR, f'{what}: {shown}{also}', meaning)
    if recording.stopped:
        yield Finding(
            'container',
            Severity.WARNING,
            f'the recording ended before its time: {recording.stopped}',
            'what came later is not in the run',
        )
    for failed in recording.undecoded:
        yield Finding(
            'decode',
            Severity.ERROR,
            f'{counted(failed.count, "message")} of {printable(failed.topic)} cannot be decoded',
            'the bytes are not what the type says, or joints have no positions; left out',
            recording.since_start(failed.time),
        )
    yield from _poses(review)


def check_told(review: Review) -> Iterator[Finding]:
    """Yield what the recorder found while it recorded, which is judged again by what is there."""
    recording = review.recording
    for number, told in enumerate(recording.told):
        left = len(recording.told) - number
        if number == _MOST_TOLD:
            text = f'the recorder told {left} more meanwhile'
            yield Finding('told', Severity.NOTE, text, 'they are in the run (klann_ros.finding)')
            return
        what = ' of '.join(printable(part) for part in (told.check, told.leg) if part)
        text = f'the recorder told meanwhile: {printable_line(told.text)} ({what})'
        meaning = 'said on /diagnostics when it was seen; the run as a whole is judged beside it'
        time = recording.since_start(told.time)
        yield Finding('told', Severity.NOTE, text, meaning, time)


def _poses(review: Review) -> Iterator[Finding]:
    """Yield that there are none, or nothing to judge them by."""
    there_are = any(len(leg.recording.poses) for leg in review.legs)
    if not there_are:
        text = 'there is no pose in the run (no joint_states of a leg)'
        meaning = 'nothing can be judged: was solver_node running, and its topic recorded?'
        yield Finding('poses', Severity.ERROR, text, meaning)
    for leg in review.legs:
        title = leg.recording.title
        if there_are and not len(leg.recording.poses):
            text = 'there is no pose of this leg in the run'
            meaning = 'its solver has it; nobody told an angle of its crank joint, it seems'
            yield Finding('poses', Severity.NOTE, text, meaning, leg=title)
        elif there_are and leg.recording.solver.leg is None:
            text = 'the run does not tell the geometry'
            legs = ', '.join(preset_names())
            meaning = f'no pose can be judged; give the leg by --geometry FILE, or one of {legs}'
            yield Finding('geometry', Severity.WARNING, text, meaning, leg=title)


def check_losses(review: Review) -> Iterator[Finding]:
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


def _meaning(topic: TopicRecording, recording: RunRecording) -> str:
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
