"""Order, latency and stamps: whether the times in the run fit together."""

from collections.abc import Collection, Iterator

from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.model.topics import TopicFigures, TopicRecording
from klann_ros.untrusted.text import listed, printable, times, verb
import numpy as np

from .motion import back_and_forth

# A latency is of a clock that is off if it hardly changes: so much from the median to the 99th
# percentile, as a part of it.
_STEADY = 0.2
# Fewer messages tell nothing of the sort.
_LEAST = 10


def check_clocks(review: Review) -> Iterator[Finding]:
    """Yield which clocks are off, and what came late."""
    both = zip(review.topics, review.recording.topics, strict=True)
    off = [topic for topic, recorded in both if _clock_is_off(topic, recorded, review)]
    yield from _latency(review, {topic.name for topic in off})
    if off:
        yield _publishers_clock(off)
    else:
        # Stamps come from the publisher's clock as a rule, which would be said twice.
        yield from _stamps(review)


def check_order(review: Review) -> Iterator[Finding]:
    """Yield times that go back."""
    back = [topic for topic in review.recording.topics if len(topic.set_back)]
    if back:
        often = times(max(len(topic.set_back) for topic in back))
        by = max(int(topic.set_back[:, 1].max()) for topic in back) / 1e9
        names = listed(topic.name for topic in back)
        text = f'the log times go back {often}, by {by:.3g} s or more, on {names}'
        meaning = "the recorder's clock was set back, or the log was put together of others"
        first = min(int(topic.set_back[0, 0]) for topic in back)
        time = review.recording.since_start(first)
        yield Finding('order', Severity.WARNING, text, meaning, time)
        # By the times of the log the stamps are out of order then, too.
        return
    overtaken = {topic.name for topic in review.recording.topics if topic.overtaken}
    for leg in review.legs:
        if leg.recording.solver.sim_time or leg.answering.surplus.solvers > 1:
            continue
        # Two that turn the crank are found as such.
        if (
            overtaken & leg.recording.pose_topics
            or back_and_forth(leg.evaluated, review.limits).size
        ):
            continue
        rows = np.flatnonzero(np.diff(leg.evaluated.poses.stamps) < 0)
        if rows.size:
            count = int(rows.size)
            stamps = verb(count, 'stamp of 1 pose is', f'stamps of {count} poses are')
            text = f'the {stamps} earlier than that of the pose before'
            meaning = 'inputs came out of order; robot_state_publisher drops such poses'
            time = review.recording.since_start(leg.evaluated.poses.times[rows[0] + 1])
            yield Finding('order', Severity.WARNING, text, meaning, time, leg.recording.title)


def _clock_is_off(topic: TopicFigures, recorded: TopicRecording, review: Review) -> bool:
    if _known(recorded) < _LEAST:
        return False
    if topic.latency_p50 < -review.limits.latency:
        return True
    return topic.latency_p50 > review.limits.clock_offset and _is_steady(topic)


def _known(recorded: TopicRecording) -> int:
    return int(np.count_nonzero(~np.isnan(recorded.latencies)))


def _is_steady(topic: TopicFigures) -> bool:
    return topic.latency_p99 - topic.latency_p50 <= _STEADY * topic.latency_p50


def _publishers_clock(topics: list[TopicFigures]) -> Finding:
    worst = max(topics, key=lambda topic: abs(topic.latency_p50))
    off = worst.latency_p50
    names = listed(topic.name for topic in topics)
    # Nothing comes before it was published; but what takes long may take equally long.
    side = 'seems {:.3f} s behind' if off > 0 else 'is {:.3f} s ahead of'
    text = f"the publisher's clock {side.format(abs(off))} the recorder's ({names})"
    meaning = 'two machines, two clocks: no latency can be told; let them agree (chrony, ptp)'
    return Finding('clock', Severity.WARNING, text, meaning)


def _latency(review: Review, untold: Collection[str]) -> Iterator[Finding]:
    limit = review.limits.latency
    for topic, recorded in zip(review.topics, review.recording.topics, strict=True):
        known = _known(recorded)
        if topic.name in untold or known < _LEAST or topic.latency_p99 <= limit:
            continue
        late = recorded.latencies > limit
        text = (
            f'{int(late.sum())} of {known} messages of {printable(topic.name)} took more than '
            f'{limit:g} s to arrive, up to {float(np.nanmax(recorded.latencies)):.3f} s'
        )
        meaning = 'the recorder, or the network, did not keep up'
        if topic.latency_p50 > limit and _is_steady(topic):
            meaning = 'all about equally long: a long way, or clocks that do not agree'
        time = review.recording.since_start(recorded.times[int(np.argmax(late))])
        yield Finding('latency', Severity.WARNING, text, meaning, time)


def _stamps(review: Review) -> Iterator[Finding]:
    for leg in review.legs:
        off = _offset(leg)
        if abs(off) > review.limits.clock_offset:
            side = 'behind' if off < 0 else 'ahead of'
            text = f"the stamps of the poses are {abs(off):.3f} s {side} the log's clock"
            meaning = 'inputs of another clock, or as old as that; tf and viewers may drop them'
            yield Finding('clock', Severity.WARNING, text, meaning, leg=leg.recording.title)


def _offset(leg: ReviewedLeg) -> float:
    """Return how far the stamps are ahead of the log times, in the median [s]; 0 if unknown."""
    poses = leg.evaluated.poses
    if leg.recording.solver.sim_time or not len(poses):
        return 0.0
    return float(np.median(poses.stamps - poses.times)) / 1e9
