"""A small file, whatever is in it, does not ask for more than 200 MB, nor for ever."""

import json
from pathlib import Path
import random
import struct

import fork_server
from klann_ros.log.definitions import definition
from klann_ros.log.errors import NotALogError
from klann_ros.log.mcap import decompression
from klann_ros.log.mcap.decompression import MIN_LIMIT
from klann_ros.log.reader import open_log
from klann_ros.log.records import Message, Topic
from klann_ros.log.recovery import recover
from klann_ros.log.write.writer import RunWriter
from klann_ros.review.reviewing import review_run
from mcap_bytes import records as mcap
from mcap_bytes.hostile import file_of_chunks, HEADER, named_often, overlapping, packed_chunk
import pytest
import zstandard

pytestmark = pytest.mark.skipif(
    not Path('/proc/self/status').exists(), reason='the peak is read from /proc'
)

MB = 2**20


def topic(name, kind, schema):
    return mcap.schema(1, kind, 'ros2msg', schema) + mcap.channel(1, 1, name, 'cdr', {})


def message(data):
    return mcap.message(1, 1, 1, 1, data)


def log(data, crc=None):
    return HEADER + packed_chunk(data, crc=crc)


def crank(data):
    kind = 'std_msgs/msg/Float64'
    return log(topic('/crank_angle', kind, definition(kind)) + data)


EMPTY = b'E[] name\n' + b'=' * 80 + b'\nMSG: sensor_msgs/E\n'
ALL = 'recover', 'review', 'play'
# Each file, and the jobs that it aims at. Just enough chunks for more than 200 MB if
# all were held at once.
BOMBS = {
    'one big message': (lambda: crank(message(bytes(MIN_LIMIT - MB))), ALL),
    'more than the limit with a false CRC': (
        lambda: log(message(bytes(5 * MIN_LIMIT)), crc=1),
        ['recover'],
    ),
    'a message of empty objects': (
        lambda: log(
            topic('/joint_states', 'sensor_msgs/msg/JointState', EMPTY)
            + message(b'\0\1\0\0\xff\xff\xff\xff' + bytes(30 * MB))
        ),
        ['review'],
    ),
    'packed messages': (
        lambda: crank(message(zstandard.compress(bytes(MIN_LIMIT - MB))) * 5),
        ALL,
    ),
    'many descriptions': (
        lambda: log(b''.join(mcap.channel(n % 65536, 0, str(n), '', {}) for n in range(70_000))),
        ['review'],
    ),
    'many chunks of zeros': (lambda: file_of_chunks('zeros', 38 * MB, 12), ['recover']),
    'an index that names an attachment often': (lambda: named_often(5000), ['recover']),
    'chunks that overlap in time': (lambda: overlapping(10, 30 * MB), ['play']),
    'chunks that overlap though the index denies it': (
        lambda: overlapping(10, 30 * MB, honest=False),
        ['play'],
    ),
    'heads in heads': (
        lambda: (
            log(b'')
            + b'\xff' * 20
            + b''.join(
                struct.pack('<BQQQQII', 6, 53 * left - 9, 0, 0, 5, 1, 4)
                + b'zstd'
                + struct.pack('<Q', 53 * (left - 1))
                for left in range(10_000, 0, -1)
            )
        ),
        ['recover'],
    ),
}


# They take seconds of computing each.
SLOW = {'many descriptions', 'packed messages'}
# Prints a job's result, the memory it took over what was there [bytes], and what it said.
MEASURE = """
from contextlib import redirect_stderr, redirect_stdout
import io, json, sys
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import main as recover
from klann_ros.review.command import main as review
def play(arguments):
    with open_log(*arguments) as log:
        return sum(1 for _ in log.messages(start=log.start_time))
def peak():
    return int(open('/proc/self/status').read().split('VmHWM:')[1].split()[0]) * 1024
job, *arguments = sys.argv[1:]
before, said = peak(), io.StringIO()
with redirect_stdout(said), redirect_stderr(said):
    result = {'play': play, 'recover': recover, 'review': review}[job](arguments)
print(json.dumps([result, peak() - before, said.getvalue()]))
"""


def run(job, path):
    """Run a job on a file in a process with a peak of its own."""
    output = ['-o', f'{path}.out'] if job == 'recover' else []
    code = fork_server.PYTHON, '-c', MEASURE
    done = fork_server.called(*code, job, path, *output, patience=120.0)
    assert done.stderr == ''
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    'bomb',
    [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in BOMBS],
)
def test_a_small_file_takes_less_than_200_mb(bomb, tmp_path) -> None:
    make, jobs = BOMBS[bomb]
    (tmp_path / 'x.mcap').write_bytes(make())
    used = {job: run(job, tmp_path / 'x.mcap')[1] for job in jobs}
    assert max(used.values()) < 200 * MB, used


@pytest.fixture(scope='module')
def grid(tmp_path_factory):
    """Return a run of a map of 7000 x 7000 unknown cells: some kilobytes, packed."""
    kind = 'nav_msgs/msg/OccupancyGrid'
    path = tmp_path_factory.mktemp('grid') / 'run'
    with RunWriter(path) as writer:
        topic = Topic(name='/map', type=kind, definition=definition(kind))
        writer.write(Message(topic, b'\0\1\0\0' + bytes(49_000_000), 10**9, 10**9, 0))
    return path


@pytest.mark.parametrize('job', ['recover', 'review'])
def test_a_large_message_that_the_recorder_packed_well_is_read(grid, job) -> None:
    _, used, said = run(job, grid)
    assert used > 49_000_000
    assert 'damaged' not in said
    assert 'refused' not in said
    if job == 'recover':
        assert 'kept: 1 message in all' in said


@pytest.mark.slow
@pytest.mark.parametrize(('size', 'compressible'), [(39, True), (41, True), (41, False)])
def test_recorded_messages_are_read_up_to_the_memory_limit(
    size, compressible, tmp_path, monkeypatch
) -> None:
    """Around 40 MB a chunk needs a proof of its size; the limit is an eighth of the memory."""
    block = bytes(MB) if compressible else random.Random(2).randbytes(MB)  # noqa: S311
    kind = 'std_msgs/msg/UInt8MultiArray'
    topic = Topic(name='/large', type=kind, definition=definition(kind))
    with RunWriter(tmp_path / 'run', compression='lz4') as writer:
        writer.write(Message(topic, block * size, 1, 1, 0))
    # The chunk holds the heads of three records beside the message.
    with_room, without = 8 * (size * MB + 10_000), 8 * (size * MB - 1)
    for memory in (with_room, without):
        monkeypatch.setattr(decompression, 'available_memory', lambda memory=memory: memory)
        fits = memory == with_room or size * MB < MIN_LIMIT
        with open_log(tmp_path / 'run') as opened:
            sizes = [len(message.data) for message in opened.messages()]
            assert sizes == ([size * MB] if fits else []), opened.problem
            assert ('refused: ' in opened.problem) == (not fits)
            assert 'damaged' not in opened.problem


def test_a_chunk_above_the_memory_limit_is_refused(tmp_path, grid, monkeypatch) -> None:
    monkeypatch.setattr(decompression, 'available_memory', lambda: 0)
    refusal = 'refused: 49 MB unpacked, above the limit of 42 MB'
    with open_log(grid) as opened:
        assert list(opened.messages()) == []
        assert refusal in opened.problem
    (finding,) = (one.text for one in review_run(grid).findings if refusal in one.text)
    assert finding.startswith('part of the log is refused')
    with pytest.raises(NotALogError, match=refusal):
        recover(grid, tmp_path / 'again')
