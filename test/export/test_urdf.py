"""The URDF of any linkage: its frames are where the points of the solved leg are."""

import io
from pathlib import Path
from typing import TYPE_CHECKING

from klann_ros.export import urdf
from klann_ros.export.travel import crank_angles
from klann_ros.export.urdf import loops_urdf
from klann_ros.kinematics import LinkageLeg
from klann_ros.robot import robot_of, RobotLeg
from klann_ros.sanitize.yaml_text import load
from klann_ros.twin import robot_mjcf
import mujoco
import numpy as np
import pytest
from sample_linkages import SHIPPED_ROBOTS

if TYPE_CHECKING:
    import yourdfpy

ROOT = Path(__file__).resolve().parents[2]


def loaded(text: str) -> 'yourdfpy.URDF':
    # When called: its meshes' library takes a second, in each worker that collects this.
    import yourdfpy

    options = {'load_meshes': False, 'build_scene_graph': True}
    return yourdfpy.URDF.load(io.BytesIO(text.encode()), **options)


def published(leg: RobotLeg, alpha: float) -> dict[str, float]:
    pose = LinkageLeg(leg.linkage).closed_form(alpha)
    names = [f'{leg.prefix}{name}' for name in leg.linkage.joint_names]
    return dict(zip(names, pose.joints, strict=True))


@pytest.mark.parametrize('name', SHIPPED_ROBOTS)
def test_the_published_joints_alone_move_each_bar_to_its_points(name: str) -> None:
    robot = robot_of(name)
    (leg,) = robot.legs
    structure = leg.linkage.structure
    model = loaded(urdf(robot))
    joints = model.robot.joints
    free = {joint.name for joint in joints if joint.type != 'fixed' and joint.mimic is None}
    assert free == set(leg.linkage.joint_names)
    # robot_state_publisher looks a mimicked joint up in the message, not in another mimic.
    assert {joint.mimic.joint for joint in joints if joint.mimic} <= free
    angles = crank_angles(leg.linkage, 9)[1:-1:2]
    assert len(angles)
    for alpha in angles:
        pose = LinkageLeg(leg.linkage).closed_form(float(alpha))
        points = dict(zip(structure.points, pose.points, strict=True))
        model.update_cfg(published(leg, float(alpha)))
        bars = [bar for body in structure.bodies for bar in body.rigid]
        assert bars
        for bar in bars:
            separator = '_' if len(bar.start + bar.end) > 2 else ''
            frame = model.get_transform(f'{bar.start}{separator}{bar.end}'.lower())
            length = np.hypot(*(points[bar.end] - points[bar.start]))
            close(frame[:3, 3], leg.mount.transform(points[bar.start]))
            close((frame @ [length, 0, 0, 1])[:3], leg.mount.transform(points[bar.end]))
        foot = model.get_transform(structure.foot.lower())[:3, 3]
        close(foot, leg.mount.transform(pose.h))


@pytest.mark.parametrize('name', ['sem104', 'jansen', 'quick_return', 'scotch_yoke'])
def test_the_centre_of_mass_is_that_of_the_simulated_leg(name: str) -> None:
    robot = robot_of(name).with_rods(0.5, slider_length=0.1)
    (leg,) = robot.legs
    simulated = mujoco.MjModel.from_xml_string(robot_mjcf(robot, crank=1.0))
    data = mujoco.MjData(simulated)
    mujoco.mj_forward(simulated, data)
    model = loaded(urdf(robot))
    model.update_cfg(published(leg, 1.0))
    total = 0.0
    moment = np.zeros(3)
    for link in model.robot.links:
        if link.inertial is not None:
            total += link.inertial.mass
            frame = model.get_transform(link.name) @ link.inertial.origin
            moment += link.inertial.mass * frame[:3, 3]
    assert leg.masses is not None
    assert total == pytest.approx(leg.masses.total)
    np.testing.assert_allclose(moment / total, data.subtree_com[0], rtol=0, atol=1e-9)


