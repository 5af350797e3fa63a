"""The launch files under the real launch: arguments, programs, refusals and ends."""

from collections.abc import Callable, Iterator
from itertools import product
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
from xml.etree import ElementTree as ET

from domain import own_domain
from klann_ros.export.command import main
from launch_process import PATIENCE, Prefix, ROOT
from playable_logs import write_bag
import pytest
from yaml_tables import read_table

pytest.importorskip('launch_ros', reason='launch_ros is in a sourced ROS 2 only')

LAUNCHES = read_table(Path(__file__).with_name('launches.yaml'))
JANSEN = str(ROOT / 'klann_ros' / 'linkages' / 'jansen.yaml')
DESCRIPTION = {
    *('params_file', 'linkage', 'namespace', 'base_frame', 'frame_id', 'frame_prefix'),
    *('use_sim_time', 'rviz', 'rviz_config'),
}
LEG = DESCRIPTION | {'record', 'output', 'slider', 'view', 'view_port'}
DEMO = LEG | {'speed', 'rate'}
ARGUMENTS = {
    'description': DESCRIPTION,
    'leg': LEG,
    'demo': DEMO,
    'walker': DEMO | {'walker', 'crank'},
    'walk': LEG | {'linear', 'friction', 'slope', 'fuse'},
    'ros2_control': {'params_file', 'folder', 'hardware', 'sim', 'headless'},
    'replay': DESCRIPTION | {'log', 'play_rate', 'start_offset', 'loop'},
}
# What a launch file starts in any case, and what a flag adds.
ALWAYS = {
    'description': set(),
    'leg': {'solver_node'},
    'demo': {'solver_node', 'crank_node'},
    'walker': {'solver_node'},
    'walk': {'solver_node', 'sim_node', 'walker_node'},
    'replay': {'player_node'},
}
FLAGS = {
    'rviz': {'rviz2'},
    'slider': {'joint_state_publisher_gui'},
    'record': {'recorder_node'},
    'view': {'view_node'},
    'crank': {'crank_node'},
    'loop': set(),
    'use_sim_time': set(),
}
# A user's own launch file, which includes one of ours and fails afterwards.
USERS = """
from launch import LaunchDescription
from launch.actions import GroupAction, IncludeLaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

def demo(**arguments):
    share = FindPackageShare('klann_ros')
    return GroupAction([IncludeLaunchDescription(
        PathJoinSubstitution([share, 'launch', 'demo.launch.py']),
        launch_arguments=arguments.items(),
    )])

def generate_launch_description():
    return LaunchDescription([demo(namespace='left', frame_prefix='left/'), {second}])
"""


@pytest.fixture
def prefix(tmp_path: Path) -> Iterator[Callable[..., Prefix]]:
    made: list[Prefix] = []
    with own_domain() as domain:

        def make(**options: object) -> Prefix:
            made.append(Prefix(tmp_path / f'prefix {len(made)}', domain, **options))
            return made[-1]

        yield make
        for each in made:
            each.close()


@pytest.mark.parametrize(
    ('package', 'arguments'),
    [
        ('joint_state_publisher_gui', ['slider:=true']),
        ('robot_state_publisher', []),
        ('rviz2', ['rviz:=True']),
        ('robot_localization', ['fuse:=ekf']),
    ],
)
def test_missing_packages_are_named_before_any_start(
    package: str, arguments: list[str], prefix: Callable[..., Prefix]
) -> None:
    made = prefix(without=(package,))
    launch = made.launch('walk' if 'fuse:=ekf' in arguments else 'demo', arguments)
    output = launch.communicate(timeout=PATIENCE)[0]
    wanted = f'needs {package}: sudo apt install ros-jazzy-{package.replace("_", "-")}\n'
    assert output.count(wanted) == 1, output
    assert list(made.started()) == [(set(), 1)]


