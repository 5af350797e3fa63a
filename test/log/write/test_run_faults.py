"""Files and folders removed, moved or changed by others: reported, and never claimed."""

from contextlib import suppress
import errno
import os
from pathlib import Path
import re
import shutil
import tempfile

from crank_runs import make_messages
from disk_faults import forbid, result_of
from klann_ros.log.errors import RunIncompleteError, RunLostError
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import main as recover_command
from klann_ros.log.recovery import recover
from klann_ros.log.write.durable_file import DurableFile, FileFault
from klann_ros.log.write.mcap_file import McapFile
from klann_ros.log.write.writer import RunWriter
import pytest
from run_faults import CHANGES, disk_error, found_in, GONE, listed, Run


@pytest.fixture
def run(tmp_path):
    return Run(tmp_path / 'run')


@pytest.mark.parametrize('name', CHANGES)
def test_a_lost_file_costs_its_messages_and_the_run_continues_in_the_next(run, name) -> None:
    run.write(10)
    CHANGES[name](run.file())
    run.writer.check_files()
    (error,) = run.errors
    reason = 'removed, moved' if name in GONE else 'cut off, overwritten'
    assert f'run_0.mcap was {reason}' in error
    assert 'its 10 messages count as lost' in error
    text, _, continuation = error.rpartition('; ')
    assert continuation == 'the recording continues in run_1.mcap'
    assert run.writer.faults.active == (text,)
    assert listed(run.folder) == ['run_1.mcap']
    run.write(7)
    assert run.close() == (7, 10)
    assert len(run.errors) == 1


@pytest.mark.parametrize('name', CHANGES)
def test_a_lost_finished_file_costs_its_messages(run, name) -> None:
    for _ in range(3):
        run.write(10).writer.split()
    CHANGES[name](run.file(0))
    run.write(4)
    for _ in range(3):
        run.writer.check_files()
    assert listed(run.folder) == ['run_1.mcap', 'run_2.mcap', 'run_3.mcap']
    CHANGES[name](run.file(1))
    assert run.close() == (14, 20)
    assert run.errors == [
        f'finished files are gone or changed: run_{n}.mcap, with 10 messages' for n in (0, 1)
    ]


def test_the_rest_of_a_truncated_file_is_recovered(run, tmp_path) -> None:
    run.write(10)
    size = run.file().stat().st_size
    run.write(10)
    os.truncate(run.file(), size + 20)
    run.write(10)
    run.write(5)
    assert run.close() == (5, 30)
    (path,) = re.findall(r'`recover (\S+)`', run.errors[0])
    recovery = recover(path, tmp_path / 'recovered')
    assert recovery.messages == 20  # the first ten, and those behind the gap
    assert recovery.lost
    assert recover(run.folder, tmp_path / 'recovered run').messages == 5


@pytest.mark.parametrize('end', [RunWriter.close, RunWriter.split])
def test_a_file_truncated_while_its_end_is_written_is_not_claimed(run, monkeypatch, end) -> None:
    finish = McapFile.finish

    def truncate_and_finish(file):
        os.truncate(run.file(), 100)
        monkeypatch.undo()
        finish(file)

    run.write(10)
    monkeypatch.setattr(McapFile, 'finish', truncate_and_finish)
    with suppress(RunIncompleteError):
        end(run.writer)
    assert 'run_0.mcap was cut off, overwritten' in run.errors[0]
    with suppress(RunIncompleteError):
        run.writer.close()
    assert run.counts() == (0, 10)


def test_a_message_is_counted_once_after_a_disk_error_and_a_removal(run, monkeypatch) -> None:
    run.write(10)
    run.writer.write(next(run.messages))
    monkeypatch.setattr(os, 'write', disk_error(errno.EIO))
    with pytest.raises(OSError, match='Input/output error'):
        run.writer.flush()
    monkeypatch.undo()
    assert run.counts() == (10, 1)
    run.file().unlink()
    with pytest.raises(OSError, match='Input/output error'):
        run.writer.close()
    assert 'run_0.mcap was removed' in run.errors[0]
    assert run.counts() == (0, 11)
    assert listed(run.folder) == []


@pytest.mark.parametrize('name', ['run_1.mcap', 'run_9.mcap', 'kept.mcap', 'run_x.mcap'])
def test_a_moved_file_is_complete_and_neither_overwritten_nor_counted(run, name) -> None:
    run.write(10)
    run.file().rename(run.folder / name)
    run.write(5)
    run.write(5)
    with open_log(run.folder / name) as log:
        assert log.complete, log.problem
        assert len(list(log.messages())) == 15
    assert run.close() == (5, 15)


def test_a_foreign_file_with_the_next_name_is_not_overwritten(run) -> None:
    run.write(10)
    run.file(1).write_bytes(b'mine')
    run.writer.split()
    run.write(10)
    assert run.file(1).read_bytes() == b'mine'
    assert listed(run.folder) == ['run_0.mcap', 'run_2.mcap']
    assert run.close() == (20, 0)


def test_links_and_restored_copies_are_accepted(run, tmp_path) -> None:
    run.write(10)
    os.link(run.file(), tmp_path / 'backup.mcap')
    run.file().rename(tmp_path / 'elsewhere.mcap')
    run.file().symlink_to(tmp_path / 'elsewhere.mcap')
    run.write(10).writer.split()
    shutil.copy(run.file(), tmp_path / 'copy.mcap')
    run.file().unlink()
    shutil.copy(tmp_path / 'copy.mcap', run.file())
    run.write(10)
    assert run.close() == (30, 0)


