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
from ros_domain import Domain, Process

EXECUTABLES = [
    *('solver_node', 'crank_node', 'recorder_node', 'player_node', 'view_node', 'walker_node'),
    *(
        'sim_node',
        'watchdog_node',
        'commission_node',
        'review',
        'recover',
        'export',
        'describe',
        'calibrate',
    ),
    *('exercise', 'design'),
]


@pytest.fixture
def fresh(ros: Domain) -> Domain:
    """Have every process begin with its own Python: the start is what is claimed."""
    ros.fresh = True
    return ros


def blocked(process: Process) -> set[int]:
    """Return the signals that a process has taken over."""
    status = Path(f'/proc/{process.popen.pid}/status').read_text()
    mask = int(status.partition('SigBlk:')[2].split()[0], 16)
    return {number for number in range(1, 65) if mask >> (number - 1) & 1}


@pytest.mark.parametrize('name', EXECUTABLES)
def test_help_version_and_an_unknown_option(
    ros: Domain, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('COLUMNS', '80')
    options = ('--help', '--version', '--no-such-option')
    helped, versioned, refused = (ros.start(name, option) for option in options)
    assert [process.wait() for process in (helped, versioned, refused)] == [0, 0, 2]
    assert helped.output.startswith(f'usage: {name}')
    assert max(map(len, helped.output.splitlines())) <= 80
    assert versioned.output == f'{name} {__version__}\n'
    assert 'Traceback' not in refused.errors


@pytest.mark.parametrize(
    ('line', 'completed'),
    [
        *((f'{name} --ver', '--version') for name in EXECUTABLES),
        ('review --each runs --engine r', 'ray'),
    ],
)
def test_a_shell_completes_options_and_choices(
    ros: Domain, monkeypatch: pytest.MonkeyPatch, line: str, completed: str
) -> None:
    completions = ros.folder / 'completions'
    variables = {
        '_ARGCOMPLETE': '1',
        '_ARGCOMPLETE_IFS': ' ',
        '_ARGCOMPLETE_SUPPRESS_SPACE': '1',
        '_ARGCOMPLETE_STDOUT_FILENAME': str(completions),
        'COMP_LINE': line,
        'COMP_POINT': str(len(line)),
        'COMP_TYPE': '9',
    }
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert ros.start(line.partition(' ')[0]).wait() == 0
    assert completions.read_text().split() == [completed]


def test_a_folder_for_logs_that_cannot_be_made_names_the_remedy(fresh: Domain) -> None:
    (fresh.folder / 'ros_log').touch()
    process = fresh.start('crank_node')
    assert process.wait() == 1
    (line,) = process.errors.splitlines()
    assert line.startswith('crank_node: ')
    assert 'set ROS_LOG_DIR' in line


@pytest.mark.parametrize(
    ('name', 'number'),
    [('solver_node', number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    + [('crank_node', signal.SIGTERM), ('recorder_node', signal.SIGINT)],
)
def test_one_or_two_stop_signals_end_a_node_orderly(
    ros: Domain, name: str, number: signal.Signals
) -> None:
    arguments = [['-r', f'__node:=node_{k}'] for k in range(2)]
    if name == 'recorder_node':
        arguments = [[*words, '-p', f'output:=run_{k}'] for k, words in enumerate(arguments)]
    nodes = [ros.start(name, '--ros-args', *words) for words in arguments]
    ros.probe.until(lambda: {'node_0', 'node_1'} <= {*ros.probe.node.get_node_names()})
    nodes[1].popen.send_signal(number)
    for node in nodes:
        assert node.stop(number) == 0
        assert 'rror' not in node.errors
        assert 'Traceback' not in node.errors


@pytest.mark.parametrize(
    ('name', 'delays'),
    [('solver_node', [0.0, 0.1, 0.2, 0.4, 0.7]), ('crank_node', [0.1]), ('recorder_node', [0.2])],
)
def test_an_interrupt_during_the_start_leaves_no_traceback(
    fresh: Domain, name: str, delays: list[float]
) -> None:
    for delay in delays:
        node = fresh.start(name)
        fresh.probe.until(lambda node=node: signal.SIGINT in blocked(node))
        time.sleep(delay)
        assert node.stop(signal.SIGINT) == 0
        assert 'Traceback' not in node.errors


def test_nohup_outlives_its_terminal(fresh: Domain) -> None:
    handler = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        node = fresh.start('solver_node')
    finally:
        signal.signal(signal.SIGHUP, handler)
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
        ('review', 'yaml', 2, 'pip install PyYAML'),
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
    program_words, ros = split(argv)
    assert program_words == ['x', 'a', 'b:=c']
    assert ros == ['--ros-args', '-p', 'k:=1', '--', '--ros-args', '-r', 'd:=e']
