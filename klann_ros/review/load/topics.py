"""Reception of each topic: times, latencies, sequence numbers and clock steps."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache, partial
import re
from typing import Any

from klann_ros.kinematics.arrays import BoolArray, IntArray
from klann_ros.log import LAST_TIME, LOSS_RECORD, topic_counts, TopicCount
from klann_ros.review.model.times import Interval, overlaps
from klann_ros.review.model.topics import TopicRecording
import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

Metadata = Mapping[str, Sequence[Mapping[str, str]]]
# As words or, until Humble, as a number of rmw.
_LATCHED = re.compile('durability: *(transient_local|1)\\b')


_INITIAL_ROWS = 1024


class GrowingArray:
    """An array that grows by rows of `width` numbers, 0 for rows that are numbers themselves."""

    def __init__(self, kind: DTypeLike, width: int = 0) -> None:
        self._columns = (width,) if width else ()
        self._rows: NDArray[Any] = np.empty((_INITIAL_ROWS, *self._columns), dtype=kind)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, new_rows: ArrayLike) -> None:
        """Append rows."""
        added = np.asarray(new_rows)
        begin = self._count
        self._count += len(added)
        if self._count > len(self._rows):
            # realloc moves pages, not bytes: half the memory of joined arrays.
            capacity = max(self._count, len(self._rows) * 3 // 2)
            self._rows.resize((capacity, *self._columns), refcheck=False)
        self._rows[slice(begin, self._count)] = added

    def array(self) -> NDArray[Any]:
        """Return all rows; nothing can be added any more."""
        self._rows.resize((self._count, *self._columns), refcheck=False)
        return self._rows


@dataclass
class _SequenceNumbers:
    """The sequence numbers of a topic, block by block; they begin at 1, and 0 means unknown."""

    last: int = 0
    count: int = 0  # of the known ones
    missing: GrowingArray = field(default_factory=partial(GrowingArray, np.int64, 3))
    steps_back: int = 0
    restarts: GrowingArray = field(default_factory=partial(GrowingArray, np.int64, 2))
    early: int = 0  # messages of later publishers before their first one here

    def add(self, numbers: IntArray, times_before: IntArray, times: IntArray) -> None:
        """Count missing numbers and restarts, between the log times before and of messages."""
        numbers_before = self.before(numbers)
        self.last = int(numbers[-1])
        self.count += int(np.count_nonzero(numbers))
        is_known = (numbers_before > 0) & (numbers > 0)
        steps = np.where(is_known, numbers - numbers_before, 1)
        is_back = steps <= 0
        self.early += int((numbers[is_back] - 1).sum())
        self.steps_back += int(np.count_nonzero(is_back))
        # A new publisher starts at 1, about; else messages are out of order.
        is_disordered = is_back & (2 * numbers > numbers_before)
        self.steps_back += int(np.count_nonzero(is_disordered))
        restarts = np.flatnonzero(is_back & ~is_disordered)
        self.restarts.add(np.column_stack([times_before[restarts], times[restarts]]))
        rows = np.flatnonzero(steps > 1)
        self.missing.add(np.column_stack([times_before[rows], times[rows], steps[rows] - 1]))

    def before(self, numbers: IntArray) -> IntArray:
        """Return the number before each of the next ones."""
        return np.concatenate([[self.last], numbers[:-1]])


@dataclass
class Reception:
    """The reception of a topic's messages, block by block."""

    times: GrowingArray = field(default_factory=partial(GrowingArray, np.int64))
    latencies: GrowingArray = field(default_factory=partial(GrowingArray, np.float32))
    back: GrowingArray = field(default_factory=partial(GrowingArray, np.int64, 3))
    numbers: _SequenceNumbers = field(default_factory=_SequenceNumbers)
    last_time: int = 0  # log time of the last message [ns]
    last_published: int = 0  # its publish time [ns]
    publishers: int = 0
    latched: bool = False
    discovered: int = 0  # on a latched topic, when its publisher was [ns]

    def add(self, qos: str, times: IntArray, published: IntArray, numbers: IntArray) -> None:
        """Add messages by their publishers' QoS, log and publish times [ns], and numbers."""
        publishers, latched = _offer(qos)
        self.publishers = max(self.publishers, publishers)
        self.latched = self.latched or latched
        # Without a publish time, recorders write the log time or 0.
        is_unknown = (published == 0) | (published == times)
        published = np.where(published > 0, published, times)
        if not self.times:
            self.last_time = times[0]
            self.last_published = published[0]
            self.discovered = times[0]
        times_before = np.concatenate([[self.last_time], times[:-1]])
        published_before = np.concatenate([[self.last_published], published[:-1]])
        back = np.flatnonzero(times < times_before)
        steps = times_before[back] - times[back]
        published_steps = published_before[back] - published[back]
        self.back.add(np.column_stack([len(self.times) + back, steps, published_steps]))
        latencies = np.where(is_unknown, np.nan, (times - published) / 1e9)
        if self.latched:
            latencies[published < self._discovery_times(times, numbers)] = np.nan
        self.last_time = int(times[-1])
        self.last_published = int(published[-1])
        self.times.add(times)
        self.latencies.add(latencies)
        self.numbers.add(numbers, times_before, times)

    def _discovery_times(self, times: IntArray, numbers: IntArray) -> IntArray:
        """Return when the publisher of each message was discovered [ns]."""
        numbers_before = self.numbers.before(numbers)
        # A restart of the numbers is another publisher, maybe an older one.
        is_restart = (numbers_before > 0) & (numbers > 0) & (numbers <= numbers_before)
        first = np.maximum.accumulate(np.where(is_restart, np.arange(len(times)), -1))
        discovery_times: IntArray = np.where(first < 0, self.discovered, times[first])
        self.discovered = int(discovery_times[-1])
        return discovery_times

    @property
    def is_shared(self) -> bool:
        """Return whether there were several publishers at once."""
        # A restarted publisher steps back once; those of two publishers do so repeatedly.
        return self.numbers.steps_back > 1 or self.publishers > 1

    @property
    def is_numbered(self) -> bool:
        """Return whether the sequence numbers are those of one publisher."""
        return bool(self.numbers.count) and not self.is_shared


