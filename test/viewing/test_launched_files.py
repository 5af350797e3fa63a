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
    'ros2_control': {
        *('params_file', 'folder', 'hardware', 'sim', 'headless', 'record', 'output'),
    },
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
ROS2_CONTROL = {
    *('robot_state_publisher', 'ros2_control_node', 'spawner'),
    *('solver_node', 'walker_node', 'watchdog_node'),
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


MakePrefix = Callable[..., Prefix]


@pytest.fixture
def make_prefix(tmp_path: Path) -> Iterator[MakePrefix]:
    prefixes: list[Prefix] = []
    with own_domain() as domain:

        def make(**options: object) -> Prefix:
            folder = tmp_path / f'prefix {len(prefixes)}'
            prefixes.append(Prefix(folder, domain, **options))
            return prefixes[-1]

        yield make
        for prefix in prefixes:
            prefix.close()


@pytest.mark.parametrize(
    ('package', 'arguments'),
    [
        ('joint_state_publisher_gui', ['slider:=true']),
        ('robot_state_publisher', []),
        ('rviz2', ['rviz:=True']),
        ('robot_localization', ['fuse:=ekf']),
        ('velocity_controllers', ['hardware:=true']),
        ('joint_state_topic_hardware_interface', ['hardware:=true']),
    ],
)
def test_missing_packages_are_named_before_any_start(
    package: str, arguments: list[str], make_prefix: MakePrefix
) -> None:
    prefix = make_prefix(without=(package,))
    files = {'fuse:=ekf': 'walk', 'hardware:=true': 'ros2_control'}
    launch = prefix.launch(files.get(' '.join(arguments), 'demo'), arguments)
    output = launch.communicate(timeout=PATIENCE)[0]
    remedy = f'needs {package}: sudo apt install ros-jazzy-{package.replace("_", "-")}\n'
    assert output.count(remedy) == 1, output
    assert list(prefix.started()) == [(set(), 1)]


@pytest.mark.parametrize(('name', 'arguments', 'words'), LAUNCHES['refused'])
def test_misspelt_arguments_are_refused_before_any_start(
    name: str, arguments: list[str], words: str, make_prefix: MakePrefix
) -> None:
    prefix = make_prefix()
    (prefix.folder / 'list.yaml').write_text('- 1\n')
    (prefix.folder / 'open.yaml').write_text('a: [1\n')
    (prefix.folder / 'short.yaml').write_text('/**: {ros__parameters: {l_ab: -1.0}}\n')
    os.mkfifo(prefix.folder / 'pipe')
    output = prefix.launch(name, arguments).communicate(timeout=PATIENCE)[0]
    assert words in output
    assert 'Traceback' not in output
    assert list(prefix.started()) == [(set(), 1)]


@pytest.mark.parametrize(('name', 'arguments', 'failed'), LAUNCHES['failing'])
def test_a_node_that_fails_ends_the_launch_with_an_error(
    name: str, arguments: list[str], failed: str, make_prefix: MakePrefix
) -> None:
    prefix = make_prefix()
    (prefix.folder / 'wrong.yaml').write_text('/**: {ros__parameters: {max_crank_step: -1.0}}\n')
    (prefix.folder / 'there').mkdir()
    write_bag(prefix.folder / 'bag.mcap')
    output = prefix.launch(name, arguments).communicate(timeout=PATIENCE)[0]
    assert output.count(f'{failed} has failed, exit code ') == 1, output
    ((started, code),) = prefix.started()
    assert code == 1
    assert failed in started
    assert prefix.left() == []


@pytest.mark.parametrize(
    ('name', 'failed', 'arguments'),
    [
        ('leg', 'robot_state_publisher', []),
        ('walk', 'ekf_node', ['fuse:=ekf']),
        ('ros2_control', 'ros2_control_node', []),
        ('ros2_control', 'spawner', []),
    ],
)
def test_a_program_of_others_that_a_robot_needs_ends_the_launch(
    name: str, failed: str, arguments: list[str], make_prefix: MakePrefix
) -> None:
    prefix = make_prefix()
    for program in prefix.folder.glob(f'lib/*/{failed}'):
        program.write_text('#!/bin/sh\nkill -SEGV $$\n')
    launch = prefix.launch(name, arguments)
    output = launch.communicate(timeout=PATIENCE)[0]
    assert output.count(f'{failed} has failed, exit code -11; the launch ends') == 1, output
    assert launch.returncode == 1
    assert prefix.left() == []


@pytest.mark.parametrize(
    ('second', 'words'),
    [
        ("demo(params_file='no.yaml')", 'params_file:=no.yaml: there is no such file'),
        ("Node(package='no_such_package', executable='node')", "'no_such_package' not found"),
    ],
)
def test_a_late_failure_leaves_no_process(
    second: str, words: str, make_prefix: MakePrefix
) -> None:
    prefix = make_prefix()
    file = prefix.folder / 'users.launch.py'
    file.write_text(USERS.replace('{second}', second))
    launch = prefix.launch(file, [])
    output = launch.communicate(timeout=PATIENCE)[0]
    assert words in output
    assert launch.returncode == 1
    pids = re.findall(r'process started with pid \[(\d+)\]', output)
    assert len(pids) == 3, output
    assert not any(Path('/proc', pid).exists() for pid in pids)


@pytest.mark.parametrize('rviz', ['', 'exit 134'])
def test_ctrl_c_ends_everything_without_an_error(rviz: str, make_prefix: MakePrefix) -> None:
    prefix = make_prefix()
    if rviz:
        # The programs of others may fail: a recording goes on when RViz crashes.
        (prefix.folder / 'lib' / 'rviz2' / 'rviz2').write_text(f'#!/bin/sh\n{rviz}\n')
    launch = prefix.launch('demo', ['record:=true', 'output:=a run', 'rviz:=true'])
    prefix.wait_for_a_recording('a run')
    launch.send_signal(signal.SIGINT)
    output = launch.communicate(timeout=PATIENCE)[0]
    assert ('exit code 134' in output) == bool(rviz)
    assert launch.returncode == 0, output
    assert prefix.left() == []


def test_a_recorder_that_cannot_finish_its_run_is_an_error(make_prefix: MakePrefix) -> None:
    prefix = make_prefix()
    # It records, and fails at its end.
    script = 'mkdir run; trap "exit 1" INT; sleep 1; printf %20001d 0 > run/0.mcap'
    script += '; while :; do sleep 0.1; done'
    (prefix.folder / 'lib' / 'klann_ros' / 'recorder_node').write_text(f'#!/bin/sh\n{script}\n')
    (prefix.folder / 'bin' / 'mkdir').symlink_to('/bin/mkdir')
    launch = prefix.launch('demo', ['record:=true', 'output:=run'])
    prefix.wait_for_a_recording('run')
    launch.send_signal(signal.SIGINT)
    output = launch.communicate(timeout=PATIENCE)[0]
    assert 'recorder_node has failed, exit code 1' in output
    assert launch.returncode == 1
    assert prefix.left() == []


def test_a_recorded_description_does_not_meet_that_of_the_launch(make_prefix: MakePrefix) -> None:
    prefix = make_prefix(brief=True)
    log = write_bag(prefix.folder / 'a bag.mcap')
    prefix.launch('replay', [f'log:={log}']).communicate(timeout=PATIENCE)
    words = prefix.given('player_node')
    renamed = words[words.index('--remap') + 1]
    assert renamed == '/robot_description:=/recorded_robot_description'


def test_a_replay_ends_with_its_run(make_prefix: MakePrefix) -> None:
    prefix = make_prefix()
    log = write_bag(prefix.folder / 'a bag.mcap')
    output = prefix.launch('replay', [f'log:={log}']).communicate(timeout=PATIENCE)[0]
    assert list(prefix.started()) == [({'robot_state_publisher', 'player_node'}, 0)], output
    assert prefix.left() == []


def test_a_replay_that_is_looked_at_stays(make_prefix: MakePrefix) -> None:
    prefix = make_prefix()
    log = write_bag(prefix.folder / 'bag.mcap')
    launch = prefix.launch('replay', [f'log:={log}', 'rviz:=true'])
    assert any('player_node' in line and 'finished cleanly' in line for line in launch.stdout)
    with pytest.raises(subprocess.TimeoutExpired):
        launch.wait(1.0)
    assert sorted(prefix.left()) == ['robot_state_publisher', 'rviz2']
    launch.send_signal(signal.SIGINT)
    launch.communicate(timeout=PATIENCE)
    assert launch.returncode == 0
    assert prefix.left() == []


@pytest.mark.parametrize('name', ARGUMENTS)
def test_the_arguments_of_included_files_are_shown(name: str, make_prefix: MakePrefix) -> None:
    arguments = make_prefix().arguments(name)
    assert len(arguments) == len(set(arguments))
    assert set(arguments) == ARGUMENTS[name]


@pytest.mark.parametrize('name', ALWAYS)
def test_every_combination_of_flags_starts_its_nodes(name: str, make_prefix: MakePrefix) -> None:
    prefix = make_prefix(brief=True)
    flags = sorted(ARGUMENTS[name] & set(FLAGS))
    runs, expected = [], []
    for values in product(('true', 'false'), repeat=len(flags) + 1):
        has_linkage = values[0] == 'true'
        asked = [flag for flag, value in zip(flags, values[1:], strict=True) if value == 'true']
        runs.append([f'{flag}:={value}' for flag, value in zip(flags, values[1:], strict=True)])
        runs[-1] += [f'log:={ROOT}'] * (name == 'replay') + [f'linkage:={JANSEN}'] * has_linkage
        always = ALWAYS[name] | {'robot_state_publisher'}
        expected.append(always.union(*(FLAGS[flag] for flag in asked)))
    launch = prefix.launch(name, *runs)
    output = launch.communicate(timeout=5 * PATIENCE)[0]
    assert [names for names, _ in prefix.started()] == expected, output
    assert {code for _, code in prefix.started()} == {0}, output


@pytest.mark.parametrize('walker', ['4', '6'])
def test_a_walker_is_solved_with_its_own_file(walker: str, make_prefix: MakePrefix) -> None:
    prefix = make_prefix(brief=True)
    prefix.launch('walker', [f'walker:={walker}']).communicate(timeout=PATIENCE)
    assert str(prefix.folder / f'share/klann_ros/config/walker{walker}.yaml') in prefix.given(
        'solver_node'
    )


def test_the_linkage_of_a_params_file_is_solved_and_drawn(
    make_prefix: MakePrefix,
) -> None:
    prefix = make_prefix(brief=True)
    prefix.launch('walk', [f'params_file:={ROOT}/config/walker_jansen.yaml']).communicate(
        timeout=PATIENCE
    )
    files = [Path(word) for word in prefix.given('solver_node') if word.startswith('/')]
    assert not any("linkage: ''" in file.read_text() for file in files)
    assert 'front_left_inner/' in prefix.parameters('robot_state_publisher')['robot_description']


def test_a_launch_file_of_a_users_package_starts_the_users_walker(
    make_prefix: MakePrefix,
) -> None:
    prefix = make_prefix(brief=True)
    prefix.add_share(ROOT / 'examples' / 'my_walker')
    launch = prefix.launch(ROOT / 'examples' / 'my_walker' / 'launch' / 'walk.launch.py', [])
    output = launch.communicate(timeout=PATIENCE)[0]
    ((started, code),) = prefix.started()
    assert (started, code) == (ALWAYS['walk'] | {'robot_state_publisher'}, 0), output
    assert any('config/desk_walker.yaml' in word for word in prefix.given('sim_node'))


@pytest.mark.parametrize(
    ('arguments', 'package', 'adds'),
    [
        ([], 'mujoco_ros2_control', set()),
        (['record:=true', 'output:=a run'], 'mujoco_ros2_control', {'recorder_node'}),
        (['headless:=false', 'sim:=true'], 'mujoco_ros2_control', set()),
        (['hardware:=true'], 'controller_manager', set()),
        (['hardware:=True', 'sim:=true'], 'controller_manager', {'sim_node'}),
    ],
)
def test_an_exported_walker_is_launched_under_ros2_control(
    arguments: list[str], package: str, adds: set[str], make_prefix: MakePrefix
) -> None:
    prefix = make_prefix(brief=True)
    folder = prefix.folder / 'the <b> & "its" $(walker)'
    assert main([f'{ROOT}/config/walker8_two_motors.yaml', '--ros2-control', str(folder)]) == 0
    launch = prefix.launch(folder / 'ros2_control.launch.py', arguments)
    output = launch.communicate(timeout=PATIENCE)[0]
    assert list(prefix.started()) == [(ROS2_CONTROL | adds, 0)], output
    assert f'/lib/{package}/' in prefix.given('ros2_control_node')[0]
    is_real = package == 'controller_manager'
    (cranks,) = (text for text in prefix.descriptions() if '<ros2_control' in text)
    hardware = {
        element.get('name'): element.text
        for element in ET.fromstring(cranks).iter('param')  # noqa: S314 - our own
    }
    if not is_real:
        assert hardware['mujoco_model'] == str(folder / 'robot.xml')
        assert hardware['headless'] == str('headless:=false' not in arguments).lower()
    if 'recorder_node' in adds:
        parameters = {'output': 'a run', 'use_sim_time': True}
        assert prefix.parameters('recorder_node') == parameters
    for name in ('walker_node', 'solver_node'):
        assert str(folder / 'walker.yaml') in prefix.given(name)
        assert prefix.parameters(name) == {'use_sim_time': not is_real}
    assert ('imu:=imu_sensor_broadcaster/imu' in prefix.given('walker_node')) != is_real
    assert ('imu_sensor_broadcaster' in prefix.given('spawner')) != is_real


def test_any_walker_is_launched_under_ros2_control(make_prefix: MakePrefix) -> None:
    prefix = make_prefix(brief=True)
    launch = prefix.launch(
        'ros2_control',
        [],
        ['sim:=false', f'params_file:={ROOT}/config/walker_jansen.yaml'],
        ['params_file:=sem104.yaml'],
        ['folder:=config'],
    )
    shutil.copy(ROOT / 'config' / 'sem104.yaml', prefix.folder)
    output = launch.communicate(timeout=PATIENCE)[0]
    assert list(prefix.started()) == [
        (ROS2_CONTROL | {'sim_node'}, 0),
        (ROS2_CONTROL, 0),
        (set(), 1),
        (set(), 1),
    ]
    assert 'sem104.yaml is refused: --ros2-control needs a walker' in output
    assert f'folder:={prefix.folder}/config: export --ros2-control has not written it' in output
    assert 'Traceback' not in output
    assert list(prefix.folder.glob('klann_ros-*')) == []


def test_a_watchdog_that_ends_in_order_ends_its_launch(make_prefix: MakePrefix) -> None:
    prefix = make_prefix()
    launch = prefix.launch('ros2_control', [])
    assert launch.stdout is not None
    # It handles signals then.
    assert any('[watchdog_node]: ready' in line for line in launch.stdout)
    (pid,) = (pid for name, pid in prefix.processes() if name == 'watchdog_node')
    os.kill(pid, signal.SIGINT)
    output = launch.communicate(timeout=PATIENCE)[0]
    assert launch.returncode == 0, output
    assert prefix.left() == []


def test_paths_may_hold_any_character(make_prefix: MakePrefix) -> None:
    prefix = make_prefix(brief=True)
    folder = prefix.folder / 'it\'s a "folder" of $(mine)'
    folder.mkdir()
    shutil.copy(ROOT / 'config' / 'patent.yaml', folder)
    path = f'{folder.name}/patent.yaml'
    arguments = [f'params_file:={path}', 'frame_prefix:=left/', 'namespace:=left']
    launch = prefix.launch('demo', arguments)
    assert launch.communicate(timeout=PATIENCE)[0]
    assert launch.returncode == 0
    assert str(prefix.folder / path) in prefix.given('solver_node')
    parameters = prefix.parameters('robot_state_publisher')
    assert 'left/leg_plane' in parameters['robot_description']
    # A publisher of frames that is held up for a second loses no joint state.
    assert parameters['qos_overrides./left/joint_states.subscription.depth'] >= 100