@pytest.mark.parametrize(('name', 'arguments', 'words'), LAUNCHES['refused'])
def test_misspelt_arguments_are_refused_before_any_start(
    name: str, arguments: list[str], words: str, prefix: Callable[..., Prefix]
) -> None:
    made = prefix()
    (made.folder / 'list.yaml').write_text('- 1\n')
    (made.folder / 'open.yaml').write_text('a: [1\n')
    (made.folder / 'short.yaml').write_text('/**: {ros__parameters: {l_ab: -1.0}}\n')
    os.mkfifo(made.folder / 'pipe')
    output = made.launch(name, arguments).communicate(timeout=PATIENCE)[0]
    assert words in output
    assert 'Traceback' not in output
    assert list(made.started()) == [(set(), 1)]


@pytest.mark.parametrize(('name', 'arguments', 'failed'), LAUNCHES['failing'])
def test_a_node_that_fails_ends_the_launch_with_an_error(
    name: str, arguments: list[str], failed: str, prefix: Callable[..., Prefix]
) -> None:
    made = prefix()
    (made.folder / 'wrong.yaml').write_text('/**: {ros__parameters: {max_crank_step: -1.0}}\n')
    (made.folder / 'there').mkdir()
    write_bag(made.folder / 'bag.mcap')
    output = made.launch(name, arguments).communicate(timeout=PATIENCE)[0]
    assert output.count(f'{failed} has failed, exit code ') == 1, output
    ((started, code),) = made.started()
    assert code == 1
    assert failed in started
    assert made.left() == []


@pytest.mark.parametrize(
    ('second', 'words'),
    [
        ("demo(params_file='no.yaml')", 'params_file:=no.yaml: there is no such file'),
        ("Node(package='no_such_package', executable='node')", "'no_such_package' not found"),
    ],
)
def test_a_late_failure_leaves_no_process(
    second: str, words: str, prefix: Callable[..., Prefix]
) -> None:
    made = prefix()
    file = made.folder / 'users.launch.py'
    file.write_text(USERS.replace('{second}', second))
    launch = made.launch(file, [])
    output = launch.communicate(timeout=PATIENCE)[0]
    assert words in output
    assert launch.returncode == 1
    pids = re.findall(r'process started with pid \[(\d+)\]', output)
    assert len(pids) == 3, output
    assert not any(Path('/proc', pid).exists() for pid in pids)


@pytest.mark.parametrize('rviz', ['', 'exit 134'])
def test_ctrl_c_ends_everything_without_an_error(rviz: str, prefix: Callable[..., Prefix]) -> None:
    made = prefix()
    if rviz:
        # The programs of others may fail: a recording goes on when RViz crashes.
        (made.folder / 'lib' / 'rviz2' / 'rviz2').write_text(f'#!/bin/sh\n{rviz}\n')
    launch = made.launch('demo', ['record:=true', 'output:=a run', 'rviz:=true'])
    made.wait_for_a_recording('a run')
    launch.send_signal(signal.SIGINT)
    output = launch.communicate(timeout=PATIENCE)[0]
    assert ('exit code 134' in output) == bool(rviz)
    assert launch.returncode == 0, output
    assert made.left() == []


def test_a_recorder_that_cannot_finish_its_run_is_an_error(prefix: Callable[..., Prefix]) -> None:
    made = prefix()
    # It records, and fails at its end.
    script = 'mkdir run; trap "exit 1" INT; sleep 1; printf %20001d 0 > run/0.mcap'
    script += '; while :; do sleep 0.1; done'
    (made.folder / 'lib' / 'klann_ros' / 'recorder_node').write_text(f'#!/bin/sh\n{script}\n')
    (made.folder / 'bin' / 'mkdir').symlink_to('/bin/mkdir')
    launch = made.launch('demo', ['record:=true', 'output:=run'])
    made.wait_for_a_recording('run')
    launch.send_signal(signal.SIGINT)
    output = launch.communicate(timeout=PATIENCE)[0]
    assert 'recorder_node has failed, exit code 1' in output
    assert launch.returncode == 1
    assert made.left() == []


def test_a_replay_ends_with_its_run(prefix: Callable[..., Prefix]) -> None:
    made = prefix()
    log = write_bag(made.folder / 'a bag.mcap')
    output = made.launch('replay', [f'log:={log}']).communicate(timeout=PATIENCE)[0]
    assert list(made.started()) == [({'robot_state_publisher', 'player_node'}, 0)], output
    assert made.left() == []


