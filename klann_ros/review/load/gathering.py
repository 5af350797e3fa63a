"""Which numbers of a run are whose: cranks, poses and feet by leg."""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar

from klann_ros.log.read.block import MessageBlock
from klann_ros.log.records import Topic
from klann_ros.log.run_parameters import SolverParameters
from klann_ros.review.model.recording import LegSolver, Undecoded
from klann_ros.review.model.times import nanoseconds, RowIndices, Times
from klann_ros.robot import Robot
import numpy as np

from .columns import GrowingArray, SeriesColumns
from .layouts import CRANK_ANGLE, FOOT, JOINT_STATE
from .pieces import DecodedRows, TopicReader
from .solvers import GIVEN, given_leg, leg_solvers, parent, published_legs

# A JointState tells by its joints what it is; of numbers and points there are many others.
COMMAND = 'crank_command'
LAST_PARTS = {CRANK_ANGLE: 'crank_angle', FOOT: 'point_h'}
# The name under which crank_angle, which turns all legs, stands among the joints.
ALL_JOINTS = ''

Place = tuple[str, str]


def may_be_of_a_leg(topic: Topic) -> bool:
    """Return whether a topic's messages may say something about a leg."""
    last = topic.name.rpartition('/')[2]
    return topic.type == JOINT_STATE or LAST_PARTS.get(topic.type) == last


