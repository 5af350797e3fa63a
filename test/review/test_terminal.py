"""What a terminal shows, and what a pipe gets: colours and progress are for people."""

import fcntl
import os
from pathlib import Path
import pty
import re
import struct
import termios

from fork_server import called, PYTHON, server
import pytest

CODE = 'import sys; from klann_ros.executables import review; sys.exit(review())'
# Shows a bar at once, whatever the machine takes for it.
EAGER = 'import klann_ros.review.command as p; p._PROGRESS_DELAY = 0.0; '
ESCAPE = '\x1b['


def environment(**changes: str) -> dict[str, str]:
    kept = {key: value for key, value in os.environ.items() if key != 'NO_COLOR'}
    return {**kept, 'TERM': 'xterm', **changes}


def in_terminal(*arguments: object, code: str = CODE, **variables: str) -> tuple[int, str]:
    """Run a review in a terminal of its own; return the exit code and all that was shown."""
    here, there = pty.openpty()
    fcntl.ioctl(there, termios.TIOCSWINSZ, struct.pack('4H', 50, 120, 0, 0))
    process = server().start(
        PYTHON,
        ['-c', code, *map(str, arguments)],
        cwd=Path.cwd(),
        environment=environment(**variables),
        stdin=there,
        stdout=there,
        stderr=there,
    )
    os.close(there)
    shown = b''
    while True:
        try:
            piece = os.read(here, 65536)
        except OSError:
            # Linux says so when the other side is closed.
            break
        if not piece:
            break
        shown += piece
    os.close(here)
    return process.wait(60.0), shown.decode()


def in_pipe(*arguments: object, code: str = CODE, **variables: str) -> tuple[int, str, str]:
    given = environment(**variables)
    done = called(PYTHON, '-c', code, *arguments, environment=given)
    return done.returncode, done.stdout, done.stderr


@pytest.fixture
def faulty(healthy, make_run):
    healthy.answers[100].pose[1] += 1e-3
    return make_run(healthy)


def test_a_terminal_shows_colours_and_a_pipe_the_same_text_without(faulty) -> None:
    code, shown = in_terminal(faulty)
    assert code == 1
    assert f'{ESCAPE}1;31mERROR{ESCAPE}0m closure' in shown
    piped = in_pipe(faulty)
    assert piped == (1, re.sub(r'\x1b\[[0-9;]*m', '', shown).replace('\r\n', '\n'), '')
    assert ESCAPE not in piped[1]


def test_no_color_is_heard(faulty) -> None:
    _, shown = in_terminal(faulty, NO_COLOR='1')
    assert ESCAPE not in shown
    assert 'ERROR closure' in shown
    # By its convention an empty one says nothing.
    assert ESCAPE in in_terminal(faulty, NO_COLOR='')[1]


def test_progress_is_for_terminals_only(faulty) -> None:
    assert '%|' in in_terminal(faulty, code=EAGER + CODE)[1]
    code, output, errors = in_pipe(faulty, code=EAGER + CODE)
    assert (code, errors) == (1, '')
    assert '%|' not in output


def test_names_in_a_log_do_not_reach_the_terminal_as_commands(healthy, make_run) -> None:
    healthy.in_namespace('/\x1b[2J')
    code, output, _ = in_pipe(make_run(healthy), PYTHONIOENCODING='ascii')
    assert code == 0
    assert ESCAPE not in output
    assert r'/\x1b[2J/joint_states' in output


def test_a_letter_that_a_terminal_does_not_know_is_no_traceback(healthy, make_run) -> None:
    healthy.in_namespace('/börde')
    code, output, errors = in_pipe(make_run(healthy), PYTHONIOENCODING='ascii')
    assert (code, errors) == (0, '')
    assert r'/b\xf6rde/joint_states' in output
