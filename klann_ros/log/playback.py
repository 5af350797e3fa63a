"""
The playback of a log: each message when it is due.

One thread iterates over :meth:`Playback.passes`; others steer its transport.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from math import inf
from threading import Condition, Thread

from .reader import Log
from .records import Message
from .transport import Transport

NS = 1e9

# Messages of a batch, their size [bytes], and batches that are read ahead, at most.
BATCH, BATCH_SIZE = 200, 1_000_000
BATCHES = 8


@dataclass(frozen=True)
class Selection:
    """The part of a log to play."""

    # Names of the topics.
    topics: frozenset[str]
    # Number of messages that each latched topic repeats before a start.
    latched: Mapping[str, int] = field(default_factory=dict)
    # Positions, from the start of the log [s].
    begin: float = 0.0
    end: float = inf
    loop: bool = False


class Playback:
    """Plays an open log at a rate (2 is twice as fast as recorded); `transport` controls it."""

    def __init__(
        self, log: Log, selection: Selection, *, rate: float = 1.0, paused: bool = False
    ) -> None:
        self._log = log
        self._selection = selection
        end = min(selection.end, length(log))
        self.transport = Transport(selection.begin, end, rate=rate, paused=paused)

    @property
    def time(self) -> int:
        """Return the position as a log time [ns]."""
        return self._log.start_time + round(self.transport.position * NS)

    def passes(self) -> Iterator[Iterator[Message]]:
        """
        Yield a pass from each start: the first one, each loop, each jump.

        A pass yields the latched messages of that position, then each message when it is due, up
        to the end of the log or an interruption.
        """
        while (begin := self.transport.take_target()) is not None:
            yield self._pass(begin)

    def _pass(self, begin: float) -> Iterator[Message]:
        """Yield the messages of a pass at their times, the latched ones before it first."""
        log = self._log
        transport = self.transport
        selection = self._selection
        start, end = (log.start_time + round(s * NS) for s in (begin, transport.length))
        yield from log.latest(selection.latched, start)
        furthest = begin
        count = 0
        messages = log.messages(selection.topics, start=start, end=end)
        with closing(ReadAhead(messages)) as ahead:
            transport.on_interrupt(ahead.close)
            for message in ahead:
                # A log without an index may be out of order.
                furthest = max(furthest, (message.log_time - log.start_time) / NS)
                if not transport.reach(furthest):
                    return
                yield message
                count += 1
        loop = selection.loop
        last = transport.length if loop else furthest
        transport.reach_end(begin, last, selection.begin if loop else None, empty=count == 0)


def length(log: Log) -> float:
    """Return the time from the first message of a log to the last [s]."""
    return (log.end_time - log.start_time) / NS


class ReadAhead:
    """Iterate over messages that another thread reads ahead; its error is raised here."""

    def __init__(self, messages: Iterable[Message]) -> None:
        self._messages = messages
        self._batches: deque[list[Message]] = deque()
        self._changed = Condition()
        self._finished = False
        self._closed = False
        self._failure: BaseException | None = None
        self._thread = Thread(target=self._run, name='read ahead', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the iteration, from any thread."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def __iter__(self) -> Iterator[Message]:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._batches or self._finished or self._closed)
                if self._closed or not self._batches:
                    break
                batch = self._batches.popleft()
                self._changed.notify_all()
            yield from batch
        if self._failure is not None and not self._closed:
            raise self._failure

    def _run(self) -> None:
        try:
            for batch in _batches(self._messages):
                if not self._put(batch):
                    return
        # Raised by the iteration.
        except BaseException as failure:  # noqa: BLE001, RUF100
            self._failure = failure
        finally:
            with self._changed:
                self._finished = True
                self._changed.notify_all()

    def _put(self, batch: list[Message]) -> bool:
        """Wait for room, and append a batch; return whether it is still wanted."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or len(self._batches) < BATCHES)
            self._batches.append(batch)
            self._changed.notify_all()
            return not self._closed


def _batches(messages: Iterable[Message]) -> Iterator[list[Message]]:
    batch: list[Message] = []
    size = 0
    for message in messages:
        batch.append(message)
        size += len(message.data)
        if len(batch) >= BATCH or size >= BATCH_SIZE:
            yield batch
            batch, size = [], 0
    if batch:
        yield batch
