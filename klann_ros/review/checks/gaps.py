"""Silence: topics that paused, and topics that ended before the run did."""

from collections.abc import Iterator
from itertools import groupby
from operator import attrgetter

from klann_ros.review.model.recording import LegRecording
from klann_ros.review.model.review import Finding, Review, Severity
from klann_ros.review.model.simulated_time import CLOCK, pauses
from klann_ros.review.model.times import Hole, merged
from klann_ros.review.model.unanswered import refusals, Silence, SOON, without_holes
from klann_ros.sanitize.text import counted, listed, printable_line, verb

# What a solver publishes beside the poses.
_ANSWERS = ('point_h', 'velocity_h')


def check_gaps(review: Review) -> Iterator[Finding]:
    """Yield silences inside the run, and topics that went silent for good."""
    holes = _holes(review)
    found = [
        silence
        for (topic,), own in groupby(review.silences, key=attrgetter('topics'))
        for silence in without_holes(list(own), holes.get(topic, review.recording.holes))
    ]
    answers = {topic for leg in review.legs for topic in answer_topics(leg.recording)}
    # A restart of a solver leaves questions open: that is a gap.
    restarts = [one for one in found if one.is_restart and answers.isdisjoint(one.topics)]
    gaps = [one for one in found if one not in restarts]
    if gaps:
        yield _gap(review, _together(gaps))
    if restarts:
        yield _restart(review, _together(restarts))
    for stall in review.recording.stalls:
        meaning = 'silence in that time is no gap; what was published meanwhile may be lost'
        time = review.recording.since_start(stall.begin)
        yield Finding('stall', Severity.NOTE, printable_line(stall.reason), meaning, time)
    yield from _ended(review)


def _holes(review: Review) -> dict[str, tuple[Hole, ...]]:
    """Return by topic when nobody asked the solver, it could say nothing, or the log has holes."""
    recording = review.recording
    paused = [*recording.holes, *pauses(recording.clock)]
    found = {topic.name: [*paused] for topic in recording.topics if topic.name != CLOCK}
    for leg in review.legs:
        of_leg = refusals(leg.evaluated, leg.answering)
        restarts = recording.restarts_on(leg.recording.crank_topics)
        of_leg += [(begin, end + SOON) for begin, end in restarts]
        for topic in answer_topics(leg.recording):
            found.setdefault(topic, [*paused]).extend(of_leg)
    return {topic: merged(holes) for topic, holes in found.items()}


def answer_topics(leg: LegRecording) -> list[str]:
    """Return the topics on which a leg's solver answers."""
    place = f'{leg.namespace}/{leg.name}'.rstrip('/')
    return [*leg.pose_topics, *(f'{place}/{name}' for name in _ANSWERS)]


def _together(silences: list[Silence]) -> list[Silence]:
    """Join silences of several topics that overlap: they have one cause."""
    merged: list[Silence] = []
    for silence in sorted(silences):
        last = merged[-1] if merged else None
        if last is not None and silence.begin < last.end:
            topics = tuple(dict.fromkeys((*last.topics, *silence.topics)))
            merged[-1] = Silence(last.begin, max(last.end, silence.end), topics)
        else:
            merged.append(silence)
    return merged


def _gap(review: Review, silences: list[Silence]) -> Finding:
    recording, longest = review.recording, max(silences, key=lambda silence: silence.length)
    what = f'nothing on {listed(longest.topics)} for {longest.length:.3f} s'
    if len(silences) > 1:
        at = recording.since_start(longest.begin)
        what = f'{len(silences)} gaps; the longest: {what} at {at:.3f} s'
    count = _unanswered(review)
    if count:
        angles = verb(count, 'crank angle was', 'crank angles were')
        what += f'; {count} {angles} not answered meanwhile'
    meaning = 'the publisher stalled, or messages could not reach the recorder'
    time = recording.since_start(silences[0].begin)
    return Finding('gap', Severity.WARNING, what, meaning, time)


def _restart(review: Review, silences: list[Silence]) -> Finding:
    recording, first = review.recording, silences[0]
    text = f'another publisher of {listed(first.topics)} began {first.length:.3f} s after the last'
    meaning = 'a node ended in order and was started again; the time between is no gap'
    return Finding('restart', Severity.NOTE, text, meaning, recording.since_start(first.begin))


def _unanswered(review: Review) -> int:
    """Return how many crank angles silences left without answer; legs on one crank share them."""
    counts: dict[frozenset[str], int] = {}
    for leg in review.legs:
        topics = leg.recording.crank_topics
        counts[topics] = max(counts.get(topics, 0), leg.unanswered.in_silences)
    return sum(counts.values())


def _ended(review: Review) -> Iterator[Finding]:
    """Yield answers that ended while their questions went on; whoever else ends may do so."""
    recording = review.recording
    for leg in review.legs:
        poses, cranks = leg.evaluated.poses, leg.evaluated.cranks
        if not (len(poses) and len(cranks)):
            continue
        silent = (int(cranks.times[-1]) - int(poses.times[-1])) / 1e9
        if silent > review.limits.stale_time:
            after = counted(leg.answering.late, 'crank angle')
            yield Finding(
                'stale',
                Severity.WARNING,
                f'the poses ended {silent:.1f} s before the crank did; {after} came after them',
                'the solver stopped, every angle was refused, or its poses no longer came here',
                recording.since_start(poses.times[-1]),
                leg.recording.title,
            )
