"""How the messages of each topic came: when, how late, and what is missing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from klann_ros.log.reading.block import Block
from klann_ros.log.records import Topic
from klann_ros.log.run_parameters import LOSS_RECORD, losses
from klann_ros.review.recording import TopicRecording
import numpy as np
from numpy.typing import NDArray

from .growing import Growing
from .holes import Hole, overlap
from .layouts import Times
from .pieces import nanoseconds, Rows
from .solvers import Metadata


@dataclass
class _Seen:
    times: Growing = field(default_factory=partial(Growing, np.int64))
    latencies: Growing = field(default_factory=partial(Growing, np.float32))
    end: int = 0
    publishers: int = 0
    backwards: int = 0
    backwards_at: int | None = None
    # By the sequence numbers, which begin at 1; 0 is what recorders write that know none.
    last: int = 0
    numbered: int = 0
    missing: Growing = field(default_factory=partial(Growing, np.int64, 3))
    steps_back: int = 0

    def add(self, heads: NDArray[np.void]) -> None:
        """Add messages by what stands before their bytes."""
        times = nanoseconds(heads['log_time'])
        before = np.concatenate([[self.end if self.times else times[0]], times[:-1]])
        back = times < before
        if self.backwards_at is None and back.any():
            self.backwards_at = int(times[np.argmax(back)])
        self.backwards += int(np.count_nonzero(back))
        self.end = int(times[-1])
        self.times.add(times)
        published = nanoseconds(heads['publish_time'])
        # Who knows no such time should write the log time; some write nothing.
        self.latencies.add(np.where(published > 0, times - published, 0) / 1e9)
        self._count(heads['sequence'].astype(np.int64), before, times)

    def _count(self, numbers: NDArray[np.int64], befores: Times, times: Times) -> None:
        """Note what is missing between the numbers of messages."""
        before = np.concatenate([[self.last], numbers[:-1]])
        self.last = int(numbers[-1])
        self.numbered += int(np.count_nonzero(numbers))
        known = (before > 0) & (numbers > 0)
        steps = np.where(known, numbers - before, 1)
        back = steps <= 0
        self.steps_back += int(np.count_nonzero(back))
        # Who starts anew starts at 1, about; else messages are out of order.
        self.steps_back += int(np.count_nonzero(back & (2 * numbers > before)))
        rows = np.flatnonzero(steps > 1)
        self.missing.add(np.column_stack([befores[rows], times[rows], steps[rows] - 1]))

    @property
    def is_numbered(self) -> bool:
        """Return whether the numbers are one publisher's, so that they tell what is missing."""
        # A publisher that starts anew goes back once, the numbers of two at a time do so for ever.
        return bool(self.numbered) and self.steps_back <= 1 and self.publishers <= 1


class TopicTally:
    """Keeps the times and numbers of every topic's messages."""

    def __init__(self) -> None:
        self._seen: dict[tuple[str, str], _Seen] = {}

    def add(self, topic: Topic, block: Block, rows: Rows) -> None:
        """Count a topic's messages in a block."""
        seen = self._seen.setdefault((topic.name, topic.type), _Seen())
        # The files of a split run may know a topic by different profiles.
        seen.publishers = max(seen.publishers, topic.qos.count('history:'))
        seen.add(block.heads[rows])

    def topics(
        self, recorded: Mapping[str, int | None], holes: Sequence[Hole]
    ) -> tuple[TopicRecording, ...]:
        """Return every topic, with the losses that the recorder itself has counted."""
        found = [
            _topic(name, kind, seen, recorded, holes) for (name, kind), seen in self._seen.items()
        ]
        self._seen.clear()
        names = {topic.name for topic in found}
        # A topic of which nothing at all arrived is lost as well.
        nothing, none = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.float32)
        missing = [
            TopicRecording(name, '', nothing, none, lost)
            for name, lost in recorded.items()
            if lost and name not in names
        ]
        return (*found, *missing)


def _topic(
    name: str,
    kind: str,
    seen: _Seen,
    recorded: Mapping[str, int | None],
    holes: Sequence[Hole],
) -> TopicRecording:
    times, latencies = seen.times.array(), seen.latencies.array()
    if seen.backwards:
        order = np.argsort(times, kind='stable')
        times, latencies = times[order], latencies[order]
    missing = seen.missing.array()
    if seen.is_numbered:
        # What is missing where the log has a hole never was on its way, or is damaged.
        missing = missing[~overlap(missing[:, 0], missing[:, 1], holes)]
    else:
        missing = missing[:0]
    return TopicRecording(
        name=name,
        type=kind,
        times=times,
        latencies=latencies,
        lost=recorded.get(name, int(missing[:, 2].sum()) if seen.is_numbered else None),
        missing=missing,
        backwards=seen.backwards,
        backwards_at=seen.backwards_at,
    )


def recorded_losses(metadata: Metadata) -> dict[str, int | None]:
    """Return what the recorder says about lost messages, by topic."""
    known: dict[str, int | None] = {}
    for record in metadata.get(LOSS_RECORD, ()):
        known.update(_losses(record))
    return known


def _losses(record: Mapping[str, str]) -> dict[str, int | None]:
    try:
        counts = losses(record)
    except ValueError:
        return {}
    # Less than none is no count.
    return {name: lost for name, lost in counts.items() if lost is None or lost >= 0}
