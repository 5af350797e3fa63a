"""The run of one event: what was held in memory before it, and what comes for a while."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from threading import Thread

from klann_ros.log.records import Message
from klann_ros.log.run_parameters import SolverParameters, ToldFinding, TopicCount
from klann_ros.log.write.background_writer import BackgroundWriter
from klann_ros.log.write.ledger import Ledger, Mark
from klann_ros.log.write.recording import RecordingSession
from klann_ros.log.write.writer import RunWriter


@dataclass(frozen=True)
class Outcome:
    """What became of an event's run."""

    is_well: bool
    said: str
    counts: Mapping[str, TopicCount]


class Event:
    """
    A run that begins in the past.

    Its account is that of the recording between two moments: what was forgotten before is no loss
    of it, and what is in it was received, left out or dropped.

    Parameters
    ----------
    run, background
        The run, and what writes to it.
    whole
        The ledger of the recording.
    before
        What had become of all messages before the first one that is given.

    Attributes
    ----------
    end : float
        When it ends, by a clock that nobody sets [s].
    outcome : Outcome or None
        Is there when the run is closed.

    """

    def __init__(
        self, run: RunWriter, background: BackgroundWriter, whole: Ledger, before: Mark
    ) -> None:
        self.end = 0.0
        self.outcome: Outcome | None = None
        self.put = background.put
        self.path = run.path
        self._background, self._whole, self._before = background, whole, before
        self._after: Mark | None = None
        self._again = Counter[str]()
        self._session = RecordingSession(run, background, self.counts)
        self.split, self.state = self._session.split, self._session.state
        self._thread: Thread | None = None

    def give_again(self, messages: Iterable[Message]) -> None:
        """Put messages that had been received before."""
        for message in messages:
            self._again[message.topic.name] += 1
            self.put(message)

    def tell(self, solver: SolverParameters) -> None:
        """Write what a solver has."""
        self._session.tell(solver)

    def found(self, finding: ToldFinding) -> None:
        """Write what was found."""
        self._session.describe_finding(finding)

    def add_metadata(self, name: str, record: Mapping[str, str]) -> None:
        """Write a record."""
        self._background.put_entry(lambda run: run.add_metadata(name, record))

    def counts(self) -> dict[str, TopicCount]:
        """Return what became of the messages of each topic."""
        after = self._whole.mark() if self._after is None else self._after
        own = self._background.ledger
        for name in after:
            own[name]  # is opened by asking
        return self._whole.between(self._before, after, own.counts(), self._again)

    @property
    def has_failed(self) -> bool:
        """Return whether nothing can be written any more."""
        return self._background.failure is not None

    def close(self, done: Callable[[], object] | None = None) -> None:
        """Finish the run in a thread of its own, for a disk may take its time; give it no more."""
        self._after = self._whole.mark()
        self._thread = Thread(target=self._finish, args=(done,), name='event', daemon=True)
        self._thread.start()

    def join(self) -> None:
        """Wait until it is closed."""
        if self._thread is not None:
            self._thread.join()

    def _finish(self, done: Callable[[], object] | None) -> None:
        is_well, said = self._session.finish()
        self.outcome = Outcome(is_well, said, self.counts())
        if done is not None:
            done()
