"""A run written by a thread of its own, behind a bounded queue."""

from collections.abc import Callable
from queue import Empty, SimpleQueue
from threading import Thread
from time import monotonic

from .errors import LogError, UnwritableError
from .records import Message
from .writer import RunWriter

# A thread that waits for a slow disk may fall behind by so many messages.
CAPACITY = 100_000

Entry = Callable[[RunWriter], None]


class BackgroundWriter:
    """
    Write messages and entries to a run, in the order they are put.

    Whoever puts them is never held up by the disk. What does not fit into the queue is dropped
    and counted.

    Parameters
    ----------
    writer : RunWriter
        The run; from now on only this object's thread uses it.
    flush_period : float
        What was put is on the disk at most so much later [s].
    on_failure : callable
        Is called once, from the thread, when the disk says no.
    capacity : int
        Length of the queue.

    Attributes
    ----------
    dropped : int
        Messages that did not fit into the queue or into the format, or came after a failure.
    failure : Exception or None
        What ended the writing.

    """

    def __init__(
        self,
        writer: RunWriter,
        *,
        flush_period: float,
        on_failure: Callable[[], object],
        capacity: int = CAPACITY,
    ) -> None:
        """Start the thread."""
        self.dropped = 0
        self.failure: Exception | None = None
        self._writer = writer
        self._flush_period = flush_period
        self._on_failure = on_failure
        self._capacity = capacity
        self._queue: SimpleQueue[Message | Entry | None] = SimpleQueue()
        self._thread = Thread(target=self._run, name='writer', daemon=True)
        self._thread.start()

    def put(self, message: Message) -> None:
        """Queue a message."""
        if self.failure is not None or self._queue.qsize() >= self._capacity:
            self.dropped += 1
        else:
            self._queue.put(message)

    def put_entry(self, entry: Entry) -> None:
        """Queue a call that writes something else than a message: metadata, an attachment."""
        self._queue.put(entry)

    def close(self) -> Exception | None:
        """Write all that is queued and finish the run; return what went wrong, now or before."""
        self._queue.put(None)
        self._thread.join()
        if self.failure is None:
            try:
                self._writer.close()
            except (OSError, LogError) as error:
                self.failure = error
        return self.failure

    def _run(self) -> None:
        try:
            self._write_all()
        # Whatever ends this thread ends the recording, and has to be said.
        except Exception as error:
            self.failure = error
            self._on_failure()
            self._drop_rest()

    def _write_all(self) -> None:
        due = monotonic() + self._flush_period
        while True:
            try:
                item = self._queue.get(timeout=max(0.0, due - monotonic()))
            except Empty:
                pass
            else:
                if item is None:
                    return
                self._write(item)
            if monotonic() >= due:
                self._writer.flush()
                due = monotonic() + self._flush_period

    def _write(self, item: Message | Entry) -> None:
        if isinstance(item, Message):
            try:
                self._writer.write(item)
            except UnwritableError:
                self.dropped += 1
        else:
            item(self._writer)

    def _drop_rest(self) -> None:
        """Count what comes after a failure until the end is asked for."""
        while (item := self._queue.get()) is not None:
            self.dropped += isinstance(item, Message)
