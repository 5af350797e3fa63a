"""Drop counters: each message in one place, and the same count for every thread."""

from collections import Counter

from klann_ros.log.run_parameters import TopicCount
from klann_ros.log.write.drop_counters import DropCounters, StoredCounts


class Run:
    """A run with given counts."""

    def __init__(self, written, dropped):
        self._counts = StoredCounts(Counter(written), Counter(dropped))

    def stored_counts(self):
        return self._counts


def test_each_topic_has_one_set_of_counters() -> None:
    counters = DropCounters(Run({}, {}))
    assert counters['/x'] is counters['/x']
    assert counters['/x'] is not counters['/y']
    assert list(counters.counts()) == ['/x', '/y']


def test_dropped_messages_are_overruns_unwritten_and_removed_ones() -> None:
    counters = DropCounters(Run({'/x': 80}, {'/x': 10}))
    topic = counters['/x']
    topic.received, topic.skipped, topic.overrun, topic.unwritten = 100, 5, 3, 2
    assert counters.counts() == {'/x': TopicCount(100, 80, dropped=15, skipped=5, missed=0)}


def test_the_loss_of_mixed_publishers_is_unknown() -> None:
    counters = DropCounters(Run({}, {}))
    counters['/x'].loss.count(1)
    counters['/x'].loss.count(5)
    assert counters.counts()['/x'].lost == 3
    counters['/x'].loss.count(6, publishers=2)
    assert counters.counts()['/x'].lost is None


def test_counts_between_two_snapshots_add_up() -> None:
    counters = DropCounters(Run({}, {}))
    counters['/a'].received = 5
    begin = counters.snapshot()
    counters['/a'].received = 9
    counters['/b'].received = 2
    counts = counters.counts_between(begin, counters.snapshot(), {}, {'/b': 1})
    assert (counts['/a'].received, counts['/b'].received) == (4, 3)
