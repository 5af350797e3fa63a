"""How the messages of each topic came: how many, how often, how late, and what is missing."""

from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from math import nan

from klann_ros.log.loss import LossCounter
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import LOSS_RECORD, losses
import numpy as np

from .decoding import nanoseconds
from .recording import TopicFigures
from .solvers import Metadata


@dataclass
class _Seen:
    # Arrays: a small file may hold a million messages.
    log: 'array[int]' = field(default_factory=lambda: array('q'))
    publish: 'array[int]' = field(default_factory=lambda: array('q'))
    sequences: 'array[int]' = field(default_factory=lambda: array('Q'))
    publishers: int = 0


class TopicTally:
    """Keeps the times and numbers of every topic's messages."""

    def __init__(self) -> None:
        self._seen: dict[tuple[str, str], _Seen] = {}

    def add(self, message: Message) -> None:
        """Count a message."""
        topic = message.topic
        seen = self._seen.get((topic.name, topic.type))
        if seen is None:
            seen = self._seen[topic.name, topic.type] = _Seen()
        seen.log.append(nanoseconds(message.log_time))
        seen.publish.append(nanoseconds(message.publish_time))
        seen.sequences.append(message.sequence)
        # The files of a split run may know a topic by different profiles.
        seen.publishers = max(seen.publishers, topic.qos.count('history:'))

    def figures(self, recorded: Mapping[str, int | None]) -> tuple[TopicFigures, ...]:
        """Return every topic's figures, with the losses that the recorder itself has counted."""
        seen = [
            _figures(name, kind, seen, recorded[name] if name in recorded else _lost(seen))
            for (name, kind), seen in self._seen.items()
        ]
        names = {topic.name for topic in seen}
        # A topic of which nothing at all arrived is lost as well.
        missing = [
            TopicFigures(name, '', 0, nan, nan, nan, lost)
            for name, lost in recorded.items()
            if lost and name not in names
        ]
        return (*seen, *missing)


def recorded_losses(metadata: Metadata) -> dict[str, int | None]:
    """Return what the recorder says about lost messages, by topic."""
    known: dict[str, int | None] = {}
    for record in metadata.get(LOSS_RECORD, ()):
        known.update(_losses(record))
    return known


def _losses(record: Mapping[str, str]) -> dict[str, int | None]:
    try:
        return losses(record)
    except ValueError:
        return {}


def _figures(name: str, kind: str, seen: _Seen, lost: int | None) -> TopicFigures:
    times = np.array(seen.log, dtype=np.int64)
    gaps = np.diff(times) / 1e9
    latencies = (times - np.array(seen.publish, dtype=np.int64)) / 1e9
    return TopicFigures(
        name=name,
        type=kind,
        count=len(times),
        rate=1.0 / float(gaps.mean()) if gaps.any() else nan,
        longest_gap=float(gaps.max()) if gaps.size else nan,
        latency=float(np.median(latencies)),
        lost=lost,
    )


def _lost(seen: _Seen) -> int | None:
    """Count by sequence numbers, where there are any and they are one publisher's."""
    # They begin at 1; 0 is what recorders write that do not know them.
    numbers = array('Q', filter(None, seen.sequences))
    # A publisher that starts anew goes back once, the numbers of two at a time do so for ever.
    steps_back = sum(after <= before for before, after in pairwise(numbers))
    if not numbers or steps_back > 1 or seen.publishers > 1:
        return None
    counter = LossCounter()
    for number in seen.sequences:
        counter.count(number or None)
    return counter.lost
