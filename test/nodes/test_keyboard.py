"""Keys that control a player: a real process on a real terminal, under real job control."""

from collections.abc import Callable, Iterator
from itertools import pairwise
import os
from pathlib import Path
import signal
from subprocess import DEVNULL, PIPE, Popen
import sys
import termios
from threading import Thread
from typing import Any

from fork_server import PACKAGE
from hypothesis import given, strategies
from klann_ros.nodes.keyboard import MAX_SEQUENCE_LENGTH, split_keys
from playable_logs import COUNT, write_bag
import pytest
from ros_domain import Domain, Process
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

JOB_CONTROL = Path(__file__).resolve().parents[1] / 'support' / 'job_control.py'
SPACE, UP, DOWN, RIGHT = ' ', '\x1b[A', '\x1b[B', '\x1b[C'
CTRL_C, CTRL_Z, CTRL_BACKSLASH = '\x03', '\x1a', '\x1c'
# Paused where nothing but numbers comes, and so slow that nothing but the next is ever due.
FIRST = 50
STILL = ('--start-paused', '--start-offset', '0.5', '--rate', '1e-5')
SENT = {' ': 'space', UP: 'up', '\x1bOA': 'up', DOWN: 'down', '\x1bOB': 'down'}
SENT |= {RIGHT: 'right', '\x1bOC': 'right'}
# Other keys: left, F5, ctrl-right, letters, umlauts, Ctrl-D, a mouse, Alt-x.
OTHERS = ('\x1b[D', '\x1b[15~', '\x1b[1;5C', 'q', 'C', '[', 'ü', '\x04', '\x1b[<0;3;4M', '\x1bx')


@given(strategies.lists(strategies.sampled_from([*SENT, *OTHERS])), strategies.data())
def test_keys_are_the_same_in_whatever_pieces_they_come(
    typed: list[str], data: strategies.DataObject
) -> None:
    sent = ''.join(typed).encode()
    cuts = sorted(data.draw(strategies.lists(strategies.integers(0, len(sent)))))
    typed_keys: list[str] = []
    rest = b''
    for begin, end in pairwise([0, *cuts, len(sent)]):
        keys, rest = split_keys(rest + sent[begin:end])
        typed_keys += keys
    assert (typed_keys, rest) == ([SENT[key] for key in typed if key in SENT], b'')


@given(strategies.binary(max_size=200))
def test_after_any_bytes_without_their_rest_a_key_is_a_key(noise: bytes) -> None:
    keys_before, rest = split_keys(noise)
    assert len(rest) < MAX_SEQUENCE_LENGTH
    keys = split_keys(noise.removesuffix(rest) + b' \x1b[A')
    assert keys == ([*keys_before, 'space', 'up'], b'')


@pytest.mark.parametrize(
    ('typed', 'keys'),
    [
        # A sequence without an end is given up, and one that another begins in.
        (b'\x1b[' + b'1' * MAX_SEQUENCE_LENGTH + b' ', ['space']),
        (b'\x1b[ \x1b[A\x1b\x1bOB', ['up', 'down']),
    ],
)
def test_a_broken_sequence_is_no_key(typed: bytes, keys: list[str]) -> None:
    assert split_keys(typed) == (keys, b'')


