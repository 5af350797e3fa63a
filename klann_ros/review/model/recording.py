"""A recorded run, decoded to arrays."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import auto, Enum
from typing import NamedTuple

from klann_ros.dynamics import Dynamics
from klann_ros.kinematics import AnyLeg, JOINTS
from klann_ros.kinematics.arrays import FloatArray, IntArray
from klann_ros.log import Pause, RecordedFinding
import numpy as np

from .times import Interval, no_series, pairs, Series
from .topics import TopicRecording


class Mismatch(Enum):
    """Reason why messages of a leg or a walker cannot be decoded."""

    ENCODING = auto()
    DEFINITION = auto()
    CONTENT = auto()
    NO_POSITIONS = auto()


@dataclass(frozen=True)
class Undecoded:
    """Messages of a topic that do not match their type."""

    topic: str
    encoding: str  # such as json
    reason: Mismatch
    count: int
    time: int  # log time of the first [ns]


@dataclass(frozen=True)
class LegSolver:
    """The solver of a leg."""

    crank_joint: str = 'crank'
    sim_time: bool = False  # whether it stamps unstamped inputs by a simulated clock
    leg: AnyLeg | None = None  # its last leg; None if unknown
    leg_time: int = 0  # log time of the last change of the leg [ns]; 0 for none
    # The leg's crank angle is direction * crank + phase [rad].
    direction: float = 1
    phase: float = 0.0
    # Full names of the solver nodes, if known; without any, direction and phase are unknown.
    nodes: tuple[str, ...] = ()
    source: str = ''  # of the leg; '' if unknown
    joint_separator: str = '/'  # of leg and joint names in JointState
    counts_per_turn: float = 0.0  # of the encoders on crank_state; 0 for JointStates
    # The leg with its masses, as mounted; None if unknown.
    dynamics: Dynamics | None = field(default=None, compare=False)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of its angles, the crank's first; a Klann leg's by default."""
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
    """The data of a leg in a run."""

    namespace: str  # '' for the root
    name: str  # '' for the unnamed leg
    solver: LegSolver  # in the run, or the reference
    pose_topics: frozenset[str]
    crank_topics: frozenset[str]
    cranks: Series  # inputs, before direction and phase [rad], values of shape (k, 1)
    poses: Series  # angles, the crank's first [rad], values of shape (n, number of angles)
    feet: Series  # H (x, y) [m], values of shape (m, 2)
    # Shape (n, number of angles) or (0, 0): velocities of the poses [rad/s], NaN for unknown; only
    # on request, as f8 or f4.
    rates: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    # The most Newton iterations since the report before, values of shape (k, 1).
    iterations: Series = field(default_factory=lambda: no_series(1))
    # Log times of inputs without a stamp, whose answers have simulated stamps [ns].
    unstamped: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    @property
    def title(self) -> str:
        """Return its title: '' for the unnamed leg in the root namespace."""
        return '/'.join(part for part in (self.namespace.lstrip('/'), self.name) if part)

    def paired_feet(self) -> FloatArray:
        """Return the foot H of each pose, shape (n, 2) [m]; NaN where there is none."""
        feet = np.full((len(self.poses), 2), np.nan)
        of_feet, of_poses = pairs(self.feet.stamps, self.poses.stamps)
        feet[of_poses] = self.feet.values[of_feet]
        return feet

    def evaluated(self) -> 'LegRecording':
        """Return the part of the run since the last change of the leg."""
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
    """A joint with recorded efforts that drives cranks."""

    joint: str
    legs: tuple[int, ...]  # indices of its legs in the run
    is_input: bool  # whether its angle is an input, before direction and phase; else the leg's
    efforts: Series  # angles [rad] and efforts [N m], values of shape (k, 2)


class Trajectory(NamedTuple):
    """Positions of cranks that a controller is to follow."""

    time: int  # log time [ns]
    start: int  # stamp of its begin [ns]; 0 for at once
    joints: tuple[str, ...]
    times: IntArray  # since its begin, shape (n,) [ns]
    positions: FloatArray  # shape (n, number of joints) [rad]


@dataclass(frozen=True, eq=False)
class WalkRecording:
    """The data of a walker in a namespace."""

    namespace: str
    # x, y and yaw of the body [m, rad].
    odometry: Series
    truth: Series
    # By joint: commanded and measured crank angles [rad], and commands that are velocities alone
    # [rad/s]; where a command has no names, the joints are numbered in the order of the states.
    commands: Mapping[str, Series]
    states: Mapping[str, Series]
    velocities: Mapping[str, Series] = field(default_factory=dict)
    trajectories: tuple[Trajectory, ...] = ()
    # Largest commanded velocity of a crank by topic [rad/s].
    speeds: Mapping[str, Series] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class RunRecording:
    """A run, decoded."""

    path: str
    files: tuple[tuple[str, int], ...]  # names and sizes [bytes]
    start: int  # first log time [ns]
    end: int  # last log time [ns]
    topics: tuple[TopicRecording, ...]
    problems: tuple[str, ...]  # faults of the container, one line each
    undecoded: tuple[Undecoded, ...]  # on topics of legs and walkers
    unrecorded: tuple[Interval, ...]  # pauses of the recorder and damage of the log, in order
    legs: tuple[LegRecording, ...]
    # Joints of the JointStates on each topic, without those of commands.
    joints: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    refused_descriptions: tuple[str, ...] = ()  # of legs, a line each
    impossible_times: str = ''  # log times that cannot be, in a line
    stopped: str = ''  # reason of an early end, by the recorder
    file_fault: str = ''  # faults of the file meanwhile, by the recorder
    is_refused_only: bool = False  # whether all problems are limits of this machine, no damage
    drives: tuple[Drive, ...] = ()
    walks: tuple[WalkRecording, ...] = ()
    stalls: tuple[Pause, ...] = ()  # of the recorder, with their reasons
    # Simulated time by log times: stamps [ns], and values [s]; empty without /clock.
    clock: Series = field(default_factory=lambda: no_series(1))
    recorder_findings: tuple[RecordedFinding, ...] = ()  # made during the recording
    # By topic, 1 while a driver holds its lease and 0 when it releases it.
    leases: Mapping[str, Series] = field(default_factory=dict)
    # Measured points by topic: x and y [m], values of shape (k, 2).
    measured: Mapping[str, Series] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Return the time between the first and the last message [s]."""
        return (self.end - self.start) / 1e9

    def restarts_on(self, names: Collection[str]) -> list[Interval]:
        """Return the restarts of publishers on some topics: intervals of log times [ns]."""
        restarts: list[Interval] = []
        for topic in self.topics:
            if topic.name in names:
                restarts += map(tuple, topic.restarts.tolist())
        return restarts

    def is_shared(self, names: Collection[str]) -> bool:
        """Return whether several publishers were active at once on one of some topics."""
        return any(topic.shared for topic in self.topics if topic.name in names)

    def lost_on(self, names: Collection[str]) -> int:
        """Return the known number of lost messages on some topics, before discovery too."""
        return sum((topic.lost or 0) + topic.early for topic in self.topics if topic.name in names)
