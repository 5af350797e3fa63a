"""Runs that a crash left unfinished."""

import os

from crank_runs import make_messages, write_run
from klann_ros.log.errors import RunIncompleteError
from klann_ros.log.write.run_folder import unfinished_runs
from klann_ros.log.write.writer import RunWriter
import pytest


def leave(run):
    """Cut off the end of a run's last file, as a kill does."""
    path = max(run.glob('*.mcap'))
    path.write_bytes(path.read_bytes()[:-30])


def test_a_run_that_was_left_is_named_and_one_in_hand_is_not(tmp_path) -> None:
    left, whole_run, in_hand, recovered = (tmp_path / name for name in ('a', 'b', 'c', 'd'))
    for folder in (left, whole_run, recovered):
        write_run(folder, [make_messages(5)])
    for folder in (left, recovered):
        leave(folder)
    write_run(tmp_path / 'd_recovered', [])
    (tmp_path / 'other').mkdir()
    (tmp_path / 'other' / 'x.mcap').write_text('no log')
    writer = RunWriter(in_hand)
    assert unfinished_runs(tmp_path) == [left]
    writer.close()
    assert unfinished_runs(tmp_path) == [left]
    assert unfinished_runs(tmp_path / 'nowhere') == []


def test_a_run_in_hand_is_not_left_whatever_became_of_its_earlier_files(tmp_path) -> None:
    with pytest.raises(RunIncompleteError), RunWriter(tmp_path / 'run') as writer:
        writer.write(make_messages(1)[0])
        writer.split()
        (writer.path / 'run_0.mcap').write_bytes(b'')
        assert unfinished_runs(tmp_path) == []
    assert unfinished_runs(tmp_path) == [tmp_path / 'run']


def test_special_files_neither_block_nor_hide_an_unfinished_run(tmp_path) -> None:
    left = tmp_path / 'left'
    write_run(left, [make_messages(5)])
    leave(left)
    os.mkfifo(left / 'a.mcap')
    (left / 'b.mcap').mkdir()
    (left / '.copy.mcap').write_bytes(b'')
    (left / 'c.mcap').symlink_to('c.mcap')
    whole_run = tmp_path / 'whole'
    write_run(whole_run, [])
    os.mkfifo(whole_run / 'a.mcap')
    (whole_run / '.copy.mcap').write_bytes(b'')
    assert unfinished_runs(tmp_path) == [left]
