"""What mujoco_ros2_control's plugin, ros2_control and launch ask of the exported files."""

import ast
from dataclasses import replace
from pathlib import Path
import resource
from typing import Any
from xml.etree import ElementTree as ET

from klann_ros.export.command import main
from klann_ros.export.ros2_control import controllers, cranks_urdf
from klann_ros.nodes.watchdog.node import WATCHDOG_PARAMETERS
from klann_ros.robot import robot_of
from klann_ros.twin import Twin
from launch_api import NAMES
import mujoco
import numpy as np
import pytest
from yaml_tables import read_table

ROOT = Path(__file__).resolve().parents[2]
FREE = int(mujoco.mjtJoint.mjJNT_FREE)
JOINT_TYPES = (FREE, int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
# By file, of ros2_controllers (jazzy, 2026-08) and controller_manager; what is set of each.
PUBLISHED = read_table(Path(__file__).parent / 'controller_parameters.yaml')


@pytest.fixture(scope='module', params=['walker6', 'walker_jansen', 'slotted_leg'])
def exported(request: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """Return a robot's file, and the exported folder."""
    folder = tmp_path_factory.mktemp(request.param) / 'control'
    file = str(ROOT / 'config' / f'{request.param}.yaml')
    if request.param == 'slotted_leg':
        text = (ROOT / 'config' / 'walker8_two_motors.yaml').read_text(encoding='utf-8')
        leg = Path(__file__).with_name('slotted_leg.yaml')
        file = str(folder.with_name('walker.yaml'))
        Path(file).write_text(
            text.replace('    bar_density', f'    linkage: {leg}\n    bar_density')
        )
    assert main([file, '--ros2-control', str(folder)]) == 0
    return file, folder


def control(folder: Path, name: str = 'cranks.urdf') -> Any:
    return ET.parse(folder / name).getroot().find('ros2_control')  # noqa: S314 - our own


def parameter(element: Any, name: str) -> str:
    (text,) = (node.text for node in element.iter('param') if node.get('name') == name)
    return str(text)


def test_an_explicit_density_is_that_of_model_and_walker(tmp_path: Path) -> None:
    file = str(ROOT / 'config' / 'walker6.yaml')
    folder = tmp_path / 'control'
    assert main([file, '--ros2-control', str(folder), '--bar-density', '0.31']) == 0
    expected = robot_of(file).with_rods(0.31)
    walker = robot_of(str(folder / 'walker.yaml'))
    model = mujoco.MjModel.from_xml_path(str(folder / 'robot.xml'))
    assert walker.body is not None
    mass = walker.body.mass
    for leg, expected_leg in zip(walker.legs, expected.legs, strict=True):
        assert leg.masses is not None
        assert expected_leg.masses is not None
        assert leg.masses.bodies == expected_leg.masses.bodies
        mass += leg.masses.total
    assert mujoco.mj_getTotalmass(model) == pytest.approx(mass, rel=1e-6)


def test_the_plugin_finds_all_that_it_looks_for_in_the_model(exported: tuple[str, Path]) -> None:
    file, folder = exported
    model = mujoco.MjModel.from_xml_path(str(folder / 'robot.xml'))
    data = mujoco.MjData(model)
    cranks = [*robot_of(file).crank_joints]
    for n in range(model.njnt):
        joint = model.joint(n)
        assert joint.name
        assert int(joint.type[0]) in JOINT_TYPES
    assert [model.actuator(n).name for n in range(model.nu)] == cranks
    element = control(folder)
    for joint in element.iter('joint'):
        actuator = model.actuator(joint.get('name'))
        assert model.actuator(actuator.id).trntype[0] == int(mujoco.mjtTrn.mjTRN_JOINT)
        assert model.joint(actuator.trnid[0]).name == joint.get('name')
        # By these the plugin takes it for a velocity actuator.
        assert actuator.biastype[0] == int(mujoco.mjtBias.mjBIAS_AFFINE)
        assert actuator.biasprm[1] == 0.0
        assert actuator.biasprm[2] != 0.0
        # It puts the joint there, whatever the model says.
        address = model.joint(joint.get('name')).qposadr[0]
        assert float(parameter(joint, 'initial_value')) == data.qpos[address]
    assert {joint.get('name') for joint in element.iter('joint')} == {*cranks}
    free = model.joint(parameter(element.find('hardware'), 'odom_free_joint_name'))
    assert int(free.type[0]) == FREE
    assert model.body(free.bodyid[0]).name == 'base_link'
    imu = parameter(element.find('sensor'), 'mujoco_sensor_name')
    assert [model.sensor(f'{imu}_{end}').dim[0] for end in ('quat', 'gyro', 'accel')] == [4, 3, 3]
    assert model.opt.timestep <= 1.0 / 100.0
    assert parameter(element.find('hardware'), 'mujoco_model') == 'robot.xml'


def test_the_model_is_that_of_sim_node_and_starts_closed(exported: tuple[str, Path]) -> None:
    file, folder = exported
    model = mujoco.MjModel.from_xml_path(str(folder / 'robot.xml'))
    data = mujoco.MjData(model)
    twin = Twin(robot_of(file), time_step=model.opt.timestep)
    for joint, state in twin.cranks().items():
        assert state.position == data.qpos[model.joint(joint).qposadr[0]]
    mujoco.mj_forward(model, data)
    assert abs(data.efc_pos[: data.ne]).max() < 1e-9
    for joint in twin.joints:
        twin.command(joint, 1.0)
        data.actuator(joint).ctrl[:] = 1.0
    twin.step(0.5)
    while data.time < 0.5:
        mujoco.mj_step(model, data)
        assert abs(data.efc_pos[: data.ne]).max() < 5e-3
    # The motors of the twin follow with a bandwidth.
    np.testing.assert_allclose(data.body('base_link').xpos, twin.truth().position, atol=0.01)


def test_the_urdfs_are_whole_and_differ_in_the_plugin(exported: tuple[str, Path]) -> None:
    # When called: its meshes' library takes half a second, in each worker that collects this.
    import yourdfpy

    file, folder = exported
    models = {}
    for name in ('robot.urdf', 'cranks.urdf', 'cranks_hardware.urdf'):
        models[name] = yourdfpy.URDF.load(str(folder / name), load_meshes=False)
        assert models[name].validate()
    joints = models['cranks.urdf'].joint_map
    plugins = []
    for name in ('cranks.urdf', 'cranks_hardware.urdf'):
        element = control(folder, name)
        plugins.append(element.find('hardware/plugin').text)
        for joint in element.iter('joint'):
            # ros2_control refuses a fixed one, and one that the URDF has not.
            assert joints[joint.get('name')].type == 'continuous'
            interfaces = [node.get('name') for node in joint if node.tag != 'param']
            assert interfaces == ['velocity', 'position', 'velocity']
    assert plugins == [
        'mujoco_ros2_control/MujocoSystemInterface',
        'joint_state_topic_hardware_interface/JointStateTopicSystem',
    ]
    sensor = control(folder).find('sensor')
    imu_interfaces = [interface.get('name') for interface in sensor.iter('state_interface')]
    assert imu_interfaces == PUBLISHED['imu_interfaces']
    legs = [replace(leg, linkage_file='') for leg in robot_of(file).legs]
    assert [*robot_of(str(folder / 'walker.yaml')).legs] == legs


def test_every_parameter_is_one_of_the_controllers(exported: tuple[str, Path]) -> None:
    file, folder = exported
    nodes = read_table(folder / 'ros2_control.yaml')
    parameters = {name: section['ros__parameters'] for name, section in nodes.items()}
    manager = parameters.pop('controller_manager')
    assert manager.pop('update_rate') == 100
    assert parameters.pop('walker_node') == {'command_type': 'velocities'}
    watchdog = parameters.pop('watchdog_node')
    for declaration in WATCHDOG_PARAMETERS:
        assert declaration.name not in watchdog or declaration.allows(watchdog[declaration.name])
    assert watchdog.keys() <= {declaration.name for declaration in WATCHDOG_PARAMETERS}
    assert manager.keys() == parameters.keys()
    for name, section in manager.items():
        types = {key: type(number).__name__ for key, number in parameters[name].items()}
        assert types.items() <= PUBLISHED['controllers'][section['type']].items()
    joints = [*robot_of(file).crank_joints]
    assert parameters['crank_velocity_controller']['joints'] == joints
    assert watchdog['joints'] == joints


def test_the_shipped_files_are_those_of_the_generator() -> None:
    robot = robot_of(str(ROOT / 'config' / 'walker6_two_motors.yaml'))
    shipped = (ROOT / 'config' / 'ros2_control.yaml').read_text(encoding='utf-8')
    assert shipped == controllers(robot, has_imu=False)
    shipped = (ROOT / 'urdf' / 'cranks.urdf').read_text(encoding='utf-8')
    assert shipped == cranks_urdf(robot, simulated=False)


def test_the_launch_file_is_one_for_jazzys_first_launch(exported: tuple[str, Path]) -> None:
    _, folder = exported
    text = (folder / 'ros2_control.launch.py').read_text(encoding='utf-8')
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module != 'pathlib':
            assert {alias.name for alias in node.names} <= NAMES[node.module].keys()
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            for names in NAMES.values():
                if node.func.id in names:
                    assert {word.arg for word in node.keywords} <= names[node.func.id]


@pytest.mark.parametrize(
    ('name', 'reason'), [('sem104', 'needs a walker'), ('missing.yaml', 'cannot be read')]
)
def test_other_robots_than_walkers_are_refused(
    name: str, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([name, '--ros2-control', str(tmp_path / 'out')]) == 2
    assert reason in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


def test_no_folder_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(ROOT / 'config' / 'walker6.yaml')
    (tmp_path / 'link').symlink_to(tmp_path / 'nowhere')
    for output, reason in (
        (tmp_path, 'it exists already'),
        (tmp_path / 'link', 'it exists already'),
        (tmp_path / 'no' / 'folder', 'there is no folder'),
        (__file__, 'it is no folder'),
        (f'{__file__}/inside', 'there is no folder'),
    ):
        assert main([file, '--ros2-control', str(output)]) == 3
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f'export: --ros2-control {output} cannot be written: {reason}')
    assert [path.name for path in tmp_path.iterdir()] == ['link']


def test_a_full_disk_leaves_no_part_of_a_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    # As a full disk does, this lets a file grow no further: the URDF is larger than the MJCF.
    resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, limit[1]))
    try:
        file = str(ROOT / 'config' / 'walker8_two_motors.yaml')
        assert main([file, '--ros2-control', str(tmp_path / 'control')]) == 3
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    reason = f'--ros2-control {tmp_path}/control cannot be written: File too large'
    assert capsys.readouterr().err == f'export: {reason}\n'
    assert [*tmp_path.iterdir()] == []
