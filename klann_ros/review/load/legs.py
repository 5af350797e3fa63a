"""Assign the numbers of messages to legs: crank inputs, poses, feet and efforts."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from klann_ros.kinematics.arrays import FloatArray, IntArray
from klann_ros.log import SolverParameters, Topic
from klann_ros.messages import FLOAT64, JOINT_STATE, POINT
from klann_ros.review.model.recording import Drive, LegRecording, LegSolver
from klann_ros.review.model.times import is_simulated, no_series, Series
from klann_ros.robot import Robot
import numpy as np

from .batches import Batch
from .collectors import COMMAND, IterationCollector
from .geometry import Descriptions, leg_solvers, published_legs, REFERENCE, reference_leg
from .series import ArrayPool, GrowingArray, SeriesColumns

LAST_NAMES = {FLOAT64.name: 'crank_angle', POINT.name: 'point_h'}
# Key of crank_angle, the input of all legs, among the joints.
ALL_JOINTS = ''

# A namespace with a leg or a joint in it.
LegKey = tuple[str, str]


def is_leg_topic(topic: Topic) -> bool:
    """Return whether a topic may have data of a leg."""
    last_name = topic.name.rpartition('/')[2]
    return topic.type == JOINT_STATE.name or LAST_NAMES.get(topic.type) == last_name


class LegDefinitions:
    """The legs that the solvers of a run define, or a reference robot, or nobody."""

    def __init__(self, records: Sequence[SolverParameters], reference: Robot | None) -> None:
        self._records = records
        self._reference = reference
        # Solvers by namespace and name of the leg, and by name where the run defines none.
        self._solvers: dict[str, dict[str, LegSolver]] = {}
        self._undefined: dict[str, LegSolver] = {}

    def solver(self, namespace: str, name: str) -> LegSolver:
        """Return the solver of a leg; an empty one if unknown."""
        return self.solvers_in(namespace).get(name) or self._undefined_solver(name)

    def solvers_in(self, namespace: str) -> dict[str, LegSolver]:
        """Return the solvers of the legs in a namespace, by their names."""
        if namespace not in self._solvers:
            self._solvers[namespace] = leg_solvers(self._records, namespace, self._reference)
        return self._solvers[namespace]

    def crank_solvers(self, namespace: str) -> Sequence[LegSolver]:
        """Return the solvers whose cranks turn in a namespace; an empty one if unknown."""
        return tuple(self.solvers_in(namespace).values()) or (self._undefined_solver(''),)

    def legs_with(self, namespace: str, joints: Sequence[str]) -> dict[str, LegSolver]:
        """Return the legs in a namespace, or without parameters those with published joints."""
        legs = dict(self.solvers_in(namespace))
        if legs:
            return legs
        names = [leg.name for leg in self._reference.legs] if self._reference else ['']
        solvers = map(self._undefined_solver, names)
        for leg_joints in dict.fromkeys(solver.joint_names for solver in solvers):
            for name, separator in published_legs(joints, leg_joints):
                solver = self._undefined_solver(name)
                if solver.joint_names == leg_joints:
                    legs[name] = replace(solver, joint_separator=separator)
        return legs

    def _undefined_solver(self, name: str) -> LegSolver:
        """Return the solver of a leg that the run does not define."""
        if name not in self._undefined:
            source = REFERENCE if self._reference else ''
            leg = reference_leg(self._reference, name)
            self._undefined[name] = LegSolver(leg=leg, source=source)
        return self._undefined[name]


class _PoseColumns:
    """The poses of a leg, with their topics, and their rates on request."""

    def __init__(self, joint_count: int, rate_kind: str) -> None:
        self.poses = SeriesColumns(joint_count)
        self.rates = SeriesColumns(joint_count, rate_kind) if rate_kind else None
        self.topics: set[str] = set()

    def add(self, batch: Batch, columns: Sequence[int]) -> None:
        """Add the poses in some columns of JointStates."""
        self.topics.add(batch.topic)
        poses = batch.numbers['position'][:, columns]
        self.poses.add(batch.times, batch.stamps, poses)
        if self.rates is not None:
            rates = np.full(poses.shape, np.nan)
            velocities = batch.numbers['velocity']
            if velocities.shape[1] == len(batch.names):
                rates = velocities[:, columns]
            with np.errstate(over='ignore'):
                self.rates.add(batch.times, batch.stamps, rates)


@dataclass
class _InputColumns:
    """The inputs of a crank, their topics, and the log times of inputs with unknown answers."""

    angles: SeriesColumns = field(default_factory=partial(SeriesColumns, 1))
    topics: set[str] = field(default_factory=set)
    unstamped: GrowingArray = field(default_factory=partial(GrowingArray, np.int64))


class LegCollector:
    """
    Collects the messages of legs, block by block.

    `rate_kind` is the type of the joint velocities; '' for none.
    """

    def __init__(self, definitions: LegDefinitions, rate_kind: str = '') -> None:
        self._definitions = definitions
        self._rate_kind = rate_kind
        # Poses by namespace and name of the leg.
        self._poses: dict[LegKey, _PoseColumns] = {}
        # Feet by the namespace of the topic.
        self._feet: dict[str, SeriesColumns] = defaultdict(partial(SeriesColumns, 2))
        # Inputs, and angles with efforts, by namespace and joint.
        self._inputs: dict[LegKey, _InputColumns] = defaultdict(_InputColumns)
        self._efforts: dict[LegKey, SeriesColumns] = defaultdict(partial(SeriesColumns, 2))

    @property
    def has_efforts(self) -> bool:
        """Return whether there are efforts of any joint."""
        return bool(self._efforts)

    def add_angles(self, batch: Batch) -> None:
        """Add messages of crank_angle, the input of all legs."""
        self._add_input(batch, ALL_JOINTS, batch.numbers['data'])

    def add_feet(self, batch: Batch) -> None:
        """Add positions of feet."""
        feet = batch.numbers['point'][:, :2]
        self._feet[batch.namespace].add(batch.times, batch.stamps, feet)

    def lacks_positions(self, batch: Batch) -> bool:
        """Return whether joints of a leg have no positions; other robots may omit them."""
        names = set(batch.names)
        if not names or len(batch.names) == batch.numbers['position'].shape[1]:
            return False
        joints: set[str] = set()
        separators = {'/'}
        for solver in self._definitions.crank_solvers(batch.namespace):
            joints.update(solver.joint_names, [solver.crank_joint])
            separators.add(solver.joint_separator)
        for separator in separators:
            names.update(name.rpartition(separator)[2] for name in batch.names)
        return not joints.isdisjoint(names)

    def add_joints(self, batch: Batch) -> None:
        """Add JointStates: poses of legs, or measured inputs; a command is neither."""
        namespace = batch.namespace
        names = batch.names
        has_poses = False
        for name, solver in self._definitions.legs_with(namespace, names).items():
            joints = solver.published_joints(name)
            if set(joints) <= set(names):
                has_poses = True
                columns = [names.index(joint) for joint in joints]
                key = (namespace, name)
                if key not in self._poses:
                    self._poses[key] = _PoseColumns(len(columns), self._rate_kind)
                self._poses[key].add(batch, columns)
                self._add_efforts(batch, joints[0])
        if has_poses or batch.last_name == COMMAND:
            return
        cranks = {solver.crank_joint for solver in self._definitions.crank_solvers(namespace)}
        for joint in cranks & set(names):
            column = names.index(joint)
            self._add_input(batch, joint, batch.numbers['position'][:, [column]])
            self._add_efforts(batch, joint)

    def _add_efforts(self, batch: Batch, joint: str) -> None:
        efforts = batch.numbers['effort']
        if efforts.shape[1] == len(batch.names):
            column = batch.names.index(joint)
            angles = batch.numbers['position'][:, column]
            columns = self._efforts[batch.namespace, joint]
            columns.add(batch.times, batch.stamps, np.column_stack([angles, efforts[:, column]]))

    def _add_input(self, batch: Batch, joint: str, angles: FloatArray) -> None:
        """Add crank inputs; the solver takes the source time for a stamp that is zero."""
        times = batch.times
        sources = batch.publish_times
        is_unstamped = batch.stamps == 0
        # Without a source time, recorders write the log time or 0.
        is_unmatched = is_unstamped & ((sources == times) | (sources == 0))
        solvers = self._definitions.crank_solvers(batch.namespace)
        if any(solver.sim_time for solver in solvers):
            # Their answers have a simulated stamp that the run does not contain.
            is_unmatched = is_unstamped
        columns = self._inputs[batch.namespace, joint]
        columns.topics.add(batch.topic)
        columns.unstamped.add(times[is_unmatched])
        stamps = np.where(is_unstamped, sources, batch.stamps)
        columns.angles.add(times[~is_unmatched], stamps[~is_unmatched], angles[~is_unmatched])

    def _leg_keys(self) -> list[LegKey]:
        """Return legs with poses and the other legs of their solvers, or with inputs or feet."""
        keys = set(self._poses)
        for namespace, _ in self._poses:
            keys.update((namespace, name) for name in self._definitions.solvers_in(namespace))
        if keys:
            return sorted(keys)
        namespaces = {namespace for namespace, _ in self._inputs} or self._feet.keys()
        return [(namespace, '') for namespace in sorted(namespaces)]

    def legs(
        self,
        iterations: IterationCollector,
        descriptions: Descriptions,
        shared: ArrayPool,
        clock: Series,
    ) -> Iterator[LegRecording]:
        """Yield the legs; nothing can be added any more."""
        feet = {namespace: columns.series(shared) for namespace, columns in self._feet.items()}
        angles: dict[LegKey, Series] = {}
        unstamped: dict[LegKey, IntArray] = {}
        for key, inputs in self._inputs.items():
            angles[key] = inputs.angles.series(shared)
            unstamped[key] = inputs.unstamped.array()
        for namespace, name in self._leg_keys():
            solver = self._definitions.solver(namespace, name)
            columns = self._poses.get((namespace, name))
            poses = no_series(len(solver.joint_names))
            if columns is not None:
                poses = columns.poses.series(shared)
            if solver.leg is None:
                solver = descriptions.described(solver, namespace, name, poses)
            if is_simulated(poses, clock):
                solver = replace(solver, sim_time=True)
            rates = np.empty((0, 0))
            if columns is not None and columns.rates is not None:
                rates = columns.rates.series(shared).values
            crank_topics: set[str] = set()
            cranks: list[Series] = []
            unstamped_times = [np.empty(0, dtype=np.int64)]
            for joint in (ALL_JOINTS, solver.crank_joint):
                key = (namespace, joint)
                if key in self._inputs:
                    crank_topics |= self._inputs[key].topics
                    cranks.append(angles[key])
                    unstamped_times.append(unstamped[key])
            yield LegRecording(
                namespace,
                name,
                solver,
                pose_topics=frozenset(columns.topics if columns else ()),
                crank_topics=frozenset(crank_topics),
                cranks=_merged(cranks),
                poses=poses,
                iterations=iterations.series(name),
                feet=feet.get(f'{namespace}/{name}' if name else namespace, no_series(2)),
                unstamped=np.sort(np.concatenate(unstamped_times)),
                rates=rates,
            )

    def drives(self, legs: Sequence[LegRecording], shared: ArrayPool) -> Iterator[Drive]:
        """Yield the joints with efforts, with their legs."""
        for (namespace, joint), columns in self._efforts.items():
            # Legs whose published angle it is, or else those whose input it is.
            posed_legs = []
            driven_legs = []
            for index, leg in enumerate(legs):
                if leg.namespace == namespace and leg.crank_pose_joint == joint:
                    posed_legs.append(index)
                if leg.namespace == namespace and leg.solver.crank_joint == joint:
                    driven_legs.append(index)
            if posed_legs or driven_legs:
                drive_legs = tuple(posed_legs or driven_legs)
                yield Drive(joint, drive_legs, not posed_legs, columns.series(shared))


def _merged(inputs: list[Series]) -> Series:
    """Return the inputs of several topics by their log times."""
    if len(inputs) < 2:
        return inputs[0] if inputs else no_series(1)
    times = np.concatenate([series.times for series in inputs])
    stamps = np.concatenate([series.stamps for series in inputs])
    angles = np.concatenate([series.values for series in inputs])
    order = np.argsort(times, kind='stable')
    return Series(times[order], stamps[order], angles[order])
