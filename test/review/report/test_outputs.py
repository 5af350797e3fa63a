"""What a review writes: never what it reads, whole or not at all, and known at the start."""

import os
from pathlib import Path
from subprocess import CompletedProcess

from fork_server import called, PYTHON
from klann_ros.review import command
from klann_ros.review.command import main
from klann_ros.sanitize.files import is_within
import pytest
from yaml_tables import read_table

# Arguments behind the run, and why they are refused; paths are those of `place`.
REFUSED = read_table(Path(__file__).with_name('refused_outputs.yaml'))


@pytest.fixture
def run(healthy, make_run) -> Path:
    return make_run(healthy)


@pytest.fixture
def place(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of the run, of other files and of links to them, as the working one."""
    monkeypatch.chdir(tmp_path)
    (run / 'more').mkdir()
    Path('more').mkdir()
    Path('file').write_text('l_ab: 0.12\n')
    Path('other.mcap').write_bytes((run / 'run_0.mcap').read_bytes())
    Path('other.db3').write_bytes(b'SQLite format 3\0' + bytes(100))
    links = {'folder': run, 'soft': run / 'run_0.mcap', 'link': 'file', 'dangling': 'nothing'}
    for name, target in links.items():
        Path(name).symlink_to(target)
    Path('hard').hardlink_to(run / 'run_0.mcap')
    Path('hard_metadata').hardlink_to(run / 'metadata.yaml')
    Path('hard_file').hardlink_to('file')

    def review_run(*_: object, **__: object) -> None:
        raise AssertionError('it has begun to work')

    monkeypatch.setattr(command, 'review_run', review_run)
    return tmp_path


def content(folder: Path) -> dict[str, bytes | None]:
    return {str(p): p.read_bytes() if p.is_file() else None for p in folder.rglob('*')}


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Return the refusal of arguments: one line, before anything is read."""
    assert main([*arguments]) == 3
    out, error = capsys.readouterr()
    assert (out, error.count('\n')) == ('', 1)
    return str(error)


@pytest.mark.parametrize(('arguments', 'reason'), REFUSED)
def test_an_output_is_refused_at_once_and_nothing_is_changed(
    place: Path, capsys: pytest.CaptureFixture[str], arguments: str, reason: str
) -> None:
    files = content(place)
    words = arguments.replace('LONG', 300 * 'x').split()
    error = refusal(capsys, 'run', *words)
    assert 'cannot be written: ' in error or 'the same file' in error
    assert reason.format(place=place) in error
    assert content(place) == files


def test_a_run_is_known_by_every_name(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with (place / 'hard').open('rb') as opened:
        name = f'/proc/self/fd/{opened.fileno()}'
        for log, output in (('folder', 'run/x'), ('soft', 'hard'), ('run', name), (name, 'hard')):
            assert 'which is only read' in refusal(capsys, log, '--html', output)


def in_process(
    *arguments: object, preparation: str = '', stdout: int | None = None
) -> CompletedProcess[str]:
    """Run a review after some preparation."""
    code = 'import sys; from klann_ros.executables import review; sys.exit(review())'
    return called(PYTHON, '-c', f'{preparation}\n{code}', *arguments, stdout=stdout)


def test_an_output_without_permission_is_refused_at_once(run: Path, tmp_path: Path) -> None:
    closed = tmp_path / 'closed'
    closed.mkdir(mode=0o555)
    read_only = tmp_path / 'read_only'
    read_only.write_text('old')
    read_only.chmod(0o444)
    for folder in (tmp_path, *tmp_path.parents[:3]):
        folder.chmod(folder.stat().st_mode | 0o055)
    # Root may do everything.
    preparation = 'import os, klann_ros.executables, klann_ros.review.command\n'
    preparation += 'os.getuid() or os.setresuid(65534, 65534, 65534)'
    for path in (closed / 'page', read_only):
        done = in_process(run, '--html', path, preparation=preparation)
        assert (done.returncode, done.stdout) == (3, ''), done.stderr
        assert done.stderr == f'review: --html {path} cannot be written: Permission denied\n'
    assert read_only.read_text() == 'old'


def test_a_full_disk_leaves_the_page_of_before(run: Path, tmp_path: Path) -> None:
    page, table = tmp_path / 'page.html', tmp_path / 'run.csv'
    page.write_text('old')
    # As a full disk does, this lets a file grow no further.
    preparation = 'import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (150_000, 150_000))'
    done = in_process(run, '--html', page, '--csv', table, preparation=preparation)
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
