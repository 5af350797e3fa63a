"""What a run holds, decoded to arrays: the model that everything else of a review works on."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace

from klann_ros.kinematics import AnyLeg
from klann_ros.kinematics.klann.leg import JOINTS
import numpy as np

from .pairing import pairs
from .times import Floats, Times
from .topics import TopicRecording


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


@dataclass(frozen=True)
class LegSolver:
    """
    The solver of a leg.

    Attributes
    ----------
    crank_joint : str
        The joint that turns its crank.
    sim_time : bool
        Whether it stamps by a simulated clock what has no stamp.
    leg : KlannLeg, LinkageLeg or None
        What it solves at last; None where the run does not tell.
    leg_time : int
        The log time since which it has it [ns]; 0 when it never had another.
    direction, phase : float
        The leg's crank angle is direction * crank + phase [rad].
    nodes : tuple of str
        Full names of the nodes that solve it, as far as the run tells; without any, direction
        and phase are not told either.
    source : str
        Who tells the leg; '' where nobody does.

    """

    crank_joint: str = 'crank'
    sim_time: bool = False
    leg: AnyLeg | None = None
    leg_time: int = 0
    direction: float = 1
    phase: float = 0.0
    nodes: tuple[str, ...] = ()
    source: str = ''

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of its angles, the crank's first; a Klann leg's where nobody tells."""
        return JOINTS if self.leg is None else self.leg.joint_names

    @property
    def slides(self) -> tuple[bool, ...]:
        """Return which of them are distances along lines [m]; the others are angles."""
        if self.leg is None:
            return (False,) * len(JOINTS)
        return tuple(body.slides for body in self.leg.linkage.structure.bodies)


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

    def paired_feet(self) -> Floats:
        """Return the foot H of each pose, shape (n, 2) [m]; NaN where there is none."""
        feet = np.full((len(self.poses), 2), np.nan)
        of_feet, of_poses = pairs(self.feet.stamps, self.poses.stamps)
        feet[of_poses] = self.feet.values[of_feet]
        return feet

    def evaluated(self) -> 'LegRecording':
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
class RunRecording:
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
