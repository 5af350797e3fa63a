"""The launch files under the real launch: their arguments, and what they start."""

from collections.abc import Callable
from itertools import product
import shutil

from launched import PATIENCE, Prefix, ROOT
import pytest
import yaml

pytest.importorskip('launch_ros', reason='launch_ros is in a sourced ROS 2 only')

JANSEN = str(ROOT / 'klann_ros' / 'linkages' / 'jansen.yaml')
DESCRIPTION = {
    *('params_file', 'linkage', 'namespace', 'base_frame', 'frame_id', 'frame_prefix'),
    *('use_sim_time', 'rviz', 'rviz_config'),
}
LEG = DESCRIPTION | {'record', 'output', 'slider', 'view', 'view_port'}
DEMO = LEG | {'speed', 'rate'}
ARGUMENTS = {
    'checks': set(),
    'description': DESCRIPTION,
    'leg': LEG,
    'demo': DEMO,
    'walker': DEMO | {'walker', 'crank'},
    'walk': LEG | {'linear', 'friction', 'slope'},
    'ros2_control': {'params_file', 'sim'},
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


@pytest.mark.parametrize('name', ARGUMENTS)
def test_the_arguments_of_included_files_are_shown(
    name: str, prefix: Callable[..., Prefix]
) -> None:
    shown = prefix().arguments(name)
    assert len(shown) == len(set(shown))
    assert set(shown) == ARGUMENTS[name]


@pytest.mark.parametrize('name', ALWAYS)
def test_every_combination_of_flags_starts_what_it_asks_for(
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
        frames = 'static_transform_publisher' if has_linkage else 'robot_state_publisher'
        expected.append(ALWAYS[name].union({frames}, *(FLAGS[flag] for flag in asked)))
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


def test_a_path_may_hold_what_it_likes(prefix: Callable[..., Prefix]) -> None:
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
    (description,) = (made.folder / word for word in made.given('robot_state_publisher')[-1:])
    urdf = yaml.safe_load(description.read_text())
    (parameters,) = (node['ros__parameters'] for node in urdf.values())
    assert 'left/leg_plane' in parameters['robot_description']
    # A publisher of frames that is held up for a second loses no joint state.
    assert parameters['qos_overrides./left/joint_states.subscription.depth'] >= 100
