"""
Count the messages of a recording: received = skipped + dropped + written, for each topic.

*Missed* messages were lost before reception, by gaps in their sequence numbers. *Skipped* ones
came during a pause, *dropped* ones found a full queue (overrun) or a file that refused them
(unwritten).
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from .run_parameters import TopicCount

# Counts by topic name.
Counts = Mapping[str, TopicCount]
_NO_MESSAGES = TopicCount(0, 0)


class LossCounter:
    """
    Count lost messages by gaps in their publication sequence numbers.

    Each publisher numbers its messages from 1, so the count is exact for a topic with one
    publisher at a time, between its first and its last received message. `publishers_changed`
    and `identify` report changes of publishers; without them, a number that is not above the last
    one is that of a restarted publisher.
    """

    def __init__(self) -> None:
        # Messages lost between two received ones of a publisher.
        self.lost = 0
        # Messages that later publishers had sent before their first received one.
        self.before_discovery = 0
        # Publishers that left (set from outside): losses at their end cannot be detected.
        self.departed = 0
        # Whether late subscribers receive the last messages again (set from outside), so that the
        # first number means nothing.
        self.latched = False
        # Whether there ever were several publishers at once.
        self.shared = False
        # Whether all messages had a number.
        self.numbered = True
        self._last: int | None = None
        # When the last one was sent [ns].
        self._last_time = 0
        # The last number before publishers changed, and its publisher.
        self._last_before_change: int | None = None
        self._publisher: object = None
        # The first number since then, if its publisher is ambiguous.
        self._first: int | None = None

    @property
    def is_known(self) -> bool:
        """Return whether `lost` is complete."""
        return self.numbered and not self.shared

    def publishers_changed(self) -> None:
        """Note that the next message may have another publisher."""
        if self._last is not None:
            self._last_before_change = self._last
            self._last = None
            self._first = None

    def identify(self, publisher: object) -> None:
        """Set the publisher since the last change; None if it is unknown."""
        if self._last is None:
            return
        first = self._first
        last_before = self._last_before_change
        self._first = None
        if publisher is None:
            return
        if first is not None and last_before is not None and self._publisher is not None:
            if publisher == self._publisher:
                self.lost += first - last_before - 1
            else:
                self._begin(first)
        self._publisher = publisher

    def count(self, sequence: int | None, publishers: int = 1, time: int = 0) -> bool:
        """
        Count the gap before a message with a sequence number; None where there is none.

        `time` is when it was sent [ns]: where discovery ends, Fast DDS 3 sends older ones late.

        The numbers of several publishers are ambiguous. Return whether it is the first message
        since publishers changed: now they can be identified.
        """
        if sequence is None or publishers > 1:
            self.shared = self.shared or publishers > 1
            self.numbered = self.numbered and sequence is not None
            self._last = self._last_before_change = self._first = None
            return False
        last = self._last
        if last is not None and sequence < last and time < self._last_time:
            return False
        self._last = sequence
        self._last_time = time
        if last is None:
            self._resume(sequence)
            return True
        if sequence > last:
            self.lost += sequence - last - 1
        else:
            # The numbers before belong to the publisher known until now.
            self._first = None
            self._begin(sequence)
        return False

    def _resume(self, sequence: int) -> None:
        """Process the first number since publishers changed."""
        if self._last_before_change is None:
            return
        if sequence <= self._last_before_change:
            self._begin(sequence)
        elif sequence > self._last_before_change + 1:
            self._first = sequence

    def _begin(self, sequence: int) -> None:
        """Process the first number of a later publisher."""
        if not self.latched:
            self.before_discovery += sequence - 1


@dataclass(slots=True)
class TopicCounters:
    """
    Counters of a topic's messages before they are written.

    Each one is incremented by one thread only, so none needs a lock.
    """

    received: int = 0
    # Messages lost before reception.
    loss: LossCounter = field(default_factory=LossCounter)
    # Messages received during a pause.
    skipped: int = 0
    # Dropped by back-pressure: the queue was full, or writing had ended.
    overrun: int = 0
    # Dropped after the queue: the file refused them.
    unwritten: int = 0

    def count(self) -> TopicCount:
        """Return the present count, of messages before they are written."""
        loss = self.loss
        return TopicCount(
            self.received,
            written=0,
            dropped=self.overrun + self.unwritten,
            skipped=self.skipped,
            missed=loss.lost,
            before_discovery=loss.before_discovery,
            departed=loss.departed,
        )


@dataclass(frozen=True)
class StoredCounts:
    """Messages that were passed to a run, by topic name."""

    # Messages in the run.
    written: Counter[str]
    # Written, but no longer in the run, or not known to be.
    dropped: Counter[str]


class DropCounters:
    """
    Counters of all topics of a recording to a run.

    Every message outside the queue is in exactly one place: for each topic
    received = skipped + dropped + written.
    """

    def __init__(self, stored_counts: Callable[[], StoredCounts]) -> None:
        self._stored_counts = stored_counts
        self._topics: dict[str, TopicCounters] = {}

    def __getitem__(self, topic: str) -> TopicCounters:
        """Return the counters of a topic, new ones at the first call."""
        counters = self._topics.get(topic)
        # Two threads may call this at the same time.
        return self._topics.setdefault(topic, TopicCounters()) if counters is None else counters

    def skipped(self) -> Counter[str]:
        """Return the messages of each topic skipped in all pauses so far."""
        return Counter({name: counters.skipped for name, counters in self._items()})

    def counts(self) -> dict[str, TopicCount]:
        """Return what became of the messages of each topic so far; thread-safe."""
        stored = self._stored_counts()
        return {
            name: replace(
                count,
                written=stored.written[name],
                dropped=count.dropped + stored.dropped[name],
                missed=count.missed if self[name].loss.is_known else None,
            )
            for name, count in self.snapshot().items()
        }

    def snapshot(self) -> Counts:
        """Return the present counts of messages before they are written."""
        return {name: counters.count() for name, counters in self._items()}

    def counts_between(
        self, begin: Counts, end: Counts, stored: Counts, pretrigger: Mapping[str, int]
    ) -> dict[str, TopicCount]:
        """
        Return what became of the messages of each topic between two snapshots.

        `stored` are the counts of the run to which they were written, and `pretrigger` messages
        received before `begin` that were written to that run as well.
        """
        counts = {}
        for name, counters in self._items():
            first = begin.get(name, _NO_MESSAGES)
            last = end.get(name, _NO_MESSAGES)
            run_count = stored.get(name, _NO_MESSAGES)
            missed = (last.missed or 0) - (first.missed or 0)
            counts[name] = TopicCount(
                received=last.received - first.received + pretrigger.get(name, 0),
                written=run_count.written,
                dropped=run_count.dropped,
                skipped=last.skipped - first.skipped,
                missed=missed if counters.loss.is_known else None,
                before_discovery=last.before_discovery - first.before_discovery,
                departed=last.departed - first.departed,
            )
        return counts

    def _items(self) -> list[tuple[str, TopicCounters]]:
        # Another thread may add a topic meanwhile.
        return list(self._topics.items())
