"""The tools as processes: exit codes, signals, terminals and pipes."""

from contextlib import suppress
import fcntl
import os
from pathlib import Path
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import time

from fork_server import called, PACKAGE, PYTHON, server
import pytest

CODE = 'import sys; from klann_ros.executables import review; sys.exit(review())'
# Shows a bar at once, whatever the machine takes for it.
EAGER = 'import klann_ros.review.command as p; p._PROGRESS_DELAY = 0.0; '
ESCAPE = '\x1b['


@pytest.mark.parametrize(
    ('command', 'code'),
    [
        ('review run', 0),
        ('review cut.mcap', 1),
        ('recover cut.mcap -o recovered', 0),
        ('review --help', 0),
        ('recover --help', 0),
        ('describe sem104', 0),
        ('export sem104 --svg /dev/null', 0),
    ],
)
def test_a_tool_without_a_reader_keeps_its_exit_code(
    healthy, make_run, tmp_path, monkeypatch, *, command: str, code: int
) -> None:
    monkeypatch.chdir(tmp_path)
    (path,) = make_run(healthy).glob('*.mcap')
    Path('cut.mcap').write_bytes(path.read_bytes()[:-3000])
    reader, writer = os.pipe()
    os.close(reader)
    done = called(*command.split(), stdout=writer)
    os.close(writer)
    assert (done.returncode, done.stderr) == (code, '')
    assert bool([*Path('recovered').glob('*.mcap')]) is ('recovered' in command)


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
        'module.main = lambda: print("printed before") or 1 / 0\n'
        'sys.modules["faulty"] = module\n'
        'executables._run_tool("faulty", "faulty", 2)\n'
    )
    done = called(PYTHON, '-c', code)
    assert (done.returncode, done.stdout) == (1, 'printed before\n')
    assert 'ZeroDivisionError' in done.stderr


@pytest.mark.parametrize('delay', [0.02, 0.3, 2.0])
def test_interrupts_end_a_tool_without_noise(healthy, make_run, tmp_path, delay: float) -> None:
    # A pipe without a reader: the tool waits for it, if it is not at work still.
    pipe = tmp_path / 'pipe.csv'
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    run = make_run(healthy)
    # It prints a line when it handles signals; what it imports then is part of the claim.
    code = CODE.replace('sys.exit', 'print("ready", flush=True); sys.exit')
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


def environment(**changes: str) -> dict[str, str]:
    variables = {**os.environ, 'TERM': 'xterm'}
    variables.pop('NO_COLOR', None)
    return variables | changes


def in_terminal(*arguments: object, code: str = CODE, **variables: str) -> tuple[int, str]:
    """Run a review in a terminal of its own; return the exit code and all that was shown."""
    terminal, terminal_of_process = pty.openpty()
    fcntl.ioctl(terminal_of_process, termios.TIOCSWINSZ, struct.pack('4H', 50, 120, 0, 0))
    process = server().start(
        PYTHON,
        ['-c', code, *map(str, arguments)],
        cwd=Path.cwd(),
        environment=environment(**variables),
        stdin=terminal_of_process,
        stdout=terminal_of_process,
        stderr=terminal_of_process,
    )
    os.close(terminal_of_process)
    output = b''
    # Linux raises this when the other side is closed.
    with suppress(OSError):
        while piece := os.read(terminal, 65536):
            output += piece
    os.close(terminal)
    return process.wait(60.0), output.decode()


def in_pipe(*arguments: object, code: str = CODE, **variables: str) -> tuple[int, str, str]:
    done = called(PYTHON, '-c', code, *arguments, environment=environment(**variables))
    return done.returncode, done.stdout, done.stderr


@pytest.fixture
def faulty(healthy, make_run):
    healthy.answers[100].pose[1] += 1e-3
    return make_run(healthy)


def test_a_terminal_shows_colours_and_a_pipe_the_same_text_without(faulty) -> None:
    code, output = in_terminal(faulty)
    assert code == 1
    assert f'{ESCAPE}1;31mERROR{ESCAPE}0m closure' in output
    piped = in_pipe(faulty)
    assert piped == (1, re.sub(r'\x1b\[[0-9;]*m', '', output).replace('\r\n', '\n'), '')
    assert ESCAPE not in piped[1]


def test_no_color_is_respected(faulty) -> None:
    _, output = in_terminal(faulty, NO_COLOR='1')
    assert ESCAPE not in output
    assert 'ERROR closure' in output
    # By its convention an empty one has no effect.
    assert ESCAPE in in_terminal(faulty, NO_COLOR='')[1]


def test_progress_is_for_terminals_only(faulty) -> None:
    assert '%|' in in_terminal(faulty, code=EAGER + CODE)[1]
    code, output, errors = in_pipe(faulty, code=EAGER + CODE)
    assert (code, errors) == (1, '')
    assert '%|' not in output


def test_characters_outside_the_terminal_encoding_cause_no_traceback(healthy, make_run) -> None:
    healthy.in_namespace('/börde')
    code, output, errors = in_pipe(make_run(healthy), PYTHONIOENCODING='ascii')
    assert (code, errors) == (0, '')
    assert r'/b\xf6rde/joint_states' in output
