"""A recording of events: it holds the last seconds in memory, and writes them when asked."""

from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
import re
from time import monotonic, time_ns

from klann_ros.log.errors import LogError
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import (
    EVENT_RECORD,
    Pause,
    PAUSE_RECORD,
    pause_record,
    SolverParameters,
    ToldFinding,
)
from klann_ros.log.write.background_writer import RunEntry
from klann_ros.log.write.disk_space import free_space
from klann_ros.log.write.ledger import Fate, Ledger
from klann_ros.log.write.recording import Pauses, RecordingState
from klann_ros.sanitize.text import counted, printable

from .event import Event
from .opening import EventTimes, Opened, Opening, OpenRun
from .ring import Ring, TURN

# What is received until the end has been taken so much later [s].
SETTLE = 0.25
# A fault is found at most so much later, which is held beside what came before its finding [s].
LOOK_BACK = 1.0
# A run that is not open after so long is waited for beside all else [s].
PATIENCE = 0.2
# A solver that changes for ever is told by its last changes.
_MOST_CHANGES = 100
_NAME = '%Y-%m-%dT%H-%M-%SZ'


@dataclass(frozen=True)
class EventSettings:
    """How much of an event is recorded."""

    # How long before its cause, and how long after [s].
    before: float
    after: float
    # What is held of it in memory at most [bytes].
    most_bytes: int


