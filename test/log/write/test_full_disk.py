"""A full disk: the run is closed, reports its losses, and every reader opens it."""

import os

from disk_faults import fill, result_of
from klann_ros.log.errors import LowSpaceError
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import LOSS_RECORD, topic_counts
from klann_ros.log.write.durable_file import check_free_space, free_space, RESERVE_SIZE
from klann_ros.log.write.writer import RunWriter
import pytest
from rosbags.highlevel import AnyReader


@pytest.mark.parametrize(
    ('compression', 'least', 'reason'),
    [
        ('zstd', 0, 'is full: [Errno 28] No space left on device'),
        ('none', 300_000, '0.3 MB have to stay free'),
    ],
)
def test_a_disk_filled_to_the_brim_leaves_a_run_that_is_whole(
    tmp_path, compression, least, reason
) -> None:
    disk = tmp_path / 'disk'
    disk.mkdir()
    put, counted, failure, is_whole = result_of(fill, disk, 1_000_000, compression, least)
    assert is_whole
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


def test_a_reserve_takes_space_and_has_no_name_that_a_user_could_remove(tmp_path) -> None:
    with RunWriter(tmp_path / 'run', reserve=True) as writer:
        reserve = os.fstat(writer._folder.reserve._descriptor)
        assert reserve.st_blocks * 512 >= RESERVE_SIZE
        assert {path.name for path in writer.path.iterdir()} == {'run_0.mcap', 'metadata.yaml'}


def test_too_little_space_is_reported_with_both_numbers(tmp_path) -> None:
    free = free_space(tmp_path / 'not' / 'there' / 'yet')
    check_free_space(tmp_path, 0)
    check_free_space(tmp_path, free // 2)
    with pytest.raises(LowSpaceError, match=r'MB are free on .* MB have to stay free; .*'):
        check_free_space(tmp_path, free * 2)
