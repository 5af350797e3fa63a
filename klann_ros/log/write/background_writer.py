"""Writer thread of a run behind a bounded queue: back-pressure drops messages and counts them."""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from threading import Event, Lock, Thread
from time import monotonic, sleep, time_ns

from klann_ros.log.errors import LogError, MalformedQosError, RunIncompleteError, UnwritableError
from klann_ros.log.loss import DropCounters
from klann_ros.log.records import Message

from .writer import RunWriter

QUEUE_CAPACITY = 128 * 1024 * 1024
"""Data that may wait for a slow disk [bytes]."""

MESSAGE_OVERHEAD = 400
"""Memory of a message beside its data, roughly [bytes]."""

REORDER_DELAY = 0.1
"""Maximum delay between reception and enqueueing by a running recorder [s]."""

# Batching delay: waking the thread for each message costs more than writing it [s].
_BATCH_PERIOD = 0.05

RunEntry = Callable[[RunWriter], None]


@dataclass(frozen=True)
class SplitLimits:
    """Limits that finish a file; 0 is no limit."""

    # Size of the file [bytes].
    size: int = 0
    # Time between its first and its last message [s].
    duration: float = 0.0

    def are_reached(self, size: int, duration: float) -> bool:
        """Return whether a file has reached the size [bytes] or the duration [s]."""
        return 0 < self.size <= size or 0.0 < self.duration <= duration


class BackgroundWriter:
    """
    Write messages and entries to a run in the order of enqueueing.

    Only this object's thread writes to the run. Enqueueing never waits for the disk: a message
    that does not fit into the queue is dropped and counted. A message is on the disk within
    `flush_period` [s]. The recording ends below `min_free_space` [bytes]; `on_failure` is called
    once, from the thread, when the disk refuses.
    """

    def __init__(
        self,
        writer: RunWriter,
        *,
        flush_period: float,
        on_failure: Callable[[], object],
        limits: SplitLimits = SplitLimits(),
        min_free_space: int = 0,
        capacity: int = QUEUE_CAPACITY,
    ) -> None:
        # The error that ended writing.
        self.failure: Exception | None = None
        self.counters = DropCounters(writer.stored_counts)
        self._writer = writer
        self._limits = limits
        self._min_free_space = min_free_space
        self._capacity = capacity
        # Sizes of all messages so far [bytes]; each is written by one thread only.
        self._enqueued_size = self._dequeued_size = 0
        self._queue: deque[Message | RunEntry] = deque()
        self._filled = Event()
        self._closing = False
        self._split_lock = Lock()
        self._split_requested = False
        work = partial(self._run, flush_period, on_failure)
        self._thread = Thread(target=work, name='writer', daemon=True)
        self._thread.start()

    def put(self, message: Message) -> None:
        """Enqueue a message."""
        size = len(message.data) + MESSAGE_OVERHEAD
        queued_size = self._enqueued_size - self._dequeued_size
        # An empty queue accepts a message of any size.
        if self.failure is not None or (queued_size and queued_size + size > self._capacity):
            self.counters[message.topic.name].overrun += 1
            return
        self._enqueued_size += size
        self._queue.append(message)
        if not self._filled.is_set():
            self._filled.set()

    def put_entry(self, entry: RunEntry) -> None:
        """Enqueue a call that writes metadata or an attachment."""
        self._queue.append(entry)
        self._filled.set()

    def split(self) -> str:
        """Begin a new file with the messages received from now on; return its name."""
        with self._split_lock:
            self._split_requested = True
            name = self._writer.next_name
        self._filled.set()
        return name

    @property
    def queued(self) -> int:
        """Return the number of messages and entries in the queue."""
        return len(self._queue)

    def close(self, last: RunEntry | None = None) -> Exception | None:
        """
        Write the queue and a last entry, and finish the run; return the first error.

        The run is finished despite an error where the disk allows it: see `RunWriter.closed`.
        """
        self._closing = True
        self._filled.set()
        self._thread.join()
        while self._queue:
            queued = self._queue.popleft()
            if isinstance(queued, Message):
                self.counters[queued.topic.name].unwritten += 1
        self._attempt(lambda: self._write_last(last))
        self._attempt(self._writer.close)
        return self.failure

    def _write_last(self, last: RunEntry | None) -> None:
        if self._writer.file.failure is None and not self._writer.closed:
            # The entry's counts must be true.
            self._writer.check_files()
            if last is not None:
                last(self._writer)

    def _attempt(self, action: Callable[[], object]) -> None:
        try:
            # The faults of an incomplete run are reported already.
            with suppress(RunIncompleteError):
                action()
        except (OSError, LogError) as error:
            self.failure = self.failure or error

    def _run(self, flush_period: float, on_failure: Callable[[], object]) -> None:
        try:
            self._write_all(flush_period)
        # Any error ends the recording, and must be reported.
        except Exception as error:
            self.failure = error
            on_failure()

    def _write_all(self, flush_period: float) -> None:
        """Write queued messages, flush and split, in the thread of the writer, until it closes."""
        batch_period = min(_BATCH_PERIOD, flush_period / 2.0)
        due = monotonic() + flush_period
        while not self._closing:
            if self._filled.wait(max(0.0, due - monotonic())) and not self._closing:
                sleep(batch_period)
            self._write_queued()
            if monotonic() >= due:
                self._writer.flush()
                self._writer.check_space(self._min_free_space)
                due = monotonic() + flush_period
            file = self._writer.file
            if self._split_requested or self._limits.are_reached(file.size, file.duration):
                self._split()
        self._write_queued()

    def _split(self) -> None:
        """
        Begin a new file with the messages received after now.

        Topics are read one after the other, so the queue is not in time order; the files of a run
        must be, for readers that read them one after the other.
        """
        split_time = time_ns()
        sleep(REORDER_DELAY)
        later = []
        try:
            for _ in range(len(self._queue)):
                queued = self._queue.popleft()
                if isinstance(queued, Message) and queued.log_time >= split_time:
                    later.append(queued)
                else:
                    self._write(queued)
        finally:
            self._queue.extendleft(reversed(later))
        with self._split_lock:
            self._split_requested = False
            self._writer.split()
        self._writer.check_space(self._min_free_space)
        self._filled.set()

    def _write_queued(self) -> None:
        # Cleared before reading the queue, so that no later message is missed.
        self._filled.clear()
        for number in range(len(self._queue)):
            self._write(self._queue.popleft())
            # The queue may be long; on a full disk the remaining space is for the end of the run.
            if number % 256 == 255 or (number % 16 == 0 and self._writer.is_full):
                self._writer.check_space(self._min_free_space)

    def _write(self, queued: Message | RunEntry) -> None:
        if not isinstance(queued, Message):
            queued(self._writer)
            return
        self._dequeued_size += len(queued.data) + MESSAGE_OVERHEAD
        try:
            self._writer.write(queued)
        except (UnwritableError, MalformedQosError):
            self.counters[queued.topic.name].unwritten += 1