class EventSession:
    """
    Write nothing until there is a cause; then what came before and after it, as a run of its own.

    A cause during an event lets it last so much longer, and is in its run: a fault that comes and
    goes makes one long run, not many that hold the same. What was held goes on being held, so that
    two events may have the same messages. To be called from one thread.

    Parameters
    ----------
    folder : Path
        Where the runs are made, each named by time and cause; it is there.
    settings : EventSettings
        How much of an event is recorded.
    open_run : callable
        Opens a run in a folder, in a thread of its own; LogError or OSError if that cannot be.
    entries : sequence of callable
        Write to each run what is true of all.
    say : callable
        Is given whether all is well, and what to say, whenever there is something.

    Attributes
    ----------
    ledger : Ledger
        Where every message is counted, whether it is ever written or not.
    pauses : Pauses
        What is left out.

    """

    def __init__(
        self,
        folder: Path,
        settings: EventSettings,
        *,
        open_run: OpenRun,
        entries: Sequence[RunEntry] = (),
        say: Callable[[bool, str], object],
    ) -> None:
        """Begin to hold messages."""
        self.ledger = Ledger(self)
        self.pauses = Pauses(self.ledger)
        self._folder, self._settings = folder, settings
        self._open_run, self._entries, self._say = open_run, entries, say
        length = settings.before + LOOK_BACK
        self._ring = Ring(length, settings.most_bytes, self.ledger.mark, monotonic())
        self._turned = monotonic()
        self._opening: Opening | None = None
        self._event: Event | None = None
        self._closing: Event | None = None
        self._wanted: list[ToldFinding] = []
        self._solvers: dict[str, deque[SolverParameters]] = {}
        self._pauses_told: deque[tuple[float, Pause]] = deque()
        self._failure = ''
        self._has_failed = False
        self._count = 0
        self._before = Fate(Counter(), Counter())

    def put(self, message: Message) -> None:
        """Take a message, when it has been counted as received."""
        self._ring.put(message)
        if self._event is not None:
            self._event.put(message)

    def tell(self, solver: SolverParameters) -> None:
        """Take what a solver has from now on: each run is to have it."""
        known = self._solvers.setdefault(solver.node, deque(maxlen=_MOST_CHANGES))
        known.append(solver)
        if self._event is not None:
            self._event.tell(solver)

    def describe_pause(self, pause: Pause) -> None:
        """Take a pause that is over: the runs in which it falls are to have it."""
        self._pauses_told.append((monotonic(), pause))
        if self._event is not None:
            self._event.add_metadata(PAUSE_RECORD, pause_record(pause))

    def describe_finding(self, finding: ToldFinding) -> None:
        """Take a cause: begin an event, or let the one that is under way last longer."""
        if self._event is not None:
            self._event.found(finding)
            self._event.end = self._end()
        elif self._opening is not None:
            self._opening.causes.append(finding)
            self._opening.times.end = self._end()
        else:
            self._wanted.append(finding)
            self.tick()

    def trigger(self) -> tuple[bool, str]:
        """Take that somebody asks for an event; return whether it is recorded, and where."""
        if self.pauses.paused:
            return False, 'it is paused'
        was_there = self._event
        self.describe_finding(
            ToldFinding('trigger', 'note', 'somebody called ~/trigger', time_ns())
        )
        if self._event is not None:
            longer = ' goes on' if was_there is self._event else ''
            return True, f'{self._event.path}{longer}'
        if self._opening is not None:
            return True, f'{self._opening.path}, which the disk takes its time to open'
        if self._wanted:
            return True, 'the run of the event before is being closed; this one follows'
        return False, self._failure

    def tick(self) -> None:
        """See what is due; to be called every tenth of a second, and when something is new."""
        now = monotonic()
        if self._opening is not None:
            self._go_on(self._opening, 0.0)
        if now >= self._turned + TURN:
            self._turned = now
            self._ring.turn(now, self._opening.times.begin if self._opening else now)
            self._forget(now - self._ring.reach(now))
        if self._event is not None and (now >= self._event.end or self._event.has_failed):
            self._closing, self._event = self._event, None
            self._closing.close()
        if self._closing is not None and self._closing.outcome is not None:
            self._reap(self._closing)
        if self._wanted and not (self._opening or self._event or self._closing):
            causes, self._wanted = self._wanted, []
            self._begin(causes)

    def split(self) -> tuple[bool, str]:
        """Go on in a new file of the event's run, if there is one."""
        return (False, 'nothing is written') if self._event is None else self._event.split()

    def fate(self) -> Fate:
        """Return what became of the messages of all events so far."""
        written, gone = self._before.written.copy(), self._before.gone.copy()
        for event in (self._event, self._closing):
            for name, count in event.counts().items() if event else ():
                written[name] += count.written
                gone[name] += count.dropped
        return Fate(written, gone)

    def state(self) -> RecordingState:
        """Return how it stands."""
        event = self._event or self._closing
        state = event.state() if event is not None else None
        faults = state.faults if state else ()
        held = {
            'held [s]': f'{min(self._ring.reach(monotonic()), self._settings.before):.1f}',
            'held [bytes]': self._ring.size,
            'fell out of memory early': self._ring.fell_out,
            'events': self._count,
        }
        return RecordingState(
            counts=self.ledger.counts(),
            queued=state.queued if state else 0,
            file=state.file if state else '',
            size=state.size if state else 0,
            free=_free_space(self._folder),
            paused=self.pauses.paused,
            faults=(*faults, *([self._failure] if self._failure else [])),
            stage=self._stage(),
            held=held,
        )

    def _stage(self) -> str:
        if self._event is not None:
            return 'recording an event'
        return 'opening the run of an event' if self._opening else 'waiting for a cause'

    def finish(self) -> tuple[bool, str]:
        """End an event that is under way; return whether all went well, and what to say."""
        if self._opening is not None:
            self._go_on(self._opening, None)
        for event in (self._closing, self._event):
            if event is not None:
                if event is self._event:
                    event.close()
                event.join()
                self._reap(event)
        if self._wanted:
            causes, self._wanted = self._wanted, []
            self._begin(causes)
            return self.finish()
        runs = f'{counted(self._count, "event")} in {printable(self._folder)}'
        said = runs if self._count else 'there was no cause, and nothing was written'
        return not self._has_failed, said

    def _begin(self, causes: list[ToldFinding]) -> None:
        """Have the run of an event opened."""
        times = EventTimes(monotonic(), self._end(), time_ns())
        path = _free(self._folder, causes[0].check)
        self._opening = Opening(self._open_run, path, causes, times)
        self._go_on(self._opening, PATIENCE)

    def _end(self) -> float:
        """Return when an event ends whose cause is there now."""
        return monotonic() + self._settings.after + SETTLE

    def _go_on(self, opening: Opening, patience: float | None) -> None:
        """Let an event begin if its run is open, after so long [s]."""
        try:
            opened = opening.result(patience)
        except (LogError, OSError) as error:
            self._opening = None
            self._fail(f'the event ({opening.causes[0].check}) is not recorded: {error}')
            return
        if opened is not None:
            self._opening = None
            self._fill(opened, opening.causes, opening.times)

    def _fill(self, opened: Opened, causes: Sequence[ToldFinding], times: EventTimes) -> None:
        """Put into the run of an event what came before."""
        run, background = opened
        self._count += 1
        ring = self._ring
        event = self._event = Event(run, background, self.ledger, ring.before)
        event.end = times.end
        first = next((message.log_time for message in ring.messages()), times.time)
        for entry in self._entries:
            background.put_entry(entry)
        for known in self._solvers.values():
            for solver in known:
                event.tell(solver)
        for _, pause in self._pauses_told:
            event.add_metadata(PAUSE_RECORD, pause_record(pause))
        event.give_again(ring.latched(first))
        for message in ring.messages():
            event.put(message)
        for cause in causes:
            event.found(cause)
        reach = ring.reach(times.begin)
        event.add_metadata(
            EVENT_RECORD,
            {
                'cause': causes[0].check,
                'time': str(times.time),
                'held': f'{reach:.3f}',
                'pre_trigger': str(self._settings.before),
                'post_trigger': str(self._settings.after),
                'fell_out': str(ring.fell_out),
            },
        )
        self._say(True, f'{causes[0].check}: recording to {printable(run.path)}')
        if ring.fell_out and reach < self._settings.before:
            wanted = f'only {reach:.1f} s of {self._settings.before:g} s before it'
            self._say(False, f'{wanted} were still in memory (pre_trigger_bytes)')

    def _reap(self, event: Event) -> None:
        """Take leave of an event whose run is closed."""
        outcome = event.outcome
        if outcome is None:
            return
        self._closing = None if event is self._closing else self._closing
        self._event = None if event is self._event else self._event
        written, gone = self._before.written.copy(), self._before.gone.copy()
        for name, count in outcome.counts.items():
            written[name] += count.written
            gone[name] += count.dropped
        self._before = Fate(written, gone)
        if outcome.is_well:
            self._failure = ''
            self._say(True, outcome.said)
        else:
            self._fail(outcome.said)

    def _fail(self, text: str) -> None:
        """Say that an event is not as it should be; the next one may be."""
        self._failure, self._has_failed = text, True
        self._say(False, text)

    def _forget(self, since: float) -> None:
        """Forget pauses and solvers' parameters that were over before what is held [s]."""
        while self._pauses_told and self._pauses_told[0][0] < since:
            self._pauses_told.popleft()
        earliest = time_ns() - round((monotonic() - since) * 1e9)
        for known in self._solvers.values():
            while len(known) > 1 and known[1].time < earliest:
                known.popleft()


def _free(folder: Path, cause: str) -> Path:
    """Return a path that is not there yet, named by the time and a cause."""
    word = re.sub(r'[^a-z0-9_]', '_', cause.lower())[:40]
    name = f'{datetime.now(timezone.utc):{_NAME}}_{word}'
    path, number = folder / name, 2
    while path.exists() or path.is_symlink():
        path, number = folder / f'{name}_{number}', number + 1
    return path


def _free_space(folder: Path) -> int | None:
    try:
        return free_space(folder)
    except OSError:
        return None
