"""What a run holds, decoded to arrays: the model that everything else of a review works on."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .loading.layouts import Floats, Times
from .loading.solvers import LegSolver


@dataclass(frozen=True, eq=False)
class TopicRecording:
    """
    How the messages of a topic came.

    Attributes
    ----------
    name, type : str
        The topic and its message type; the type is '' if nothing of it is in the run.
    times : numpy.ndarray, shape (n,)
        Log times, sorted [ns].
    latencies : numpy.ndarray of float32, shape (n,)
        Times from publishing to receiving [s]; NaN of what a latched publisher sent before it
        was heard, which waited for whoever would come.
    lost : int or None
        Messages lost on the way into the run; None where nobody can tell.
    dropped : int
        How many of them the recorder had received.
    early : int
        What publishers that came later had sent before the recorder heard them.
    left : int
        How many publishers left: of what each sent last nothing is known.
    shared : bool
        Whether several publishers were there at once, as their numbers or the recorder tell.
    missing : numpy.ndarray, shape (k, 3)
        Where sequence numbers are missing: the log times before and after [ns], and how many.
    set_back : numpy.ndarray, shape (k, 2)
        Where the recorder's clock was set back: the log times after that, and by how much at
        least [ns].
    overtaken : int
        How many other messages are logged earlier than the one before them in the file: those of
        several publishers come in turns, and some are sent again.

    """

    name: str
    type: str  # noqa: A003, RUF100 - as all tools call it; ruff lets it be
    times: Times
    latencies: NDArray[np.float32]
    lost: int | None
    early: int = 0
    left: int = 0
    shared: bool = False
    missing: Times = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))
    set_back: Times = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    overtaken: int = 0
    dropped: int = 0

    @property
    def lost_at(self) -> int | None:
        """Return the log time of the first message behind a gap in the numbers [ns]."""
        return int(self.missing[0, 1]) if len(self.missing) else None


@dataclass(frozen=True)
class Undecoded:
    """
    Messages of a topic that do not hold what their type says.

    Attributes
    ----------
    topic : str
        The topic's name.
    count : int
        How many there are.
    time : int
        Log time of the first [ns].

    """

    topic: str
    count: int
    time: int


@dataclass(frozen=True, eq=False)
class Series:
    """
    What messages of one kind say, in the order of their log times.

    Attributes
    ----------
    times : numpy.ndarray, shape (n,)
        Log times [ns], the clock of the run.
    stamps : numpy.ndarray, shape (n,)
        Header stamps, or what stands for them [ns]: they tell which answer belongs to which
        input, and may be of another clock than the log times.
    values : numpy.ndarray, shape (n, k)
        What they say.

    """

    times: Times
    stamps: Times
    values: Floats

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.times, self.stamps, self.values):
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.times)

    def since(self, time: int) -> 'Series':
        """Return what was logged at a time or later."""
        first = int(np.searchsorted(self.times, time))
        return Series(self.times[first:], self.stamps[first:], self.values[first:])


def no_series(width: int) -> Series:
    """Return a series without any row."""
    nothing = np.empty(0, dtype=np.int64)
    return Series(nothing, nothing.copy(), np.empty((0, width)))


@dataclass(frozen=True, eq=False)
class LegRecording:
    """
    What a run says of a leg.

    Attributes
    ----------
    namespace, name : str
        Where it publishes, and its name; '' for the root, and for the unnamed leg.
    solver : LegSolver
        What the run tells of its solver, or what it is held against.
    pose_topics, crank_topics : frozenset of str
        Where its poses and its crank inputs come from.
    cranks : Series
        Crank inputs, before direction and phase [rad], values of shape (k, 1).
    poses : Series
        The leg's angles, the crank's first [rad], values of shape (n, number of angles).
    rates : numpy.ndarray, shape (n, number of angles) or (0, 0)
        The velocities of the poses [rad/s], NaN where not told; only if they were asked for, and
        in floats of half the size where that will do.
    iterations : Series
        The most Newton iterations since the report before, values of shape (k, 1).
    feet : Series
        H (x, y) [m], values of shape (m, 2).
    unstamped : numpy.ndarray
        Log times of other crank inputs, whose answers nobody can tell: they have no stamp, and a
        simulated clock gave one to their answers [ns].

    """

    namespace: str
    name: str
    solver: LegSolver
    pose_topics: frozenset[str]
    crank_topics: frozenset[str]
    cranks: Series
    poses: Series
    feet: Series
    rates: Floats = field(default_factory=lambda: np.empty((0, 0)))
    iterations: Series = field(default_factory=lambda: no_series(1))
    unstamped: Times = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    @property
    def title(self) -> str:
        """Return how to call it: '' for the unnamed leg in the root namespace."""
        return '/'.join(part for part in (self.namespace.lstrip('/'), self.name) if part)

    def judged(self) -> 'LegRecording':
        """Return the part of the run that its leg holds for."""
        since = self.solver.leg_time
        if not since:
            return self
        first = len(self.poses) - len(self.poses.since(since))
        return replace(
            self,
            cranks=self.cranks.since(since),
            poses=self.poses.since(since),
            feet=self.feet.since(since),
            rates=self.rates[first:],
            unstamped=self.unstamped[self.unstamped >= since],
        )


@dataclass(frozen=True, eq=False)
class Recording:
    """
    A run, decoded.

    Attributes
    ----------
    path : str
        Where it is.
    files : tuple of (str, int)
        Its files, and their sizes [bytes].
    start, end : int
        First and last log time [ns].
    topics : tuple of TopicRecording
        All topics.
    problems : tuple of str
        What is wrong with the container, one line each.
    undecoded : tuple of Undecoded
        What concerns a leg by its topic, and cannot be decoded.
    holes : tuple of (int, int), in the order of time
        Where the log has nothing for reasons of its own, a pause or damage: log times [ns].
    legs : tuple of LegRecording
        The legs.
    stopped, harmed : str
        What ended the recording before its time, and what somebody took away meanwhile, as the
        recorder tells; '' for nothing.

    """

    path: str
    files: tuple[tuple[str, int], ...]
    start: int
    end: int
    topics: tuple[TopicRecording, ...]
    problems: tuple[str, ...]
    undecoded: tuple[Undecoded, ...]
    holes: tuple[tuple[int, int], ...]
    legs: tuple[LegRecording, ...]
    stopped: str = ''
    harmed: str = ''

    @property
    def duration(self) -> float:
        """Return the time between the first and the last message [s]."""
        return (self.end - self.start) / 1e9

    def since_start(self, log_time: int) -> float:
        """Return a log time from the start of the run [s]."""
        return (int(log_time) - self.start) / 1e9

    def lost_on(self, names: Collection[str]) -> int:
        """Return how many messages of some topics were lost, as far as is known."""
        return sum(topic.lost or 0 for topic in self.topics if topic.name in names)
