"""What crashes leave: which runs are named as unfinished, and what may go."""

import os
from pathlib import Path
from types import ModuleType

from klann_ros.log.errors import RunHarmedError
from klann_ros.log.write.unfinished import remove_old_reserves, unfinished_runs
from klann_ros.log.write.writer import RunWriter
import pytest

# Of an old reserve [bytes].
SIZE = 256 * 1024


def leave(run):
    """Cut off the end of a run's last file, as a kill does."""
    path = max(run.glob('*.mcap'))
    path.write_bytes(path.read_bytes()[:-30])


def test_a_run_that_was_left_is_named_and_one_in_hand_is_not(
    tmp_path: Path, runs: ModuleType
) -> None:
    left, whole, in_hand, recovered = (tmp_path / name for name in ('a', 'b', 'c', 'd'))
    for folder in (left, whole, recovered):
        runs.write_run(folder, [runs.make_messages(5)])
    for folder in (left, recovered):
        leave(folder)
    runs.write_run(tmp_path / 'd_recovered', [])
    (tmp_path / 'other').mkdir()
    (tmp_path / 'other' / 'x.mcap').write_text('no log')
    writer = RunWriter(in_hand)
    assert unfinished_runs(tmp_path) == [left]
    writer.close()
    assert unfinished_runs(tmp_path) == [left]
    assert unfinished_runs(tmp_path / 'nowhere') == []


def test_a_run_in_hand_is_not_left_whatever_became_of_its_earlier_files(
    tmp_path: Path, runs: ModuleType
) -> None:
    with pytest.raises(RunHarmedError), RunWriter(tmp_path / 'run') as writer:
        writer.write(runs.make_messages(1)[0])
        writer.split()
        (writer.path / 'run_0.mcap').write_bytes(b'')
        assert unfinished_runs(tmp_path) == []
    assert unfinished_runs(tmp_path) == [tmp_path / 'run']


def test_what_is_no_plain_file_holds_nobody_up_and_hides_nothing(
    tmp_path: Path, runs: ModuleType
) -> None:
    left = tmp_path / 'left'
    runs.write_run(left, [runs.make_messages(5)])
    leave(left)
    os.mkfifo(left / 'a.mcap')
    (left / 'b.mcap').mkdir()
    (left / '.copy.mcap').write_bytes(b'')
    (left / 'c.mcap').symlink_to('c.mcap')
    whole = tmp_path / 'whole'
    runs.write_run(whole, [])
    os.mkfifo(whole / 'a.mcap')
    (whole / '.copy.mcap').write_bytes(b'')
    assert unfinished_runs(tmp_path) == [left]


@pytest.mark.parametrize('is_recovered', [True, False])
def test_an_old_reserve_of_a_run_that_was_left_goes(
    tmp_path: Path, runs: ModuleType, is_recovered
) -> None:
    for name in ('left', 'whole'):
        runs.write_run(tmp_path / name, [runs.make_messages(5)])
        (tmp_path / name / '.reserve').write_bytes(bytes(SIZE + 5000))
    leave(tmp_path / 'left')
    if is_recovered:
        runs.write_run(tmp_path / 'left_recovered', [])
    with RunWriter(tmp_path / 'in hand') as writer:
        (writer.path / '.reserve').write_bytes(bytes(SIZE))
        remove_old_reserves(tmp_path)
    kept = {path.parent.name for path in tmp_path.glob('*/.reserve')}
    assert kept == {'whole', 'in hand'}


def test_what_only_has_the_name_of_a_reserve_stays(tmp_path: Path, runs: ModuleType) -> None:
    makers = {
        'small': lambda path: path.write_bytes(bytes(SIZE - 1)),
        'content': lambda path: path.write_bytes(bytes(SIZE) + b'mine'),
        'folder': lambda path: path.mkdir(),
        'pipe': os.mkfifo,
        'link': lambda path: path.symlink_to(tmp_path / 'target'),
        'large': lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_WRONLY), 2**40),
    }
    (tmp_path / 'target').write_bytes(bytes(SIZE))
    for name, make in makers.items():
        runs.write_run(tmp_path / name, [runs.make_messages(5)])
        leave(tmp_path / name)
        make(tmp_path / name / '.reserve')
    remove_old_reserves(tmp_path)
    assert {path.parent.name for path in tmp_path.glob('*/.reserve')} == set(makers)
    assert (tmp_path / 'target').exists()
