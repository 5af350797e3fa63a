"""A run written by a thread of its own, behind a bounded queue."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from threading import Event, Lock, Thread
from time import monotonic, sleep, time_ns

from klann_ros.log.errors import LogError, MalformedQosError, RunHarmedError, UnwritableError
from klann_ros.log.records import Message

from .ledger import Ledger
from .writer import RunWriter

# A thread that waits for a slow disk may fall behind by so much [bytes].
CAPACITY = 128 * 1024 * 1024
# What a message takes beside its data [bytes], about.
OVERHEAD = 400
# Messages are written in batches: to wake the thread for each one costs more than to write it [s].
GATHER = 0.05
# What was received before a moment has been put so much later [s].
SETTLE = 0.1

RunEntry = Callable[[RunWriter], None]


@dataclass(frozen=True)
class SplitLimits:
    """A file is finished as soon as it has reached a limit; 0 is none."""

    # Of the file [bytes].
    size: int = 0
    # Between its first and its last message [s].
    duration: float = 0.0

    def are_reached(self, size: int, duration: float) -> bool:
        """Return whether a file is as large [bytes] or as long [s] as it may be."""
        return 0 < self.size <= size or 0.0 < self.duration <= duration


class BackgroundWriter:
    """
    Write messages and entries to a run, in the order they are put.

    Whoever puts them is never held up by the disk. What does not fit into the queue is dropped
    and counted.

    Parameters
    ----------
    writer : RunWriter
        The run; from now on only this object's thread writes to it.
    flush_period : float
        What was put is on the disk at most so much later [s].
    on_failure : callable
        Is called once, from the thread, when the disk says no.
    limits : SplitLimits
        When a file of the run is finished and the next one begun.
    min_free_space : int
        The recording ends when less is free on the disk [bytes].
    capacity : int
        What the queue may hold [bytes].

    Attributes
    ----------
    failure : Exception or None
        What ended the writing.
    ledger : Ledger
        What became of what was put.

    """

    def __init__(
        self,
        writer: RunWriter,
        *,
        flush_period: float,
        on_failure: Callable[[], object],
        limits: SplitLimits = SplitLimits(),
        min_free_space: int = 0,
        capacity: int = CAPACITY,
    ) -> None:
        self.failure: Exception | None = None
        self.ledger = Ledger(writer)
        self._writer = writer
        self._flush_period = flush_period
        self._gather = min(GATHER, flush_period / 2.0)
        self._on_failure = on_failure
        self._limits = limits
        self._min_free_space = min_free_space
        self._capacity = capacity
        # Each of these is written by one thread only: what was put, and what was dealt with.
        self._put_size = self._done_size = 0
        self._queue: deque[Message | RunEntry] = deque()
        self._filled = Event()
        self._closing = False
        self._split_lock = Lock()
        self._split_wanted = False
        self._thread = Thread(target=self._run, name='writer', daemon=True)
        self._thread.start()

    def put(self, message: Message) -> None:
        """Queue a message."""
        size = len(message.data) + OVERHEAD
        waiting = self._put_size - self._done_size
        # An empty queue takes a message of any size.
        if self.failure is not None or (waiting and waiting + size > self._capacity):
            self.ledger[message.topic.name].overrun += 1
            return
        self._put_size += size
        self._queue.append(message)
        if not self._filled.is_set():
            self._filled.set()

    def put_entry(self, entry: RunEntry) -> None:
        """Queue a call that writes something else than a message: metadata, an attachment."""
        self._queue.append(entry)
        self._filled.set()

    def split(self) -> str:
        """Let a new file begin with what is received from now on; return its name."""
        with self._split_lock:
            self._split_wanted = True
            name = self._writer.next_name
        self._filled.set()
        return name

    @property
    def queued(self) -> int:
        """Return how many messages and entries wait."""
        return len(self._queue)

    def close(self, last: RunEntry | None = None) -> Exception | None:
        """
        Write all that is queued and then a last entry, and finish the run.

        Returns
        -------
        Exception or None
            What went wrong, now or before. The run is finished nevertheless where the disk allows
            it: see `RunWriter.closed`.

        """
        self._closing = True
        self._filled.set()
        self._thread.join()
        self._drop_queued()
        self._attempt(lambda: self._write_last(last))
        self._attempt(self._writer.close)
        return self.failure

    def _write_last(self, last: RunEntry | None) -> None:
        if self._writer.failure is None and not self._writer.closed:
            # What it tells of the run is to be true.
            self._writer.look()
            if last is not None:
                last(self._writer)

    def _attempt(self, action: Callable[[], object]) -> None:
        try:
            action()
        except RunHarmedError:
            pass  # that has been told, and what is left is finished
        except (OSError, LogError) as error:
            self.failure = self.failure or error

    def _run(self) -> None:
        try:
            self._write_all()
        # Whatever ends this thread ends the recording, and has to be said.
        except Exception as error:
            self.failure = error
            self._on_failure()

    def _write_all(self) -> None:
        due = monotonic() + self._flush_period
        while not self._closing:
            if self._filled.wait(max(0.0, due - monotonic())) and not self._closing:
                sleep(self._gather)
            self._write_queued()
            if monotonic() >= due:
                self._writer.flush()
                self._check_space()
                due = monotonic() + self._flush_period
            file = self._writer.file
            if self._split_wanted or self._limits.are_reached(file.size, file.duration):
                self._split()
        self._write_queued()

    def _check_space(self) -> None:
        problem = self._writer.space_problem(self._min_free_space)
        if problem is not None:
            raise problem

    def _split(self) -> None:
        """
        Begin a new file, with what was received later than now.

        Topics are taken one after the other, so what is queued is not in the order of its times;
        the files of a run have to be, or a reader that reads one after the other goes back.
        """
        cut = time_ns()
        sleep(SETTLE)
        later = []
        try:
            for _ in range(len(self._queue)):
                item = self._queue.popleft()
                if isinstance(item, Message) and item.log_time >= cut:
                    later.append(item)
                else:
                    self._write(item)
        finally:
            self._queue.extendleft(reversed(later))
        with self._split_lock:
            self._split_wanted = False
            self._writer.split()
        self._check_space()
        self._filled.set()

    def _write_queued(self) -> None:
        # Before the queue is looked at, so that nothing is overlooked.
        self._filled.clear()
        for number in range(len(self._queue)):
            self._write(self._queue.popleft())
            # Often, for a writer that was held up has much to write; and when the disk is full,
            # what is left of the space is for the end of the run.
            if number % 256 == 255 or (number % 16 == 0 and self._writer.is_full):
                self._check_space()

    def _write(self, item: Message | RunEntry) -> None:
        if not isinstance(item, Message):
            item(self._writer)
            return
        self._done_size += len(item.data) + OVERHEAD
        try:
            self._writer.write(item)
        except (UnwritableError, MalformedQosError):
            self.ledger[item.topic.name].unwritten += 1

    def _drop_queued(self) -> None:
        """Count what waits, when nothing is written any more."""
        while self._queue:
            item = self._queue.popleft()
            if isinstance(item, Message):
                self.ledger[item.topic.name].unwritten += 1
