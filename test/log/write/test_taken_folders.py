"""Folders, disks and outputs that somebody takes away while a run is written."""

import os
from pathlib import Path
import shutil
import tempfile
from types import ModuleType

from disk_scripts import can_mount, run_script, UNSHARE
from klann_ros.log.errors import RunHarmedError, RunLostError
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import main as recover_command
from klann_ros.log.recovery import recover
from klann_ros.log.write.writer import RunWriter
import pytest
from taken_away import found_in, listed, Run

HERE = Path(__file__).parent


@pytest.fixture
def run(runs: ModuleType, tmp_path: Path):
    return Run(runs, tmp_path / 'run')


def test_a_folder_that_was_removed_is_made_anew(run) -> None:
    run.write(10).writer.split()
    run.write(10)
    shutil.rmtree(run.folder)
    run.writer.look()
    assert listed(run.folder) == ['run_2.mcap']
    assert len(run.errors) == 2
    what = f'{run.folder} was removed while it was recorded, with 10 messages in the files that'
    assert run.errors[0].startswith(what)
    assert run.errors[0].endswith('it was made anew')
    assert 'run_1.mcap was removed while it was recorded, with 10 messages' in run.errors[1]
    run.write(5)
    assert run.close() == (5, 20)


def test_what_every_file_says_stands_in_the_one_that_follows(run) -> None:
    run.writer.add_metadata('solver', {'tolerance': '1e-12'}, in_every_file=True)
    run.writer.attach('leg.yaml', 'text/yaml', b'l_ab: 0.12', 1, in_every_file=True)
    run.write(10)
    shutil.rmtree(run.folder)
    run.write(10)
    run.write(5)
    run.close()
    with open_log(run.folder) as log:
        assert log.metadata['solver'] == [{'tolerance': '1e-12'}]
        assert [item.name for item in log.attachments] == ['leg.yaml']


@pytest.mark.parametrize(
    ('make', 'reason'),
    [
        (lambda path: path.write_text('mine'), 'exists already, not overwriting'),
        (lambda path: path.mkdir(), 'exists already, not overwriting'),
        (lambda path: path.symlink_to(path), 'exists already, not overwriting'),
        (lambda path: path.parent.rmdir(), 'no other can be made: No such file or directory'),
    ],
)
def test_where_the_folder_cannot_be_made_anew_the_run_ends(
    runs: ModuleType, tmp_path: Path, make, reason
) -> None:
    run = Run(runs, tmp_path / 'parent' / 'run')
    run.write(10).writer.split()
    run.write(10)
    shutil.rmtree(run.folder)
    make(run.folder)
    with pytest.raises(RunLostError, match='was removed while') as told:
        run.writer.look()
    assert reason in str(told.value)
    assert run.writer.closed
    with pytest.raises(RunHarmedError):
        run.writer.close()
    assert not list(tmp_path.rglob('*.mcap'))
    fate = run.writer.fate()
    assert (fate.written.total(), fate.gone.total()) == (0, 20)


def test_a_folder_that_was_renamed_is_followed(run, tmp_path: Path) -> None:
    run.write(10).writer.split()
    run.write(10)
    run.folder.rename(tmp_path / 'renamed')
    (tmp_path / 'run').mkdir()
    run.write(10)
    assert run.writer.path == tmp_path / 'renamed'
    assert run.writer.file_path == tmp_path / 'renamed' / 'run_1.mcap'
    (said,) = run.warnings
    assert said.startswith(f'{tmp_path}/run was renamed while it was recorded')
    assert said.endswith(f'the recording goes on in {tmp_path}/renamed')
    run.writer.split()
    run.write(10)
    assert run.close() == (40, 0)
    assert listed(tmp_path / 'renamed') == ['run_0.mcap', 'run_1.mcap', 'run_2.mcap']
    assert not list((tmp_path / 'run').iterdir())


def test_a_folder_renamed_before_the_end_is_finished_where_it_is(run, tmp_path: Path) -> None:
    run.write(10)
    (tmp_path / 'new').mkdir()
    run.folder.rename(tmp_path / 'new' / 'name')
    assert run.close() == (10, 0)
    assert run.writer.path == tmp_path / 'new' / 'name'


