"""The legs of a run, from the columns of its log: crank inputs, poses, feet and efforts."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import IntArray
from klann_ros.log import SolverParameters
from klann_ros.review.model.recording import Drive, LegRecording, LegSolver
from klann_ros.review.model.times import is_simulated, isin, no_series, Series, SeriesPool
from klann_ros.robot import Robot
import numpy as np

from .columns import JointSelection, LogColumns, Part
from .geometry import leg_solvers, published_legs, REFERENCE, reference_leg, RobotDescriptions
from .roles import COMMAND, place_of, Role, STATE

# Key of crank_angle, the input of all legs, among the joints.
ALL_JOINTS = ''
# Name of an unnamed leg in diagnostics.
_UNNAMED = 'leg'
# An encoder counts in 32 bits.
_OVERFLOW = 2**32

# A namespace with a leg or a joint in it.
LegKey = tuple[str, str]


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

    def selection(self, topic: str, names: Sequence[str]) -> JointSelection:
        """Return the joints of legs and cranks among names; a command is no input."""
        namespace, last_name = place_of(topic)
        published = set(names)
        joints: list[str] = []
        drives: list[str] = []
        for name, solver in self.legs_with(namespace, names).items():
            leg_joints = solver.published_joints(name)
            if published.issuperset(leg_joints):
                joints += leg_joints
                drives.append(leg_joints[0])
        is_input = not joints and last_name != COMMAND
        if is_input:
            joints = [*{solver.crank_joint for solver in self.crank_solvers(namespace)}]
            drives = joints = [joint for joint in joints if joint in published]
        if last_name in (COMMAND, STATE) or (is_input and last_name == 'joint_states'):
            joints = [*names]
        return JointSelection(tuple(dict.fromkeys(joints)), tuple(drives), is_input)

    def lacks_positions(self, topic: str, names: Sequence[str], count: int) -> bool:
        """
        Return whether JointStates with a number of positions lack those of a leg.

        Other robots may omit positions, and a command may be of velocities alone.
        """
        namespace, last_name = place_of(topic)
        if not names or (last_name == COMMAND and not count):
            return False
        joints: set[str] = set()
        separators = {'/'}
        for solver in self.crank_solvers(namespace):
            joints.update(solver.joint_names, [solver.crank_joint])
            separators.add(solver.joint_separator)
        last_names = set(names)
        for separator in separators:
            last_names.update(name.rpartition(separator)[2] for name in names)
        return not joints.isdisjoint(last_names)

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


class _Inputs(NamedTuple):
    """The inputs of a crank."""

    topics: frozenset[str]
    # Angles [rad], and the log times of inputs whose answers have an unknown stamp [ns].
    angles: Series
    unstamped: IntArray


class LegColumns:
    """The legs in the columns of a log."""

    def __init__(
        self, columns: LogColumns, definitions: LegDefinitions, pool: SeriesPool, clock: Series
    ) -> None:
        self._definitions = definitions
        self._descriptions = RobotDescriptions(columns.contents(Role.DESCRIPTION))
        self._pool = pool
        self._clock = clock
        # Poses by the leg; inputs by the joint, efforts, too; feet by the namespace of the topic.
        self._poses: dict[LegKey, list[Part]] = defaultdict(list)
        self._inputs: dict[LegKey, list[Part]] = defaultdict(list)
        # Efforts also by the topic.
        self._efforts: dict[tuple[str, str, str], list[Series]] = defaultdict(list)
        self._feet: dict[str, list[Series]] = defaultdict(list)
        for part in columns.parts(Role.JOINTS):
            self._add_joints(part)
        for part in columns.parts(Role.ANGLE, Role.TICKS):
            self._inputs[input_joint(part)].append(part)
        for part in columns.parts(Role.FOOT):
            self._feet[part.namespace].append(part.series())
        # Log times [ns] and solver iterations by the titles of the legs' reports.
        self._iterations: dict[str, list[tuple[int, float]]] = defaultdict(list)
        for _, time, report in columns.contents(Role.REPORT):
            for title, iterations in report.items():
                self._iterations[title].append((time, iterations))

    @property
    def has_efforts(self) -> bool:
        """Return whether there are efforts of any joint."""
        return bool(self._efforts)

    def _add_joints(self, part: Part) -> None:
        """Add JointStates: poses of legs, or measured inputs; a command is neither."""
        namespace = part.namespace
        names = part.selection.names
        if part.selection.is_input:
            for joint in part.selection.drives:
                self._inputs[namespace, joint].append(part)
        else:
            for name, solver in self._definitions.legs_with(namespace, names).items():
                if set(solver.published_joints(name)).issubset(names):
                    self._poses[namespace, name].append(part)
        for joint in part.selection.drives:
            if 'effort' in part.paths:
                angles = part.numbers([joint], 'position')
                numbers = np.column_stack([angles, part.numbers([joint], 'effort')])
                efforts = self._efforts[namespace, joint, part.topic]
                efforts.append(Series(part.times, part.stamps, numbers))

    def _leg_keys(self) -> list[LegKey]:
        """Return legs with poses and the other legs of their solvers, or with inputs or feet."""
        keys = set(self._poses)
        for namespace, _ in self._poses:
            keys.update((namespace, name) for name in self._definitions.solvers_in(namespace))
        if keys:
            return sorted(keys)
        namespaces = {namespace for namespace, _ in self._inputs} or self._feet.keys()
        for namespace in namespaces:
            names = self._definitions.solvers_in(namespace) or ('',)
            keys.update((namespace, name) for name in names)
        return sorted(keys)

    def legs(self) -> Iterator[LegRecording]:
        """Yield the legs."""
        feet = {name: self._pool.series(series, 2) for name, series in self._feet.items()}
        poses = {key: self._posed(key, 'position') for key in self._leg_keys()}
        inputs = {key: self._input(key, poses) for key in self._inputs}
        for (namespace, name), leg_poses in poses.items():
            solver = self._definitions.solver(namespace, name)
            if solver.leg is None:
                solver = self._descriptions.described(solver, namespace, name, leg_poses)
            if is_simulated(leg_poses, self._clock):
                solver = replace(solver, sim_time=True)
            rates = self._posed((namespace, name), 'velocity').values
            joints = dict.fromkeys((ALL_JOINTS, solver.crank_joint))
            cranks = [inputs[namespace, joint] for joint in joints if (namespace, joint) in inputs]
            unstamped = [crank.unstamped for crank in cranks]
            yield LegRecording(
                namespace,
                name,
                solver,
                pose_topics=frozenset(part.topic for part in self._poses[namespace, name]),
                crank_topics=frozenset().union(*(crank.topics for crank in cranks)),
                cranks=self._pool.series([crank.angles for crank in cranks], 1),
                poses=leg_poses,
                iterations=self._iteration_series(name),
                feet=feet.get(f'{namespace}/{name}' if name else namespace, no_series(2)),
                unstamped=np.sort(np.concatenate([np.empty(0, np.int64), *unstamped])),
                rates=rates if rates.size else np.empty((0, 0)),
            )

    def _posed(self, key: LegKey, path: str) -> Series:
        """Return the positions or velocities of a leg's joints."""
        namespace, name = key
        solver = self._definitions.solver(namespace, name)
        series = []
        for part in self._poses.get(key, ()):
            if path in part.paths:
                series.append(part.series(solver.published_joints(name), path))
        return self._pool.series(series, len(solver.joint_names))

    def _input(self, key: LegKey, poses: Mapping[LegKey, Series]) -> _Inputs:
        """Return the inputs of a crank."""
        namespace, joint = key
        solvers = self._definitions.crank_solvers(namespace)
        is_simulated_time = any(solver.sim_time for solver in solvers)
        angles: dict[str, list[Series]] = defaultdict(list)
        unstamped: dict[str, IntArray] = {}
        for part in self._inputs[key]:
            series = (
                part.series([joint], 'position') if part.role is Role.JOINTS else part.series()
            )
            # Without a source time, recorders write the log time or 0. Simulated stamps of
            # answers are not in the run.
            is_unmatched = part.unstamped & (is_simulated_time | (part.stamps == part.times))
            times = unstamped.get(part.topic, part.times[:0])
            unstamped[part.topic] = np.concatenate([times, part.times[is_unmatched]])
            if is_unmatched.any():
                series = series.rows(~is_unmatched)
            if part.role is Role.TICKS:
                series = self._counted_angles(key, series, poses)
            angles[part.topic].append(series)
        inputs = {}
        for topic, topic_angles in angles.items():
            inputs[topic] = _since_first_angle(self._pool.series(topic_angles, 1))
        if joint != ALL_JOINTS and len(inputs) > 1:
            inputs = self._answered(namespace, inputs, poses)
        return _Inputs(
            frozenset(inputs),
            self._pool.series([*inputs.values()], 1),
            np.concatenate([unstamped[topic] for topic in inputs]),
        )

    @staticmethod
    def _answered(
        namespace: str, inputs: dict[str, Series], poses: Mapping[LegKey, Series]
    ) -> dict[str, Series]:
        """Return the topics of a crank that a solver answers, or the first one."""
        # The others are the feedback that ros2_control receives, or publishes.
        stamps = [np.empty(0, dtype=np.int64)]
        for (leg_namespace, _), leg_poses in poses.items():
            if leg_namespace == namespace:
                stamps.append(leg_poses.stamps)
        answers = np.concatenate(stamps)
        answered = {
            topic: angles for topic, angles in inputs.items() if isin(angles.stamps, answers).any()
        }
        return answered or dict([*inputs.items()][:1])

    def _counted_angles(
        self, key: LegKey, counts: Series, poses: Mapping[LegKey, Series]
    ) -> Series:
        """
        Return the angles of counts, which overflow, as the solver computes them.

        It leaves out the whole turns of its first count, which its answers show.
        """
        namespace, joint = key
        solvers = self._definitions.crank_solvers(namespace)
        counts_per_turn = max(solver.counts_per_turn for solver in solvers)
        if not (counts_per_turn and len(counts)):
            return no_series(1)
        steps = np.diff(counts.values[:, 0])
        steps = (steps + _OVERFLOW / 2) % _OVERFLOW - _OVERFLOW / 2
        turns = np.cumsum([counts.values[0, 0], *steps]) / counts_per_turn
        first_turns = -round(turns[0])
        for (leg_namespace, name), leg_poses in poses.items():
            solver = self._definitions.solver(leg_namespace, name)
            if leg_namespace == namespace and joint in (ALL_JOINTS, solver.crank_joint):
                _, inputs, answers = np.intersect1d(
                    counts.stamps, leg_poses.stamps, return_indices=True
                )
                if len(inputs):
                    alpha = leg_poses.values[answers[0], 0]
                    angle = (alpha - solver.phase) / solver.direction
                    first_turns = round(angle / TURN - turns[inputs[0]])
        return replace(counts, values=(turns + first_turns)[:, np.newaxis] * TURN)

    def _iteration_series(self, name: str) -> Series:
        """Return the iterations of a leg; none if several solvers have one of its name."""
        end = f': {name or _UNNAMED}'
        titles = [title for title in self._iterations if title.endswith(end)]
        if len(titles) != 1:
            return no_series(1)
        log_times, iterations = zip(*self._iterations[titles[0]], strict=True)
        times = np.array(log_times, dtype=np.int64)
        return self._pool.series([Series(times, times, np.array(iterations)[:, np.newaxis])], 1)

    def drives(self, legs: Sequence[LegRecording]) -> Iterator[Drive]:
        """Yield the joints with efforts, with their legs."""
        for (namespace, joint, _), efforts in self._efforts.items():
            # Legs whose published angle it is, or else those whose input it is.
            posed_legs = []
            driven_legs = []
            for index, leg in enumerate(legs):
                if leg.namespace != namespace:
                    continue
                if leg.solver.published_joints(leg.name)[0] == joint:
                    posed_legs.append(index)
                if leg.solver.crank_joint == joint:
                    driven_legs.append(index)
            if posed_legs or driven_legs:
                drive_legs = tuple(posed_legs or driven_legs)
                yield Drive(joint, drive_legs, not posed_legs, self._pool.series(efforts, 2))


def _since_first_angle(angles: Series) -> Series:
    """Return angles since the first: ros2_control publishes NaN before the first feedback."""
    is_angle = ~np.isnan(angles.values[:, 0])
    return angles.rows(slice(int(np.argmax(is_angle)), None)) if is_angle.any() else angles


def input_joint(part: Part) -> LegKey:
    """Return the namespace and the joint of a topic with the angle or the counts of a crank."""
    if part.last_name in (STATE, 'crank_angle'):
        return part.namespace, ALL_JOINTS
    return part.namespace.rpartition('/')[0], part.last_name
