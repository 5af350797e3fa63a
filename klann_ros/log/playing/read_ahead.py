"""Messages read by a thread of its own, so that unpacking a chunk makes no message late."""

from __future__ import annotations

from collections import deque
from threading import Condition, Thread
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from types import TracebackType

    from klann_ros.log.records import Message
    from typing_extensions import Self

# What is handed over at once at most: messages, and their size [bytes].
BATCH, BATCH_SIZE = 200, 1_000_000
# So many batches wait at most.
BATCHES = 8


class ReadAhead:
    """
    Iterate over messages that another thread has read already.

    Parameters
    ----------
    messages
        Where they come from; what it raises is raised by the iteration.

    """

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

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

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
        # Whatever it is: it belongs to whoever iterates.
        except BaseException as failure:  # noqa: BLE001, RUF100
            self._failure = failure
        finally:
            with self._changed:
                self._finished = True
                self._changed.notify_all()

    def _put(self, batch: list[Message]) -> bool:
        """Wait for room and put a batch there; return whether anyone still wants it."""
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
