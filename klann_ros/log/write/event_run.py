"""The run of one event: the pre-trigger messages, and those until its end."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Thread

from klann_ros.log.records import Message
from klann_ros.log.run_parameters import RecordedFinding, TopicCount

from .background_writer import BackgroundWriter
from .drop_counters import DropCounters, Snapshot
from .recording import RecordingSession
from .writer import RunWriter

OpenedRun = tuple[RunWriter, BackgroundWriter]
# Opens a run in a new folder.
OpenRun = Callable[[Path], OpenedRun]


@dataclass
class EventTimes:
    """Begin and end of an event, monotonic [s], and its begin [ns since the epoch]."""

    begin: float
    end: float
    time: int


class EventOpening:
    """
    Open a run in a thread, so that a slow disk does not delay the reception of messages.

    Attributes
    ----------
    path : Path
        The new folder.
    causes : list of RecordedFinding
        Its causes.
    times : EventTimes
        Its duration.

    """

    def __init__(
        self, open_run: OpenRun, path: Path, causes: list[RecordedFinding], times: EventTimes
    ) -> None:
        """Start the thread."""
        self.path, self.causes, self.times = path, causes, times
        self._open_run = open_run
        self._opened: OpenedRun | None = None
        self._error: Exception | None = None
        self._thread = Thread(target=self._run, name='opening', daemon=True)
        self._thread.start()

    def result(self, timeout: float | None) -> OpenedRun | None:
        """Return the opened run, or None after a timeout [s]; raise the error of opening."""
        self._thread.join(timeout)
        if self._error is not None:
            raise self._error
        return self._opened

    def _run(self) -> None:
        try:
            self._opened = self._open_run(self.path)
        # Raised by `result`, in the caller's thread.
        except Exception as error:
            self._error = error


@dataclass(frozen=True)
class EventResult:
    """Result of an event's run: success, a message for the user, and its counts."""

    ok: bool
    message: str
    counts: Mapping[str, TopicCount]


class EventRun:
    """
    A run that begins in the past.

    Its counts are those of the recording between two snapshots: messages removed from the ring
    buffer before are no loss, and each message in between was received, skipped or dropped.

    Parameters
    ----------
    run, background
        The run and its writer thread.
    recording
        Drop counters of the whole recording.
    begin
        Their snapshot before the first message.
    end
        Monotonic time of the end [s].

    Attributes
    ----------
    end : float
        Monotonic time of the end [s].
    result : EventResult or None
        Set when the run is closed.

    """

    def __init__(
        self,
        run: RunWriter,
        background: BackgroundWriter,
        recording: DropCounters,
        begin: Snapshot,
        end: float,
    ) -> None:
        self.end = end
        self.result: EventResult | None = None
        self.put, self.path = background.put, run.path
        self._background, self._recording, self._begin = background, recording, begin
        self._last: Snapshot | None = None
        self._pretrigger = Counter[str]()
        self._session = session = RecordingSession(run, background, self.counts)
        self.split, self.state = session.split, session.state
        self.add_solver, self.add_finding = session.add_solver, session.add_finding
        self.add_pause = session.add_pause
        self._thread: Thread | None = None

    def write_pretrigger(self, messages: Iterable[Message]) -> None:
        """Write messages that were received before the first snapshot."""
        for message in messages:
            self._pretrigger[message.topic.name] += 1
            self.put(message)

    def add_metadata(self, name: str, record: Mapping[str, str]) -> None:
        """Write a metadata record."""
        self._background.put_entry(lambda run: run.add_metadata(name, record))

    def counts(self) -> dict[str, TopicCount]:
        """Return what became of the messages of each topic."""
        last = self._recording.snapshot() if self._last is None else self._last
        own = self._background.counters
        for name in last:
            own[name]  # creates missing counters
        return self._recording.counts_between(self._begin, last, own.counts(), self._pretrigger)

    @property
    def has_failed(self) -> bool:
        """Return whether nothing more can be written."""
        return self._background.failure is not None

    def close(self) -> None:
        """Finish the run in a thread, as a disk may be slow; no more messages may follow."""
        self._last = self._recording.snapshot()
        self._thread = Thread(target=self._finish, name='event', daemon=True)
        self._thread.start()

    def join(self) -> None:
        """Wait until it is closed."""
        if self._thread is not None:
            self._thread.join()

    def _finish(self) -> None:
        ok, message = self._session.finish()
        self.result = EventResult(ok, message, self.counts())
