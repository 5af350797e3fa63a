"""Order, latency and stamps: whether the times in the run fit together."""

from collections.abc import Collection, Iterator

from klann_ros.review.finding import Finding, Severity
from klann_ros.review.reviewed import Review, ReviewedLeg
from klann_ros.review.topic_figures import TopicFigures
import numpy as np

# A latency is of a clock that is off if it hardly changes: so much from the median to the 99th
# percentile, as a part of it.
_STEADY = 0.2
# Fewer messages tell nothing of the sort.
_LEAST = 10


def check(review: Review) -> Iterator[Finding]:
    """Yield what is wrong with times."""
    yield from _order(review)
    off = [topic for topic in review.topics if _clock_is_off(topic, review)]
    yield from _latency(review, {topic.name for topic in off})
    if off:
        yield _publishers_clock(off)
    else:
        # Stamps come from the publisher's clock as a rule, which would be said twice.
        yield from _stamps(review)


def _order(review: Review) -> Iterator[Finding]:
    back = [topic for topic in review.recording.topics if topic.backwards_at is not None]
    if back:
        count = max(topic.backwards for topic in back)
        names = ', '.join(topic.name for topic in back)
        text = f'{count} messages of {names} are logged before those they follow'
        meaning = "the recorder's clock was set back, or the log was put together of others"
        first = min(topic.backwards_at or 0 for topic in back)
        time = review.recording.since_start(first)
        yield Finding('order', Severity.WARNING, text, meaning, time)
        # By the times of the log the stamps are out of order then, too.
        return
    for leg in review.legs:
        rows = np.flatnonzero(np.diff(leg.judged.poses.stamps) < 0)
        if rows.size and not leg.recording.solver.sim_time:
            text = f'the stamps of {rows.size} poses are before that of the pose they follow'
            meaning = 'inputs came out of order; robot_state_publisher drops such poses'
            time = review.recording.since_start(leg.judged.poses.times[rows[0] + 1])
            yield Finding('order', Severity.WARNING, text, meaning, time, leg.recording.title)


def _clock_is_off(topic: TopicFigures, review: Review) -> bool:
    p50, p99 = topic.latency_p50, topic.latency_p99
    if topic.count < _LEAST:
        return False
    if p50 < -review.limits.latency:
        return True
    return p50 > review.limits.clock_offset and p99 - p50 <= _STEADY * p50


def _publishers_clock(topics: list[TopicFigures]) -> Finding:
    worst = max(topics, key=lambda topic: abs(topic.latency_p50))
    off = worst.latency_p50
    names = ', '.join(topic.name for topic in topics)
    side = 'behind' if off > 0 else 'ahead of'
    text = f"the publisher's clock is {abs(off):.3f} s {side} the recorder's ({names})"
    meaning = 'two machines, two clocks: no latency can be told; let them agree (chrony, ptp)'
    return Finding('clock', Severity.WARNING, text, meaning)


def _latency(review: Review, untold: Collection[str]) -> Iterator[Finding]:
    for topic, recorded in zip(review.topics, review.recording.topics, strict=True):
        limit = review.limits.latency
        late = topic.count >= _LEAST and topic.latency_p99 > limit
        if late and topic.name not in untold:
            text = f'one in a hundred messages of {topic.name} came {topic.latency_p99:.3f} s late'
            meaning = 'the recorder, or the network, did not keep up'
            first = recorded.times[int(np.argmax(recorded.latencies > limit))]
            time = review.recording.since_start(first)
            yield Finding('latency', Severity.WARNING, text, meaning, time)


def _stamps(review: Review) -> Iterator[Finding]:
    for leg in review.legs:
        off = _offset(leg)
        if abs(off) > review.limits.clock_offset:
            side = 'behind' if off < 0 else 'ahead of'
            text = f"the stamps of the poses are {abs(off):.3f} s {side} the log's clock"
            meaning = 'the inputs are stamped by another clock; tf and viewers will drop them'
            yield Finding('clock', Severity.WARNING, text, meaning, leg=leg.recording.title)


def _offset(leg: ReviewedLeg) -> float:
    """Return how far the stamps are ahead of the log times, in the median [s]; 0 if unknown."""
    poses = leg.judged.poses
    if leg.recording.solver.sim_time or not len(poses):
        return 0.0
    return float(np.median(poses.stamps - poses.times)) / 1e9
