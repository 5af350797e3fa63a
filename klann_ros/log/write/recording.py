"""A recording as a whole: its run, its pauses, and what became of every message."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

from klann_ros.log.records import Message
from klann_ros.log.run_parameters import (
    FINDING_RECORD,
    finding_record,
    HARM_RECORD,
    harm_record,
    LOSS_RECORD,
    loss_record,
    Pause,
    PAUSE_RECORD,
    pause_record,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
    ToldFinding,
    TopicCount,
)
from klann_ros.sanitize.text import counted, listed, printable, verb
import yaml

from .background_writer import BackgroundWriter
from .ledger import Account, Ledger
from .writer import RunWriter

_WHY = 'several published there at once, or their messages have no numbers'
# So many topics are named.
_MOST = 3
# So many findings are in a run.
MOST_FINDINGS = 1000


@dataclass(frozen=True)
class RecordingState:
    """A recording at a moment."""

    # What became of the messages of each topic so far.
    counts: Mapping[str, TopicCount]
    # Messages that wait for the disk.
    queued: int
    # The file that is being written.
    file: str
    # Its size [bytes].
    size: int
    # The free space on its disk [bytes]; None where the disk does not tell.
    free: int | None
    # Whether messages are left out now.
    paused: bool
    # What ended the writing; empty while there is nothing.
    failure: str = ''
    # What others have done to the run, a line each.
    faults: tuple[str, ...] = ()
    # What else there is to say, where only events are written; '' and nothing otherwise.
    stage: str = ''
    held: Mapping[str, object] = field(default_factory=dict)

    @property
    def lost(self) -> int:
        """Return how many messages were lost, of those topics where that can be told."""
        return sum(count.lost or 0 for count in self.counts.values())


class Pauses:
    """
    Tells the messages that a pause leaves out, by when they were received.

    They are taken later than they were received, so a pause that is over still counts. Times are
    in [ns since the epoch].

    Parameters
    ----------
    ledger : Ledger
        Where what is left out is counted.

    Attributes
    ----------
    paused : bool
        Whether nothing is recorded now.

    """

    def __init__(self, ledger: Ledger) -> None:
        self.paused = False
        self._ledger = ledger
        self._begin = self._end = 0
        self._before: Counter[str] = Counter()

    def begin(self, now: int) -> None:
        """Begin a pause."""
        self.paused = True
        self._begin = now
        self._before = self._ledger.left_out()

    def end(self, now: int) -> None:
        """End it."""
        self.paused = False
        self._end = now

    def leaves_out(self, account: Account, received: int) -> bool:
        """Return whether a message belongs to the last pause, and count it if so."""
        if received < self._begin or not (self.paused or received < self._end):
            return False
        account.left_out += 1
        return True

    def last(self) -> Pause:
        """
        Return the last pause, when all that was received in it was taken.

        Nothing more belongs to it then, not even when the clock is set back into it.
        """
        left_out = self._ledger.left_out() - self._before
        pause = Pause(self._begin, self._end, dict(left_out))
        self._begin = self._end = 0
        return pause


class Recording(Protocol):
    """What a recorder does with what it hears; see RecordingSession and EventSession."""

    ledger: Ledger
    pauses: Pauses

    @property
    def put(self) -> Callable[[Message], None]:
        """Return what takes every message that is not left out."""

    def tell(self, solver: SolverParameters) -> None:
        """Take what a solver has from now on."""

    def describe_pause(self, pause: Pause) -> None:
        """Take a pause that is over, when all that was received in it was taken."""

    def describe_finding(self, finding: ToldFinding) -> None:
        """Take what was found."""

    def split(self) -> tuple[bool, str]:
        """Go on in a new file; return whether that was done, and its name or why not."""

    def state(self) -> RecordingState:
        """Return how it stands."""

    def finish(self) -> tuple[bool, str]:
        """Finish, when all was put; return whether all went well, and what to say."""


class RecordingSession:
    """
    What a recorder does with what it hears.

    Parameters
    ----------
    writer
        The run.
    background
        Writes to it, and keeps the ledger.
    counts
        Returns what became of the messages of each topic; the ledger's otherwise.

    Attributes
    ----------
    put : callable
        Takes every message that is not left out.
    ledger : Ledger
        Where every message is counted.
    pauses : Pauses
        What is left out.

    """

    def __init__(
        self,
        writer: RunWriter,
        background: BackgroundWriter,
        counts: Callable[[], Mapping[str, TopicCount]] | None = None,
    ) -> None:
        self._writer, self._background = writer, background
        self.put, self.ledger = background.put, background.ledger
        self.pauses = Pauses(self.ledger)
        self._counts = counts or self.ledger.counts
        self._findings = 0

    def tell(self, solver: SolverParameters) -> None:
        """Write what a solver has from now on."""
        self._background.put_entry(partial(describe_solver, solver))

    def split(self) -> tuple[bool, str]:
        """Go on in a new file; return whether that was done, and its name or why not."""
        if self._writer.file_is_empty:
            return False, f'there is no message in {self._writer.file_path.name} yet'
        return True, self._background.split()

    def describe_pause(self, pause: Pause) -> None:
        """Write a pause to the run, when all that was received in it was taken."""
        record = pause_record(pause)
        self._background.put_entry(lambda run: run.add_metadata(PAUSE_RECORD, record))

    def describe_finding(self, finding: ToldFinding) -> None:
        """Write to the run what was found; what comes again and again is not written for ever."""
        if self._findings < MOST_FINDINGS:
            self._findings += 1
            record = finding_record(finding)
            self._background.put_entry(lambda run: run.add_metadata(FINDING_RECORD, record))

    def state(self) -> RecordingState:
        """Return how it stands."""
        failure = self._background.failure
        return RecordingState(
            counts=self._counts(),
            queued=self._background.queued,
            file=str(self._writer.file_path),
            size=self._writer.file.size,
            free=self._free_space(),
            paused=self.pauses.paused,
            failure='' if failure is None else str(failure),
            faults=self._writer.faults.lasting,
        )

    def _describe_losses(self, run: RunWriter) -> None:
        """Write to the run what became of its messages, and of itself."""
        run.add_metadata(LOSS_RECORD, loss_record(self._counts()))
        harm = harm_record(str(self._background.failure or ''), run.faults.lasting)
        if harm:
            run.add_metadata(HARM_RECORD, harm)

    def _free_space(self) -> int | None:
        try:
            return self._writer.free_space
        except OSError:
            return None

    def finish(self) -> tuple[bool, str]:
        """Finish the run, when all was put; return whether all went well, and what to say."""
        failure = self._background.close(self._describe_losses)
        counts = self._counts()
        written = sum(count.written for count in counts.values())
        path, faults = printable(self._writer.path), self._writer.faults.lasting
        what = f'{counted(written, "message")} of {counted(len(counts), "topic")}'
        said = f'{what} {verb(written, "is", "are")} in {path}; {losses_in_words(counts)}'
        said = '; '.join((said, *faults))
        if failure is None:
            return not faults, said
        if self._writer.is_unfinished:
            said = f'{said}; `recover {path}` finishes the run'
        return False, f'the recording stopped early: {failure}; {said}'


def describe_solver(solver: SolverParameters, run: RunWriter) -> None:
    """Write a solver's parameters: as a record, and as the file that starts it so again."""
    name = f'{solver.node.strip("/").replace("/", "_")}.yaml'
    file = yaml.safe_dump({solver.node: {'ros__parameters': solver.parameters}}).encode()
    run.add_metadata(SOLVER_RECORD, solver_record(solver), in_every_file=True)
    run.attach(name, 'text/yaml', file, solver.time, in_every_file=True)


def losses_in_words(counts: Mapping[str, TopicCount]) -> str:
    """Return how many messages were lost, and of what nobody can tell."""
    lost = sum(count.lost or 0 for count in counts.values())
    early = sum(count.early for count in counts.values())
    unknown = [name for name, count in counts.items() if count.unheard is None]
    left = [name for name, count in counts.items() if count.left and count.unheard is not None]
    limited = ', as far as can be counted' if unknown or left else ''
    parts = [f'{lost} {verb(lost, "was", "were")} lost{limited}']
    if early:
        were = verb(early, 'was', 'were')
        parts.append(f'{early} {were} sent before the recorder heard their publishers')
    if left:
        number = sum(counts[name].left for name in left)
        publishers = counted(number, 'publisher')
        last = f'of what {verb(number, "it", "they")} sent last nothing is known'
        parts.append(f'{publishers} left ({listed(left, _MOST)}), and {last}')
    if unknown:
        parts.append(f'of {listed(unknown, _MOST)} nobody can tell: {_WHY}')
    return '; '.join(parts)
