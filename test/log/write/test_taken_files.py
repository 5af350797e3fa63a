"""Files that somebody takes away while they are written: noticed, counted truly, done without."""

from contextlib import suppress
import os
from pathlib import Path
import re
import shutil
from types import ModuleType

from klann_ros.log.errors import RunHarmedError
from klann_ros.log.reader import open_log
from klann_ros.log.recovery import recover
from klann_ros.log.write import file_watch
from klann_ros.log.write.file_watch import FileWatch
from klann_ros.log.write.mcap_file import McapFile
from klann_ros.log.write.writer import RunWriter
import pytest
from taken_away import HARMS, listed, Run


@pytest.fixture
def run(runs: ModuleType, tmp_path: Path):
    return Run(runs, tmp_path / 'run')


@pytest.mark.parametrize('name', HARMS)
def test_what_takes_the_file_away_costs_what_was_in_it_and_no_more(run, name) -> None:
    harm, said = HARMS[name]
    run.write(10)
    harm(run.file())
    run.writer.look()
    assert len(run.errors) == 1
    assert said in run.errors[0]
    what, _, where = run.errors[0].rpartition('; the recording goes on in ')
    assert where == 'run_1.mcap'
    assert run.writer.faults.lasting == (what,)
    assert listed(run.folder) == ['run_1.mcap']
    run.write(7)
    assert run.close() == (7, 10)
    assert len(run.errors) == 1


@pytest.mark.parametrize('name', HARMS)
def test_what_is_written_before_anybody_looks_is_counted_as_well(run, name) -> None:
    run.write(10)
    HARMS[name][0](run.file())
    run.write(7)
    run.write(3)
    assert run.close() == (3, 17)


@pytest.mark.parametrize('name', HARMS)
def test_what_takes_the_file_away_before_the_end_is_found_at_the_end(run, name) -> None:
    run.write(10)
    HARMS[name][0](run.file())
    assert run.close() == (0, 10)
    assert listed(run.folder) == ['run_1.mcap']


@pytest.mark.parametrize('name', HARMS)
def test_what_takes_a_finished_file_away_costs_what_was_in_it(run, name) -> None:
    for _ in range(3):
        run.write(10).writer.split()
    HARMS[name][0](run.file(0))
    run.write(4)
    for _ in range(3):
        run.writer.look()
    assert listed(run.folder) == ['run_1.mcap', 'run_2.mcap', 'run_3.mcap']
    HARMS[name][0](run.file(1))
    assert run.close() == (14, 20)
    assert len(run.errors) == 2
    assert 'finished run_0.mcap went, or were spoilt, with 10 messages' in run.errors[0]


def test_what_is_left_of_a_file_that_was_cut_off_is_recovered(run, tmp_path: Path) -> None:
    run.write(10)
    size = run.file().stat().st_size
    run.write(10)
    os.truncate(run.file(), size + 20)
    run.write(10)
    run.write(5)
    assert run.close() == (5, 30)
    (path,) = re.findall(r'`recover (\S+)`', run.errors[0])
    recovery = recover(path, tmp_path / 'again')
    assert recovery.messages == 20  # the first ten, and those behind the hole
    assert recovery.lost
    assert recover(run.folder, tmp_path / 'run again').messages == 5


@pytest.mark.parametrize('ends', [RunWriter.close, RunWriter.split])
def test_what_is_cut_off_while_the_end_is_written_is_noticed(
    run, monkeypatch: pytest.MonkeyPatch, ends
) -> None:
    finish = McapFile.finish

    def cut_and_finish(file):
        os.truncate(run.file(), 100)
        monkeypatch.undo()
        finish(file)

    run.write(10)
    monkeypatch.setattr(McapFile, 'finish', cut_and_finish)
    with suppress(RunHarmedError):
        ends(run.writer)
    assert 'run_0.mcap was cut off or overwritten' in run.errors[0]
    with suppress(RunHarmedError):
        run.writer.close()
    fate = run.writer.fate()
    assert (fate.written.total(), fate.gone.total()) == (0, 10)


def test_what_the_disk_refuses_and_somebody_takes_away_is_counted_once(
    run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_):
        raise OSError(5, 'Input/output error')

    run.write(10)
    run.writer.write(next(run._messages))
    monkeypatch.setattr(os, 'write', refuse)
    with pytest.raises(OSError, match='Input/output error'):
        run.writer.flush()
    monkeypatch.undo()
    assert run.writer.fate().written.total() == 10
    run.file().unlink()
    with pytest.raises(OSError, match='Input/output error'):
        run.writer.close()
    assert 'run_0.mcap was removed while it was recorded' in run.errors[0]
    fate = run.writer.fate()
    assert (fate.written.total(), fate.gone.total()) == (0, 11)
    assert listed(run.folder) == []


