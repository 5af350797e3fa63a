"""The command `design`: what it writes and refuses, and what a fault leaves behind."""

from collections.abc import Callable
import json
import os
from pathlib import Path
import resource
import signal
import subprocess
import sys
import time

from klann_ros.datasheet.command import main as describe
from klann_ros.design import command
from klann_ros.design.command import main
import pytest

Capture = pytest.CaptureFixture[str]

PROGRAM = 'import sys; from klann_ros.executables import design; sys.exit(design())'
# Ctrl-C comes when the rounds are over.
PROGRAM_STOPPED_IN_PROOF = """
import os, signal, sys
from klann_ros.executables import design
import klann_ros.design.command
module = sys.modules['klann_ros.design.search']
prove = module._proven_legs
def prove_and_stop(*arguments, **options):
    os.killpg(0, signal.SIGINT)
    return prove(*arguments, **options)
module._proven_legs = prove_and_stop
sys.exit(design())
"""
REQUIREMENTS = """\
linkage: four_bar
vary: 10
figures: {stride: maximize, lift: maximize, transmission_angle: {at_least: 0.3}}
count: 2
"""
OPTIONS = ['requirements.yaml', '-o', 'out', '--evaluations', '480']


@pytest.fixture
def out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of the result, beside the requirements."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'requirements.yaml').write_text(REQUIREMENTS)
    return tmp_path / 'out'


@pytest.fixture(scope='module')
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp('undisturbed')
    (folder / 'requirements.yaml').write_text(REQUIREMENTS)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run() == 0
    return (folder / 'out/design.json').read_text()


def run(*options: str) -> int:
    try:
        return main([*OPTIONS, '--jobs', '1', *options])
    except SystemExit as end:
        return int(end.code or 0)


def started(jobs: int, *options: str, program: str = PROGRAM) -> subprocess.Popen[str]:
    line = [sys.executable, '-c', program, *OPTIONS, '--jobs', str(jobs), *options]
    return subprocess.Popen(line, stderr=subprocess.PIPE, text=True, start_new_session=True)


def wait_until(process: subprocess.Popen[str], holds: Callable[[], bool]) -> None:
    while not holds():
        assert process.poll() is None
        time.sleep(0.02)


def workers(process: subprocess.Popen[str]) -> list[int]:
    def children(pid: int) -> list[int]:
        return [int(k) for k in Path(f'/proc/{pid}/task/{pid}/children').read_text().split()]

    return [worker for server in children(process.pid) for worker in children(server)]


def test_it_writes_legs_that_describe_takes(out: Path, undisturbed: str, capsys: Capture) -> None:
    assert run() == 0
    shown, error = capsys.readouterr()
    assert shown.splitlines()[0].endswith('in out')
    assert 'candidates' in error
    assert (out / 'design.json').read_text() == undisturbed
    page = (out / 'index.html').read_text()
    legs = [leg['file'] for leg in json.loads(undisturbed)['legs']]
    assert all(leg.removesuffix('.yaml') in page for leg in legs)
    assert describe([str(out / legs[0])]) == 0
    assert 'The crank turns fully.' in capsys.readouterr().out
    assert run() == 3
    assert 'out exists already: continue it with --resume' in capsys.readouterr().err
    assert run('--resume', '--seed', '5') == 2
    assert 'the search to resume has other requirements or another seed' in capsys.readouterr().err
    (out / legs[0]).write_text('mine')
    assert run('--resume') == 0
    assert f'not of this search or changed: {legs[0]}' in capsys.readouterr().out
    assert (out / legs[0]).read_text() == 'mine'


def test_requirements_that_no_leg_fulfils_have_exit_code_1(out: Path, capsys: Capture) -> None:
    file = out.with_name('requirements.yaml')
    file.write_text(REQUIREMENTS.replace('0.3', '1.5'))
    assert run() == 1
    assert 'transmission_angle at least 1.5 rad: best 0.' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('arguments', 'code', 'message'),
    [
        (['--resume'], 2, 'out/search.json cannot be read: No such file'),
        (['--time', '-1'], 2, 'seconds > 0'),
        (['-o', 'requirements.yaml/x'], 3, 'cannot be made'),
        (['-o', 'old', '--resume'], 2, 'search.json cannot be read: it is no state of a search'),
    ],
)
def test_a_refusal_is_one_line(
    arguments: list[str], code: int, message: str, out: Path, capsys: Capture
) -> None:
    old = out.with_name('old')
    old.mkdir()
    (old / 'search.json').write_text('{"key": 1}')
    assert run(*arguments) == code
    error = capsys.readouterr().err
    assert message in error.splitlines()[-1]
    assert 'Traceback' not in error