def test_a_disk_that_reports_no_sizes_of_open_files_is_not_checked(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(DurableFile, 'find_fault', lambda _: FileFault.CHANGED)
    run = Run(tmp_path / 'run')
    run.write(10).writer.split()
    run.write(10)
    assert run.close() == (20, 0)


@pytest.mark.parametrize('is_moved', [True, False])
def test_a_removed_or_renamed_folder_is_created_again(run, tmp_path, is_moved) -> None:
    run.writer.add_metadata('solver', {'tolerance': '1e-12'}, in_every_file=True)
    run.writer.attach('leg.yaml', 'text/yaml', b'l_ab: 0.12', 1, in_every_file=True)
    run.write(10).writer.split()
    run.write(10)
    if is_moved:
        run.folder.rename(tmp_path / 'renamed')
    else:
        shutil.rmtree(run.folder)
    run.writer.check_files()
    assert listed(run.folder) == ['run_2.mcap']
    assert 'run_1.mcap was removed, moved or replaced' in run.errors[0]
    assert run.errors[1:] == ['finished files are gone or changed: run_0.mcap, with 10 messages']
    run.write(5)
    assert run.close() == (5, 20)
    with open_log(run.folder) as log:
        assert log.metadata['solver'] == [{'tolerance': '1e-12'}]
        assert [item.name for item in log.attachments] == ['leg.yaml']
    if is_moved:
        assert found_in(tmp_path / 'renamed') == 20


@pytest.mark.parametrize(
    ('make', 'reason'),
    [
        (lambda path: path.write_text('mine'), 'exists already, not overwriting'),
        (lambda path: path.mkdir(), 'exists already, not overwriting'),
        (lambda path: path.symlink_to(path), 'exists already, not overwriting'),
        (lambda path: path.parent.rmdir(), 'no new file: No such file or directory'),
    ],
)
def test_the_run_ends_where_its_folder_cannot_be_created_again(tmp_path, make, reason) -> None:
    run = Run(tmp_path / 'parent' / 'run')
    run.write(10).writer.split()
    run.write(10)
    shutil.rmtree(run.folder)
    make(run.folder)
    with pytest.raises(RunLostError, match=r'run_1\.mcap was removed') as error:
        run.writer.check_files()
    assert reason in str(error.value)
    assert run.writer.closed
    with pytest.raises(RunIncompleteError):
        run.writer.close()
    assert not [path for path in tmp_path.rglob('*') if path.suffix in ('.mcap', '.yaml')]
    assert run.counts() == (0, 20)


@pytest.mark.parametrize('kind', ['folder', 'pipe', 'temporary'])
def test_an_unwritable_metadata_yaml_is_a_fault_until_it_can_be_written(run, kind) -> None:
    run.write(10)
    path = run.folder / ('.metadata.yaml.new' if kind == 'temporary' else 'metadata.yaml')
    path.unlink(missing_ok=True)
    (os.mkfifo if kind == 'pipe' else Path.mkdir)(path)
    run.writer.split()
    run.write(10)
    if kind != 'pipe':
        (fault,) = run.writer.faults.active
        assert fault == f'{run.folder}/metadata.yaml cannot be written: Is a directory'
        path.rmdir()
        run.write(10)
        run.errors.clear()
    assert run.writer.faults.active == ()
    assert listed(run.folder) == ['run_0.mcap', 'run_1.mcap']
    written, dropped = run.close()
    assert (written, dropped) == (20 if kind == 'pipe' else 30, 0)


def test_an_unwritable_metadata_yaml_at_the_end_is_reported(run) -> None:
    run.write(10)
    (run.folder / 'metadata.yaml').unlink()
    (run.folder / 'metadata.yaml').mkdir()
    with pytest.raises(RunIncompleteError, match='cannot be written: Is a directory'):
        run.writer.close()
    assert found_in(run.folder) == 10


def test_files_without_read_permission_are_not_called_lost() -> None:
    # Below /tmp itself, which other users can enter.
    with tempfile.TemporaryDirectory() as folder:
        assert result_of(forbid, folder) == [[40, 0], []]


def test_a_with_block_raises_an_incomplete_run(tmp_path) -> None:
    incomplete = pytest.raises(
        RunIncompleteError, match=r'run is incomplete: run_0\.mcap was removed'
    )
    with incomplete, RunWriter(tmp_path / 'run') as writer:
        for message in make_messages(5):
            writer.write(message)
        writer.file.path.unlink()
    with pytest.raises(RunIncompleteError) as error, RunWriter(tmp_path / 'other') as writer:
        writer.file.path.unlink()
        raise KeyError('mine')
    assert isinstance(error.value.__cause__, KeyError)


def test_a_recovery_reports_the_loss_of_its_output(
    run_file, tmp_path, monkeypatch, capsys
) -> None:
    output, close = tmp_path / 'again', RunWriter.close

    def remove_files(writer):
        for path in output.glob('*.mcap'):
            path.unlink()
        return close(writer)

    monkeypatch.setattr(RunWriter, 'close', remove_files)
    assert recover_command([str(run_file), '-o', str(output)]) == 1
    printed = capsys.readouterr()
    assert 'again_0.mcap was removed' in printed.err
    assert printed.out == ''
    assert not output.exists()


def test_a_failed_recovery_removes_no_foreign_folder(run_file, tmp_path, monkeypatch) -> None:
    output = tmp_path / 'again'
    attach = RunWriter.attach

    def replace_output(writer, *arguments, **options):
        if not (output / 'mine').exists():
            shutil.rmtree(output)
            output.mkdir()
            (output / 'mine').write_text('mine')
        return attach(writer, *arguments, **options)

    monkeypatch.setattr(RunWriter, 'attach', replace_output)
    with pytest.raises((RunIncompleteError, RunLostError)):
        recover(run_file, output)
    assert [path.name for path in output.iterdir()] == ['mine']
