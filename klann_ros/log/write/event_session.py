"""Event recording: a ring buffer in memory that is written when a trigger occurs."""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from functools import partial
from pathlib import Path
import re
from threading import Thread
from time import monotonic, time_ns
from typing import TypeAlias, TypeVar

from klann_ros.log.errors import LogError
from klann_ros.log.loss import Counts, DropCounters, StoredCounts
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import (
    EVENT_RECORD,
    Pause,
    RecordedFinding,
    SolverParameters,
    TopicCount,
)
from klann_ros.sanitize.text import counted, printable

from .background_writer import BackgroundWriter, RunEntry
from .durable_file import free_space
from .recording import known_free_space, Pauses, RecordingSession, RecordingState
from .ring_buffer import RingBuffer, SEGMENT_SECONDS
from .writer import RunWriter

OpenedRun = tuple[RunWriter, BackgroundWriter]
# Opens a run in a new folder.
OpenRun = Callable[[Path], OpenedRun]
Returned = TypeVar('Returned')

# Maximum delay between reception and `put`, with stalls: a later message is in no event run [s].
_RECEPTION_DELAY = 0.25
# Maximum delay between a fault and its finding, buffered in addition to the pre-trigger [s].
_FINDING_DELAY = 1.0
# Opening a run longer than this continues in the background [s].
_OPENING_TIMEOUT = 0.2
# Parameter changes of a solver that are stored.
_MAX_SOLVER_CHANGES = 100
_NAME_FORMAT = '%Y-%m-%dT%H-%M-%SZ'


@dataclass(frozen=True)
class EventSettings:
    """Recorded times before (pre-trigger) and after an event's last cause [s]."""

    pre_trigger: float
    post_trigger: float
    # Memory limit of the ring buffer [bytes].
    max_bytes: int


def _in_thread(action: Callable[[], Returned]) -> Future[Returned]:
    """Begin an action in a thread: a slow disk delays neither reception nor the process's end."""
    future: Future[Returned] = Future()

    def run() -> None:
        try:
            future.set_result(action())
        # Raised in the thread that takes the result.
        except Exception as error:
            future.set_exception(error)

    Thread(target=run, name='event', daemon=True).start()
    return future


@dataclass
class EventOpening:
    """The run of an event that is being opened."""

    path: Path
    causes: list[RecordedFinding]
    run: Future[OpenedRun]
    # Begin and end of the event, monotonic [s].
    begin_time: float
    end_time: float
    # Begin of the event [ns since the epoch].
    time: int


class _RunContext:
    """The entries, solver parameters and pauses that each run of an event begins with."""

    def __init__(self, entries: Sequence[RunEntry]) -> None:
        self._entries = entries
        # The last parameters of each solver, in the order of time.
        self._solvers: dict[str, deque[SolverParameters]] = {}
        # Pauses with the monotonic times of their ends [s].
        self._pauses: deque[tuple[float, Pause]] = deque()

    def add_solver(self, solver: SolverParameters) -> None:
        changes = self._solvers.setdefault(solver.node, deque(maxlen=_MAX_SOLVER_CHANGES))
        changes.append(solver)

    def add_pause(self, pause: Pause) -> None:
        self._pauses.append((monotonic(), pause))

    def write(self, run: RecordingSession) -> None:
        """Write the context to a new run."""
        for entry in self._entries:
            run.put_entry(entry)
        for changes in self._solvers.values():
            for solver in changes:
                run.add_solver(solver)
        for _, pause in self._pauses:
            run.add_pause(pause)

    def remove_old(self, since: float) -> None:
        """Remove pauses and solver parameters that ended before a monotonic time [s]."""
        while self._pauses and self._pauses[0][0] < since:
            self._pauses.popleft()
        earliest = time_ns() - round((monotonic() - since) * 1e9)
        for changes in self._solvers.values():
            while len(changes) > 1 and changes[1].time < earliest:
                changes.popleft()


class EventRun(RecordingSession):
    """
    A run that begins in the past, at a snapshot of the recording's drop counters.

    Its counts are those of the recording between two snapshots: messages removed from the ring
    buffer before are no loss, and each message in between was received, skipped or dropped.
    """

    def __init__(
        self, opened: OpenedRun, drop_counters: DropCounters, first_counts: Counts, end_time: float
    ) -> None:
        run, background = opened
        super().__init__(run, background)
        # Monotonic time of the end [s].
        self.end_time = end_time
        # Success and a message for the user, from `close` on.
        self.outcome: Future[tuple[bool, str]] | None = None
        self.path = run.path
        self._drop_counters = drop_counters
        self._first_counts = first_counts
        self._last_counts: Counts | None = None
        self._pretrigger = Counter[str]()

    def write_pretrigger(self, messages: Iterable[Message]) -> None:
        """Write messages that were received before the first snapshot."""
        for message in messages:
            self._pretrigger[message.topic.name] += 1
            self.put(message)

    def counts(self) -> dict[str, TopicCount]:
        """Return what became of the messages of each topic between the snapshots."""
        last = self._drop_counters.snapshot() if self._last_counts is None else self._last_counts
        for name in last:
            self.counters[name]  # creates missing counters
        return self._drop_counters.counts_between(
            self._first_counts, last, self.counters.counts(), self._pretrigger
        )

    @property
    def has_failed(self) -> bool:
        """Return whether nothing more can be written."""
        return self._background.failure is not None

    def close(self) -> None:
        """Begin to finish the run; no more messages may follow."""
        self._last_counts = self._drop_counters.snapshot()
        self.outcome = _in_thread(self.finish)