@pytest.mark.parametrize('content', ['', '# nothing\n', '---\n', 'linkage: ~nosuchuser/x\n'])
def test_requirements_without_content_are_refused(content: str, out: Path) -> None:
    out.with_name('requirements.yaml').write_text(content)
    assert run() == 2
    assert not out.exists()


@pytest.mark.parametrize(
    ('package', 'options'), [('pymoo', []), ('scipy', []), ('ray', ['--engine', 'ray'])]
)
def test_a_missing_extra_leaves_nothing_behind(
    package: str, options: list[str], out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    try:
        assert run(*options) == 2
    except ModuleNotFoundError as error:
        assert error.name == package
    assert not out.exists()


def test_an_empty_folder_is_taken(out: Path) -> None:
    out.mkdir()
    assert run() == 0


@pytest.mark.slow
def test_two_jobs_find_the_same_legs_without_a_worker(out: Path, undisturbed: str) -> None:
    process = started(jobs=2)
    wait_until(process, lambda: bool(workers(process)))
    os.kill(workers(process)[0], signal.SIGKILL)
    _, error = process.communicate(timeout=300)
    assert process.returncode == 0
    assert 'Traceback' not in error
    assert (out / 'design.json').read_text() == undisturbed


def test_a_killed_search_is_resumed(out: Path, undisturbed: str) -> None:
    process = started(jobs=1)
    wait_until(process, (out / 'search.json').exists)
    process.kill()
    process.communicate(timeout=300)
    assert process.returncode == -signal.SIGKILL
    assert run('--resume') == 0
    assert (out / 'design.json').read_text() == undisturbed


@pytest.mark.slow
@pytest.mark.parametrize(('evaluations', 'jobs'), [(0, 1), (1, 2)])
def test_ctrl_c_keeps_the_legs_found(out: Path, evaluations: int, jobs: int) -> None:
    """At the begin of the first round, and as the workers of the next start."""
    # Many rounds follow, so that the signal never comes in the proof.
    process = started(jobs, '--evaluations', '40000')
    state = out / 'search.json'

    def holds() -> bool:
        if not evaluations:
            return out.exists()
        return state.exists() and json.loads(state.read_text())['evaluations'] >= evaluations

    wait_until(process, holds)
    # As a terminal does.
    os.killpg(process.pid, signal.SIGINT)
    _, error = process.communicate(timeout=300)
    assert process.returncode == 130
    assert 'Traceback' not in error
    if jobs == 2:
        assert json.loads((out / 'design.json').read_text())['legs']


@pytest.mark.slow
def test_ctrl_c_in_the_proof_ends_it(out: Path) -> None:
    process = started(1, program=PROGRAM_STOPPED_IN_PROOF)
    _, error = process.communicate(timeout=300)
    assert process.returncode == 130
    assert 'Traceback' not in error
    assert json.loads((out / 'search.json').read_text())['evaluations'] >= 480


def test_an_interrupted_search_without_a_leg_does_not_deny_that_there_is_one(
    out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    requirements = out.with_name('requirements.yaml')
    requirements.write_text(REQUIREMENTS.replace('0.3', '1.5'))

    def stop(*_: object) -> str:
        raise KeyboardInterrupt

    # The progress is printed after a round.
    monkeypatch.setattr(command, '_line', stop)
    assert run() == 130


# Bytes that a file may have.
@pytest.mark.parametrize('room', [20_000, 100])
def test_a_full_disk_leaves_a_search_to_resume(
    out: Path, undisturbed: str, capsys: Capture, room: int
) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, limits[1]))
    try:
        assert run() == 3
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    error = capsys.readouterr().err
    assert 'cannot be written: File too large' in error.splitlines()[-1]
    assert run('--resume') == 0
    assert (out / 'design.json').read_text() == undisturbed
