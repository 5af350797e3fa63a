"""What a review writes: never what it reads, whole or not at all, and known at the start."""

from collections.abc import Callable
import os
from pathlib import Path
from subprocess import CompletedProcess

from fork_server import called, PYTHON
from klann_ros.review import command
from klann_ros.review.command import main
from klann_ros.sanitize.files import is_within
import pytest

OPTIONS = ('--html', '--json', '--csv')


@pytest.fixture
def run(healthy, make_run) -> Path:
    return make_run(healthy)


@pytest.fixture
def refused(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., str]:
    """Return what gives the refusal of arguments: one line, before anything is read."""

    def review_run(*_: object, **__: object) -> None:
        raise AssertionError('it has begun to work')

    monkeypatch.setattr(command, 'review_run', review_run)

    def reason(*arguments: object) -> str:
        assert main([str(argument) for argument in arguments]) == 3
        out, error = capsys.readouterr()
        assert (out, error.count('\n')) == ('', 1)
        return str(error)

    return reason


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


@pytest.mark.parametrize('option', OPTIONS)
@pytest.mark.parametrize('name', ['run_0.mcap', 'metadata.yaml', 'new.html', 'more/new.html'])
def test_nothing_is_written_into_a_run(run: Path, refused, option: str, name: str) -> None:
    (run / 'more').mkdir()
    before = content(run)
    error = refused(run, option, run / name)
    assert f'review: {option} {run / name} cannot be written: it is inside {run}, ' in error
    assert content(run) == before


def test_symbolic_links_are_kept(run: Path, refused, tmp_path: Path) -> None:
    file = run / 'run_0.mcap'
    (tmp_path / 'folder').symlink_to(run)
    (tmp_path / 'soft').symlink_to(file)
    (tmp_path / 'hard').hardlink_to(file)
    (tmp_path / 'other').hardlink_to(run / 'metadata.yaml')
    before = content(run)
    for path in ('folder/x', 'folder/../run/x', 'soft', 'hard', 'other'):
        assert 'which is only read' in refused(run, '--html', tmp_path / path)
    assert 'which is only read' in refused(tmp_path / 'folder', '--html', run / 'x')
    assert 'which is only read' in refused(tmp_path / 'soft', '--html', tmp_path / 'hard')
    with file.open('rb') as opened:
        path = f'/proc/self/fd/{opened.fileno()}'
        assert 'which is only read' in refused(run, '--html', path)
        assert 'which is only read' in refused(path, '--html', file)
    assert content(run) == before


@pytest.mark.parametrize('option', ['--geometry', '--limits', 'LOG2'])
def test_all_that_is_read_is_kept(run: Path, refused, tmp_path: Path, option: str) -> None:
    file = tmp_path / 'file'
    file.write_text('l_ab: 0.12\n')
    given = [option, file] if option != 'LOG2' else [file]
    assert f'it is {file}, which is only read' in refused(run, *given, '--json', file)
    assert file.read_text() == 'l_ab: 0.12\n'


def test_no_other_log_is_overwritten(run: Path, refused, tmp_path: Path) -> None:
    other = tmp_path / 'other.mcap'
    other.write_bytes((run / 'run_0.mcap').read_bytes())
    assert 'it is a log, and no log is overwritten' in refused(run, '--html', other)
    bag = tmp_path / 'bag.db3'
    bag.write_bytes(b'SQLite format 3\0' + bytes(100))
    assert 'it is a log' in refused(run, '--html', bag)


def test_two_outputs_are_two_files(run: Path, refused, tmp_path: Path) -> None:
    one = tmp_path / 'page'
    assert '--json and --html are the same file' in refused(run, '--html', one, '--json', one)
    one.write_text('old')
    (tmp_path / 'hard').hardlink_to(one)
    assert 'the same file' in refused(run, '--html', one, '--csv', tmp_path / 'hard')
    assert one.read_text() == 'old'


def test_an_unwritable_output_is_refused_at_once(run: Path, refused, tmp_path: Path) -> None:
    file = tmp_path / 'file'
    file.write_text('')
    for path, reason in (
        (tmp_path, 'it is a folder'),
        (tmp_path / 'no' / 'page', f'there is no folder {tmp_path / "no"}'),
        (file / 'page', f'there is no folder {file}'),
        (tmp_path / ('x' * 300), 'File name too long'),
        (f'{tmp_path}/new/', 'that is no path of a file'),
        ('', 'that is no path of a file'),
    ):
        error = refused(run, '--html', path)
        assert reason in error
        assert 'cannot be written: ' in error
    assert sorted(path.name for path in tmp_path.iterdir()) == ['file', 'run']


