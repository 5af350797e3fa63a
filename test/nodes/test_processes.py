"""How every executable starts and ends."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import time

from domain import own_domain
from fork_server import PACKAGE
from klann_ros import __version__
from klann_ros.log.reader import open_log
from klann_ros.nodes.process import split
from klann_ros.stop_signals import END_TIMEOUT
import pytest
from ros_domain import Domain, PATIENCE

STUCK_NODE = Path(__file__).with_name('stuck_node.py')

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
    *('exercise', 'design', 'import_linkage'),
]


@pytest.fixture
def fresh(ros: Domain) -> Domain:
    """Have every process begin with its own Python: the start is what is claimed."""
    ros.fresh = True
    return ros


def blocked(folder: Path) -> set[int]:
    """Return the signals that a process has taken over, or a thread, by its folder in /proc."""
    status = (folder / 'status').read_text()
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


@pytest.mark.parametrize(
    'wrapper', [['env'], ['env', '-u', 'ROS_LOG_DIR', '-u', 'HOME', '-u', 'USER']]
)
def test_a_folder_for_logs_that_cannot_be_made_names_the_remedy(
    fresh: Domain, wrapper: list[str]
) -> None:
    (fresh.folder / 'ros_log').touch()
    process = fresh.start_by(wrapper, 'crank_node')
    assert process.wait() == 1
    # Without a home ROS prints lines of its own before.
    line = process.errors.splitlines()[-1]
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ('name', 'delays'),
    [('solver_node', [0.0, 0.1, 0.2, 0.4, 0.7]), ('crank_node', [0.1]), ('recorder_node', [0.2])],
)
def test_an_interrupt_during_the_start_leaves_no_traceback(
    fresh: Domain, name: str, delays: list[float]
) -> None:
    for delay in delays:
        node = fresh.start(name)
        fresh.probe.until(
            lambda node=node: signal.SIGINT in blocked(Path(f'/proc/{node.popen.pid}'))
        )
        time.sleep(delay)
        assert node.stop(signal.SIGINT) == 0
        assert 'Traceback' not in node.errors


class StuckNode:
    """A node whose middleware never ends, with its timeout and its grace of signals [s]."""

    def __init__(self, domain: int, folder: Path, timeout: float, grace: float, name: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(STUCK_NODE), str(timeout), str(grace), name],
            cwd=folder,
            env={**os.environ, 'PYTHONPATH': PACKAGE, 'ROS_DOMAIN_ID': str(domain)},
            stderr=subprocess.PIPE,
            text=True,
        )
        # Its first line.
        self.read_line()

    def read_line(self) -> str:
        assert self._process.stderr is not None
        return self._process.stderr.readline()

    def stop(self, number: signal.Signals) -> None:
        """Send a signal, and wait until the node is stuck."""
        self._process.send_signal(number)
        while self.read_line() not in ('stuck\n', ''):
            pass

    def await_grace(self, number: signal.Signals) -> None:
        """Wait until no thread of the node takes a signal."""
        threads = Path(f'/proc/{self._process.pid}/task')
        while not all(number in blocked(thread) for thread in threads.iterdir()):
            time.sleep(0.01)

    def end(self, number: signal.Signals) -> int:
        """Send a signal again and again; return the exit code."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            self._process.send_signal(number)
            with suppress(subprocess.TimeoutExpired):
                return self._process.wait(0.1)
        raise TimeoutError

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()


@pytest.fixture
def start_stuck(tmp_path: Path) -> Iterator[Callable[..., StuckNode]]:
    """Start nodes whose middleware never ends."""
    with own_domain() as domain, ExitStack() as stack:

        def start(name: str, *, timeout: float = END_TIMEOUT, grace: float = 600.0) -> StuckNode:
            node = StuckNode(domain, tmp_path, timeout, grace, name)
            stack.callback(node.kill)
            return node

        yield start


@pytest.mark.slow
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_middleware_that_never_ends_does_not_hold_up_a_finished_node(
    start_stuck: Callable[..., StuckNode], tmp_path: Path, number: signal.Signals
) -> None:
    recorder = start_stuck('recorder_node')
    recorder.stop(number)
    recorder.await_grace(number)
    # The next ones come soon, as those of `ros2 launch`, and change nothing.
    assert recorder.end(number) == 0
    (run,) = (tmp_path / 'runs').iterdir()
    with open_log(run) as log:
        assert log.problems == ()


def test_a_stuck_node_ends_with_the_code_that_it_has_earned(
    start_stuck: Callable[..., StuckNode], tmp_path: Path
) -> None:
    recorder = start_stuck('recorder_node')
    shutil.rmtree(tmp_path / 'runs')
    recorder.stop(signal.SIGINT)
    assert recorder.end(signal.SIGINT) == 1


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_later_signal_ends_a_stuck_node_at_once(
    start_stuck: Callable[..., StuckNode], number: signal.Signals
) -> None:
    crank = start_stuck('crank_node', timeout=600.0, grace=0.2)
    crank.stop(number)
    assert crank.end(number) == -number


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


def test_a_closed_standard_output_leaves_the_end_in_order() -> None:
    end = 'from klann_ros.stop_signals import StopSignals; StopSignals().limit_end(0)'
    shell = ('sh', '-c', 'exec "$@" >&-', 'sh')
    process = subprocess.run(
        [*shell, sys.executable, '-c', end], stderr=subprocess.PIPE, text=True, check=False
    )
    assert (process.returncode, process.stderr) == (0, '')


@pytest.mark.parametrize(
    ('name', 'absent', 'code', 'remedy'),
    [
        ('solver_node', 'rclpy', 1, 'source ROS 2'),
        ('recorder_node', 'mcap', 1, 'pip install mcap'),
        ('review no_such_run', 'yaml', 2, 'pip install PyYAML'),
        ('walker_node', 'nav_msgs', 1, "pip install 'klann_ros[ros]'"),
        ('view_node', 'aiohttp', 1, "pip install 'klann_ros[view]'"),
        ('sim_node --ros-args -p legs:=[a,b]', 'mujoco', 1, "pip install 'klann_ros[sim]'"),
        ('solver_node --ros-args -p linkage:=jansen', 'jsonschema', 1, 'pip install jsonschema'),
        ('design no_such_file', 'pymoo', 2, "pip install 'klann_ros[design]'"),
        ('calibrate no_such_run --leg sem104', 'scipy', 2, 'pip install'),
        ('export sem104 --dxf no.dxf', 'ezdxf', 3, "pip install 'klann_ros[dxf]'"),
        ('review --each . --table no.parquet', 'pyarrow', 2, "pip install 'klann_ros[parquet]'"),
        ('review --each . --engine ray', 'ray', 2, "pip install 'klann_ros[cluster]'"),
    ],
)
def test_a_package_that_is_absent_is_one_line_with_its_remedy(
    name: str, absent: str, code: int, remedy: str, tmp_path: Path
) -> None:
    name, *arguments = name.split()
    program = (
        f'import sys; sys.modules["{absent}"] = None\n'
        f'from klann_ros.executables import {name}; sys.exit({name}())'
    )
    done = subprocess.run(
        [sys.executable, '-c', program, *arguments],
        cwd=tmp_path,
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
