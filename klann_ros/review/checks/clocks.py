"""Check times: order, latency, and the offset of clocks."""

from collections.abc import Iterable, Iterator

from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.model.times import CLOCK, offsets, overlaps, Series
from klann_ros.review.model.topics import TopicFigures, TopicRecording
from klann_ros.sanitize.text import listed, number_range, printable, times, verb
import numpy as np
from numpy.typing import NDArray

from .motion import back_and_forth

# A steady latency means a clock offset: largest distance from the median to the 99th percentile,
# as a part of the median.
_MAX_LATENCY_SPREAD = 0.2
# Messages that a latency needs.
_MIN_MESSAGES = 10


def check_clocks(review: Review) -> Iterator[Finding]:
    """Yield clock offsets and late messages."""
    topics = []
    offset_topics = []
    for topic in review.recording.topics:
        if _has_latency(topic.latencies):
            figures = topic.figures
            is_late = figures.latency_p50 > review.limits.clock_offset and _is_steady(figures)
            if is_late or figures.latency_p50 < -review.limits.latency:
                offset_topics.append(figures)
            else:
                topics.append(topic)
    yield from _latency(review, topics)
    late_topics = [topic for topic in offset_topics if topic.latency_p50 > 0]
    early_topics = [topic for topic in offset_topics if topic.latency_p50 < 0]
    yield from _publishers_clock(late_topics, 'seems', 'behind')
    yield from _publishers_clock(early_topics, 'is', 'ahead of')
    if not offset_topics:
        # Stamps usually have the publisher's clock: one finding is enough.
        yield from _stamps(review)


def check_order(review: Review) -> Iterator[Finding]:
    """Yield impossible log times, and log times and stamps that go back."""
    if review.recording.impossible_times:
        meaning = 'a clock was not set, or a counter rolled over; the time before is taken instead'
        text = review.recording.impossible_times
        yield Finding('order', Severity.WARNING, text, meaning)
    topics = [topic for topic in review.recording.topics if len(topic.set_back)]
    if topics:
        steps = [topic.set_back for topic in topics]
        counts = sorted(map(len, steps))
        repetition = ' to '.join(dict.fromkeys([times(counts[0]), times(counts[-1])]))
        max_steps = number_range([topic_steps[:, 1].max() / 1e9 for topic_steps in steps], '.3g')
        names = listed(topic.name for topic in topics)
        text = f'the log times go back {repetition}, by {max_steps} s or more, on {names}'
        meaning = "the recorder's clock was set back, or the log was merged from others"
        first_time = min(int(topic_steps[0, 0]) for topic_steps in steps)
        yield Finding('order', Severity.WARNING, text, meaning, review.since_start(first_time))
        return
    reordered = {topic.name for topic in review.recording.topics if topic.reordered}
    for leg in review.legs:
        if leg.recording.solver.sim_time or leg.answers.duplicates.solvers > 1:
            continue
        # `check_motion` finds two sources.
        swaps = back_and_forth(review, leg.evaluated)
        if reordered & leg.recording.pose_topics or swaps.size:
            continue
        rows = np.flatnonzero(np.diff(leg.evaluated.poses.stamps) < 0)
        if rows.size:
            count = int(rows.size)
            stamps = verb(count, 'stamp of 1 pose is', f'stamps of {count} poses are')
            text = f'the {stamps} earlier than that of the pose before'
            meaning = 'inputs came out of order; robot_state_publisher drops such poses'
            time = review.since_start(leg.evaluated.poses.times[rows[0] + 1])
            yield Finding('order', Severity.WARNING, text, meaning, time, leg.recording.title)


def _has_latency(latencies: NDArray[np.float32]) -> bool:
    return bool(np.count_nonzero(~np.isnan(latencies)) >= _MIN_MESSAGES)


def _is_steady(topic: TopicFigures) -> bool:
    return topic.latency_p99 - topic.latency_p50 <= _MAX_LATENCY_SPREAD * topic.latency_p50


def _publishers_clock(
    topics: list[TopicFigures], predicate: str, relation: str
) -> Iterator[Finding]:
    """Yield the offsets of one sign: a negative latency proves one, a steady one suggests it."""
    if topics:
        offsets = number_range([abs(topic.latency_p50) for topic in topics], '.3f')
        names = listed(topic.name for topic in topics)
        text = f"the publisher's clock {predicate} {offsets} s {relation} the recorder's ({names})"
        meaning = (
            'two machines with different clocks hide the latency; synchronise them (chrony, ptp)'
        )
        yield Finding('clock', Severity.WARNING, text, meaning)


def _latency(review: Review, topics: Iterable[TopicRecording]) -> Iterator[Finding]:
    """Yield topics whose messages arrive later than the limit."""
    limit = review.limits.latency
    for topic in topics:
        if not topic.is_periodic or topic.figures.latency_p99 <= limit:
            continue
        # Messages that waited for a stalled recorder do not count.
        has_waited = overlaps(topic.times, topic.times, review.recording.unrecorded)
        latencies = np.where(has_waited, np.nan, topic.latencies)
        if not _has_latency(latencies) or np.nanpercentile(latencies, 99.0) <= limit:
            continue
        is_late = latencies > limit
        count = int(np.count_nonzero(~np.isnan(latencies)))
        text = (
            f'{int(is_late.sum())} of {count} messages of {printable(topic.name)} took more than '
            f'{limit:g} s to arrive, up to {float(np.nanmax(latencies)):.3f} s'
        )
        meaning = 'the recorder or the network was overloaded'
        if topic.figures.latency_p50 > limit and _is_steady(topic.figures):
            meaning = 'all take about equally long: a slow link, or unsynchronised clocks'
        time = review.since_start(topic.times[int(np.argmax(is_late))])
        yield Finding('latency', Severity.WARNING, text, meaning, time)


def _stamps(review: Review) -> Iterator[Finding]:
    for leg in review.legs:
        clock = review.recording.clock
        offset = _offset(leg, clock)
        if abs(offset) > review.limits.clock_offset:
            relation = 'behind' if offset < 0 else 'ahead of'
            reference = CLOCK if leg.recording.solver.sim_time else "the log's clock"
            text = f'the stamps of the poses are {abs(offset):.3f} s {relation} {reference}'
            meaning = (
                'the inputs have another clock, or are that old; tf and viewers may drop the poses'
            )
            yield Finding('clock', Severity.WARNING, text, meaning, leg=leg.recording.title)


def _offset(leg: ReviewedLeg, clock: Series) -> float:
    """Return the median offset of the stamps to their clock [s]; 0 if unknown."""
    poses = leg.evaluated.poses
    if not len(poses) or (leg.recording.solver.sim_time and not len(clock)):
        return 0.0
    if leg.recording.solver.sim_time:
        return float(np.median(offsets(poses, clock)))
    return float(np.median(poses.stamps - poses.times)) / 1e9