def in_process(
    *arguments: object, before: str = '', stdout: int | None = None
) -> CompletedProcess[str]:
    """Run a review after some preparation."""
    code = 'import sys; from klann_ros.executables import review; sys.exit(review())'
    return called(PYTHON, '-c', f'{before}\n{code}', *arguments, stdout=stdout)


def test_an_output_without_permission_is_refused_at_once(run: Path, tmp_path: Path) -> None:
    closed, kept = tmp_path / 'closed', tmp_path / 'kept'
    closed.mkdir(mode=0o555)
    kept.write_text('old')
    kept.chmod(0o444)
    for folder in (tmp_path, *tmp_path.parents[:3]):
        folder.chmod(folder.stat().st_mode | 0o055)
    # Root may do everything.
    before = 'import os, klann_ros.executables, klann_ros.review.command\n'
    before += 'os.getuid() or os.setresuid(65534, 65534, 65534)'
    for path in (closed / 'page', kept):
        done = in_process(run, '--html', path, before=before)
        assert (done.returncode, done.stdout) == (3, ''), done.stderr
        assert done.stderr == f'review: --html {path} cannot be written: Permission denied\n'
    assert kept.read_text() == 'old'


def test_a_full_disk_leaves_the_page_of_before(run: Path, tmp_path: Path) -> None:
    page, table = tmp_path / 'page.html', tmp_path / 'run.csv'
    page.write_text('old')
    # As a full disk does, this lets a file grow no further.
    before = 'import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (150_000, 150_000))'
    done = in_process(run, '--html', page, '--csv', table, before=before)
    assert done.returncode == 3
    assert done.stderr == f'review: --html {page} cannot be written: File too large\n'
    assert 'nothing found: every pose is the right one' in done.stdout
    assert page.read_text() == 'old'
    assert len(table.read_text().splitlines()) == 401
    assert sorted(path.name for path in tmp_path.iterdir()) == ['page.html', 'run', 'run.csv']


def test_the_permissions_of_a_file_stay(run: Path, tmp_path: Path) -> None:
    file = tmp_path / 'file'
    file.write_text('old')
    file.chmod(0o640)
    assert main([str(run), '--json', str(file)]) == 0
    assert file.read_text().startswith('{')
    assert file.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize('target', ['file', 'nothing'])
def test_no_target_of_a_link_is_written(run: Path, refused, tmp_path: Path, target: str) -> None:
    (tmp_path / 'file').write_text('old')
    (tmp_path / 'link').symlink_to(target)
    error = refused(run, '--json', tmp_path / 'link')
    assert 'it is a symbolic link: name the file itself' in error
    assert (tmp_path / 'file').read_text() == 'old'
    assert not (tmp_path / 'nothing').exists()


def test_a_pipe_is_written_in_place_and_not_awaited_without_a_reader(
    run: Path, tmp_path: Path
) -> None:
    pipe = tmp_path / 'pipe'
    os.mkfifo(pipe)
    done = in_process(run, '--json', pipe)
    assert done.returncode == 3
    assert done.stderr.startswith(f'review: --json {pipe} cannot be written: ')
    assert pipe.is_fifo()
    done = in_process(run, '--json', '/dev/stdout')
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.startswith('{')
    assert done.stdout.endswith('the right one for its crank angle\n')
    assert in_process(run, '--json', '/dev/null', '--html', '/dev/null').returncode == 0


def test_two_outputs_to_one_file_are_refused(run: Path, tmp_path: Path) -> None:
    with (tmp_path / 'report').open('w') as file:
        done = in_process(run, '--json', '/dev/stdout', stdout=file.fileno())
    assert done.returncode == 3
    assert 'the report itself goes there' in done.stderr


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='a device of Linux')
def test_a_full_device_is_reported(run: Path) -> None:
    done = in_process(run, '--json', '/dev/full')
    assert done.returncode == 3
    assert done.stderr == ('review: --json /dev/full cannot be written: No space left on device\n')


def test_a_path_is_within_by_whatever_way_it_takes(tmp_path: Path) -> None:
    (tmp_path / 'a' / 'b').mkdir(parents=True)
    (tmp_path / 'link').symlink_to('a')
    (tmp_path / 'loop').symlink_to('loop')
    assert is_within(tmp_path / 'a' / 'new', tmp_path / 'link')
    assert is_within(tmp_path / 'link' / 'b' / '..' / 'new', tmp_path / 'a')
    assert is_within(tmp_path / 'a', tmp_path / 'a')
    assert not is_within(tmp_path / 'ab', tmp_path / 'a')
    assert not is_within(tmp_path / 'a' / '..' / 'new', tmp_path / 'a')
    assert not is_within(tmp_path / 'loop' / 'new', tmp_path / 'a')
    assert not is_within('a', tmp_path / 'loop')
    assert not is_within('a\0b', tmp_path)
