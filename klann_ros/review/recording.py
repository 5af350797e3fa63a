"""What a run holds, decoded to arrays: the model that everything else of a review works on."""

from dataclasses import dataclass, replace

from klann_ros.kinematics.leg_types import Leg
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Times = NDArray[np.int64]


@dataclass(frozen=True)
class TopicFigures:
    """
    A topic in a run, by its messages' times.

    Attributes
    ----------
    name, type : str
        The topic and its message type.
    count : int
        Messages in the run.
    rate : float
        Mean rate of the log times [Hz]; NaN for less than two messages.
    longest_gap : float
        Longest time between two messages [s]; NaN for less than two messages.
    latency : float
        Median time from publishing to receiving [s]; NaN without any message.
    lost : int or None
        Messages lost on the way into the run; None where nobody can tell.

    """

    name: str
    type: str  # noqa: A003, RUF100 - as all tools call it; ruff lets it be
    count: int
    rate: float
    longest_gap: float
    latency: float
    lost: int | None


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
    What messages of one kind say, in the order of the log.

    Attributes
    ----------
    times : numpy.ndarray, shape (n,)
        Log times [ns], the clock of the run.
    stamps : numpy.ndarray, shape (n,)
        Header stamps, or what stands for them [ns]: they tell which answer belongs to which
        input, and may be of another clock than the log times.
    values : numpy.ndarray, shape (n,) or (n, k)
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
        late = self.times >= time
        return Series(self.times[late], self.stamps[late], self.values[late])


@dataclass(frozen=True, eq=False)
class Recording:
    """
    A run, decoded.

    Attributes
    ----------
    path : str
        Where it is.
    start, end : int
        First and last log time [ns].
    topics : tuple of TopicFigures
        All topics.
    problem : str
        What is wrong with the container, in one line; empty when nothing is.
    undecoded : tuple of Undecoded
        What concerns a leg by its topic, and cannot be decoded.
    remarks : tuple of str
        What a reader must know and is no fault of the run.
    leg : KlannLeg, LinkageLeg or None
        What the solver solved, as the run tells it at last, or as it was given.
    leg_time : int
        The log time since which it was this leg [ns]; 0 for the whole run.
    cranks : Series
        Crank inputs [rad], values of shape (k,).
    poses : Series
        The leg's angles, the crank's first [rad], values of shape (n, number of angles).
    feet : Series
        H (x, y) [m], values of shape (m, 2).

    """

    path: str
    start: int
    end: int
    topics: tuple[TopicFigures, ...]
    problem: str
    undecoded: tuple[Undecoded, ...]
    remarks: tuple[str, ...]
    leg: Leg | None
    leg_time: int
    cranks: Series
    poses: Series
    feet: Series

    @property
    def duration(self) -> float:
        """Return the time between the first and the last message [s]."""
        return (self.end - self.start) / 1e9

    def judged(self) -> 'Recording':
        """Return the part of the run that its leg holds for."""
        since = self.leg_time
        return replace(
            self,
            cranks=self.cranks.since(since),
            poses=self.poses.since(since),
            feet=self.feet.since(since),
        )
