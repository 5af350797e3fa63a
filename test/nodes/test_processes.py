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
def test_help_and_version(ros: World, name: str) -> None:
    asked = {option: ros.start(name, option) for option in ('--help', '--version')}
    assert [process.wait() for process in asked.values()] == [0, 0]
    assert asked['--help'].output.startswith(f'usage: {name}')
    assert asked['--version'].output == f'{name} {__version__}\n'


@pytest.mark.parametrize('name', EXECUTABLES)
def test_an_unknown_option_is_exit_code_2_without_a_traceback(ros: World, name: str) -> None:
    process = ros.start(name, '--no-such-option')
    assert process.wait() == 2
    assert 'Traceback' not in process.errors


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


def test_without_ros_one_line_says_what_to_do() -> None:
    code = (
        'import sys; sys.modules["rclpy"] = None\n'
        'from klann_ros.executables import solver_node; sys.exit(solver_node())'
    )
    done = subprocess.run(
        [sys.executable, '-c', code],
        env={**os.environ, 'PYTHONPATH': PACKAGE},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.count('\n') == 1
    assert 'source ROS 2' in done.stderr


def test_a_command_line_is_split_between_us_and_ros() -> None:
    argv = ['x', 'a', '--ros-args', '-p', 'k:=1', '--', 'b:=c', '--ros-args', '-r', 'd:=e']
    own, ros = split(argv)
    assert own == ['x', 'a', 'b:=c']
    assert ros == ['--ros-args', '-p', 'k:=1', '--', '--ros-args', '-r', 'd:=e']
