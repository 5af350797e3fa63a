"""`commission_node` as a process, with a simulated robot that is wired wrongly."""

import fcntl
import os
from pathlib import Path
import signal
import termios
from types import SimpleNamespace
from typing import Any

from crank_motors import TWO_MOTORS
from klann_ros.nodes.commission.node import CommissionNode
from klann_ros.robot import CrankDrive, robot_from_parameters, solver_parameters
import pytest
from ros_domain import Domain, Process
from sensor_msgs.msg import JointState
import yaml

FILE = ('--ros-args', '--params-file', TWO_MOTORS)
# The time of the simulated motors, which lag behind on a busy machine.
SIMULATED = (*FILE, '-p', 'use_sim_time:=true', '-p', 'feedback_timeout:=3.0')


class Commands:
    """The commands to the cranks."""

    def __init__(self, ros: Domain) -> None:
        self.probe = ros.probe
        self._messages: list[JointState] = ros.probe.listen(JointState, 'crank_command')

    def until_turning(self) -> None:
        self.probe.until(lambda: self._messages and any(self._messages[-1].velocity))

    def until_zero(self) -> None:
        """Wait for what was under way, and then for the end."""
        self.probe.until(lambda: list(self._messages[-1].velocity) == [0.0, 0.0])


def robot(ros: Domain, faults: str, **types: object) -> Process:
    return ros.start('sim_node', *FILE, faults=faults, home_switches=True, use_clock=True, **types)


@pytest.mark.parametrize(
    'types',
    [
        {},
        pytest.param(
            {'crank_state_type': 'ticks', 'counts_per_turn': 4096}, marks=pytest.mark.slow
        ),
    ],
)
def test_wrong_wiring_is_named_and_written(
    ros: Domain, tmp_path: Path, types: dict[str, Any]
) -> None:
    robot(ros, 'left_crank_reversed, right_crank_gear_ratio=-2, left_crank_zero=0.4', **types)
    commands = Commands(ros)
    options = ('--yes', '--backwards', 'left_crank', '--zero', '-o', 'cranks.yaml')
    process = ros.start('commission_node', *options, *SIMULATED, max_angle=0.3, **types)
    commands.until_turning()
    assert process.wait() == 0, process.output
    commands.until_zero()
    assert 'left_crank: wrong sign: its motor leads are exchanged\n' in process.output
    assert 'right_crank: wrong sign: its encoder counts backwards\n' in process.output
    assert 'right_crank: gear ratio: its encoder turns ' in process.output
    assert 'ended early: an encoder turned by more than 17 deg' in process.output
    text = (tmp_path / 'cranks.yaml').read_text()
    parameters = {**solver_parameters(yaml.safe_load(Path(TWO_MOTORS).read_text()))}
    written = yaml.safe_load(text)['/**']['ros__parameters']
    drives = robot_from_parameters({**parameters, **written}).drives
    left, right = drives.values()
    assert left == CrankDrive(1.0, -1.0, pytest.approx(0.4, abs=0.05))  # type: ignore[arg-type]
    assert right.encoder_ratio == pytest.approx(-2.0, rel=0.15)
    # A file is not replaced unless it is said.
    again = ros.start('commission_node', *options, *FILE)
    assert again.wait() == 2
    assert 'cranks.yaml exists already: --overwrite replaces it' in again.errors
    assert (tmp_path / 'cranks.yaml').read_text() == text


def test_a_failed_step_is_no_end_of_the_last_one(ros: Domain, tmp_path: Path) -> None:
    robot(ros, 'left_crank_zero=0.4')
    commands = Commands(ros)
    script = str(Path(__file__).with_name('failing_commission.py'))
    process = ros.start('python', script, '--yes', '-o', 'cranks.yaml', *SIMULATED, angle=0.05)
    commands.until_turning()
    assert process.wait() == 1
    commands.until_zero()
    assert 'RuntimeError: on purpose' in process.errors
    assert process.output.count('commission_node: it failed, as its log says: nothing is') == 1
    assert not (tmp_path / 'cranks.yaml').exists()


