"""How every executable starts and ends."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from fork_server import PACKAGE
from klann_ros import __version__
from klann_ros.nodes.process import split
import pytest
from ros_world import Process, World

NODES = ['solver_node', 'crank_node', 'recorder_node']
NODES_OF_WALKERS = ['walker_node', 'sim_node']
EXECUTABLES = [
    *NODES,
    'player_node',
    'view_node',
    *NODES_OF_WALKERS,
    'review',
    'recover',
    'export',
]
STOP_SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]


@pytest.fixture
def fresh(ros: World) -> World:
    """Have every process begin with its own Python: the start is what is claimed."""
    ros.fresh = True
    return ros


def blocked(process: Process) -> set[int]:
    """Return the signals that a process has taken over."""
    status = Path(f'/proc/{process.popen.pid}/status').read_text()
    mask = int(status.partition('SigBlk:')[2].split()[0], 16)
    return {number for number in range(1, 65) if mask >> (number - 1) & 1}


@pytest.mark.parametrize('name', EXECUTABLES)
def test_help_and_version(ros: World, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('COLUMNS', '80')
    asked = {option: ros.start(name, option) for option in ('--help', '--version')}
    assert [process.wait() for process in asked.values()] == [0, 0]
    assert asked['--help'].output.startswith(f'usage: {name}')
    # Of a terminal's 80 columns argparse leaves two free.
    assert max(map(len, asked['--help'].output.splitlines())) <= 80
    assert asked['--version'].output == f'{name} {__version__}\n'


@pytest.mark.parametrize(
    ('line', 'completed'),
    [
        *((f'{name} --ver', '--version') for name in EXECUTABLES),
        ('review --each runs --engine r', 'ray'),
    ],
)
def test_a_shell_completes_options_and_choices(line: str, completed: str, tmp_path: Path) -> None:
    name = line.partition(' ')[0]
    variables = {
        '_ARGCOMPLETE': '1',
        '_ARGCOMPLETE_IFS': ' ',
        '_ARGCOMPLETE_SUPPRESS_SPACE': '1',
        '_ARGCOMPLETE_STDOUT_FILENAME': str(tmp_path / 'completions'),
        'COMP_LINE': line,
        'COMP_POINT': str(len(line)),
        'COMP_TYPE': '9',
    }
    command = f'import sys; from klann_ros.executables import {name}; sys.exit({name}())'
    subprocess.run(
        [sys.executable, '-c', command], env=os.environ | variables, check=True, timeout=60
    )
    assert (tmp_path / 'completions').read_text().split() == [completed]


@pytest.mark.parametrize('name', EXECUTABLES)
def test_an_unknown_option_is_exit_code_2_without_a_traceback(ros: World, name: str) -> None:
    process = ros.start(name, '--no-such-option')
    assert process.wait() == 2
    assert 'Traceback' not in process.errors


def test_a_folder_for_logs_that_cannot_be_made_names_the_remedy(fresh: World) -> None:
    (fresh.folder / 'ros_log').touch()
    process = fresh.start('crank_node')
    assert process.wait() == 1
    (line,) = process.errors.splitlines()
    assert line.startswith('crank_node: ')
    assert 'set ROS_LOG_DIR' in line


@pytest.mark.parametrize('number', STOP_SIGNALS)
@pytest.mark.parametrize('name', NODES)
def test_a_stop_signal_ends_a_node_in_order(ros: World, name: str, number: signal.Signals) -> None:
    node = ros.start(name)
    ros.probe.until(lambda: name in ros.probe.node.get_node_names())
    assert node.stop(number) == 0
    assert 'Traceback' not in node.errors
    assert 'rror' not in node.errors


@pytest.mark.parametrize('name', NODES)
def test_two_interrupts_in_a_row_are_one(ros: World, name: str) -> None:
    node = ros.start(name)
    ros.probe.until(lambda: name in ros.probe.node.get_node_names())
    node.popen.send_signal(signal.SIGINT)
    assert node.stop(signal.SIGINT) == 0
    assert 'Traceback' not in node.errors


@pytest.mark.parametrize('delay', [0.0, 0.1, 0.2, 0.4, 0.7])
@pytest.mark.parametrize('name', NODES)
def test_an_interrupt_while_it_starts_leaves_no_traceback(
    fresh: World, name: str, delay: float
) -> None:
    node = fresh.start(name)
    fresh.probe.until(lambda: signal.SIGINT in blocked(node))
    time.sleep(delay)
    assert node.stop(signal.SIGINT) == 0
    assert 'Traceback' not in node.errors


def test_nohup_outlives_its_terminal(fresh: World) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        node = fresh.start('solver_node')
    finally:
        signal.signal(signal.SIGHUP, before)
    fresh.probe.until(lambda: 'solver_node' in fresh.probe.node.get_node_names())
    node.popen.send_signal(signal.SIGHUP)
    fresh.probe.spin(0.5)
    assert node.popen.poll() is None
    assert node.stop(signal.SIGTERM) == 0


@pytest.mark.parametrize(
    ('name', 'absent', 'code', 'remedy'),
    [
        ('solver_node', 'rclpy', 1, 'source ROS 2'),
        ('recorder_node', 'mcap', 1, 'pip install mcap'),
        ('review', 'mcap_ros2', 2, 'pip install mcap-ros2-support'),
    ],
)
def test_a_package_that_is_absent_is_one_line_with_its_remedy(
    name: str, absent: str, code: int, remedy: str
) -> None:
    program = (
        f'import sys; sys.modules["{absent}"] = None\n'
        f'from klann_ros.executables import {name}; sys.exit({name}())'
    )
    done = subprocess.run(
        [sys.executable, '-c', program, 'no_such_run'],
        env={**os.environ, 'PYTHONPATH': PACKAGE},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code
    assert done.stderr.count('\n') == 1
    assert remedy in done.stderr


def test_a_command_line_is_split_between_us_and_ros() -> None:
    argv = ['x', 'a', '--ros-args', '-p', 'k:=1', '--', 'b:=c', '--ros-args', '-r', 'd:=e']
    own, ros = split(argv)
    assert own == ['x', 'a', 'b:=c']
    assert ros == ['--ros-args', '-p', 'k:=1', '--', '--ros-args', '-r', 'd:=e']