class Terminal:
    """
    A pseudo-terminal with one job, in its foreground (`fg`) or not (`bg`).

    `start` is given what starts the job under job control, and options of Popen.
    """

    def __init__(
        self, ros: Domain, start: Callable[..., Process | Popen[str]], place: str
    ) -> None:
        self.ros = ros
        self.is_over = False
        self.keys, self.screen = os.openpty()
        self.before = self.attributes
        commands, self._commands = os.pipe()
        leader = [sys.executable, str(JOB_CONTROL), str(commands), place]
        started = start(leader, stdin=self.screen, pass_fds=[commands], start_new_session=True)
        os.close(commands)
        self._started = started
        self._events: list[str] = []
        Thread(target=self._listen, daemon=True).start()
        word, number = self.event().split()
        assert word == 'started'
        self.job = int(number)

    @property
    def errors(self) -> str:
        return self.process.errors

    @property
    def process(self) -> Process:
        assert isinstance(self._started, Process)
        return self._started

    def _listen(self) -> None:
        popen = self._started.popen if isinstance(self._started, Process) else self._started
        assert popen.stdout is not None
        for line in popen.stdout:
            self._events.append(line.strip())

    @property
    def attributes(self) -> list[Any]:
        return termios.tcgetattr(self.screen)

    @property
    def is_taken(self) -> bool:
        """Return whether keys come one by one, unseen; signals are keys all the same."""
        modes = self.attributes[3]
        assert modes & termios.ISIG
        return not modes & (termios.ICANON | termios.ECHO)

    def event(self) -> str:
        self.ros.probe.until(lambda: self._events)
        event = self._events.pop(0)
        self.is_over = self.is_over or event.startswith('ended')
        return event

    def put(self, place: str) -> None:
        """Put the job into the foreground or the background, and let it go on."""
        os.write(self._commands, f'{place}\n'.encode())

    def press(self, text: str) -> None:
        os.write(self.keys, text.encode())

    def await_log(self, text: str, count: int = 1) -> None:
        self.ros.probe.until(lambda: self.errors.count(text) >= count)

    def until_taken(self) -> None:
        self.ros.probe.until(lambda: self.is_taken)

    def close(self) -> None:
        if not self.is_over:
            # What is stopped is continued, so that it can end.
            os.killpg(self.job, signal.SIGTERM)
            os.killpg(self.job, signal.SIGCONT)
            while not self.is_over:
                self.event()
        for descriptor in (self.keys, self.screen, self._commands):
            os.close(descriptor)


Open = Callable[..., Terminal]


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return write_bag(tmp_path / 'bag.mcap')


@pytest.fixture
def job(ros: Domain) -> Iterator[Callable[..., Terminal]]:
    """Return what starts something on a terminal of its own."""
    terminals: list[Terminal] = []

    def start(command: Callable[..., Process | Popen[str]], place: str = 'fg') -> Terminal:
        terminals.append(Terminal(ros, command, place))
        return terminals[-1]

    yield start
    for terminal in terminals:
        terminal.close()


@pytest.fixture
def terminal(ros: Domain, bag: Path, job: Open) -> Open:
    """Return what starts a player on a terminal of its own."""

    def start(*arguments: str, place: str = 'fg') -> Terminal:
        command = ['player_node', str(bag), '--delay', '0', *arguments]
        return job(lambda leader, **o: ros.start_by(leader, *command, **o), place)

    return start


def values(numbers: list[Float64]) -> list[float]:
    return [message.data for message in numbers]


def test_keys_are_those_of_ros2_bag_play_and_of_job_control(ros: Domain, terminal: Open) -> None:
    numbers = ros.probe.listen(Float64, 'number')
    player = terminal(*STILL)
    ros.probe.await_publishers('number')
    player.until_taken()
    player.await_log('keys: space pauses and resumes, right arrow plays the next message')
    for n in range(3):
        if n:
            # The terminal is given back, and taken again in the foreground.
            player.press(CTRL_Z)
            assert player.event() == 'stopped'
            assert player.attributes == player.before
            player.put('fg')
            assert player.event() == 'continued'
            player.until_taken()
        player.press(RIGHT if n else '\x1bOC')
        ros.probe.until(lambda n=n: values(numbers) == [*range(FIRST, FIRST + n + 1)])
    player.await_log('one message on, at 0.52')
    player.press(UP + UP)
    player.await_log('rate 1.21e-05')
    player.press(DOWN)
    player.await_log('rate 1.1e-05')
    player.press(SPACE)
    player.await_log('playing from 0.52')
    player.press(RIGHT)
    player.await_log('[player_node]: it is playing; pause it first')
    player.press(SPACE)
    player.await_log('paused at 0.52')
    player.press(''.join(OTHERS))
    player.press(DOWN)
    player.await_log('rate 1e-05')
    # A service sees what a key has done.
    answer = ros.probe.call(Trigger, 'player_node/resume', Trigger.Request())
    assert answer.success
    player.press(SPACE)
    player.await_log('paused at', 2)
    # A text that is dropped on the terminal delays nothing.
    player.press(UP * 500)
    assert ros.probe.call(Trigger, 'player_node/pause', Trigger.Request()).success
    os.kill(player.job, signal.SIGHUP)
    assert player.event() == 'ended 0'
    assert player.attributes == player.before