@pytest.mark.slow
def test_a_closed_pipe_stops_the_cranks(ros: Domain) -> None:
    robot(ros, 'imu_missing')
    commands = Commands(ros)
    to_head = ['bash', '-c', 'set -o pipefail; "$0" "$@" | head -1']
    process = ros.start_by(to_head, 'commission_node', '--yes', *SIMULATED, '-p', 'angle:=0.05')
    commands.until_turning()
    assert process.wait() == 1
    commands.until_zero()
    assert process.output == 'left_crank turns\n'
    assert 'BrokenPipeError' in process.errors
    assert 'Traceback' not in process.errors
    assert 'Exception ignored' not in process.errors


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_cranks(ros: Domain, number: signal.Signals) -> None:
    robot(ros, 'imu_missing')
    commands = Commands(ros)
    process = ros.start('commission_node', '--yes', *SIMULATED, angle=0.6, rate=0.05)
    commands.until_turning()
    # Nothing was measured, so a script must not walk on.
    assert process.stop(number) == 1
    commands.until_zero()
    assert process.output == 'left_crank turns\n'
    assert 'Traceback' not in process.errors


def test_a_key_begins_and_a_key_stops(ros: Domain) -> None:
    robot(ros, 'imu_missing')
    commands = Commands(ros)
    keys, screen = os.openpty()
    process = Process(
        'commission_node',
        *(*SIMULATED, '-p', 'angle:=0.6', '-p', 'rate:=0.05'),
        domain=ros.domain,
        cwd=ros.folder,
        stdin=screen,
        start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
    )
    output: Any = process.popen.stdout
    # A key before the question begins nothing.
    os.write(keys, b' ')
    try:
        assert output.readline().startswith('left_crank, right_crank will turn by 34 deg')
        assert not commands._messages
        os.write(keys, b' ')
        commands.until_turning()
        os.write(keys, b' ')
        assert process.wait() == 1
        commands.until_zero()
        assert 'commission_node: stopped by a key' in process.output
    finally:
        process.release()
        os.close(keys)
        os.close(screen)


def test_without_a_terminal_it_turns_nothing_unasked(ros: Domain) -> None:
    process = ros.start('commission_node', *FILE)
    assert process.wait() == 1
    assert '--yes turns the cranks without a question' in process.errors


@pytest.mark.parametrize(
    ('name', 'words'), [('other', '/other'), ('commission_node', 'another node of this name')]
)
def test_it_refuses_to_drive_beside_another_node(ros: Domain, name: str, words: str) -> None:
    ros.probe.add_node(name).create_publisher(JointState, 'crank_command', 10)
    process = ros.start('commission_node', '--yes', *FILE)
    assert process.wait() == 1
    assert f'commission_node: {words} publishes /crank_command: end it first' in process.output


def test_an_unknown_joint_is_refused(ros: Domain) -> None:
    process = ros.start('commission_node', '--yes', '--backwards', 'wheel', *FILE)
    assert process.wait() == 1
    words = "--backwards = 'wheel' is refused: it must be of left_crank, right_crank, or none"
    assert words in process.errors


@pytest.mark.parametrize(
    ('output', 'reason'),
    [
        ('there/is/none.yaml', 'there is no folder '),
        ('.', 'it is a folder'),
        (TWO_MOTORS, f'it is {TWO_MOTORS}, which is only read'),
    ],
)
def test_a_file_that_cannot_be_written_turns_nothing(
    ros: Domain, output: str, reason: str
) -> None:
    process = ros.start('commission_node', '--yes', '--overwrite', '-o', output, *FILE)
    assert process.wait() == 2
    assert f'error: -o {output} cannot be written: {reason}' in process.errors


