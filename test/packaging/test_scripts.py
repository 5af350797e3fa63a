"""scripts/test and scripts/demo: errors in one line, children ended, sources seen to change."""

from contextlib import ExitStack
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from domain import own_domain
import install
from lock import made_folder
import pytest
import ros
import source

ROOT = Path(__file__).resolve().parents[2]

STARTS_MANY = """
from pathlib import Path
import processes, signal, stop
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # these tests may themselves run under nohup
stop.listen()
processes.adopt_orphans()
try:
    processes.run(['sh', '-c', {script!r}], Path('output'), {{}}, Path())
finally:
    processes.end_orphans()
"""


@pytest.mark.parametrize('name', ['test', 'demo'])
@pytest.mark.parametrize(
    ('script', 'said'),
    [
        (None, 'no such Python'),
        ('echo "pyenv: python3.12: command not found" >&2; exit 127', 'pyenv: python3.12'),
        ('echo 3.9; exit 3', 'is Python 3.9; klann_ros needs 3.10 or newer'),
    ],
)
def test_an_unfit_python_is_refused_in_one_line(
    name: str, script: str | None, said: str, tmp_path: Path
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
    assert said in result.stderr
    assert result.stderr.count('\n') == 1


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize(
    'script',
    [
        'sleep 1000',
        'sleep 1000 & sleep 1000',
        # A session of its own, and an orphan in it.
        'setsid sh -c "sleep 1000 & sleep 1000" & sleep 1000',
    ],
)
def test_a_signal_ends_all_descendants(number: int, script: str, tmp_path: Path) -> None:
    # A duration that no other process sleeps for marks the descendants of this test.
    duration = f'1000.{os.getpid()}{time.monotonic_ns()}'
    process = subprocess.Popen(
        [sys.executable, '-c', STARTS_MANY.format(script=script.replace('1000', duration))],
        cwd=tmp_path,
        env=os.environ | {'PYTHONPATH': str(ROOT / 'scripts' / 'support')},
        stderr=subprocess.PIPE,
        text=True,
    )
    wanted = script.count('sleep')
    deadline = time.monotonic() + 20
    try:
        while len(sleepers(duration)) < wanted and time.monotonic() < deadline:
            time.sleep(0.05)
        assert len(sleepers(duration)) == wanted
        process.send_signal(number)
        assert 'StoppedError' in process.communicate(timeout=20)[1]
        assert sleepers(duration) == []
    finally:
        process.kill()
        for pid in sleepers(duration):
            os.kill(pid, signal.SIGKILL)


def test_a_folder_is_made_once_and_then_shared(tmp_path: Path) -> None:
    made = []
    folder = tmp_path / 'folder'
    with made_folder(folder, lambda: bool(made), lambda: made.append(1)):
        assert folder.is_dir()
        with made_folder(folder, lambda: bool(made), lambda: made.append(2)):
            assert made == [1]


def test_two_runs_at_once_get_different_domains() -> None:
    with ExitStack() as stack:
        domains = [stack.enter_context(own_domain()) for _ in range(20)]
    assert len(set(domains)) == 20
    assert set(domains) <= set(range(1, 100))


def test_another_environments_wheels_are_taken_off_the_library_path() -> None:
    site = '/a/.venv-3.12/lib/python3.12/site-packages'
    entries = [f'{site}/ros_rcl.libs', '/opt/lib', '/a/.venv-3.12/lib', '/lib/other.libs']
    assert ros.without_wheels(entries) == ['/opt/lib', '/lib/other.libs']


def test_a_workspace_with_another_klann_ros_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / 'workspace' / 'klann_ros').mkdir(parents=True)
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}/workspace:/opt/ros/jazzy')
    monkeypatch.setenv(ros.GUARD, '1')
    variables = ros.clean_variables()
    assert variables['PYTHONPATH'] == '/opt/ros/jazzy'
    assert ros.GUARD not in variables


def test_what_is_shipped_is_seen_to_change(tmp_path: Path) -> None:
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


@pytest.mark.parametrize(
    ('output', 'said'),
    [
        ('WARNING: x\nERROR: No matching distribution found for a\nhint\n', 'found for a'),
        ('Retrying ... NewConnectionError ...\nERROR: No matching x\n', 'no network?'),
        ('ERROR: No matching distribution found for ros-jazzy-rclpy', 'source a ROS 2 Jazzy'),
        ('OSError: [Errno 28] No space left on device\n', 'No space left'),
        ('', 'no output'),
    ],
)
def test_a_failed_installation_is_explained_in_one_line(output: str, said: str) -> None:
    explanation = install.explain(output)
    assert said in explanation
    assert '\n' not in explanation


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
