"""The tools as processes: their exit codes do not depend on who reads what they say."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from fork_server import called, PACKAGE, PYTHON
import pytest


def without_a_reader(name: str, *arguments: object) -> tuple[int, str]:
    """Run a tool whose output nobody takes; return its exit code and what it complains of."""
    reader, writer = os.pipe()
    os.close(reader)
    done = called(name, *arguments, stdout=writer)
    os.close(writer)
    return done.returncode, done.stderr


def test_review_without_a_reader_keeps_its_exit_code(healthy, make_run) -> None:
    run = make_run(healthy)
    assert without_a_reader('review', run) == (0, '')
    (path,) = run.glob('*.mcap')
    path.write_bytes(path.read_bytes()[:-3000])
    assert without_a_reader('review', path) == (1, '')


def test_recover_without_a_reader_keeps_its_exit_code(healthy, make_run, tmp_path) -> None:
    (path,) = make_run(healthy).glob('*.mcap')
    path.write_bytes(path.read_bytes()[:-8] + b'no magic')
    code, errors = without_a_reader('recover', path, '-o', tmp_path / 'recovered')
    assert (code in (0, 3), errors) == (True, '')
    assert list((tmp_path / 'recovered').glob('*.mcap'))


@pytest.mark.parametrize('name', ['review', 'recover'])
def test_help_without_a_reader_is_no_fault(name: str) -> None:
    assert without_a_reader(name, '--help') == (0, '')


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='a device of Linux')
@pytest.mark.parametrize(('name', 'expected'), [('review', 3), ('recover', 1)])
def test_a_full_disk_is_one_line(healthy, make_run, tmp_path, name: str, expected: int) -> None:
    run = make_run(healthy)
    output = [] if name == 'review' else ['-o', tmp_path / 'recovered']
    with Path('/dev/full').open('w') as full:
        done = called(name, run, *output, stdout=full.fileno())
    assert done.returncode == expected
    assert done.stderr == f'{name}: the report cannot be written: No space left on device\n'


def test_a_report_comes_before_the_traceback_of_a_fault() -> None:
    code = (
        'import sys, types\n'
        'from klann_ros import executables\n'
        'module = types.ModuleType("faulty")\n'
        'module.main = lambda: print("said before") or 1 / 0\n'
        'sys.modules["faulty"] = module\n'
        'executables._tool("faulty", "faulty", 2)\n'
    )
    done = called(PYTHON, '-c', code)
    assert (done.returncode, done.stdout) == (1, 'said before\n')
    assert 'ZeroDivisionError' in done.stderr


@pytest.mark.parametrize('delay', [0.02, 0.1, 0.3, 0.6, 2.0])
def test_interrupts_end_a_tool_without_noise(healthy, make_run, tmp_path, delay: float) -> None:
    # A pipe that nobody empties: the tool waits for it, if it is not at work still.
    pipe = tmp_path / 'pipe.csv'
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    run = make_run(healthy)
    # It says a line when its signals count; what it imports then is part of the claim.
    code = (
        'import sys; from klann_ros.executables import review; '
        'print("ready", flush=True); sys.exit(review())'
    )
    process = subprocess.Popen(
        [sys.executable, '-c', code, '--csv', pipe, run],
        env={**os.environ, 'PYTHONPATH': PACKAGE},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == 'ready\n'
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    time.sleep(0.02)
    # It may have ended by now; then this one goes nowhere.
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=60.0)
    os.close(reader)
    assert (process.returncode, output, errors) == (130, '', '')
