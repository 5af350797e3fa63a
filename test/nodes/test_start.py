"""A node's line at its start, its help, and parameters of numbers and masses."""

from collections.abc import Callable
from pathlib import Path
import re
import subprocess
import sys
from typing import Any

from klann_ros.log.run_parameters import LINKAGE_PARAMETER
from klann_ros.nodes.crank.node import main as crank_main
from klann_ros.nodes.recorder.node import main as recorder_main
from klann_ros.nodes.solver.node import main as solver_main
from playable_logs import write_bag
import pytest
from ros_domain import Domain
from yaml_tables import read_table

ROOT = Path(__file__).resolve().parents[2]
JANSEN = ROOT / 'klann_ros' / 'linkages' / 'jansen.yaml'
# Parameters of every node of rclpy, and one that users do not set.
OF_ALL = {'use_sim_time', 'start_type_description_service', LINKAGE_PARAMETER}
WORDS = {
    'CONFIG': str(ROOT / 'config'),
    'JANSEN': str(JANSEN),
    'TURNED': 'turned by /crank_angle and /crank_state (joint crank)',
}
LINES = read_table(Path(__file__).with_name('start_lines.yaml'))


@pytest.mark.parametrize(('name', 'arguments', 'line'), LINES)
def test_a_node_logs_its_task_in_one_line(
    create: Callable[..., Any],
    capfd: pytest.CaptureFixture[str],
    name: str,
    arguments: list[str],
    line: str,
) -> None:
    for word, text in WORDS.items():
        *arguments, line = (argument.replace(word, text) for argument in [*arguments, line])
    create(name, *arguments)
    lines = [text.partition(']: ')[2] for text in capfd.readouterr().err.splitlines()]
    assert lines == [f'ready: {line}']


def test_a_player_logs_its_task_in_one_line(ros: Domain, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag.mcap')
    arguments = ['--start-offset', '0.5', '--loop', '--start-paused', '--topics', 'number']
    player = ros.start('player_node', str(bag), *arguments, rate=2)
    line = f'ready: {bag}, 1 topic, 0.990 s at rate 2, from 0.5 s, again and again, paused\n'
    ros.probe.until(lambda: line in player.errors)


def test_a_number_takes_the_type_of_its_default(create: Callable[..., Any]) -> None:
    parameters = ('phase:=3', 'direction:=-1.0', 'assembly:=[1.0, 1.0]')
    solver = create('solver_node', *(word for value in parameters for word in ('-p', value)))
    values = [solver.get_parameter(name).value for name in ('phase', 'direction')]
    assert (values, [type(value) for value in values]) == ([3.0, -1], [float, int])
    assert list(solver.get_parameter('assembly').value) == [1, 1]
    for name in ('phase', 'direction'):
        descriptor = solver.describe_parameter(name)
        assert descriptor.read_only
        assert descriptor.description
    length, bend = (solver.describe_parameter(name) for name in ('l_ab', 'angle_fgh'))
    assert ('[m]' in length.description, '[rad]' in bend.description) == (True, True)
    assert not length.read_only


def test_masses_are_declared_where_they_are_given(create: Callable[..., Any]) -> None:
    parameters = ('legs:=[one]', 'bar_density:=1', 'one.foot_mass:=0.2')
    solver = create('solver_node', *(word for value in parameters for word in ('-p', value)))
    names = ['bar_density', 'foot_mass', 'one.foot_mass']
    assert [solver.has_parameter(name) for name in names] == [True, False, True]
    assert [solver.get_parameter(name).value for name in names[::2]] == [1, 0.2]


MAINS = {'solver_node': solver_main, 'crank_node': crank_main, 'recorder_node': recorder_main}


@pytest.mark.parametrize(
    ('name', 'arguments'),
    [('solver_node', ['-p', 'legs:=[LEG]']), *((name, []) for name in MAINS)],
)
def test_the_help_has_every_parameter(
    create: Callable[..., Any], capsys: pytest.CaptureFixture[str], name: str, arguments: list[str]
) -> None:
    names = set(create(name, *arguments).list_parameters([], 0).names) - OF_ALL
    with pytest.raises(SystemExit) as end:
        MAINS[name]([name, '--help'], None)  # type: ignore[arg-type]
    assert end.value.code == 0
    assert len(names) > 5
    plain = {name for name in names if not name.startswith('qos_overrides.')}
    assert plain <= set(re.findall(r'[\w.]+', capsys.readouterr().out))


def test_a_start_loads_nothing_that_only_markers_mistakes_and_simulations_need() -> None:
    code = 'import sys; from klann_ros.executables import solver_node; sys.exit(solver_node())'
    start = [sys.executable, '-X', 'importtime', '-c', code, '--ros-args', '-p', 'tolerance:=0.0']
    done = subprocess.run(start, check=False, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    loaded = set(re.findall(r'\| +(\S+)$', done.stderr, re.MULTILINE))
    assert {
        'rclpy',
        'klann_ros.nodes.solver.leg_publishers',
        'type_description_interfaces',
    } <= loaded
    unneeded = {
        # what the generator of rclpy's messages needs
        *('lark', 'em', 'rosidl_adapter'),
        *('klann_ros.dynamics.forces', 'klann_ros.kinematics.batch.kernels'),
        *('klann_ros.kinematics.foot.path', 'klann_ros.kinematics.svg', 'difflib', 'tempfile'),
        *('importlib.metadata', 'importlib.resources', 'jsonschema', 'mcap', 'matplotlib'),
    }
    assert loaded & unneeded == set()


MUTATED_START = """
import sys
import rclpy.impl.rcutils_logger as logger
source = open(logger.__file__, encoding='utf-8').read()
del logger.inspect
exec(compile(source.replace('inspect', {!r}).replace('import looking', 'import inspect as looking')
    .replace('getframeinfo(frame)', {!r}), logger.__file__, 'exec'), vars(logger))
from klann_ros.executables import crank_node
sys.exit(crank_node())
"""


@pytest.mark.parametrize(
    ('module', 'call'),
    [('looking', 'getframeinfo(frame)'), ('inspect', 'getouterframes(frame, 2)[0]')],
)
def test_a_logger_of_another_rclpy_is_left_as_it_is(module: str, call: str) -> None:
    """A distribution may import `inspect` by another name, or use another function of it."""
    code = MUTATED_START.format(module, call)
    arguments = ['--ros-args', '-p', 'revolutions:=0.001']
    start = [sys.executable, '-c', code, *arguments]
    done = subprocess.run(start, check=False, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr.count('ready: constant')) == (0, 1)


def test_ctrl_c_is_handled_before_any_slow_import() -> None:
    code = """
import signal, sys
from klann_ros import executables
assert 'klann_ros.sanitize' not in sys.modules
sys.modules['klann_ros.stop_signals'] = type(sys)('unfinished')
try:
    executables.crank_node()
except ImportError:
    print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))
"""
    done = subprocess.run(
        [sys.executable, '-c', code], check=False, capture_output=True, text=True
    )
    assert (done.stdout, done.stderr) == ('True\n', '')