def test_a_replay_that_is_looked_at_stays(prefix: Callable[..., Prefix]) -> None:
    made = prefix()
    log = write_bag(made.folder / 'bag.mcap')
    launch = made.launch('replay', [f'log:={log}', 'rviz:=true'])
    assert any('player_node' in line and 'finished cleanly' in line for line in launch.stdout)
    with pytest.raises(subprocess.TimeoutExpired):
        launch.wait(1.0)
    assert sorted(made.left()) == ['robot_state_publisher', 'rviz2']
    launch.send_signal(signal.SIGINT)
    launch.communicate(timeout=PATIENCE)
    assert launch.returncode == 0
    assert made.left() == []


@pytest.mark.parametrize('name', ARGUMENTS)
def test_the_arguments_of_included_files_are_shown(
    name: str, prefix: Callable[..., Prefix]
) -> None:
    shown = prefix().arguments(name)
    assert len(shown) == len(set(shown))
    assert set(shown) == ARGUMENTS[name]


@pytest.mark.parametrize('name', ALWAYS)
def test_every_combination_of_flags_starts_its_nodes(
    name: str, prefix: Callable[..., Prefix]
) -> None:
    made = prefix(brief=True)
    flags = sorted(ARGUMENTS[name] & set(FLAGS))
    runs, expected = [], []
    for values in product(('true', 'false'), repeat=len(flags) + 1):
        has_linkage = values[0] == 'true'
        asked = [flag for flag, value in zip(flags, values[1:], strict=True) if value == 'true']
        runs.append([f'{flag}:={value}' for flag, value in zip(flags, values[1:], strict=True)])
        runs[-1] += [f'log:={ROOT}'] * (name == 'replay') + [f'linkage:={JANSEN}'] * has_linkage
        always = ALWAYS[name] | {'robot_state_publisher'}
        expected.append(always.union(*(FLAGS[flag] for flag in asked)))
    launch = made.launch(name, *runs)
    output = launch.communicate(timeout=5 * PATIENCE)[0]
    assert [names for names, _ in made.started()] == expected, output
    assert {code for _, code in made.started()} == {0}, output


@pytest.mark.parametrize('walker', ['4', '6'])
def test_a_walker_is_solved_with_its_own_file(walker: str, prefix: Callable[..., Prefix]) -> None:
    made = prefix(brief=True)
    made.launch('walker', [f'walker:={walker}']).communicate(timeout=PATIENCE)
    assert str(made.folder / f'share/klann_ros/config/walker{walker}.yaml') in made.given(
        'solver_node'
    )


def test_the_linkage_of_a_params_file_is_solved_and_drawn(
    prefix: Callable[..., Prefix],
) -> None:
    made = prefix(brief=True)
    made.launch('walk', [f'params_file:={ROOT}/config/walker_jansen.yaml']).communicate(
        timeout=PATIENCE
    )
    files = [Path(word) for word in made.given('solver_node') if word.startswith('/')]
    assert not any("linkage: ''" in file.read_text() for file in files)
    assert 'front_left_inner/' in made.parameters('robot_state_publisher')['robot_description']


def test_a_launch_file_of_a_users_package_starts_the_users_walker(
    prefix: Callable[..., Prefix],
) -> None:
    made = prefix(brief=True)
    made.add_share(ROOT / 'examples' / 'my_walker')
    launch = made.launch(ROOT / 'examples' / 'my_walker' / 'launch' / 'walk.launch.py', [])
    output = launch.communicate(timeout=PATIENCE)[0]
    ((started, code),) = made.started()
    assert (started, code) == (ALWAYS['walk'] | {'robot_state_publisher'}, 0), output
    assert any('config/desk_walker.yaml' in word for word in made.given('sim_node'))


