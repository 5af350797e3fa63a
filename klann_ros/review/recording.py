"""What a run holds, decoded to arrays: the model that everything else of a review works on."""

from dataclasses import dataclass

from klann_ros.kinematics import KlannGeometry
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
        Messages lost by sequence number; None where the run cannot tell.

    """

    name: str
    type: str  # noqa: A003, RUF100 - as all tools call it; ruff lets it be
    count: int
    rate: float
    longest_gap: float
    latency: float
    lost: int | None


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
    geometry : KlannGeometry or None
        The solver's geometry as the run tells it, or as it was given.
    crank_stamps, crank_angles : numpy.ndarray, shape (k,)
        Crank inputs: stamp [ns], angle [rad].
    pose_stamps : numpy.ndarray, shape (n,)
        Header stamps of the poses [ns].
    poses : numpy.ndarray, shape (n, 5)
        alpha, gamma, beta, delta, theta [rad].
    foot_stamps : numpy.ndarray, shape (m,)
        Header stamps of the feet [ns].
    feet : numpy.ndarray, shape (m, 2)
        H (x, y) [m].

    """

    path: str
    start: int
    end: int
    topics: tuple[TopicFigures, ...]
    problem: str
    geometry: KlannGeometry | None
    crank_stamps: Times
    crank_angles: Floats
    pose_stamps: Times
    poses: Floats
    foot_stamps: Times
    feet: Floats

    @property
    def duration(self) -> float:
        """Return the time between the first and the last message [s]."""
        return (self.end - self.start) / 1e9