def close(place: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(place, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ('plain', 'robot_name'),
    [
        ('klann', 'sem104'),
        ('walker4', str(ROOT / 'config' / 'walker4.yaml')),
        ('walker6', str(ROOT / 'config' / 'walker6.yaml')),
    ],
    ids=['klann', 'walker4', 'walker6'],
)
def test_a_klann_leg_has_the_joints_and_frames_of_the_plain_urdf(
    plain: str, robot_name: str
) -> None:
    robot = robot_of(robot_name)
    ours = loaded(urdf(robot, joint_separator='/'))
    theirs = loaded((ROOT / 'urdf' / f'{plain}.urdf').read_text())
    assert {link.name for link in ours.robot.links} == {link.name for link in theirs.robot.links}
    assert {*map(joint_facts, ours.robot.joints)} == {*map(joint_facts, theirs.robot.joints)}
    for alpha in np.linspace(-3, 3, 4):
        positions: dict[str, float] = {}
        for leg in robot.legs:
            positions |= published(leg, float(leg.crank_angles(alpha)))
        ours.update_cfg(positions)
        theirs.update_cfg(positions)
        for link in theirs.robot.links:
            close(ours.get_transform(link.name), theirs.get_transform(link.name))


def joint_facts(joint: 'yourdfpy.Joint') -> tuple:
    """Return what makes a joint what it is, but for its place."""
    mimic = joint.mimic and (joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset)
    axis = None if joint.type == 'fixed' else tuple(map(float, joint.axis))
    return joint.name, joint.type, joint.parent, joint.child, axis, mimic


def test_a_walkers_legs_mimic_their_crank_and_close_where_they_are_mounted() -> None:
    robot = robot_of(str(ROOT / 'config' / 'walker6.yaml'))
    files = loops_urdf(robot, '_')
    model = loaded(files['robot.urdf'].decode())
    loops = load(files['loop_closures.yaml'].decode())
    assert loops['independent'] == ['front_left_A']
    assert len(loops['dependent']) == 6 * 4
    closures = {closure['name']: closure['point'] for closure in loops['closures']}
    model.update_cfg({'front_left_A': 0.5})
    for leg in robot.legs:
        points = leg.linkage.structure.points
        zero, moved = map(LinkageLeg(leg.linkage).closed_form, leg.crank_angles([0.0, 0.5]))
        for point in 'CG':
            place = zero.points[points.index(point)]
            close(closures[f'{leg.name}_{point}'], leg.mount.transform(place))
        pin = model.joint_map[f'{leg.name}_B'].child
        place = moved.points[points.index('B')]
        close(model.get_transform(pin)[:3, 3], leg.mount.transform(place))


def test_frames_can_be_renamed_and_joints_keep_their_names() -> None:
    robot = robot_of('quick_return')
    text = urdf(robot, base_frame='body', frame_id='plane', frame_prefix='left/')
    model = loaded(text)
    assert model.base_link == 'body'
    assert {link.name.split('/')[0] for link in model.robot.links} == {'body', 'left'}
    assert set(robot.legs[0].linkage.joint_names) <= set(model.joint_map)


HOSTILE = """
name: hostile
pivots: {A: [0, 0], mount: [0.2, 0]}
crank: foot
foot: leg_plane
bodies:
  foot:
    bars: [{from: A, to: b, length: 0.05}]
  mount:
    bars: [{from: b, to: B, length: 0.2}, {from: B, to: leg_plane, length: 0.1}]
  foot_back:
    bars: [{from: mount, to: B, length: 0.15}]
start: {foot: 1.0, mount: 0.7, foot_back: 1.9}
"""


def test_names_that_are_alike_stay_apart(tmp_path: Path) -> None:
    file = tmp_path / '<a & "b">.yaml'
    file.write_text(HOSTILE)
    robot = robot_of(str(file))
    model = loaded(urdf(robot))
    links, joints = model.robot.links, model.robot.joints
    assert len({link.name for link in links}) == len(links)
    assert len({joint.name for joint in joints}) == len(joints)
    assert model.robot.name == '<a & "b">'
    pose = LinkageLeg(robot.legs[0].linkage).closed_form(1.0)
    model.update_cfg(published(robot.legs[0], 1.0))
    foot = next(joint.child for joint in joints if joint.name == 'foot_')
    close(model.get_transform(foot)[:3, 3], robot.legs[0].mount.transform(pose.h))


def test_sliders_have_room_for_their_stroke() -> None:
    robot = robot_of('slider_crank')
    linkage = robot.legs[0].linkage
    sliding = {body.angle for body in linkage.structure.bodies if body.slides}
    joints = [joint for joint in loaded(urdf(robot)).robot.joints if joint.type == 'prismatic']
    assert {joint.name for joint in joints} == sliding
    for alpha in np.linspace(0, 6, 20):
        positions = published(robot.legs[0], float(alpha))
        for joint in joints:
            assert joint.limit.lower < positions[joint.name] < joint.limit.upper
