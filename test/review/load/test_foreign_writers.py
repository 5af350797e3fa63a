"""A healthy run that another program wrote is judged as the original, by what is in the bag."""

from collections.abc import Callable, Iterator
from dataclasses import replace
import math
from pathlib import Path
from types import MappingProxyType
from typing import Any

from klann_ros.kinematics import KlannGeometry
from klann_ros.log.definitions import definition
from klann_ros.log.reader import open_log
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import leg_description, SolverParameters
from klann_ros.log.write.writer import RunWriter
from klann_ros.review.model.review import Review
from klann_ros.review.reviewing import review_run
from leg_runs import filled, joint_state, LegRun, START, STATE, STORE, topic_of
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as Ros2Writer
import numpy as np
import pytest
from rosbags.convert.converter import convert
from rosbags.rosbag2 import StoragePlugin, Writer as BagWriter
from type_definitions import idl_definition
from walk_runs import Walking

STRING = 'std_msgs/msg/String'
COUNTS_PER_TURN = 4096
TICKS = MappingProxyType({'crank_state_type': 'ticks', 'counts_per_turn': float(COUNTS_PER_TURN)})


class CountedRun(LegRun):
    """A leg whose encoder counts."""

    def crank(self, number: int) -> float:
        return counted(super().crank(number)) / COUNTS_PER_TURN * math.tau


class SinglePrecisionRun(LegRun):
    """A leg whose crank's angle has single precision."""

    def crank(self, number: int) -> float:
        return float(np.float32(super().crank(number)))


def counted(angle: float) -> int:
    return round(angle / math.tau * COUNTS_PER_TURN)


def described(parameters: dict[str, Any]) -> Message:
    """Return the message with which a solver describes its leg."""
    solver = SolverParameters('/solver_node', START, parameters)
    content = filled(STRING, {'data': leg_description(solver)})
    data = bytes(STORE.serialize_cdr(content, STRING))
    return Message(topic_of('/leg_description', STRING), data, START + 1000, START, 1)


def solver_run(
    run: LegRun, kind: str, name: str, content: Callable[[int, float], Any], **parameters: Any
) -> Iterator[Message]:
    """Yield a run with its inputs as messages of a type."""
    yield described({**KlannGeometry().as_dict(), **parameters})
    for message in run.messages():
        if message.topic.name == '/crank_angle':
            angle = content(message.publish_time, run.crank(message.sequence - 1))
            data = bytes(STORE.serialize_cdr(angle, kind))
            yield replace(message, topic=topic_of(name, kind), data=data)
        else:
            yield message


def by_joint_states() -> Iterator[Message]:
    def state(time: int, angle: float) -> Any:
        return joint_state(time, ['crank'], [angle])

    return solver_run(LegRun(cranks=True), STATE, '/crank_state', state)


def by_single_precision() -> Iterator[Message]:
    kind = 'std_msgs/msg/Float32'
    run = SinglePrecisionRun(cranks=True)
    return solver_run(run, kind, '/crank_angle', lambda _, angle: filled(kind, {'data': angle}))


def by_counts() -> Iterator[Message]:
    """Return a run whose encoder has counted for long, and overflows."""
    kind = 'std_msgs/msg/Int32'

    def count(_: int, angle: float) -> Any:
        start = 2**31 - COUNTS_PER_TURN
        return filled(kind, {'data': (counted(angle) + start + 2**31) % 2**32 - 2**31})

    return solver_run(CountedRun(cranks=True), kind, '/crank_state', count, **TICKS)


def walk() -> Iterator[Message]:
    """Return a walk, without the poses of its legs."""
    return Walking(scale=1.01).messages()


def calibration() -> Iterator[Message]:
    """Return a crank that turns, and the foot as a camera measures it."""
    for message in by_joint_states():
        name = message.topic.name
        if name == '/crank_state':
            yield message
        elif name == '/point_h':
            yield replace(message, topic=replace(message.topic, name='/mocap/h'))


SOLVED = [by_joint_states, by_single_precision, by_counts]
RUNS = [*SOLVED, walk, calibration]


def as_run(run: Path, _: Path) -> Path:
    return run


def by_rosbags_convert(storage: str, mode: str) -> Callable[[Path, Path], Path]:
    def write(run: Path, folder: Path) -> Path:
        compression = 'zstd' if mode else None
        convert([run], folder, storage, 9, compression, mode or 'file', None, None, (), (), (), ())
        return folder

    return write


def by_rosbags(storage: StoragePlugin) -> Callable[[Path, Path], Path]:
    """Return what writes with the definitions that rosbags makes of its own types."""

    def write(run: Path, folder: Path) -> Path:
        connections: dict[str, Any] = {}
        with BagWriter(folder, version=8, storage_plugin=storage) as bag, open_log(run) as log:
            for message in log.messages():
                topic = message.topic
                if topic.name not in connections:
                    connection = bag.add_connection(topic.name, topic.type, typestore=STORE)
                    connections[topic.name] = connection
                bag.write(connections[topic.name], message.log_time, message.data)
        return folder

    return write