def test_a_file_that_was_moved_is_whole_where_it_is_and_not_in_the_run(
    run, tmp_path: Path
) -> None:
    run.write(10)
    run.writer.write(next(run._messages))
    run.file().rename(tmp_path / 'kept.mcap')
    run.writer.look()
    assert f'its 11 messages went to {tmp_path}/kept.mcap, and are not in the' in run.errors[0]
    with open_log(tmp_path / 'kept.mcap') as log:
        assert log.complete, log.problem
        assert len(list(log.messages())) == 11
    run.write(5)
    assert run.close() == (5, 11)


@pytest.mark.parametrize('name', ['run_1.mcap', 'run_9.mcap', 'kept.mcap', 'run_x.mcap'])
def test_whatever_a_file_is_renamed_to_nothing_is_overwritten_or_counted_twice(run, name) -> None:
    run.write(10)
    run.file().rename(run.folder / name)
    run.write(5)
    run.write(5)
    with open_log(run.folder / name) as log:
        assert len(list(log.messages())) == 15
    assert run.close() == (5, 15)


def test_a_file_of_somebody_else_in_the_place_of_the_next_is_left_alone(run) -> None:
    run.write(10)
    run.file(1).write_bytes(b'mine')
    run.writer.split()
    run.write(10)
    assert run.file(1).read_bytes() == b'mine'
    assert listed(run.folder) == ['run_0.mcap', 'run_2.mcap']
    assert run.close() == (20, 0)


def test_a_link_in_the_place_of_the_file_is_the_file(run, tmp_path: Path) -> None:
    run.write(10)
    run.file().rename(tmp_path / 'elsewhere.mcap')
    run.file().symlink_to(tmp_path / 'elsewhere.mcap')
    run.write(10)
    assert run.close() == (20, 0)


def test_another_name_for_the_file_harms_nothing(run, tmp_path: Path) -> None:
    run.write(10)
    os.link(run.file(), tmp_path / 'backup.mcap')
    run.write(10)
    assert run.close() == (20, 0)


def test_what_somebody_appends_is_cut_off_and_the_run_is_whole(run) -> None:
    run.write(10)
    for _ in range(2):
        with run.file().open('ab') as file:
            file.write(b'x' * 100_000)
        run.writer.look()
    assert len(run.warnings) == 2
    assert 'appended 100000 bytes to run_0.mcap; that is cut off again' in run.warnings[0]
    run.write(10)
    with run.file().open('ab') as file:
        file.write(b'x')
    assert run.close() == (20, 0)
    with open_log(run.folder) as log:
        assert log.complete, log.problem


def test_a_finished_file_that_grew_or_was_restored_is_still_there(run, tmp_path: Path) -> None:
    for _ in range(2):
        run.write(10).writer.split()
    shutil.copy(run.file(0), tmp_path / 'backup.mcap')
    run.file(0).unlink()
    shutil.copy(tmp_path / 'backup.mcap', run.file(0))
    with run.file(1).open('ab') as file:
        file.write(b'more')
    run.write(10)
    assert run.close() == (30, 0)


def test_a_file_that_a_network_disk_hides_is_removed(run) -> None:
    run.write(10)
    run.file().rename(run.folder / '.nfs000000000001')
    run.writer.look()
    assert 'run_0.mcap was removed while it was recorded' in run.errors[0]


def test_a_disk_that_tells_nonsense_of_a_new_file_is_not_believed(
    runs: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(file_watch, '_holds', lambda *_: False)
    run = Run(runs, tmp_path / 'run')
    run.write(10)
    run.writer.split()
    run.write(10)
    assert run.close() == (20, 0)


@pytest.mark.parametrize('name', ['truncate -s 0', 'cp other', 'zeros'])
def test_what_happens_to_a_later_file_as_soon_as_it_is_made_is_believed(
    run, monkeypatch: pytest.MonkeyPatch, name
) -> None:
    run.write(10)
    begin = FileWatch.begin

    def harm_and_begin(watch):
        HARMS[name][0](run.file(1))
        begin(watch)

    monkeypatch.setattr(FileWatch, 'begin', harm_and_begin)
    run.writer.split()
    monkeypatch.undo()
    run.write(10)
    run.write(5)
    assert run.close() == (15, 10)
    assert 'run_1.mcap was cut off or overwritten' in run.errors[0]
