"""Silence: topics that paused, and topics that ended before the run did."""

from collections.abc import Iterator
from itertools import groupby
from operator import attrgetter

from klann_ros.review.model.review import Finding, Review, Severity
from klann_ros.review.model.times import Hole, merged
from klann_ros.review.model.unanswered import refusals, Silence, without_holes
from klann_ros.untrusted.text import counted, listed, verb

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
    if found:
        yield _gap(review, _together(found))
    yield from _ended(review)


def _holes(review: Review) -> dict[str, tuple[Hole, ...]]:
    """Return by topic when the solver could say nothing, or the log has holes."""
    found: dict[str, list[Hole]] = {}
    for leg in review.legs:
        of_leg = refusals(leg.evaluated, leg.answering)
        place = f'{leg.recording.namespace}/{leg.recording.name}'.rstrip('/')
        for topic in (*leg.recording.pose_topics, *(f'{place}/{name}' for name in _ANSWERS)):
            found.setdefault(topic, list(review.recording.holes)).extend(of_leg)
    return {topic: merged(holes) for topic, holes in found.items()}


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
    meaning = 'whoever publishes stood still, or the way into the run was blocked'
    time = recording.since_start(silences[0].begin)
    return Finding('gap', Severity.WARNING, what, meaning, time)


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