def by_mcap_ros2(run: Path, folder: Path) -> Path:
    """Write messages that were read by mcap-ros2-support, with it."""
    path = folder.with_suffix('.mcap')
    with path.open('wb') as file, open_log(run) as log:
        writer = Ros2Writer(file)
        schemas = {}
        decoders = {}
        for message in log.messages():
            kind = message.topic.type
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(kind, message.topic.definition)
                decoders[kind] = DecoderFactory().decoder_for('cdr', schemas[kind])
            content = decoders[kind](message.data)
            times = message.log_time, message.publish_time
            writer.write_message(message.topic.name, schemas[kind], content, *times)
        writer.finish()
    return path


def by_mcap(encoding: str, define: Callable[[str], str]) -> Callable[[Path, Path], Path]:
    """Return what writes with the MCAP library, and a schema of some encoding."""

    def write(run: Path, folder: Path) -> Path:
        path = folder.with_suffix('.mcap')
        with path.open('wb') as file, open_log(run) as log:
            writer = Writer(file)
            writer.start()
            channels: dict[str, int] = {}
            for message in log.messages():
                name = message.topic.name
                if name not in channels:
                    kind = message.topic.type
                    schema = writer.register_schema(kind, encoding, define(kind).encode())
                    channels[name] = writer.register_channel(name, 'cdr', schema)
                writer.add_message(
                    channels[name], message.log_time, message.data, message.publish_time
                )
            writer.finish()
        return path

    return write


WRITERS = {
    'klann_ros': as_run,
    'rosbags-convert mcap': by_rosbags_convert('mcap', ''),
    'rosbags-convert mcap message': by_rosbags_convert('mcap', 'message'),
    'rosbags-convert sqlite3': by_rosbags_convert('sqlite3', ''),
    'rosbags-convert sqlite3 file': by_rosbags_convert('sqlite3', 'file'),
    'rosbags mcap': by_rosbags(StoragePlugin.MCAP),
    'rosbags sqlite3': by_rosbags(StoragePlugin.SQLITE3),
    'mcap-ros2-support': by_mcap_ros2,
    'mcap ros2msg': by_mcap('ros2msg', definition),
    'mcap ros2idl': by_mcap('ros2idl', idl_definition),
    'mcap without schemas': by_mcap('ros2msg', lambda _: ''),
    'mcap without encoding': by_mcap('', lambda _: ''),
}


@pytest.fixture(scope='module', params=RUNS, ids=lambda messages: messages.__name__)
def original(request: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a run with all that is known of it in its messages."""
    folder = tmp_path_factory.mktemp('original') / 'run'
    messages = sorted(request.param(), key=lambda message: message.log_time)
    with RunWriter(folder) as run:
        for message in messages:
            run.write(message)
    return folder


@pytest.fixture(scope='module')
def judged(original: Path) -> dict[str, Any]:
    return judgement(review_run(original))


def judgement(review: Review) -> dict[str, Any]:
    """Return what must not depend on the writer: NaN is like NaN as text."""
    return {
        'legs': [repr(leg.figures) for leg in review.legs],
        'walks': [repr(replace(walk, odometry_time=0)) for walk in review.walks],
        'is_healthy': review.is_healthy,
        'findings': [finding.text for finding in review.findings],
        'poses': [len(leg.recording.poses) for leg in review.legs],
        'iterations': [leg.recording.iterations.values.tolist() for leg in review.legs],
        'measured': {name: len(points) for name, points in review.recording.measured.items()},
        'sources': [leg.recording.solver.source for leg in review.legs],
    }


@pytest.mark.parametrize('writer', WRITERS.values(), ids=WRITERS)
def test_the_writer_of_a_bag_changes_no_verdict(
    writer: Callable[[Path, Path], Path], original: Path, judged: dict[str, Any], tmp_path: Path
) -> None:
    assert judged['is_healthy']
    assert judgement(review_run(writer(original, tmp_path / 'bag'))) == judged


@pytest.mark.parametrize('original', SOLVED, indirect=True, ids=lambda run: run.__name__)
def test_inputs_of_any_type_are_held_against_their_answers(original: Path) -> None:
    (leg,) = review_run(original).legs
    assert (leg.answers.asked, leg.answers.count) == (400, 400)
    assert leg.recording.iterations.values[:, 0].tolist() == [3 + 40 * n % 3 for n in range(10)]
    assert np.array_equal(leg.recording.cranks.values[:, 0], leg.recording.poses.values[:, 0])