class Gathering:
    """
    Gathers what blocks say about legs.

    Parameters
    ----------
    records : sequence of SolverParameters
        What the run tells of its solvers.
    given : Robot, optional
        The robot that the run is held against, instead of its own.
    rates : str
        Whether the velocities of the joints are wanted: 'f8' as they are, 'f4' in half the memory,
        '' not at all.

    Attributes
    ----------
    poses, rates : dict of SeriesColumns
        By namespace and name of the leg.
    pose_topics : dict of set
        By namespace and name of the leg, where its poses come from.
    feet : dict of SeriesColumns
        By the namespace of their topic.
    cranks, crank_topics : dict of SeriesColumns, dict of set
        By namespace and joint: the inputs, and where they come from.
    efforts : dict of SeriesColumns
        By namespace and joint that is a crank, or a leg's own angle of it: angles and efforts.
    unstamped : dict of GrowingArray
        By namespace and joint, log times of inputs whose answers nobody can tell.

    """

    def __init__(
        self,
        records: Sequence[SolverParameters],
        given: Robot | None = None,
        *,
        rates: str = '',
    ) -> None:
        self.poses: dict[Place, SeriesColumns] = {}
        self.rates: dict[Place, SeriesColumns] = {}
        self.feet: dict[str, SeriesColumns] = defaultdict(partial(SeriesColumns, 2))
        self.cranks: dict[Place, SeriesColumns] = defaultdict(partial(SeriesColumns, 1))
        self.efforts: dict[Place, SeriesColumns] = defaultdict(partial(SeriesColumns, 2))
        self.pose_topics: dict[Place, set[str]] = defaultdict(set)
        self.crank_topics: dict[Place, set[str]] = defaultdict(set)
        self.unstamped: dict[Place, GrowingArray] = defaultdict(partial(GrowingArray, np.int64))
        self._records = records
        self._given = given
        self._unknowns: dict[str, LegSolver] = {}
        self._kind_of_rates = rates
        self._solvers: dict[str, dict[str, LegSolver]] = {}
        self._readers: dict[Topic, TopicReader | None] = {}

    def solver(self, namespace: str, name: str) -> LegSolver:
        """Return the solver of a leg; one that knows nothing where the run does not tell."""
        return self._in(namespace).get(name) or self._unknown(name)

    def _unknown(self, name: str) -> LegSolver:
        """Return the solver of a leg that the run does not define."""
        if name not in self._unknowns:
            source = GIVEN if self._given else ''
            self._unknowns[name] = LegSolver(leg=given_leg(self._given, name), source=source)
        return self._unknowns[name]

    def _unknown_legs(self, names: Sequence[str]) -> dict[str, LegSolver]:
        """Return the legs whose joints are all among the names, where the run defines none."""
        legs: dict[str, LegSolver] = {}
        known = [leg.name for leg in self._given.legs] if self._given else ['']
        for joints in dict.fromkeys(self._unknown(name).joint_names for name in known):
            for name, separator in published_legs(names, joints):
                solver = self._unknown(name)
                if solver.joint_names == joints:
                    legs[name] = replace(solver, joint_separator=separator)
        return legs

    def places(self) -> list[Place]:
        """Return the legs that have poses, and those that the same solvers have beside them."""
        told = {(space, name) for space, _ in self.poses for name in self._in(space)}
        return sorted(told | self.poses.keys())

    def add(self, topic: Topic, block: MessageBlock, rows: RowIndices) -> list[DecodedRows]:
        """Add what a topic's messages in a block say, and return it as it was decoded."""
        reader = self._reader(topic)
        if reader is None:
            return []
        taken = []
        for piece in reader.read(block, rows):
            if self._is_torn(parent(topic.name), piece):
                reader.refuse(log_times(block, piece))
            else:
                self._add[topic.type](self, topic.name, block, piece)
                taken.append(piece)
        return taken

    def undecoded(self) -> tuple[Undecoded, ...]:
        """Return what could not be decoded so far."""
        found = ((topic, reader) for topic, reader in self._readers.items() if reader)
        return tuple(
            Undecoded(topic.name, reader.failed, reader.failed_at)
            for topic, reader in found
            if reader.failed
        )

    def _is_torn(self, namespace: str, piece: DecodedRows) -> bool:
        """Return whether joints of a leg have no positions: another robot's may do without."""
        if len(piece.names) in (0, piece.values.shape[1]):
            return False
        solvers = self._crank_solvers(namespace)
        joints = {joint for solver in solvers for joint in solver.joint_names}
        joints.update(solver.crank_joint for solver in solvers)
        separators = {'/', *(solver.joint_separator for solver in solvers)}
        names = {*piece.names, *(n.rpartition(s)[2] for s in separators for n in piece.names)}
        return not joints.isdisjoint(names)

    def _in(self, namespace: str) -> dict[str, LegSolver]:
        if namespace not in self._solvers:
            self._solvers[namespace] = leg_solvers(self._records, namespace, self._given)
        return self._solvers[namespace]

    def _reader(self, topic: Topic) -> TopicReader | None:
        if topic not in self._readers:
            wanted = may_be_of_a_leg(topic)
            self._readers[topic] = TopicReader(topic) if wanted else None
        return self._readers[topic]

    def _add_crank_angle(self, topic: str, block: MessageBlock, piece: DecodedRows) -> None:
        self._add_crank(topic, ALL_JOINTS, block, piece, 0)

    def _add_foot(self, topic: str, block: MessageBlock, piece: DecodedRows) -> None:
        self.feet[parent(topic)].add(log_times(block, piece), piece.stamps, piece.values[:, :2])

    def _add_joint_state(self, topic: str, block: MessageBlock, piece: DecodedRows) -> None:
        namespace, names = parent(topic), piece.names
        legs = self._in(namespace) or self._unknown_legs(names)
        found = False
        for name, solver in legs.items():
            joints = solver.published_joints(name)
            if set(joints) <= set(names):
                found = True
                self.pose_topics[namespace, name].add(topic)
                self._add_pose((namespace, name), [names.index(j) for j in joints], block, piece)
                self._add_effort(namespace, joints[0], block, piece)
        # What cranks are to do is no place where they are.
        if not found and topic.rpartition('/')[2] != COMMAND:
            for joint in {solver.crank_joint for solver in self._crank_solvers(namespace)}:
                if joint in names:
                    self._add_crank(topic, joint, block, piece, names.index(joint))
                    self._add_effort(namespace, joint, block, piece)

    def _crank_solvers(self, namespace: str) -> Sequence[LegSolver]:
        return tuple(self._in(namespace).values()) or (self._unknown(''),)

    def _add_pose(
        self, place: Place, columns: list[int], block: MessageBlock, piece: DecodedRows
    ) -> None:
        times = log_times(block, piece)
        poses = self.poses.setdefault(place, SeriesColumns(len(columns)))
        poses.add(times, piece.stamps, piece.values[:, columns])
        if self._kind_of_rates:
            known = piece.velocities.shape[1] == len(piece.names)
            rates = self.rates.setdefault(place, SeriesColumns(len(columns), self._kind_of_rates))
            missing = np.full((len(times), len(columns)), np.nan)
            with np.errstate(over='ignore'):
                rates.add(times, piece.stamps, piece.velocities[:, columns] if known else missing)

    def _add_effort(
        self, namespace: str, joint: str, block: MessageBlock, piece: DecodedRows
    ) -> None:
        if piece.efforts.shape[1] != len(piece.names):
            return
        column = piece.names.index(joint)
        values = np.column_stack([piece.values[:, column], piece.efforts[:, column]])
        self.efforts[namespace, joint].add(log_times(block, piece), piece.stamps, values)

    def _add_crank(
        self, topic: str, joint: str, block: MessageBlock, piece: DecodedRows, column: int
    ) -> None:
        """Add crank inputs; the solver takes the source time for a stamp that is zero."""
        namespace = parent(topic)
        self.crank_topics[namespace, joint].add(topic)
        stamps, values = piece.stamps, piece.values[:, slice(column, column + 1)]
        times = log_times(block, piece)
        unstamped = stamps == 0
        sources = nanoseconds(block.heads['publish_time'][piece.rows])
        # Recorders that do not know the source time write the log time, or nothing.
        untold = unstamped & ((sources == times) | (sources == 0))
        if any(solver.sim_time for solver in self._crank_solvers(namespace)):
            # Their answers have the simulated time of a moment that the run does not tell.
            untold = unstamped
        stamps = np.where(unstamped, sources, stamps)
        self.unstamped[namespace, joint].add(times[untold])
        stamps, values, times = (a[~untold] for a in (stamps, values, times))
        self.cranks[namespace, joint].add(times, stamps, values)

    _add: ClassVar[Mapping[str, Callable[..., None]]] = {
        CRANK_ANGLE: _add_crank_angle,
        FOOT: _add_foot,
        JOINT_STATE: _add_joint_state,
    }


def log_times(block: MessageBlock, piece: DecodedRows) -> Times:
    """Return when the messages of a piece were received [ns]."""
    return nanoseconds(block.heads['log_time'][piece.rows])
