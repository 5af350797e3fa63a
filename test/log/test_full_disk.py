"""A disk that is full: the run says what is missing, is closed, and every reader takes it."""

import json
import os
from pathlib import Path
import subprocess
import sys

from klann_ros.log.errors import LowSpaceError
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import LOSS_RECORD, topic_counts
from klann_ros.log.writing.disk_reserve import DiskReserve, NAME
from klann_ros.log.writing.free_space import check_free_space, free_space
from klann_ros.log.writing.writer import RunWriter
import pytest
from rosbags.highlevel import AnyReader

HERE = Path(__file__).parent
UNSHARE = ('unshare', '-rm')


def can_mount(folder):
    try:
        command = [*UNSHARE, 'mount', '-t', 'tmpfs', '-o', 'size=64k', 'none', str(folder)]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


@pytest.mark.parametrize(
    ('compression', 'least', 'reason'),
    [
        ('zstd', 0, 'is full: [Errno 28] No space left on device'),
        ('none', 0, 'is full: [Errno 28] No space left on device'),
        ('none', 300_000, '0.3 MB have to stay free'),
    ],
)
def test_a_disk_filled_to_the_brim_leaves_a_run_that_is_whole(
    tmp_path, compression, least, reason
):
    disk = tmp_path / 'disk'
    disk.mkdir()
    if not can_mount(disk):
        pytest.skip('this machine lets nobody mount a tmpfs in a user namespace')
    done = subprocess.run(
        [
            *(*UNSHARE, sys.executable, HERE / 'full_disk.py'),
            *(disk, '1000000', HERE, compression, str(least)),
        ],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
        timeout=60,
    )
    assert done.stderr == ''
    put, counted, failure, whole = json.loads(done.stdout)
    assert whole
    assert reason in failure
    run = tmp_path / 'copy'
    with open_log(run) as log:
        assert log.complete, log.problem
        messages = list(log.messages())
        (record,) = log.metadata[LOSS_RECORD]
    count = topic_counts(record)['/crank_angle']
    assert (count.received, count.written) == (put, len(messages))
    assert count.written + count.dropped == count.received
    assert counted == len(messages) > 1000
    assert [message.sequence for message in messages] == list(range(1, len(messages) + 1))
    with AnyReader([run]) as reader:
        assert reader.message_count == len(messages)
    assert not (run / NAME).exists()


def test_a_reserve_takes_space_until_it_is_given_up(tmp_path):
    reserve = DiskReserve(tmp_path)
    (path,) = tmp_path.iterdir()
    assert path.stat().st_blocks * 512 >= 256 * 1024
    reserve.hold(1_000_000)
    assert path.stat().st_blocks * 512 >= 1_000_000
    assert not reserve.helps(OSError(5, 'Input/output error'))
    assert reserve.helps(OSError(28, 'No space left on device'))
    assert list(tmp_path.iterdir()) == []
    assert not reserve.helps(OSError(28, 'No space left on device'))


def test_a_run_leaves_no_reserve_behind(tmp_path):
    with RunWriter(tmp_path / 'run', reserve=True) as writer:
        assert (writer.path / NAME).exists()
    assert not (writer.path / NAME).exists()


def test_too_little_space_is_told_with_both_numbers(tmp_path):
    free = free_space(tmp_path / 'not' / 'there' / 'yet')
    check_free_space(tmp_path, 0)
    check_free_space(tmp_path, free // 2)
    with pytest.raises(LowSpaceError, match=r'MB are free on .* MB have to stay free; .*'):
        check_free_space(tmp_path, free * 2)