@pytest.mark.parametrize(
    ('arguments', 'package', 'adds'),
    [
        ([], 'mujoco_ros2_control', set()),
        (['headless:=false', 'sim:=true'], 'mujoco_ros2_control', set()),
        (['hardware:=true'], 'controller_manager', set()),
        (['hardware:=True', 'sim:=true'], 'controller_manager', {'sim_node'}),
    ],
)
def test_an_exported_walker_is_launched_under_ros2_control(
    arguments: list[str], package: str, adds: set[str], prefix: Callable[..., Prefix]
) -> None:
    made = prefix(brief=True)
    folder = made.folder / 'the <b> & "its" $(walker)'
    assert main([f'{ROOT}/config/walker8_two_motors.yaml', '--ros2-control', str(folder)]) == 0
    launch = made.launch(folder / 'ros2_control.launch.py', arguments)
    output = launch.communicate(timeout=PATIENCE)[0]
    always = {'robot_state_publisher', 'ros2_control_node', 'spawner', 'solver_node'}
    always |= {'watchdog_node'}
    assert list(made.started()) == [(always | {'walker_node'} | adds, 0)], output
    assert f'/lib/{package}/' in made.given('ros2_control_node')[0]
    is_real = package == 'controller_manager'
    (cranks,) = (text for text in made.descriptions() if '<ros2_control' in text)
    hardware = {
        each.get('name'): each.text
        for each in ET.fromstring(cranks).iter('param')  # noqa: S314 - our own
    }
    if not is_real:
        assert hardware['mujoco_model'] == str(folder / 'robot.xml')
        assert hardware['headless'] == ('false' if arguments else 'true')
    for name in ('walker_node', 'solver_node'):
        assert str(folder / 'walker.yaml') in made.given(name)
        assert made.parameters(name) == {'use_sim_time': not is_real}
    assert ('imu:=imu_sensor_broadcaster/imu' in made.given('walker_node')) != is_real
    assert ('imu_sensor_broadcaster' in made.given('spawner')) != is_real


def test_any_walker_is_launched_under_ros2_control(prefix: Callable[..., Prefix]) -> None:
    made = prefix(brief=True)
    launch = made.launch(
        'ros2_control',
        [],
        ['sim:=false', f'params_file:={ROOT}/config/walker_jansen.yaml'],
        ['params_file:=sem104.yaml'],
        ['folder:=config'],
    )
    shutil.copy(ROOT / 'config' / 'sem104.yaml', made.folder)
    output = launch.communicate(timeout=PATIENCE)[0]
    always = {'robot_state_publisher', 'ros2_control_node', 'spawner', 'solver_node'}
    always |= {'watchdog_node'}
    always |= {'walker_node'}
    assert list(made.started()) == [
        (always | {'sim_node'}, 0),
        (always, 0),
        (set(), 1),
        (set(), 1),
    ]
    assert 'sem104.yaml is refused: --ros2-control needs a walker' in output
    assert f'folder:={made.folder}/config: export --ros2-control has not written it' in output
    assert 'Traceback' not in output
    assert list(made.folder.glob('klann_ros-*')) == []


def test_a_watchdog_that_ends_in_order_ends_its_launch(prefix: Callable[..., Prefix]) -> None:
    made = prefix()
    launch = made.launch('ros2_control', [])
    assert launch.stdout is not None
    # It handles signals then.
    assert any('[watchdog_node]: ready' in line for line in launch.stdout)
    (pid,) = (pid for name, pid in made.processes() if name == 'watchdog_node')
    os.kill(pid, signal.SIGINT)
    output = launch.communicate(timeout=PATIENCE)[0]
    assert launch.returncode == 0, output
    assert made.left() == []


def test_paths_may_hold_any_character(prefix: Callable[..., Prefix]) -> None:
    made = prefix(brief=True)
    folder = made.folder / 'it\'s a "folder" of $(mine)'
    folder.mkdir()
    shutil.copy(ROOT / 'config' / 'patent.yaml', folder)
    path = f'{folder.name}/patent.yaml'
    arguments = [f'params_file:={path}', 'frame_prefix:=left/', 'namespace:=left']
    launch = made.launch('demo', arguments)
    assert launch.communicate(timeout=PATIENCE)[0]
    assert launch.returncode == 0
    assert str(made.folder / path) in made.given('solver_node')
    parameters = made.parameters('robot_state_publisher')
    assert 'left/leg_plane' in parameters['robot_description']
    # A publisher of frames that is held up for a second loses no joint state.
    assert parameters['qos_overrides./left/joint_states.subscription.depth'] >= 100