def test_a_folder_that_disappears_meanwhile_ends_it(ros: Domain, tmp_path: Path) -> None:
    folder = tmp_path / 'notes'
    folder.mkdir()
    robot(ros, 'imu_missing')
    commands = Commands(ros)
    options = ('--yes', '-o', 'notes/cranks.yaml')
    process = ros.start('commission_node', *options, *SIMULATED)
    commands.until_turning()
    folder.rmdir()
    assert process.wait() == 1
    commands.until_zero()
    assert process.output.count('left_crank turns') == 1
    reason = '-o notes/cranks.yaml cannot be written: there is no folder'
    assert f'commission_node: {reason}' in process.output
    assert 'encoder_ratio: 1.0' in process.output
    assert 'callback failed' not in process.errors


@pytest.mark.parametrize(
    ('names', 'is_withdrawn', 'has_feedback', 'times', 'problem'),
    [
        ((), False, False, (10.0, 10.5), 'no crank_state of left, right: start the driver'),
        ((), True, True, (0.0, 0.0), 'stopped by a key'),
        # Discovery knows a publisher before its node.
        (
            ('_NODE_NAME_UNKNOWN_',),
            False,
            True,
            (2.0, 2.5),
            'another node of this name publishes /crank_command: end it first',
        ),
        (
            ('commission_node',),
            False,
            True,
            (0.0, 0.0),
            'another node of this name publishes /crank_command: end it first',
        ),
        (('b', 'a'), False, True, (0.0, 0.0), '/a, /b publishes /crank_command: end it first'),
    ],
)
def test_no_crank_turns_before_all_is_ready(
    names: tuple[str, ...],
    is_withdrawn: bool,
    has_feedback: bool,
    times: tuple[float, float],
    problem: str,
) -> None:
    publishers = [
        SimpleNamespace(node_name=name, node_namespace='/') for name in ('commission_node', *names)
    ]
    node: Any = SimpleNamespace(
        _start_time=0.0,
        _joints=('left', 'right'),
        _has_feedback=has_feedback,
        _permission=SimpleNamespace(is_withdrawn=is_withdrawn),
        resolve_topic_name=lambda name: f'/{name}',
        count_publishers=lambda _: len(publishers),
        get_publishers_info_by_topic=lambda _: publishers,
        get_fully_qualified_name=lambda: '/commission_node',
    )
    last_time, time = times
    if last_time < time:
        assert CommissionNode._problem(node, last_time) == ''
    assert CommissionNode._problem(node, time) == problem


@pytest.mark.parametrize(
    ('problem', 'code', 'files'), [('', 0, ['cranks.yaml']), ('repair first: imu', 1, [])]
)
def test_a_robot_that_needs_repair_is_not_written(
    problem: str, code: int, files: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    codes: list[int] = []
    written: list[str] = []
    node: Any = SimpleNamespace(
        _command=lambda _: None,
        _commands=SimpleNamespace(publish=lambda *_: None),
        _commissioning=SimpleNamespace(findings=[], problem=problem),
        _output_path='cranks.yaml',
        _write=lambda path: written.append(path) or '',
        _finish=codes.append,
    )
    CommissionNode._end(node, '')
    assert (codes, written) == ([code], files)
    assert problem in capsys.readouterr().out


def test_no_crank_turns_before_others_are_discovered() -> None:
    times = [0.5, 2.0, 2.5]
    steps: list[float] = []
    node: Any = SimpleNamespace(
        _is_complete=False,
        _types=SimpleNamespace(check=lambda: ''),
        _commissioning=SimpleNamespace(now=0.0),
        _clock=SimpleNamespace(now=lambda: times[0]),
        _start_time=0.0,
        _problem=lambda _: '',
        _has_feedback=True,
        _permission=SimpleNamespace(is_given=True),
        _step=lambda: steps.append(times[0]),
    )
    while times:
        CommissionNode._on_timer(node)
        times.pop(0)
    assert steps == [2.5]
