"""Order, latency and stamps: whether the times in the run fit together."""

from collections.abc import Collection, Iterator

from klann_ros.review.model.recording import Series
from klann_ros.review.model.review import Finding, Review, ReviewedLeg, Severity
from klann_ros.review.model.simulated_time import CLOCK, offsets
from klann_ros.review.model.times import overlap
from klann_ros.review.model.topics import TopicFigures, TopicRecording
from klann_ros.sanitize.text import listed, printable, times, verb
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
        is_late = topic.latency_p99 > limit and _known(recorded) >= _LEAST
        if topic.name in untold or not (recorded.is_periodic and is_late):
            continue
        # What waited while the recorder stalled says nothing of the way.
        times, holes = recorded.times, review.recording.holes
        latencies = np.where(overlap(times, times, holes), np.nan, recorded.latencies)
        known = int(np.count_nonzero(~np.isnan(latencies)))
        if known < _LEAST or np.nanpercentile(latencies, 99.0) <= limit:
            continue
        late = latencies > limit
        text = (
            f'{int(late.sum())} of {known} messages of {printable(topic.name)} took more than '
            f'{limit:g} s to arrive, up to {float(np.nanmax(latencies)):.3f} s'
        )
        meaning = 'the recorder, or the network, did not keep up'
        if topic.latency_p50 > limit and _is_steady(topic):
            meaning = 'all about equally long: a long way, or clocks that do not agree'
        time = review.recording.since_start(recorded.times[int(np.argmax(late))])
        yield Finding('latency', Severity.WARNING, text, meaning, time)


def _stamps(review: Review) -> Iterator[Finding]:
    for leg in review.legs:
        clock = review.recording.clock
        off = _offset(leg, clock)
        if abs(off) > review.limits.clock_offset:
            side = 'behind' if off < 0 else 'ahead of'
            of = CLOCK if leg.recording.solver.sim_time else "the log's clock"
            text = f'the stamps of the poses are {abs(off):.3f} s {side} {of}'
            meaning = 'inputs of another clock, or as old as that; tf and viewers may drop them'
            yield Finding('clock', Severity.WARNING, text, meaning, leg=leg.recording.title)


def _offset(leg: ReviewedLeg, clock: Series) -> float:
    """Return how far the stamps are ahead of their clock, in the median [s]; 0 if unknown."""
    poses = leg.evaluated.poses
    if not len(poses) or (leg.recording.solver.sim_time and not len(clock)):
        return 0.0
    if leg.recording.solver.sim_time:
        return float(np.median(offsets(poses, clock)))
    return float(np.median(poses.stamps - poses.times)) / 1e9
