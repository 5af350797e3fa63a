"""Runs made by the real solver and the real writer, without ROS: a message is its CDR bytes."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
import math
from pathlib import Path
from typing import Any

from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.log.definitions import definition
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import SOLVER_RECORD, solver_record
from klann_ros.log.writer import RunWriter
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
START = 1_700_000_000_000_000_000
PERIOD = 5_000_000
JOINTS = ['alpha', 'gamma', 'beta', 'delta', 'theta']


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
    """A crank angle and what was answered."""

    stamp: int
    alpha: float
    pose: list[float]
    foot: tuple[float, float]
    sequence: int


@dataclass
class Script:
    """What a run is made of; a test changes one thing in it."""

    geometry: KlannGeometry | None = field(default_factory=KlannGeometry)
    answers: list[Answer] = field(default_factory=list)
    unanswered: list[tuple[int, float]] = field(default_factory=list)

    def change(self, index: int, **fields: Any) -> None:
        self.answers[index] = replace(self.answers[index], **fields)


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
        if script.geometry is not None:
            run.add_metadata(
                SOLVER_RECORD, solver_record('/solver_node', script.geometry.as_dict())
            )
        for stamp, alpha in script.unanswered:
            run.write(_message(CRANK, stamp, 0, make(CRANK.type, data=alpha)))
        for answer in script.answers:
            _write_answer(run, answer)
    return folder


def _write_answer(run: RunWriter, answer: Answer) -> None:
    stamp, number = answer.stamp, answer.sequence
    run.write(_message(CRANK, stamp, number, make(CRANK.type, data=answer.alpha)))
    state = make(
        POSES.type,
        header=header(stamp, ''),
        name=JOINTS,
        position=np.array(answer.pose),
        velocity=np.array([]),
        effort=np.array([]),
    )
    run.write(_message(POSES, stamp, number, state))
    point = make('geometry_msgs/msg/Point', x=answer.foot[0], y=answer.foot[1], z=0.0)
    foot = make(FEET.type, header=header(stamp, 'leg_plane'), point=point)
    run.write(_message(FEET, stamp, number, foot))


def _message(topic: Topic, stamp: int, sequence: int, content: Any) -> Message:
    data = bytes(STORE.serialize_cdr(content, topic.type))
    return Message(topic, data, stamp + 200_000, stamp, sequence)


@pytest.fixture
def make_run(tmp_path: Path) -> Callable[[Script], Path]:
    return lambda script: write(script, tmp_path / 'run')


@pytest.fixture
def healthy() -> Script:
    return script()


@pytest.fixture
def make_script() -> Callable[..., Script]:
    return script