def topic_recordings(
    receptions: Mapping[tuple[str, str], Reception],
    recorded: Mapping[str, TopicCount],
    unrecorded: Sequence[Interval],
) -> Iterator[TopicRecording]:
    """Yield all topics, with the losses that the recorder counted."""
    for (name, kind), reception in receptions.items():
        yield _topic(name, kind, reception, recorded.get(name), unrecorded)
    names = {name for name, _ in receptions}
    # A topic without any received message is lost, too.
    for name, count in recorded.items():
        is_lossy = count.lost or count.before_discovery or count.departed > 1
        if is_lossy and name not in names:
            yield _topic(name, '', Reception(), count, unrecorded)


@lru_cache(maxsize=64)
def _offer(qos: str) -> tuple[int, bool]:
    """Return the number of publishers in a QoS text, and whether one is latched."""
    return qos.count('history:'), _LATCHED.search(qos) is not None


def _topic(
    name: str,
    kind: str,
    reception: Reception,
    recorded: TopicCount | None,
    unrecorded: Sequence[Interval],
) -> TopicRecording:
    """Return a topic by its received messages, and by the recorder's count if there is one."""
    times = reception.times.array()
    latencies = reception.latencies.array()
    back = reception.back.array()
    # Numbers of two publishers may look like those of one; the recorder counts publishers.
    is_alone = reception.is_numbered and (recorded is None or recorded.missed is not None)
    set_back = back[recorder_clock_steps(latencies, back, alone=is_alone)]
    set_back = np.column_stack([times[set_back[:, 0]], set_back[:, 1]])
    if len(back):
        order = np.argsort(times, kind='stable')
        times = times[order]
        latencies = latencies[order]
    missing = (
        reception.numbers.missing.array()
        if reception.is_numbered
        else np.empty((0, 3), dtype=np.int64)
    )
    # Numbers missing at a pause or at damage are no loss.
    missing = missing[~overlaps(missing[:, 0], missing[:, 1], unrecorded)]
    # Unknown; a restarted publisher has left before.
    lost = None
    early = 0
    publishers_left = 0
    shared = reception.is_shared
    if recorded is not None:
        lost = recorded.lost
        shared = recorded.missed is None
        early = recorded.before_discovery
        publishers_left = recorded.departed
    elif reception.is_numbered:
        lost = int(missing[:, 2].sum())
        publishers_left = reception.numbers.steps_back
        early = 0 if reception.latched else reception.numbers.early
    if reception.latched and not reception.numbers.count:
        # Latched messages from before the discovery are indistinguishable from later ones.
        latencies = np.full_like(latencies, np.nan)
    return TopicRecording(
        name=name,
        type=kind,
        times=times,
        latencies=latencies,
        lost=lost,
        early=early,
        publishers_left=publishers_left,
        shared=shared,
        missing=missing,
        restarts=reception.numbers.restarts.array()[: 0 if shared else None],
        set_back=set_back,
        reordered=len(back) - len(set_back),
        dropped=0 if recorded is None else recorded.dropped,
    )


