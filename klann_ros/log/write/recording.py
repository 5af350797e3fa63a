"""A recording session: a run, its pauses, and the loss report of every topic."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from klann_ros.log import run_parameters
from klann_ros.log.loss import DropCounters, TopicCounters
from klann_ros.log.run_parameters import Pause, RecordedFinding, SolverParameters, TopicCount
from klann_ros.sanitize.text import counted, listed, printable, verb

from .background_writer import BackgroundWriter
from .writer import RunWriter

MAX_FINDINGS = 1000
"""Findings written to a run."""

_UNKNOWN_LOSS = 'several publishers at once, or messages without sequence numbers'
_MAX_NAMED_TOPICS = 3


@dataclass(frozen=True)
class RecordingState:
    """State of a recording at a moment."""

    counts: Mapping[str, TopicCount] = field(default_factory=dict)
    # Messages that wait for the disk.
    queued: int = 0
    # The file in progress and its size [bytes].
    file: str = ''
    size: int = 0
    # Free space on the disk [bytes]; None if unknown.
    free: int | None = None
    paused: bool = False
    # The error that ended writing; '' without one.
    failure: str = ''
    # Outside changes of the run, one line each.
    faults: tuple[str, ...] = ()
    # Stage and buffer of an event recording.
    stage: str = ''
    buffer: Mapping[str, object] = field(default_factory=dict)

    @property
    def lost(self) -> int:
        """Return the lost messages of all topics with a known loss."""
        return sum(count.lost or 0 for count in self.counts.values())


class Pauses:
    """
    Skips messages received during a pause, with times in [ns since the epoch].

    Messages are read later than received, so a pause that has ended still applies.
    """

    def __init__(self, counters: DropCounters) -> None:
        self.paused = False
        self._counters = counters
        self._begin = self._end = 0
        self._skipped_before: Counter[str] = Counter()

    def begin(self, now: int) -> None:
        """Begin a pause."""
        self.paused = True
        self._begin = now
        self._skipped_before = self._counters.skipped()

    def end(self, now: int) -> None:
        """End the pause."""
        self.paused = False
        self._end = now

    def skips(self, counters: TopicCounters, received: int) -> bool:
        """Return whether a message belongs to the last pause; count it if so."""
        if received < self._begin or not (self.paused or received < self._end):
            return False
        counters.skipped += 1
        return True

    def take_last(self) -> Pause:
        """
        Return the last pause, after all messages received in it were read.

        Later messages do not belong to it, even if the clock is set back into it.
        """
        skipped = self._counters.skipped() - self._skipped_before
        pause = Pause(self._begin, self._end, dict(skipped))
        self._begin = self._end = 0
        return pause


class RecordingSession:
    """Receives the messages of a recorder, and writes them to one run in a background thread."""

    def __init__(self, writer: RunWriter, background: BackgroundWriter) -> None:
        self._writer = writer
        self._background = background
        self.put = background.put
        self.put_entry = background.put_entry
        self.counters = background.counters
        self.pauses = Pauses(self.counters)
        self._findings = 0

    def counts(self) -> dict[str, TopicCount]:
        """Return what became of the messages of each topic."""
        return self.counters.counts()

    def add_solver(self, solver: SolverParameters) -> None:
        """Write the new parameters of a solver."""
        self.put_entry(partial(_write_solver, solver))

    def split(self) -> tuple[bool, str]:
        """Begin a new file; return whether that was done, and its name or the reason."""
        if self._writer.file_is_empty:
            return False, f'there is no message in {self._writer.file.path.name} yet'
        return True, self._background.split()

    def add_pause(self, pause: Pause) -> None:
        """Write a pause to the run, after all messages received in it were read."""
        record = run_parameters.pause_record(pause)
        self.put_entry(lambda run: run.add_metadata(run_parameters.PAUSE_RECORD, record))

    def add_finding(self, finding: RecordedFinding) -> None:
        """Write a finding to the run, up to MAX_FINDINGS."""
        if self._findings < MAX_FINDINGS:
            self._findings += 1
            record = run_parameters.finding_record(finding)
            self.put_entry(lambda run: run.add_metadata(run_parameters.FINDING_RECORD, record))

    def state(self) -> RecordingState:
        """Return the present state."""
        failure = self._background.failure
        return RecordingState(
            counts=self.counts(),
            queued=self._background.queued,
            file=str(self._writer.file.path),
            size=self._writer.file.size,
            free=known_free_space(lambda: self._writer.free_space),
            paused=self.pauses.paused,
            failure='' if failure is None else str(failure),
            faults=self._writer.faults.active,
        )

    def _write_losses(self, run: RunWriter) -> None:
        """Write the drop counters and the faults to the run."""
        run.add_metadata(run_parameters.LOSS_RECORD, run_parameters.loss_record(self.counts()))
        faults = run_parameters.fault_record(
            str(self._background.failure or ''), run.faults.active
        )
        if faults:
            run.add_metadata(run_parameters.FAULT_RECORD, faults)

    def finish(self) -> tuple[bool, str]:
        """Finish the run after the last message; return success and a message for the user."""
        failure = self._background.close(self._write_losses)
        counts = self.counts()
        written = sum(count.written for count in counts.values())
        path = printable(self._writer.path)
        faults = self._writer.faults.active
        content = f'{counted(written, "message")} of {counted(len(counts), "topic")}'
        text = f'{content} {verb(written, "is", "are")} in {path}; {losses_in_words(counts)}'
        text = '; '.join((text, *faults))
        if failure is None:
            return not faults, text
        if self._writer.is_unfinished:
            text = f'{text}; `recover {path}` finishes the run'
        return False, f'the recording stopped early: {failure}; {text}'


def _write_solver(solver: SolverParameters, run: RunWriter) -> None:
    """Write a solver's parameters as a record, and as a parameter file that reproduces it."""
    name = f'{solver.node.strip("/").replace("/", "_")}.yaml'
    file = run_parameters.leg_description(solver).encode()
    run.add_metadata(
        run_parameters.SOLVER_RECORD, run_parameters.solver_record(solver), in_every_file=True
    )
    run.attach(name, 'text/yaml', file, solver.time, in_every_file=True)


def known_free_space(free_space: Callable[[], int]) -> int | None:
    """Return the free space on a disk [bytes]; None if the disk does not say."""
    try:
        return free_space()
    except OSError:
        return None


def losses_in_words(counts: Mapping[str, TopicCount]) -> str:
    """Return the number of lost messages, and the topics with an unknown loss."""
    lost = sum(count.lost or 0 for count in counts.values())
    early = sum(count.before_discovery for count in counts.values())
    unknown = [name for name, count in counts.items() if count.missed is None]
    departed = [
        name for name, count in counts.items() if count.departed and count.missed is not None
    ]
    at_least = 'at least ' if unknown or departed else ''
    clauses = [f'{at_least}{lost} {verb(lost, "was", "were")} lost']
    if early:
        were = verb(early, 'was', 'were')
        clauses.append(f'{early} {were} sent before the recorder discovered their publishers')
    if departed:
        number = sum(counts[name].departed for name in departed)
        publishers = counted(number, 'publisher')
        topics = listed(departed, _MAX_NAMED_TOPICS)
        clauses.append(f'{publishers} left ({topics}): losses at their end cannot be detected')
    if unknown:
        topics = listed(unknown, _MAX_NAMED_TOPICS)
        clauses.append(f'the loss of {topics} is unknown: {_UNKNOWN_LOSS}')
    return '; '.join(clauses)