def test_where_nobody_can_tell_where_the_folder_is_that_is_told(
    run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run.write(10)
    monkeypatch.setattr('klann_ros.log.write.open_folder.whereabouts', lambda _: None)
    run.folder.rename(tmp_path / 'renamed')
    run.write(10)
    run.write(10)
    assert run.errors == [f'{run.folder} was removed, or moved to where it cannot be seen']
    (tmp_path / 'renamed').rename(run.folder)
    run.write(10)
    assert run.writer.faults.lasting == ()
    run.errors.clear()
    assert run.close() == (40, 0)


@pytest.mark.parametrize('kind', ['folder', 'pipe', 'in the way'])
def test_metadata_yaml_that_cannot_be_written_ends_nothing(run, kind) -> None:
    run.write(10)
    yaml_file = run.folder / 'metadata.yaml'
    yaml_file.unlink()
    if kind == 'folder':
        yaml_file.mkdir()
    elif kind == 'pipe':
        os.mkfifo(yaml_file)
    else:
        (run.folder / '.metadata.yaml.new').mkdir()
    run.writer.split()
    run.write(10)
    if kind == 'pipe':
        assert run.close() == (20, 0)
        return
    assert f'{yaml_file} cannot be written: Is a directory' in run.writer.faults.lasting
    (run.folder / ('metadata.yaml' if kind == 'folder' else '.metadata.yaml.new')).rmdir()
    run.write(10)
    assert run.writer.faults.lasting == ()
    assert listed(run.folder) == ['run_0.mcap', 'run_1.mcap']
    run.errors.clear()
    assert run.close() == (30, 0)


def test_metadata_yaml_that_cannot_be_written_at_the_end_is_told(run) -> None:
    run.write(10)
    (run.folder / 'metadata.yaml').unlink()
    (run.folder / 'metadata.yaml').mkdir()
    with pytest.raises(RunHarmedError, match='cannot be written: Is a directory'):
        run.writer.close()
    assert found_in(run.folder) == 10


def test_what_may_not_be_looked_at_is_not_called_gone() -> None:
    # Below /tmp itself, for whoever is not root.
    with tempfile.TemporaryDirectory() as folder:
        found, written, before, told = run_script(HERE / 'without_permission.py', folder)
    assert (found, written) == (40, 40)
    assert before == []
    assert 'metadata.yaml cannot be written: Permission denied' in told[0]
    assert len(told) == 2  # and again by what closing raises


def test_a_run_whose_disk_was_unmounted_is_whole_on_that_disk(tmp_path: Path) -> None:
    if not can_mount(tmp_path):
        pytest.skip('this machine lets nobody mount a tmpfs in a user namespace')
    found, written, told, left = run_script(HERE / 'taken_disk.py', tmp_path, before=UNSHARE)
    assert (found, written, left) == (30, 30, [])
    assert told[0] == f'{tmp_path}/run was removed, or moved to where it cannot be seen'
    assert len(told) == 2


def test_a_with_block_ends_with_what_was_taken_away(runs: ModuleType, tmp_path: Path) -> None:
    harmed = pytest.raises(RunHarmedError, match=r'run is not whole: run_0\.mcap was removed')
    with harmed, RunWriter(tmp_path / 'run') as writer:
        for message in runs.make_messages(5):
            writer.write(message)
        writer.file_path.unlink()
    with pytest.raises(RunHarmedError) as told, RunWriter(tmp_path / 'other') as writer:
        writer.file_path.unlink()
        raise KeyError('mine')
    assert isinstance(told.value.__cause__, KeyError)


@pytest.mark.parametrize('moment', ['begin', 'end'])
def test_a_recovery_whose_output_is_taken_away_says_so(
    run_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    moment,
) -> None:
    output = tmp_path / 'again'
    taken = RunWriter.attach if moment == 'begin' else RunWriter.close

    def take_away(writer, *arguments, **options):
        for path in output.glob('*.mcap'):
            path.unlink()
        return taken(writer, *arguments, **options)

    monkeypatch.setattr(RunWriter, taken.__name__, take_away)
    assert recover_command([str(run_file), '-o', str(output)]) == 1
    said = capsys.readouterr()
    assert 'again_0.mcap was removed while it was recorded' in said.err
    assert said.out == ''
    assert not output.exists()


@pytest.mark.parametrize('is_renamed', [True, False])
def test_a_failed_recovery_removes_nothing_of_others(
    run_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_renamed
) -> None:
    output = tmp_path / 'again'
    attach = RunWriter.attach

    def replace_output(writer, *arguments, **options):
        if not (output / 'mine').exists():
            (output / 'again_0.mcap').unlink()
            output.rename(tmp_path / 'moved')
            if not is_renamed:
                shutil.rmtree(tmp_path / 'moved')
            output.mkdir()
            (output / 'mine').write_text('mine')
        return attach(writer, *arguments, **options)

    monkeypatch.setattr(RunWriter, 'attach', replace_output)
    with pytest.raises((RunHarmedError, RunLostError)):
        recover(run_file, output)
    assert (output / 'mine').read_text() == 'mine'
    assert not (tmp_path / 'moved').exists()
