"""scripts/test and scripts/demo: errors in one line, children ended, sources seen to change."""

from collections.abc import Iterator
from contextlib import ExitStack
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
from threading import Timer
import time

import checks
from domain import own_domain
import environment
from environment import Environment, STAMP, VERSION
import pytest
import source

ROOT = Path(__file__).resolve().parents[2]

STARTS_MANY = """
from pathlib import Path
import processes, signal
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # these tests may themselves run under nohup
processes.listen()
processes.run(['sh', '-c', {script!r}], {{}}, Path('output'))
"""


@pytest.mark.parametrize('name', ['test', 'demo'])
@pytest.mark.parametrize(
    ('script', 'reason'),
    [
        (None, 'no such Python'),
        ('echo "pyenv: python3.12: command not found" >&2; exit 127', 'pyenv: python3.12'),
        ('echo 3.9; exit 3', 'is Python 3.9; klann_ros needs 3.10 or newer'),
    ],
)
def test_an_unfit_python_is_refused_in_one_line(
    name: str, script: str | None, reason: str, tmp_path: Path
) -> None:
    python = tmp_path / 'python'
    if script:
        python.write_text(f'#!/bin/sh\n{script}\n')
        python.chmod(0o755)
    result = subprocess.run(
        [ROOT / 'scripts' / name],
        env=os.environ | {'PYTHON': str(python)},
        capture_output=True,
        check=False,
        text=True,
    )
    assert result.returncode == 1
    assert result.stdout == ''
    assert result.stderr.startswith(f'scripts/{name}: {python}')
    assert reason in result.stderr
    assert result.stderr.count('\n') == 1


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize(
    'script',
    [
        'sleep 1000',
        'sleep 1000 & sleep 1000',
        # An orphan, which its parent did not wait for.
        'sh -c "sleep 1000 &" ; sleep 1000',
    ],
)
def test_a_signal_ends_a_process_and_all_that_it_started(
    number: int, script: str, tmp_path: Path
) -> None:
    # A duration that no other process sleeps for marks the descendants of this test.
    duration = f'1000.{os.getpid()}{time.monotonic_ns()}'
    process = subprocess.Popen(
        [sys.executable, '-c', STARTS_MANY.format(script=script.replace('1000', duration))],
        cwd=tmp_path,
        env=os.environ | {'PYTHONPATH': str(ROOT / 'scripts' / 'support')},
        stderr=subprocess.PIPE,
        text=True,
    )
    expected = script.count('sleep')
    deadline = time.monotonic() + 40
    try:
        while len(sleepers(duration)) < expected and time.monotonic() < deadline:
            time.sleep(0.05)
        assert len(sleepers(duration)) == expected
        process.send_signal(number)
        assert 'CommandError: stopped by' in process.communicate(timeout=20)[1]
        # What is killed takes a moment to go.
        while sleepers(duration) and time.monotonic() < deadline:
            time.sleep(0.01)
        assert sleepers(duration) == []
    finally:
        process.kill()
        for pid in sleepers(duration):
            os.kill(pid, signal.SIGKILL)


def test_two_runs_at_once_get_different_domains() -> None:
    with ExitStack() as stack:
        domains = [stack.enter_context(own_domain()) for _ in range(20)]
    assert len(set(domains)) == 20
    assert set(domains) <= set(range(1, 100))


@pytest.mark.parametrize('numpy', ['', '1.26.4'])
def test_a_sourced_ros_is_seen_where_it_is_used_and_its_klann_ros_comes_last(
    numpy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}/workspace:/opt/ros/jazzy')
    monkeypatch.setenv('_ROS_WHEELS_BOOTSTRAP_COMPLETE', '1')
    variables = Environment(tmp_path, '', numpy).variables
    first, *others = variables.get('PYTHONPATH', '').split(':')
    assert others == ([f'{tmp_path}/workspace', '/opt/ros/jazzy'] if numpy else [])
    assert first.endswith('site-packages') == bool(numpy)
    assert '_ROS_WHEELS_BOOTSTRAP_COMPLETE' not in variables


@pytest.mark.slow
@pytest.mark.parametrize('was_made', [False, True])
def test_a_set_up_that_fails_leaves_no_broken_environment(tmp_path: Path, was_made: bool) -> None:
    root = tmp_path / 'a checkout'
    shutil.copytree(ROOT / 'scripts', root / 'scripts')
    folder = root / f'.venv-{VERSION}'
    stamp = f'{folder} {Path(sys.executable).resolve()}\ntest of before'
    if was_made:
        subprocess.run([sys.executable, '-m', 'venv', '--without-pip', folder], check=True)
        (folder / STAMP).write_text(stamp)
    result = subprocess.run(
        [root / 'scripts' / 'demo'],
        env=os.environ | {'PYTHON': sys.executable, 'PIP_NO_INDEX': '1'},
        capture_output=True,
        check=False,
        text=True,
    )
    assert result.returncode == 1
    assert 'set-up of' in result.stderr
    if was_made:
        subprocess.run([folder / 'bin' / 'python', '-c', ''], check=True)
        assert {*(folder / STAMP).read_text().splitlines()} == {*stamp.splitlines()}
    else:
        assert [*folder.iterdir()] == []


