"""What a run holds, decoded to arrays: the model that everything else of a review works on."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

from klann_ros.dynamics import Dynamics
from klann_ros.kinematics import AnyLeg
from klann_ros.kinematics.klann.leg import JOINTS
from klann_ros.log.run_parameters import Pause, ToldFinding
import numpy as np

from .pairing import pairs
from .times import Floats, Hole, Times
from .topics import TopicRecording


@dataclass(frozen=True)
class Undecoded:
    """Messages of a topic that do not hold what their type says."""

    # The topic's name.
    topic: str
    # How many there are.
    count: int
    # Log time of the first [ns].
    time: int


@dataclass(frozen=True, eq=False)
class Series:
    """What messages of one kind say, in the order of their log times."""

    # Shape (n,): log times [ns], the clock of the run.
    times: Times
    # Shape (n,): header stamps, or what stands for them [ns]: they tell which answer belongs to
    # which input, and may be of another clock than the log times.
    stamps: Times
    # Shape (n, k): what they say.
    values: Floats

    def __post_init__(self) -> None:
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
    """The solver of a leg."""

    # The joint that turns its crank.
    crank_joint: str = 'crank'
    # Whether it stamps by a simulated clock what has no stamp.
    sim_time: bool = False
    # What it solves at last; None where the run does not tell.
    leg: AnyLeg | None = None
    # The log time since which it has it [ns]; 0 when it never had another.
    leg_time: int = 0
    # The leg's crank angle is direction * crank + phase [rad].
    direction: float = 1
    phase: float = 0.0
    # Full names of the nodes that solve it, as far as the run tells; without any, direction and
    # phase are not told either.
    nodes: tuple[str, ...] = ()
    # Who tells the leg; '' where nobody does.
    source: str = ''
    # What stands between the leg's name and its joint's in JointState.
    joint_separator: str = '/'
    # The leg with its masses, as it is mounted; None where nobody tells them.
    dynamics: Dynamics | None = field(default=None, compare=False)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of its angles, the crank's first; a Klann leg's where nobody tells."""
        return JOINTS if self.leg is None else self.leg.joint_names

    def published_joints(self, name: str) -> tuple[str, ...]:
        """Return the names of its angles in JointState, for the leg's name."""
        prefix = f'{name}{self.joint_separator}' if name else ''
        return tuple(prefix + joint for joint in self.joint_names)

    @property
    def slides(self) -> tuple[bool, ...]:
        """Return which of them are distances along lines [m]; the others are angles."""
        if self.leg is None:
            return (False,) * len(JOINTS)
        return tuple(body.slides for body in self.leg.linkage.structure.bodies)


@dataclass(frozen=True, eq=False)
class LegRecording:
    """What a run says of a leg."""

    # Where it publishes, and its name; '' for the root, and for the unnamed leg.
    namespace: str
    name: str
    # What the run tells of its solver, or what it is held against.
    solver: LegSolver
    # Where its poses and its crank inputs come from.
    pose_topics: frozenset[str]
    crank_topics: frozenset[str]
    # Crank inputs, before direction and phase [rad], values of shape (k, 1).
    cranks: Series
    # The leg's angles, the crank's first [rad], values of shape (n, number of angles).
    poses: Series
    # H (x, y) [m], values of shape (m, 2).
    feet: Series
    # Shape (n, number of angles) or (0, 0): the velocities of the poses [rad/s], NaN where not
    # told; only if they were asked for, and in floats of half the size where that will do.
    rates: Floats = field(default_factory=lambda: np.empty((0, 0)))
    # The most Newton iterations since the report before, values of shape (k, 1).
    iterations: Series = field(default_factory=lambda: no_series(1))
    # Log times of other crank inputs, whose answers nobody can tell: they have no stamp, and a
    # simulated clock gave one to their answers [ns].
    unstamped: Times = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    @property
    def title(self) -> str:
        """Return how to call it: '' for the unnamed leg in the root namespace."""
        return '/'.join(part for part in (self.namespace.lstrip('/'), self.name) if part)

    @property
    def crank_pose_joint(self) -> str:
        """Return the name under which its crank's angle is published."""
        return self.solver.published_joints(self.name)[0]

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
class Drive:
    """A joint whose efforts the run has, and which turns cranks."""

    # Its name.
    joint: str
    # The legs that it turns, by their places in the run.
    legs: tuple[int, ...]
    # Whether its angle is the cranks' before direction and phase; else it is the leg's own.
    is_input: bool
    # Angles [rad] and efforts [N m], values of shape (k, 2).
    efforts: Series


@dataclass(frozen=True, eq=False)
class Walk:
    """What a run says of a walking robot in a namespace."""

    namespace: str
    # x, y and yaw of the body [m, rad], as odometry has it, and in truth where somebody knows.
    odometry: Series
    truth: Series
    # By joint, the angles of the cranks [rad]: as commanded, and as they were.
    commands: Mapping[str, Series]
    states: Mapping[str, Series]


@dataclass(frozen=True, eq=False)
class RunRecording:
    """A run, decoded."""

    # Where it is.
    path: str
    # Its files, and their sizes [bytes].
    files: tuple[tuple[str, int], ...]
    # First and last log time [ns].
    start: int
    end: int
    # All topics.
    topics: tuple[TopicRecording, ...]
    # What is wrong with the container, one line each.
    problems: tuple[str, ...]
    # What concerns a leg by its topic, and cannot be decoded.
    undecoded: tuple[Undecoded, ...]
    # Where the log has nothing for reasons of its own, a pause or damage: log times in order [ns].
    holes: tuple[Hole, ...]
    # The legs.
    legs: tuple[LegRecording, ...]
    # What ended the recording before its time, and what somebody took away meanwhile, as the
    # recorder tells; '' for nothing.
    stopped: str = ''
    harmed: str = ''
    # The joints that turn cranks and tell efforts.
    drives: tuple[Drive, ...] = ()
    # Robots that walk.
    walks: tuple[Walk, ...] = ()
    # When the recorder itself did not run, and why.
    stalls: tuple[Pause, ...] = ()
    # The simulated time by log times, values of shape (k, 0); empty where nobody published it.
    clock: Series = field(default_factory=lambda: no_series(0))
    # What the recorder found, and told, while it recorded.
    told: tuple[ToldFinding, ...] = ()

    @property
    def duration(self) -> float:
        """Return the time between the first and the last message [s]."""
        return (self.end - self.start) / 1e9

    def since_start(self, log_time: int) -> float:
        """Return a log time from the start of the run [s]."""
        return (int(log_time) - self.start) / 1e9

    def restarts_on(self, names: Collection[str]) -> list[Hole]:
        """Return between which log times [ns] publishers of some topics were started again."""
        restarts = (t.restarts.tolist() for t in self.topics if t.name in names)
        return [(begin, end) for pairs_ in restarts for begin, end in pairs_]

    def lost_on(self, names: Collection[str]) -> int:
        """Return how many messages of some topics were lost, as far as is known."""
        return sum(topic.lost or 0 for topic in self.topics if topic.name in names)
