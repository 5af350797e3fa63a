"""Runs made by the real solver and the real writer, without ROS: a message is its CDR bytes."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
import math
from pathlib import Path
from typing import Any

from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.kinematics.klann.pose import JOINTS
from klann_ros.log.definitions import definition
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import SOLVER_RECORD, solver_record, SolverParameters
from klann_ros.log.writing.writer import RunWriter
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
START = 1_700_000_000_000_000_000
PERIOD = 5_000_000


def topic(name: str, kind: str) -> Topic:
    return Topic(name, kind, definition(kind))


CRANK = topic('/crank_angle', 'std_msgs/msg/Float64')
POSES = topic('/joint_states', 'sensor_msgs/msg/JointState')
FEET = topic('/point_h', 'geometry_msgs/msg/PointStamped')


def make(kind: str, **fields: Any) -> Any:
    return STORE.types[kind](**fields)


def header(stamp: int, frame: str) -> Any:
    time = make('builtin_interfaces/msg/Time', sec=stamp // 10**9, nanosec=stamp % 10**9)
    return make('std_msgs/msg/Header', stamp=time, frame_id=frame)


@dataclass
class Answer:
    """A crank angle and what was answered; all at one time, unless it says otherwise."""

    stamp: int
    alpha: float
    pose: list[float]
    foot: tuple[float, float]
    sequence: int
    header_stamp: int | None = None
    foot_stamp: int | None = None


@dataclass
class Script:
    """What a run is made of; a test changes one thing in it."""

    geometry: KlannGeometry | None = field(default_factory=KlannGeometry)
    answers: list[Answer] = field(default_factory=list)
    unanswered: list[tuple[int, float]] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    messages: list[Message] = field(default_factory=list)
    others: list['Script'] = field(default_factory=list)
    namespace: str = ''
    crank: Topic = CRANK
    poses: Topic = POSES
    feet: Topic = FEET

    def change(self, index: int, **fields: Any) -> None:
        self.answers[index] = replace(self.answers[index], **fields)

    def add_solver(self, time: int, geometry: KlannGeometry, node: str = '/solver_node') -> None:
        record = solver_record(SolverParameters(node, time, geometry.as_dict()))
        self.metadata.append((SOLVER_RECORD, record))

    def in_namespace(self, namespace: str) -> 'Script':
        """Return the run with its topics and its solver in a namespace."""
        self.namespace = namespace
        self.crank, self.poses, self.feet = (
            replace(topic, name=namespace + topic.name)
            for topic in (self.crank, self.poses, self.feet)
        )
        return self

    def by_crank_state(self) -> 'Script':
        """Return the run with a JointState as its input: it has stamps of its own."""
        self.crank = replace(POSES, name='/crank_state')
        return self


def script(geometry: KlannGeometry | None = None, turns: float = 2.0, count: int = 400) -> Script:
    """Return a healthy run of the crank."""
    leg = KlannLeg(geometry)
    made = Script(geometry=leg.geometry)
    for n in range(count):
        pose = leg.solve(0.3 + turns * 2 * math.pi * n / (count - 1))
        made.answers.append(Answer(START + n * PERIOD, pose.alpha, list(pose[:5]), pose.h, n + 1))
    return made


def write(script: Script, folder: Path) -> Path:
    with RunWriter(folder) as run:
        write_script(run, script)
    return folder


def write_script(run: RunWriter, script: Script) -> None:
    if script.geometry is not None:
        parameters = {**script.geometry.as_dict(), **script.parameters}
        node = f'{script.namespace}/solver_node'
        record = solver_record(SolverParameters(node, START, parameters))
        run.add_metadata(SOLVER_RECORD, record)
    for name, content in script.metadata:
        run.add_metadata(name, content)
    for stamp, alpha in script.unanswered:
        run.write(message(script.crank, stamp, 0, crank(script.crank, stamp, alpha)))
    for answer in script.answers:
        _write_answer(run, script, answer)
    for extra in script.messages:
        run.write(extra)
    for other in script.others:
        write_script(run, other)


def crank(topic: Topic, stamp: int, alpha: float) -> Any:
    if topic.type == CRANK.type:
        return make(CRANK.type, data=alpha)
    return joint_state(stamp, ['crank'], [alpha])


def joint_state(stamp: int, names: list[str], angles: list[float]) -> Any:
    return make(
        POSES.type,
        header=header(stamp, ''),
        name=names,
        position=np.array(angles, dtype=float),
        velocity=np.array([]),
        effort=np.array([]),
    )


def _write_answer(run: RunWriter, script: Script, answer: Answer) -> None:
    time, number = answer.stamp, answer.sequence
    stamp = time if answer.header_stamp is None else answer.header_stamp
    asked = crank(script.crank, stamp, answer.alpha)
    run.write(message(script.crank, time, number, asked))
    state = joint_state(stamp, list(JOINTS), answer.pose)
    run.write(message(script.poses, time, number, state))
    point = make('geometry_msgs/msg/Point', x=answer.foot[0], y=answer.foot[1], z=0.0)
    of_foot = header(stamp if answer.foot_stamp is None else answer.foot_stamp, 'leg_plane')
    foot = make(FEET.type, header=of_foot, point=point)
    run.write(message(script.feet, time, number, foot))


def message(topic: Topic, time: int, sequence: int, content: Any) -> Message:
    data = bytes(STORE.serialize_cdr(content, topic.type))
    return Message(topic, data, time + 200_000, time, sequence)


@pytest.fixture
def make_run(tmp_path: Path) -> Callable[[Script], Path]:
    return lambda script: write(script, tmp_path / 'run')


@pytest.fixture
def healthy() -> Script:
    return script()


@pytest.fixture
def make_script() -> Callable[..., Script]:
    return script
