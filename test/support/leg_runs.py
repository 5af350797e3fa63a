"""Runs of any legs by the real solver and the real writer, without ROS: messages as CDR."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
import math
from pathlib import Path
from typing import Any

from klann_ros.kinematics import AnyLeg as Leg, KlannLeg
from klann_ros.log.definitions import definition
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import SOLVER_RECORD, solver_record, SolverParameters
from klann_ros.log.write.writer import RunWriter
import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
START = 1_700_000_000_000_000_000
FLOAT = 'std_msgs/msg/Float64'
STATE, POINT = 'sensor_msgs/msg/JointState', 'geometry_msgs/msg/PointStamped'
REPORT = 'diagnostic_msgs/msg/DiagnosticArray'


@cache
def topic_of(name: str, kind: str) -> Topic:
    """Return a topic; its definition is looked for once."""
    return Topic(name, kind, definition(kind))


@dataclass
class LegRun:
    """A run of legs whose crank turns evenly."""

    # By their names; '' is the unnamed one.
    legs: Mapping[str, Leg] = field(default_factory=lambda: {'': KlannLeg()})
    # Of named legs, from the crank's angle [rad].
    phases: Mapping[str, float] = field(default_factory=dict)
    # The solver's; None for a run without them. And those since the n-th message.
    parameters: Mapping[str, Any] | None = None
    later: tuple[int, Mapping[str, Any]] | None = None
    # First angle of the crank [rad], its turns, time between messages [s], number of messages.
    start: float = 0.0
    turns: float = 2.0
    period: float = 0.005
    count: int = 400
    # Whether the run has inputs, velocities, poses, and reports of the solver.
    cranks: bool = False
    rates: bool = True
    poses: bool = True
    iterations: bool = True
    namespace: str = ''
    # A message, and the length of the gap before it [s].
    pause: tuple[int, float] | None = None
    # A value in place of all numbers of a message.
    garbled: Mapping[int, float] = field(default_factory=dict)
    # Of named legs: 1 as the crank turns, or -1.
    directions: Mapping[str, float] = field(default_factory=dict)

    def write(self, folder: Path, compression: str = 'zstd') -> Path:
        with RunWriter(folder, compression=compression) as run:
            for time, parameters in self._records():
                node = f'{self.namespace}/solver_node'
                record = SolverParameters(node, time, dict(parameters))
                run.add_metadata(SOLVER_RECORD, solver_record(record))
            for message in self.messages():
                run.write(message)
        return folder

    def messages(self) -> Iterator[Message]:
        """Yield all messages, in the order of time."""
        for number in range(self.count):
            yield from self._messages(number)

    def crank(self, number: int) -> float:
        """Return the angle of the crank in the n-th message [rad]."""
        return self.start + math.tau * self.turns * number / (self.count - 1)

    def alpha(self, number: int, name: str = '') -> float:
        """Return a leg's crank angle in the n-th message [rad]."""
        return self.directions.get(name, 1.0) * self.crank(number) + self.phases.get(name, 0.0)

    def _records(self) -> Iterator[tuple[int, Mapping[str, Any]]]:
        if self.parameters is not None:
            yield START, self.parameters
        if self.later is not None:
            number, parameters = self.later
            yield START + round(number * self.period * 1e9), parameters

    def _messages(self, number: int) -> list[Message]:
        time = START + round(number * self.period * 1e9)
        if self.pause is not None and number >= self.pause[0]:
            time += round(self.pause[1] * 1e9)
        rate = math.tau * self.turns / (self.period * (self.count - 1))
        names: list[str] = []
        positions: list[float] = []
        velocities: list[float] = []
        messages = []
        if self.cranks:
            angle = filled(FLOAT, {'data': self.crank(number)})
            messages.append(self._message('/crank_angle', FLOAT, time, number, angle))
        for name, leg in self.legs.items():
            pose = leg.solve(self.alpha(number, name))
            h = [self.garbled[number]] * 2 if number in self.garbled else pose.h
            names += [f'{name}/{joint}' if name else joint for joint in leg.joint_names]
            positions += pose.joints
            leg_rate = self.directions.get(name, 1.0) * rate
            velocities += (leg_rate * np.array([1.0, *pose.coefficients])).tolist()
            topic = f'/{name}/point_h' if name else '/point_h'
            messages.append(self._message(topic, POINT, time, number, foot_at(time, h)))
        if number in self.garbled:
            positions = velocities = [self.garbled[number]] * len(positions)
        if self.poses:
            state = joint_state(time, names, positions, velocities if self.rates else ())
            messages.append(self._message('/joint_states', STATE, time, number, state))
        if self.iterations and number % 40 == 0:
            report = self._report(time, number)
            messages.append(self._message('/diagnostics', REPORT, time, number // 40, report))
        return messages

    def _message(self, name: str, kind: str, time: int, number: int, content: Any) -> Message:
        data = bytes(STORE.serialize_cdr(content, kind))
        late = 150_000 + 20_000 * (number % 7)
        topic = topic_of(self.namespace + name, kind)
        return Message(topic, data, time + late, time, number + 1)

    def _report(self, time: int, number: int) -> Any:
        common = {
            'message': 'solving',
            'values': [{'key': 'iterations', 'value': str(3 + number % 3)}],
        }
        statuses = [common | {'name': f'solver_node: {name or "leg"}'} for name in self.legs]
        return filled(REPORT, {'header': leg_header(time), 'status': statuses})


def make(kind: str, **fields: Any) -> Any:
    return STORE.types[kind](**fields)


def filled(kind: str, content: Mapping[str, Any]) -> Any:
    """Return a message of nested content; what it leaves out is 0 or empty."""
    fields: dict[str, Any] = {}
    for name, (node, description) in STORE.fielddefs[kind][1]:
        if node == Nodetype.NAME:
            fields[name] = filled(description, content.get(name, {}))
        elif node == Nodetype.BASE:
            fields[name] = content.get(name, '' if description[0] == 'string' else 0)
        else:
            (element_node, element_kind), length = description
            elements = content.get(name, ())
            if element_node == Nodetype.NAME:
                fields[name] = [filled(element_kind, element) for element in elements]
            elif element_kind[0] == 'string':
                fields[name] = [*elements]
            else:
                array = elements if len(elements) else [0] * length
                fields[name] = np.array(array, dtype=element_kind[0])
    return STORE.types[kind](**fields)


def stamp_fields(time: int) -> dict[str, int]:
    return {'sec': time // 10**9, 'nanosec': time % 10**9}


def leg_header(time: int) -> dict[str, Any]:
    return {'stamp': stamp_fields(time), 'frame_id': 'leg_plane'}


def joint_state(
    time: int, names: Sequence[str], positions: Any, velocities: Any = (), efforts: Any = ()
) -> Any:
    numbers = {'position': positions, 'velocity': velocities, 'effort': efforts}
    return filled(STATE, {'header': leg_header(time), 'name': names, **numbers})


def foot_at(time: int, h: Sequence[float]) -> Any:
    return filled(POINT, {'header': leg_header(time), 'point': {'x': h[0], 'y': h[1]}})