def test_a_distribution_of_ros_has_an_environment_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(source, 'ROOT', tmp_path)
    monkeypatch.setattr(environment, '_is_provided', lambda *_: True)
    monkeypatch.delenv('PIP_CONSTRAINT', raising=False)
    folders = {}
    for sourced, ros in (('', ''), ('', 'kilted'), ('kilted', ''), ('kilted', 'jazzy')):
        monkeypatch.setenv('ROS_DISTRO', sourced)
        with environment.environment('demo', ros) as env:
            folders[sourced, ros] = env.folder.name.removesuffix('-ros')
    jazzy = f'.venv-{VERSION}'
    assert [*folders.values()] == [jazzy, f'{jazzy}-kilted', f'{jazzy}-kilted', jazzy]


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        (['--ros', 'kilted', 'ruff'], '--ros runs pytest alone'),
        (['--ros', 'humble'], 'jazzy'),
    ],
)
def test_other_checks_and_distributions_without_wheels_are_refused(
    arguments: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        checks.main(arguments)
    assert ended.value.code == 2
    assert reason in capsys.readouterr().err


USES_AN_ENVIRONMENT = """
import sys
from pathlib import Path
sys.path.insert(0, {support!r})
import environment, processes, source

def install(env, command, is_made):
    print('installing', flush=True)
    env.python.parent.mkdir(exist_ok=True)
    while not Path('fetched').exists():
        processes.pause()
    env.python.exists() or env.python.symlink_to(sys.executable)

environment._install = install  # without a network
source.ROOT = Path.cwd()
with environment.environment(sys.argv[1]) as env:
    print('uses', env.folder.name, flush=True)
    processes.pause(1000)
"""


class EnvironmentUsers:
    """Commands in an empty checkout, whose downloads end when `fetched` exists."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        support = str(ROOT / 'scripts' / 'support')
        (folder / 'main.py').write_text(USES_AN_ENVIRONMENT.format(support=support))
        self.processes: list[subprocess.Popen[str]] = []

    def start(self, command: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, '-u', self.folder / 'main.py', command],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.processes.append(process)
        # Where it waits for ever, the test fails instead of waiting too.
        limit = Timer(120.0, process.kill)
        limit.daemon = True
        limit.start()
        return process

    def fetch(self) -> None:
        (self.folder / 'fetched').touch()


@pytest.fixture
def users(tmp_path: Path) -> Iterator[EnvironmentUsers]:
    made = EnvironmentUsers(tmp_path)
    yield made
    for process in made.processes:
        process.kill()
        process.communicate()


def line_with(process: subprocess.Popen[str], text: str) -> str:
    """Return the next line of a process with a text; '' at its end."""
    assert process.stdout is not None
    return next((line for line in process.stdout if text in line), '')


@pytest.mark.parametrize('is_killed', [False, True])
def test_of_two_set_ups_at_once_the_second_waits_says_for_whom_and_goes_on(
    users: EnvironmentUsers, is_killed: bool
) -> None:
    first = users.start('demo')
    assert line_with(first, 'installing')
    second = users.start('demo')
    assert f'scripts/demo (process {first.pid})' in line_with(second, 'Waiting for')
    if is_killed:
        first.kill()
        assert line_with(second, 'installing')
    users.fetch()
    assert line_with(second, 'uses') == f'uses .venv-{VERSION}\n'


def test_an_environment_in_use_stays_as_it_is_and_another_command_gets_a_spare_one(
    users: EnvironmentUsers,
) -> None:
    users.fetch()
    running = users.start('demo')
    assert line_with(running, 'uses')
    stamp = users.folder / f'.venv-{VERSION}' / STAMP
    before = stamp.read_text()
    other = users.start('test')
    assert f'scripts/demo (process {running.pid})' in line_with(other, 'runs in')
    assert line_with(other, 'uses') == f'uses .venv-{VERSION}-2\n'
    assert stamp.read_text() == before
    # What is complete is shared.
    assert line_with(users.start('demo'), 'uses') == f'uses .venv-{VERSION}\n'


def test_changes_of_shipped_files_are_detected(tmp_path: Path) -> None:
    module = tmp_path / 'klann_ros' / 'module.py'
    module.parent.mkdir()
    seen = [source.digest(tmp_path)]

    def changed() -> bool:
        seen.append(source.digest(tmp_path))
        return seen[-1] not in seen[:-1]

    module.write_text('1')
    assert changed()
    module.write_text('2')
    assert changed()
    module.chmod(0o755)
    assert changed()
    module.rename(module.with_name('renamed.py'))
    assert changed()
    (tmp_path / 'test').mkdir()
    (tmp_path / 'test' / 'test_module.py').write_text('not shipped')
    (tmp_path / 'klann_ros' / '__pycache__').mkdir()
    (tmp_path / 'klann_ros' / '__pycache__' / 'module.pyc').write_text('not shipped')
    assert not changed()


def sleepers(duration: str) -> list[int]:
    """Return the ids of the processes that sleep for this long."""
    found = []
    for path in Path('/proc').glob('[0-9]*/cmdline'):
        try:
            if path.read_bytes() == f'sleep\0{duration}\0'.encode():
                found.append(int(path.parent.name))
        except OSError:
            pass
    return found