@pytest.mark.slow
@pytest.mark.parametrize(
    ('key', 'code'),
    [(SPACE, 0), (CTRL_BACKSLASH, -signal.SIGQUIT)],
    ids=['the log', 'a core dump'],
)
def test_the_terminal_is_as_it_was_after_the_end_of(terminal: Open, key: str, code: int) -> None:
    player = terminal('--start-paused', '--rate', '9')
    player.until_taken()
    player.process.note_segments(player.job)
    player.press(key)
    assert player.event() == f'ended {code}'
    assert player.attributes == player.before


@pytest.mark.parametrize('end', ['raise ValueError', 'pass', 'os._exit(close())'])
def test_the_terminal_is_as_it_was_after_any_end_of_python(job: Open, end: str) -> None:
    code = f"""
import contextlib, os, sys, threading
from klann_ros.nodes.keyboard import Keyboard
keyboard, pressed = Keyboard(), threading.Event()
keyboard.start(lambda key: pressed.set(), lambda: None)
def close():
    with contextlib.closing(keyboard):
        return 1
pressed.wait()
{end}
"""
    environment = {**os.environ, 'PYTHONPATH': PACKAGE}

    def start(leader: list[str], **options: Any) -> Popen[str]:
        command = [*leader, sys.executable, '-c', code]
        return Popen(command, env=environment, stdout=PIPE, stderr=DEVNULL, text=True, **options)

    terminal = job(start)
    terminal.until_taken()
    terminal.press(SPACE)
    assert terminal.event() == f'ended {0 if end == "pass" else 1}'
    assert terminal.attributes == terminal.before


@pytest.mark.slow
def test_in_the_background_the_terminal_is_not_touched(ros: Domain, terminal: Open) -> None:
    player = terminal(*STILL, place='bg')
    ros.probe.until(lambda: 'ready: ' in player.errors)
    player.press(f'{SPACE}line\n')
    ros.probe.spin(0.7)
    assert player.attributes == player.before
    assert 'keys: ' not in player.errors
    # It has not been stopped for reading, and the line is still there.
    assert ros.probe.call(Trigger, 'player_node/step', Trigger.Request()).success
    assert os.read(player.screen, 100) == b' line\n'
    # Into the foreground without having been stopped, as `fg` does.
    player.put('fg')
    player.until_taken()
    player.press(SPACE)
    player.await_log('playing from')
    # And back again by way of Ctrl-Z.
    player.press(CTRL_Z)
    assert player.event() == 'stopped'
    player.put('bg')
    assert player.event() == 'continued'
    ros.probe.spin(0.7)
    assert player.attributes == player.before
    player.put('fg')
    player.until_taken()
    player.press(CTRL_C)
    assert player.event() == 'ended 0'
    assert player.attributes == player.before


@pytest.mark.slow
def test_the_terminal_is_left_alone_when_asked_to(ros: Domain, terminal: Open) -> None:
    player = terminal('--start-paused', '--disable-keyboard-controls')
    # Where keys are read, the terminal is taken before a node answers.
    assert ros.probe.call(Trigger, 'player_node/pause', Trigger.Request()).success
    ros.probe.spin(0.2)
    assert player.attributes == player.before
    player.press(CTRL_Z)
    assert player.event() == 'stopped'
    player.put('fg')
    assert player.event() == 'continued'
    player.press(CTRL_C)
    assert player.event() == 'ended 0'


@pytest.mark.parametrize('kind', ['pipe', 'closed'])
def test_keys_are_read_from_a_terminal_only(ros: Domain, bag: Path, kind: str) -> None:
    numbers = ros.probe.listen(Float64, 'number')
    read_end, write_end = os.pipe()
    os.write(write_end, b'  \n')
    arguments = [str(bag), '--delay', '0', '--start-paused', '--rate', '9']
    if kind == 'closed':
        shell = ['sh', '-c', 'exec "$@" <&-', 'sh']
        process = ros.start_by(shell, 'player_node', *arguments)
    else:
        process = ros.start_by([], 'player_node', *arguments, stdin=read_end)
    ros.probe.await_publishers('number')
    assert ros.probe.call(Trigger, 'player_node/resume', Trigger.Request()).success
    assert process.wait() == 0
    ros.probe.until(lambda: len(numbers) == COUNT)
    assert os.read(read_end, 10) == b'  \n'
    assert 'keys: ' not in process.errors
    for descriptor in (read_end, write_end):
        os.close(descriptor)