class EventSession:
    """
    Sink of a recorder that writes a run for each event: the messages before and after its cause.

    A cause during an event extends it and belongs to its run, so that an intermittent fault makes
    one long run. Buffered messages stay in the buffer: two events may share messages. All methods
    must be called from one thread.

    The runs are folders in an existing one, named by time and cause, opened by `open_run` in a
    thread, which may raise LogError or OSError, each with the entries. `on_status` receives
    success and a message for the user.
    """

    def __init__(
        self,
        folder: Path,
        settings: EventSettings,
        *,
        open_run: OpenRun,
        entries: Sequence[RunEntry] = (),
        on_status: Callable[[bool, str], object],
    ) -> None:
        self.counters = DropCounters(self.stored_counts)
        self.pauses = Pauses(self.counters)
        self._folder = folder
        self._settings = settings
        self._open_run = open_run
        self._on_status = on_status
        # The failure of the last event, '' without one, and whether any failed.
        self._failure = ''
        self._has_failed = False
        self._context = _RunContext(entries)
        duration = settings.pre_trigger + _FINDING_DELAY
        self._buffer = RingBuffer(
            duration, settings.max_bytes, self.counters.snapshot, monotonic()
        )
        self._opening: EventOpening | None = None
        self._event: EventRun | None = None
        self._closing: EventRun | None = None
        self._pending_triggers: list[RecordedFinding] = []
        # Number of events.
        self._count = 0
        # Messages of the finished events.
        self._finished_counts = StoredCounts(Counter(), Counter())

    def put(self, message: Message) -> None:
        """Take a message that was counted as received."""
        self._buffer.put(message)
        if self._event is not None:
            self._event.put(message)

    def add_solver(self, solver: SolverParameters) -> None:
        """Take new parameters of a solver, for every run."""
        self._context.add_solver(solver)
        if self._event is not None:
            self._event.add_solver(solver)

    def add_pause(self, pause: Pause) -> None:
        """Take a pause that has ended, for the runs that contain it."""
        self._context.add_pause(pause)
        if self._event is not None:
            self._event.add_pause(pause)

    def add_finding(self, finding: RecordedFinding) -> None:
        """Take a cause: begin an event, or extend the present one."""
        if self._event is not None:
            self._event.add_finding(finding)
            self._event.end_time = self._end_time()
        elif self._opening is not None:
            self._opening.causes.append(finding)
            self._opening.end_time = self._end_time()
        else:
            self._pending_triggers.append(finding)
            self.tick()

    def trigger(self) -> tuple[bool, str]:
        """Record an event on request; return whether that is done, and its run or the reason."""
        if self.pauses.paused:
            return False, 'it is paused'
        event = self._event
        self.add_finding(RecordedFinding('trigger', 'note', 'call of ~/trigger', time_ns()))
        if self._event is not None:
            extended = ' (extended)' if event is self._event else ''
            return True, f'{self._event.path}{extended}'
        if self._opening is not None:
            return True, f'{self._opening.path}, which a slow disk is still opening'
        if self._pending_triggers:
            return True, 'the run of the last event is being closed; this one follows'
        return False, self._failure

    def tick(self) -> None:
        """Begin and end events; to be called every 0.1 s, and after changes."""
        now = monotonic()
        if self._opening is not None:
            self._begin_if_open(self._opening, 0.0)
        if now >= self._buffer.rotated + SEGMENT_SECONDS:
            self._buffer.rotate(now, self._opening.begin_time if self._opening else now)
            self._context.remove_old(now - self._buffer.buffered_time(now))
        if self._event is not None and (now >= self._event.end_time or self._event.has_failed):
            self._closing = self._event
            self._event = None
            self._closing.close()
        if self._closing is not None and self._closing.outcome and self._closing.outcome.done():
            self._finalize(self._closing)
        if self._pending_triggers and not (self._opening or self._event or self._closing):
            self._open_event()

    def split(self) -> tuple[bool, str]:
        """Begin a new file of the event's run, if there is one."""
        return (False, 'nothing is written') if self._event is None else self._event.split()

    def stored_counts(self) -> StoredCounts:
        """Return what became of the messages of all events so far."""
        stored = self._finished_counts
        for event in (self._event, self._closing):
            stored = _add_counts(stored, event.counts()) if event else stored
        return stored

    def state(self) -> RecordingState:
        """Return the present state."""
        event = self._event or self._closing
        state = event.state() if event is not None else RecordingState()
        stage = 'opening the run of an event' if self._opening else 'waiting for a trigger'
        if self._event is not None:
            stage = 'recording an event'
        failures = [self._failure] if self._failure else []
        buffered = min(self._buffer.buffered_time(monotonic()), self._settings.pre_trigger)
        return replace(
            state,
            counts=self.counters.counts(),
            free=known_free_space(lambda: free_space(self._folder)),
            paused=self.pauses.paused,
            failure='',
            faults=(*state.faults, *failures),
            stage=stage,
            buffer={
                'buffered [s]': f'{buffered:.1f}',
                'buffered [bytes]': self._buffer.size,
                'evicted': self._buffer.evicted,
                'events': self._count,
            },
        )

    def finish(self) -> tuple[bool, str]:
        """End a present event; return success and a message for the user."""
        if self._opening is not None:
            self._begin_if_open(self._opening, None)
        for event in (self._closing, self._event):
            if event is not None:
                if event is self._event:
                    event.close()
                self._finalize(event)
        if self._pending_triggers:
            self._open_event()
            return self.finish()
        runs = f'{counted(self._count, "event")} in {printable(self._folder)}'
        message = runs if self._count else 'no trigger occurred; nothing was written'
        return not self._has_failed, message

    def _open_event(self) -> None:
        """Open the run of the pending triggers."""
        causes = self._pending_triggers
        self._pending_triggers = []
        path = _unused_path(self._folder, causes[0].check)
        run = _in_thread(partial(self._open_run, path))
        self._opening = EventOpening(path, causes, run, monotonic(), self._end_time(), time_ns())
        self._begin_if_open(self._opening, _OPENING_TIMEOUT)

    def _end_time(self) -> float:
        """Return the end of an event with a cause now."""
        return monotonic() + self._settings.post_trigger + _RECEPTION_DELAY

    def _begin_if_open(self, opening: EventOpening, timeout: float | None) -> None:
        """Begin the event if its run is open within a timeout [s]."""
        wait([opening.run], timeout)
        if not opening.run.done():
            return
        self._opening = None
        try:
            opened = opening.run.result()
        except (LogError, OSError) as error:
            text = f'the event ({opening.causes[0].check}) is not recorded: {error}'
            self._report_outcome(False, text)
        else:
            self._begin(opened, opening)

    def _begin(self, opened: OpenedRun, opening: EventOpening) -> None:
        """Write metadata, the buffer and the causes to the event's run."""
        self._count += 1
        buffer = self._buffer
        causes = opening.causes
        event = self._event = EventRun(opened, self.counters, buffer.counters, opening.end_time)
        first_time = next((message.log_time for message in buffer.messages()), opening.time)
        self._context.write(event)
        event.write_pretrigger(buffer.latched(first_time))
        for message in buffer.messages():
            event.put(message)
        for cause in causes:
            event.add_finding(cause)
        buffered = buffer.buffered_time(opening.begin_time)
        pre_trigger = self._settings.pre_trigger
        record = {
            'cause': causes[0].check,
            'time': str(opening.time),
            'buffered': f'{buffered:.3f}',
            'pre_trigger': str(pre_trigger),
            'post_trigger': str(self._settings.post_trigger),
            'evicted': str(buffer.evicted),
        }
        event.put_entry(lambda run: run.add_metadata(EVENT_RECORD, record))
        self._on_status(True, f'{causes[0].check}: recording to {printable(event.path)}')
        if buffer.evicted and buffered < pre_trigger:
            available = f'only {buffered:.1f} s of {pre_trigger:g} s before it'
            self._on_status(False, f'{available} were still in memory (pre_trigger_bytes)')

    def _finalize(self, event: EventRun) -> None:
        """Wait for the end of a run, add its counts, and report its outcome."""
        if event.outcome is None:
            return
        outcome = event.outcome.result()
        if event is self._closing:
            self._closing = None
        if event is self._event:
            self._event = None
        self._finished_counts = _add_counts(self._finished_counts, event.counts())
        self._report_outcome(*outcome)

    def _report_outcome(self, ok: bool, text: str) -> None:
        """Report an event that is complete; not ok if it is missing or incomplete."""
        self._failure = '' if ok else text
        self._has_failed = self._has_failed or not ok
        self._on_status(ok, text)


def _add_counts(stored: StoredCounts, counts: Mapping[str, TopicCount]) -> StoredCounts:
    """Return the counts with those of an event's run added, by topic name."""
    written = stored.written.copy()
    dropped = stored.dropped.copy()
    for name, count in counts.items():
        written[name] += count.written
        dropped[name] += count.dropped
    return StoredCounts(written, dropped)


def _unused_path(folder: Path, cause: str) -> Path:
    """Return a new path, named by time and cause."""
    word = re.sub(r'[^a-z0-9_]', '_', cause.lower())[:40]
    name = f'{datetime.now(timezone.utc):{_NAME_FORMAT}}_{word}'
    path = folder / name
    number = 2
    while path.exists() or path.is_symlink():
        path = folder / f'{name}_{number}'
        number += 1
    return path


Recording: TypeAlias = RecordingSession | EventSession
"""Sink of a recorder."""
