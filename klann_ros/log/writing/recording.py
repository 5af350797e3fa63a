"""A recording as a whole: its run, its pauses, and what became of every message."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from klann_ros.log.run_parameters import (
    HARM_RECORD,
    harm_record,
    LOSS_RECORD,
    loss_record,
    Pause,
    PAUSE_RECORD,
    pause_record,
    TopicCount,
)
from klann_ros.untrusted.text import counted, listed, printable, verb

from .background_writer import BackgroundWriter
from .ledger import Account, Ledger
from .writer import RunWriter

_WHY = 'several published there at once, or their messages have no numbers'
# So many topics are named.
_MOST = 3


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


class RecordingSession:
    """
    What a recorder does with what it hears.

    Parameters
    ----------
    writer
        The run.
    background
        Writes to it, and keeps the ledger.
    pauses
        What is left out.

    """

    def __init__(self, writer: RunWriter, background: BackgroundWriter, pauses: Pauses) -> None:
        self._writer, self._background, self._pauses = writer, background, pauses

    def split(self) -> tuple[bool, str]:
        """Go on in a new file; return whether that was done, and its name or why not."""
        if self._writer.file_is_empty:
            return False, f'there is no message in {self._writer.file_path.name} yet'
        return True, self._background.split()

    def describe_pause(self) -> None:
        """Write of a pause to the run, when all that was received in it was taken."""
        record = pause_record(self._pauses.last())
        self._background.put_entry(lambda run: run.add_metadata(PAUSE_RECORD, record))

    def state(self) -> RecordingState:
        """Return how it stands."""
        failure = self._background.failure
        return RecordingState(
            counts=self._background.ledger.counts(),
            queued=self._background.queued,
            file=str(self._writer.file_path),
            size=self._writer.file.size,
            free=self._free_space(),
            paused=self._pauses.paused,
            failure='' if failure is None else str(failure),
            faults=self._writer.faults.lasting,
        )

    def _describe_losses(self, run: RunWriter) -> None:
        """Write to the run what became of its messages, and of itself."""
        run.add_metadata(LOSS_RECORD, loss_record(self._background.ledger.counts()))
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
        ledger = self._background.ledger
        failure = self._background.close(self._describe_losses)
        counts = ledger.counts()
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