def recorded_losses(metadata: Metadata) -> dict[str, TopicCount]:
    """Return the losses that the recorder counted, by topic; not those of invalid records."""
    counts: dict[str, TopicCount] = {}
    for record in metadata.get(LOSS_RECORD, ()):
        with suppress(ValueError):
            for name, count in topic_counts(record).items():
                numbers = count.lost or 0, count.dropped, count.before_discovery, count.departed
                if min(numbers) >= 0 and max(numbers) <= LAST_TIME:
                    counts[name] = count
    return counts


# Recorders empty one queue after the other, and retransmissions come late: so messages are
# reordered without a clock step, by up to this [ns], or this with several publishers [ns].
_MAX_REORDERING = 5_000_000
_MAX_SHARED_REORDERING = 100_000_000
# Messages before and after a step whose smallest latency is compared, and steps of a topic.
_LATENCY_WINDOW = 1000
_MAX_STEPS = 10_000
# Percentile of the latency that is compared as well.
_LATENCY_PERCENTILE = 90.0
# Messages that a comparison needs.
_MIN_LATENCIES = 20


def recorder_clock_steps(
    latencies: NDArray[np.float32], steps: IntArray, *, alone: bool
) -> BoolArray:
    """
    Return which steps back of log times are steps of the recorder's clock, shape (k,).

    Either the publish times step back, too (same machine), or all later latencies are smaller.
    `latencies` are those of all messages in the order of the log [s], NaN for unknown; a row of
    `steps`, shape (k, 3), is a message logged earlier than its predecessor, the step of the log
    time, and that of the publish time, usually negative [ns]; `alone` says that there is a single
    publisher.
    """
    rows, back, published_back = steps.T
    likely: BoolArray = back >= _MAX_REORDERING
    if not likely.any():
        return likely
    has_publisher_step = published_back >= back / 2
    has_publisher_step &= alone | (back > _MAX_SHARED_REORDERING)
    return np.asarray(likely & (has_publisher_step | _latency_drops(latencies, rows, back)))


def _latency_drops(latencies: NDArray[np.float32], rows: IntArray, back: IntArray) -> BoolArray:
    """Return the rows where the latency drops permanently by about `back` [ns]."""
    is_drop = np.zeros(len(rows), dtype=bool)
    steps = zip(rows[:_MAX_STEPS].tolist(), back.tolist(), strict=False)
    for index, (row, step) in enumerate(steps):
        last_latencies = latencies[:row][-_LATENCY_WINDOW:]
        new_latencies = latencies[row:][:_LATENCY_WINDOW]
        if min(len(last_latencies), len(new_latencies)) < _MIN_LATENCIES:
            continue
        min_latency = np.fmin.reduce(last_latencies, initial=np.inf)
        # A large clock offset leaves few digits of the float32 latency.
        is_coarse = float(np.spacing(np.abs(min_latency))) * 1e9 > step / 8
        if not is_coarse and _drops_by(step, min_latency, np.fmin.reduce(new_latencies)):
            # With two publishers one may start late, while the other goes on.
            high_latency = np.nanpercentile(last_latencies, _LATENCY_PERCENTILE)
            high_new_latency = np.nanpercentile(new_latencies, _LATENCY_PERCENTILE)
            is_drop[index] = _drops_by(step, high_latency, high_new_latency)
    return is_drop


def _drops_by(step: int, latency: Any, new_latency: Any) -> bool:
    """Return whether a latency [s] drops by about a step [ns]."""
    drop = (np.float64(latency) - np.float64(new_latency)) * 1e9
    return bool(np.abs(drop - step) <= step / 2)
