"""The URDF's links are at the points of the leg that the library computes."""

from functools import cache
import io
from math import isclose
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

from klann_ros.kinematics import KlannGeometry, KlannLeg, KlannPose
import numpy as np
import pytest
from xacro_legs import ROOT, urdf_of
import yaml
import yourdfpy

ANGLES = ('alpha', 'gamma', 'beta', 'delta', 'theta')
CRANK = np.linspace(-np.pi, np.pi, 10, endpoint=False).tolist()
PLAIN = {'klann': 'sem104', 'walker4': 'walker4', 'walker6': 'walker6'}

# The point of the pose at which each link has its origin.
LINKS = ('ab', 'b', 'bc', 'cg', 'dc', 'ef', 'f', 'fg', 'gh', 'h')
ORIGINS = {link: link[0].upper() for link in LINKS}
# A tree does not close loops: the far ends of these bars are the origins of others.
ENDS = {'ab': ('l_ab', 'B'), 'bc': ('l_bc', 'C'), 'cg': ('l_cg', 'G'), 'dc': ('l_dc', 'C')}


class Mounted(NamedTuple):
    """A leg of a parameter file."""

    prefix: str
    geometry: KlannGeometry
    phase: float
    direction: int
    mount: np.ndarray


def parameters(name: str) -> dict:
    content = yaml.safe_load((ROOT / 'config' / f'{name}.yaml').read_text())
    return content['/**']['ros__parameters']


def legs(name: str) -> list[Mounted]:
    """Return the legs of a shipped parameter file."""
    shared = parameters(name)
    return [mounted(f'{leg}/', {**shared, **shared[leg]}) for leg in shared.get('legs', [])] or [
        mounted('', shared)
    ]


def mounted(prefix: str, values: dict) -> Mounted:
    sem104 = KlannGeometry.sem104().as_dict()
    mount = np.eye(4)
    mount[:3, :3] = rotation(*values.get('mount_rpy', (np.pi / 2, 0.0, 0.0)))
    mount[:3, 3] = values.get('mount_xyz', (0.0, 0.0, 0.0))
    return Mounted(
        prefix,
        KlannGeometry(**{key: values.get(key, default) for key, default in sem104.items()}),
        values.get('phase', 0.0),
        values.get('direction', 1),
        mount,
    )


def rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return Rz(yaw) Ry(pitch) Rx(roll)."""
    (c_x, s_x), (c_y, s_y), (c_z, s_z) = ((np.cos(a), np.sin(a)) for a in (roll, pitch, yaw))
    x = np.array([[1, 0, 0], [0, c_x, -s_x], [0, s_x, c_x]])
    y = np.array([[c_y, 0, s_y], [0, 1, 0], [-s_y, 0, c_y]])
    z = np.array([[c_z, -s_z, 0], [s_z, c_z, 0], [0, 0, 1]])
    return z @ y @ x


@cache
def robot(name: str) -> yourdfpy.URDF:
    return loaded(urdf_of(ROOT / 'config' / f'{name}.yaml'))


def loaded(urdf: str) -> yourdfpy.URDF:
    return yourdfpy.URDF.load(io.BytesIO(urdf.encode()), load_meshes=False)


def published(leg: Mounted, pose: KlannPose) -> dict[str, float]:
    """Return joint_states: the names and positions of a leg."""
    return {f'{leg.prefix}{name}': value for name, value in zip(ANGLES, pose.joints, strict=True)}


def point(pose: KlannPose, letter: str) -> list[float]:
    """Return a point of the leg in its plane, homogeneous."""
    return [*pose.points['ABCDEFGH'.index(letter)], 0.0, 1.0]


@pytest.mark.parametrize('name', ['sem104', 'patent', 'walker4', 'walker6'])
def test_every_link_is_at_its_point_at_every_crank_angle(name: str) -> None:
    urdf, walker = robot(name), legs(name)
    solvers = [KlannLeg(leg.geometry) for leg in walker]
    for crank in CRANK:
        alphas = [leg.direction * crank + leg.phase for leg in walker]
        poses = [solver.solve(alpha) for solver, alpha in zip(solvers, alphas, strict=True)]
        for leg, pose in zip(walker, poses, strict=True):
            urdf.update_cfg(published(leg, pose))
            frames = {link: urdf.get_transform(f'{leg.prefix}{link}') for link in ORIGINS}
            for link, letter in ORIGINS.items():
                close(frames[link][:, 3], leg.mount @ point(pose, letter))
            for link, (length, letter) in ENDS.items():
                end = frames[link] @ [getattr(leg.geometry, length), 0.0, 0.0, 1.0]
                close(end, leg.mount @ point(pose, letter))
            close(frames['h'][:, 3], leg.mount @ [*pose.h, 0.0, 1.0])


def close(found: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize('name', ['sem104', 'patent', 'walker4', 'walker6'])
def test_the_joints_that_nothing_mimics_are_the_published_ones(name: str) -> None:
    joints = robot(name).robot.joints
    free = {joint.name for joint in joints if joint.type != 'fixed' and joint.mimic is None}
    assert free == {f'{leg.prefix}{angle}' for leg in legs(name) for angle in ANGLES}
    assert {joint.type for joint in joints} == {'continuous', 'fixed'}
    # robot_state_publisher looks a mimicked joint up in the message, not in another mimic.
    assert {joint.mimic.joint for joint in joints if joint.mimic} <= free


@pytest.mark.parametrize('name', ['sem104', 'walker4'])
def test_every_plane_hangs_upright_in_base_link(name: str) -> None:
    urdf = robot(name)
    assert urdf.base_link == 'base_link'
    for leg in legs(name):
        frame = urdf.get_transform(f'{leg.prefix}leg_plane')
        close(frame, leg.mount)
        np.testing.assert_allclose(frame[:3, 1], [0, 0, 1], rtol=0, atol=1e-15)


def test_a_leg_has_its_own_length_and_else_that_of_all(tmp_path: Path) -> None:
    file = tmp_path / 'my legs.yaml'
    values = {'legs': ['one', 'two'], 'l_gh': 0.5, 'two': {'l_gh': 0.6}}
    file.write_text(yaml.safe_dump({'solver_node': {'ros__parameters': values}}))
    urdf = loaded(urdf_of(file))
    feet = [urdf.get_transform(f'{leg}/h', f'{leg}/gh')[0, 3] for leg in ('one', 'two')]
    assert feet == [0.5, 0.6]
    assert urdf.get_transform('one/gh', 'one/fg')[0, 3] == KlannGeometry.sem104().l_fg


def test_frames_can_be_renamed_and_joints_keep_their_names() -> None:
    names = {'base_frame': 'body', 'frame_id': 'plane', 'frame_prefix': 'left/'}
    urdf = loaded(urdf_of(ROOT / 'config' / 'sem104.yaml', **names))
    assert urdf.base_link == 'body'
    links = {link.name for link in urdf.robot.links} - {'body'}
    assert links == {'left/plane', *(f'left/{link}' for link in ORIGINS)}
    assert set(ANGLES) <= set(urdf.joint_map)


@pytest.mark.parametrize('plain', PLAIN)
def test_a_plain_urdf_is_up_to_date(plain: str) -> None:
    found = (ROOT / 'urdf' / f'{plain}.urdf').read_text()
    fresh = urdf_of(ROOT / 'config' / f'{PLAIN[plain]}.yaml')
    found, fresh = (ET.fromstring(text) for text in (found, fresh))  # noqa: S314  # our own
    pairs = list(zip(found.iter(), fresh.iter(), strict=True))
    assert [one.tag for one, _ in pairs] == [other.tag for _, other in pairs]
    for one, other in pairs:
        assert one.keys() == other.keys()
        for key in one.keys():  # noqa: SIM118  # an element's iteration is over its children
            assert same(one.get(key), other.get(key)), f'{key} of {one.tag}: {one.attrib}'


def same(one: str, other: str) -> bool:
    """Return whether two attributes are alike, numbers but for the last digits of a libm."""
    try:
        numbers = [[float(word) for word in text.split()] for text in (one, other)]
    except ValueError:
        return one == other
    return all(isclose(a, b, abs_tol=1e-9) for a, b in zip(*numbers, strict=True))


def test_the_slider_turns_the_crank_and_nothing_else() -> None:
    crank = yourdfpy.URDF.load(ROOT / 'urdf' / 'crank.urdf')
    (joint,) = crank.robot.joints
    assert joint.name == 'crank'
    assert joint.limit.upper - joint.limit.lower >= 2 * np.pi
