"""Each message is counted in one place, and a pause skips what was received in it."""

from collections import Counter

from hypothesis import given, strategies as st
from klann_ros.log.loss import DropCounters, StoredCounts
from klann_ros.log.run_parameters import Pause, TopicCount
from klann_ros.log.write.recording import Pauses
import pytest

TIMES = st.integers(0, 100)


def drop_counters(written=0, dropped=0):
    """Return the counters of a run with these messages of a topic."""
    stored = StoredCounts(Counter({'/x': written}), Counter({'/x': dropped}))
    return DropCounters(lambda: stored)


def test_dropped_messages_are_overruns_unwritten_and_removed_ones() -> None:
    counters = drop_counters(80, 10)
    topic = counters['/x']
    assert topic.count() == TopicCount(0, 0)
    topic.received, topic.skipped, topic.overrun, topic.unwritten = 100, 5, 3, 2
    assert counters.counts() == {'/x': TopicCount(100, 80, dropped=15, skipped=5, missed=0)}
    topic.loss.count(1)
    topic.loss.count(5)
    assert counters.counts()['/x'].missed == 3
    # The numbers of several publishers are mixed.
    topic.loss.count(6, publishers=2)
    assert counters.counts()['/x'].missed is None


def test_counts_between_two_snapshots_add_up() -> None:
    counters = drop_counters()
    topic = counters['/a']

    def receive(received: int, skipped: int, *sequence: int) -> None:
        topic.received += received
        topic.skipped += skipped
        for number in sequence:
            topic.loss.count(number)
        topic.loss.departed += 1

    receive(5, 1, 1, 3, 2)
    begin = counters.snapshot()
    receive(4, 2, 6, 4)
    counters['/b'].received = 2
    # What is received later is that of another run.
    end = counters.snapshot()
    receive(7, 3, 9)
    stored = {'/a': TopicCount(0, 80, dropped=8)}
    assert counters.counts_between(begin, end, stored, {'/b': 1}) == {
        '/a': TopicCount(4, 80, dropped=8, skipped=2, missed=3, before_discovery=3, departed=1),
        '/b': TopicCount(3, 0, missed=0),
    }
    topic.loss.count(None)
    assert counters.counts_between(begin, end, stored, {})['/a'].missed is None


@pytest.fixture
def counters():
    return drop_counters()


@pytest.mark.parametrize('received', [0, 2**63])
def test_without_a_pause_nothing_is_skipped(counters, received) -> None:
    assert not Pauses(counters).skips(counters['/x'], received)
    assert counters['/x'].skipped == 0


@given(begin=TIMES, length=TIMES, received=TIMES, is_taken_late=st.booleans())
def test_the_time_of_reception_decides(begin, length, received, is_taken_late) -> None:
    counters = drop_counters()
    pauses = Pauses(counters)
    pauses.begin(begin)
    end = begin + length
    if is_taken_late or received >= end:
        pauses.end(end)
    assert pauses.skips(counters['/x'], received) == (begin <= received < end)
    assert counters['/x'].skipped == (begin <= received < end)


def test_each_pause_has_counts_of_its_own(counters) -> None:
    pauses = Pauses(counters)
    for begin, topics in ((10, ['/x', '/x', '/y']), (30, ['/y'])):
        pauses.begin(begin)
        for topic in topics:
            assert pauses.skips(counters[topic], begin + 5)
        pauses.end(begin + 10)
        counts = {topic: topics.count(topic) for topic in topics}
        assert pauses.take_last() == Pause(begin, begin + 10, counts)
    # The clock is set back into it.
    assert not pauses.skips(counters['/x'], 35)
    assert counters.skipped() == {'/x': 2, '/y': 2}
