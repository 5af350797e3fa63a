"""The model of any robot: it loads, stands closed, and is named as the robot's frames are."""

from pathlib import Path

from klann_ros.dynamics import MassError, rods
from klann_ros.kinematics import KlannGeometry, LinkageLeg, shipped_linkages, UnreachableError
from klann_ros.robot import Robot, robot_from_parameters, robot_of, RobotLeg
from klann_ros.twin import Floor, robot_mjcf
import mujoco
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
SEM104 = KlannGeometry.sem104().linkage
MASSES = rods(SEM104, 1.0)


def loaded(robot: Robot, **options: object) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, **options))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize('name', ['sem104', 'patent', *shipped_linkages()])
def test_every_shipped_leg_loads_and_stands_closed(name: str) -> None:
    robot = robot_of(name)
    model, data = loaded(robot)
    (leg,) = robot.legs
    assert model.njnt == len(leg.linkage.structure.bodies)
    alpha = float(leg.crank_angles(data.joint('crank').qpos[0]))
    pose = LinkageLeg(leg.linkage).closed_form(alpha)
    for point, place in zip(
        leg.linkage.structure.points, leg.mount.transform(pose.points), strict=True
    ):
        assert data.site(point.lower()).xpos == pytest.approx(place, abs=1e-12)
    assert np.abs(data.efc_pos).max() <= 1e-12


@pytest.mark.parametrize(('number', 'crank'), [(4, 0.0), (6, 0.7)])
def test_a_walker_stands_on_its_lowest_feet_under_the_names_of_ros(
    number: int, crank: float
) -> None:
    """Also where a leg's crank turns the other way, or is half a turn ahead."""
    robot = robot_of(str(ROOT / 'config' / f'walker{number}.yaml'))
    model, data = loaded(robot, crank=crank)
    base = data.body('base_link').xpos
    heights = []
    for leg in robot.legs:
        foot = LinkageLeg(leg.linkage).closed_form(float(leg.crank_angles(crank))).h
        position = data.site(f'{leg.name}/h').xpos
        assert position - base == pytest.approx(leg.mount.transform(foot), abs=1e-12)
        heights.append(position[2])
    assert 0.0 < min(heights) <= 0.01
    names = [model.joint(joint).name for joint in range(model.njnt)]
    cranks = [float(data.joint(name).qpos[0]) for name in names if 'crank' in name]
    assert cranks == pytest.approx([crank] * number)
    assert data.sensor('imu_quat').data == pytest.approx([1.0, 0.0, 0.0, 0.0])
    assert model.nu == 1
    assert model.actuator('crank').trnid[0] == model.joint('crank').id
    weight = 20.0 + sum(leg.masses.total for leg in robot.legs if leg.masses)
    assert float(model.body_mass.sum()) == pytest.approx(weight)


def test_legs_on_two_joints_have_two_actuators() -> None:
    robot = robot_of(str(ROOT / 'config' / 'walker6_two_motors.yaml'))
    model, _ = loaded(robot)
    assert tuple(model.actuator(n).name for n in range(model.nu)) == robot.crank_joints
    assert np.sum(model.eq_type == mujoco.mjtEq.mjEQ_JOINT) == 4


def test_a_walker_on_a_slope_stands_square_to_it() -> None:
    robot = robot_of(str(ROOT / 'config' / 'walker6.yaml'))
    flat, steep = (loaded(robot, floor=Floor(slope=slope))[1] for slope in (0.0, 0.2))
    uphill = steep.body('base_link').xmat.reshape(3, 3)[:, 0]
    assert uphill == pytest.approx([np.cos(0.2), 0.0, np.sin(0.2)])
    assert steep.geom('floor').xmat == pytest.approx(steep.body('base_link').xmat)
    normal = steep.geom('floor').xmat.reshape(3, 3)[:, 2]
    assert normal @ steep.body('base_link').xpos == pytest.approx(flat.body('base_link').xpos[2])


@pytest.mark.parametrize('name', ['a"><b', '\x00\x1b', 'Ünï ☃', '\ud800', 'world', 'x' * 5000])
def test_hostile_names_do_not_break_the_model(name: str) -> None:
    robot = Robot(name, (RobotLeg(name, SEM104, name, masses=MASSES),))
    model, _ = loaded(robot)
    assert model.nu == 1


def test_points_that_differ_in_case_only_are_two_sites() -> None:
    text = (ROOT / 'klann_ros' / 'linkages' / 'four_bar.yaml').read_text()
    text = text.replace('to: A', 'to: b').replace('from: A', 'from: b')
    robot = robot_from_parameters({'linkage_description': text})
    _, data = loaded(robot)
    assert np.linalg.norm(data.site('b').xpos - data.site('b_').xpos) == pytest.approx(0.2)


def test_missing_masses_are_reported() -> None:
    leg = RobotLeg('', SEM104)
    with pytest.raises(MassError, match='sem has no masses: bar_density'):
        robot_mjcf(Robot('sem', (leg,)))
    legs = (RobotLeg('a', SEM104, masses=MASSES), RobotLeg('b', SEM104, masses=MASSES))
    with pytest.raises(MassError, match=r'two has no body_mass \[kg\], body_size \[m\]'):
        robot_mjcf(Robot('two', legs))
    with pytest.raises(UnreachableError):
        robot_mjcf(robot_of('roberts'), crank=3.0)
    with pytest.raises(ValueError, match='time_step = -1'):
        robot_mjcf(robot_of('sem104'), time_step=-1.0)


@pytest.mark.parametrize(('name', 'value'), [('friction', -0.1), ('slope', 2.0)])
def test_invalid_floors_are_refused(name: str, value: float) -> None:
    for wrong in (value, float('nan')):
        with pytest.raises(ValueError, match=f'{name} = .* is refused'):
            Floor(**{name: wrong})
