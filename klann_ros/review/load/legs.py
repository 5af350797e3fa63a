"""Assign the numbers of messages to legs: crank inputs, poses, feet and efforts."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

from klann_ros.kinematics.arrays import IndexArray
from klann_ros.log import MessageBlock, SolverParameters, Topic
from klann_ros.review.model.recording import LegSolver, Undecoded
from klann_ros.review.model.times import nanoseconds
from klann_ros.robot import Robot
import numpy as np

from .decode import (
    COMMAND,
    CRANK_ANGLE,
    DecodedRows,
    FOOT,
    JOINT_STATE,
    ODOMETRY,
    TopicReader,
)
from .geometry import leg_solvers, parent, published_legs, REFERENCE, reference_leg
from .series import GrowingArray, ODOMETRY_TOPICS, SeriesColumns

LAST_PARTS = {CRANK_ANGLE: 'crank_angle', FOOT: 'point_h'}
# Key of crank_angle, the input of all legs, among the joints.
ALL_JOINTS = ''

LegKey = tuple[str, str]


def is_leg_topic(topic: Topic) -> bool:
    """Return whether a topic may have data of a leg."""
    last = topic.name.rpartition('/')[2]
    return topic.type == JOINT_STATE or LAST_PARTS.get(topic.type) == last


class LegCollector:
    """Reads the messages of legs and walkers, and collects those of legs, block by block."""

    def __init__(
        self,
        records: Sequence[SolverParameters],
        reference: Robot | None = None,
        *,
        rates: str = '',
    ) -> None:
        # By namespace and name of the leg.
        self.poses: dict[LegKey, SeriesColumns] = {}
        self.rates: dict[LegKey, SeriesColumns] = {}
        self.pose_topics: dict[LegKey, set[str]] = defaultdict(set)
        # By the namespace of the topic.
        self.feet: dict[str, SeriesColumns] = defaultdict(partial(SeriesColumns, 2))
        # By namespace and joint: inputs, their topics, angles with efforts, and log times of
        # inputs with unknown answers.
        self.cranks: dict[LegKey, SeriesColumns] = defaultdict(partial(SeriesColumns, 1))
        self.efforts: dict[LegKey, SeriesColumns] = defaultdict(partial(SeriesColumns, 2))
        self.crank_topics: dict[LegKey, set[str]] = defaultdict(set)
        self.unstamped: dict[LegKey, GrowingArray] = defaultdict(partial(GrowingArray, np.int64))
        self._records = records
        self._reference = reference
        self._unknowns: dict[str, LegSolver] = {}
        self._kind_of_rates = rates
        self._solvers: dict[str, dict[str, LegSolver]] = {}
        self._readers: dict[Topic, TopicReader | None] = {}

    def solver(self, namespace: str, name: str) -> LegSolver:
        """Return the solver of a leg; an empty one if unknown."""
        return self._solvers_in(namespace).get(name) or self._unknown(name)

    def _unknown(self, name: str) -> LegSolver:
        """Return the solver of a leg that the run does not define."""
        if name not in self._unknowns:
            leg, source = reference_leg(self._reference, name), REFERENCE * bool(self._reference)
            self._unknowns[name] = LegSolver(leg=leg, source=source)
        return self._unknowns[name]

    def _unknown_legs(self, names: Sequence[str]) -> dict[str, LegSolver]:
        """Return the legs with all joints among the names, in a run without parameters."""
        legs: dict[str, LegSolver] = {}
        known = [leg.name for leg in self._reference.legs] if self._reference else ['']
        for joints in dict.fromkeys(self._unknown(name).joint_names for name in known):
            for name, separator in published_legs(names, joints):
                solver = self._unknown(name)
                if solver.joint_names == joints:
                    legs[name] = replace(solver, joint_separator=separator)
        return legs

    def places(self) -> list[LegKey]:
        """Return the legs with poses, and the other legs of their solvers."""
        known = {(space, name) for space, _ in self.poses for name in self._solvers_in(space)}
        return sorted(known | self.poses.keys())

    def add(self, topic: Topic, block: MessageBlock, rows: IndexArray) -> list[DecodedRows]:
        """Add the messages of a topic in a block, and return them decoded."""
        reader = self._reader(topic)
        if reader is None:
            return []
        taken = []
        for piece in reader.read(block, rows):
            if self._lacks_positions(parent(topic.name), piece):
                reader.refuse(piece.times)
            else:
                if topic.type == CRANK_ANGLE:
                    self._add_crank(topic.name, ALL_JOINTS, block, piece, 0)
                elif topic.type == JOINT_STATE:
                    self._add_joint_state(topic.name, block, piece)
                elif topic.type == FOOT:
                    foot = piece.values[:, :2]
                    self.feet[parent(topic.name)].add(piece.times, piece.stamps, foot)
                taken.append(piece)
        return taken

    def undecoded(self) -> Iterator[Undecoded]:
        """Yield the topics with undecodable messages."""
        for reader in filter(None, self._readers.values()):
            yield from reader.undecoded

    def _lacks_positions(self, namespace: str, piece: DecodedRows) -> bool:
        """Return whether joints of a leg have no positions; other robots may omit them."""
        if len(piece.names) in (0, piece.values.shape[1]):
            return False
        solvers = self._crank_solvers(namespace)
        joints = {joint for solver in solvers for joint in solver.joint_names}
        joints.update(solver.crank_joint for solver in solvers)
        separators = {'/', *(solver.joint_separator for solver in solvers)}
        names = {*piece.names, *(n.rpartition(s)[2] for s in separators for n in piece.names)}
        return not joints.isdisjoint(names)

    def _solvers_in(self, namespace: str) -> dict[str, LegSolver]:
        if namespace not in self._solvers:
            self._solvers[namespace] = leg_solvers(self._records, namespace, self._reference)
        return self._solvers[namespace]

    def _reader(self, topic: Topic) -> TopicReader | None:
        if topic not in self._readers:
            is_pose = topic.type == ODOMETRY and topic.name.rpartition('/')[2] in ODOMETRY_TOPICS
            is_read = is_pose or is_leg_topic(topic)
            self._readers[topic] = TopicReader(topic) if is_read else None
        return self._readers[topic]

    def _add_joint_state(self, topic: str, block: MessageBlock, piece: DecodedRows) -> None:
        namespace, names = parent(topic), piece.names
        legs = self._solvers_in(namespace) or self._unknown_legs(names)
        found = False
        for name, solver in legs.items():
            joints = solver.published_joints(name)
            if set(joints) <= set(names):
                found = True
                self.pose_topics[namespace, name].add(topic)
                self._add_pose((namespace, name), [names.index(j) for j in joints], piece)
                self._add_effort(namespace, joints[0], piece)
        # A command is no measured input.
        if not found and topic.rpartition('/')[2] != COMMAND:
            for joint in {solver.crank_joint for solver in self._crank_solvers(namespace)}:
                if joint in names:
                    self._add_crank(topic, joint, block, piece, names.index(joint))
                    self._add_effort(namespace, joint, piece)

    def _crank_solvers(self, namespace: str) -> Sequence[LegSolver]:
        return tuple(self._solvers_in(namespace).values()) or (self._unknown(''),)

    def _add_pose(self, place: LegKey, columns: list[int], piece: DecodedRows) -> None:
        poses, times = self.poses.setdefault(place, SeriesColumns(len(columns))), piece.times
        poses.add(times, piece.stamps, piece.values[:, columns])
        if self._kind_of_rates:
            known = piece.velocities.shape[1] == len(piece.names)
            rates = self.rates.setdefault(place, SeriesColumns(len(columns), self._kind_of_rates))
            missing = np.full((len(times), len(columns)), np.nan)
            with np.errstate(over='ignore'):
                rates.add(times, piece.stamps, piece.velocities[:, columns] if known else missing)

    def _add_effort(self, namespace: str, joint: str, piece: DecodedRows) -> None:
        if piece.efforts.shape[1] == len(piece.names):
            column = piece.names.index(joint)
            values = np.column_stack([piece.values[:, column], piece.efforts[:, column]])
            self.efforts[namespace, joint].add(piece.times, piece.stamps, values)

    def _add_crank(
        self, topic: str, joint: str, block: MessageBlock, piece: DecodedRows, column: int
    ) -> None:
        """Add crank inputs; the solver takes the source time for a stamp that is zero."""
        namespace = parent(topic)
        self.crank_topics[namespace, joint].add(topic)
        stamps, values = piece.stamps, piece.values[:, slice(column, column + 1)]
        times, unstamped = piece.times, stamps == 0
        sources = nanoseconds(block.heads['publish_time'][piece.rows])
        # Without a source time, recorders write the log time or 0.
        unmatched = unstamped & ((sources == times) | (sources == 0))
        if any(solver.sim_time for solver in self._crank_solvers(namespace)):
            # Their answers have a simulated stamp that the run does not contain.
            unmatched = unstamped
        stamps = np.where(unstamped, sources, stamps)
        self.unstamped[namespace, joint].add(times[unmatched])
        stamps, values, times = (a[~unmatched] for a in (stamps, values, times))
        self.cranks[namespace, joint].add(times, stamps, values)
