"""The planar linkage in a URDF, whose loops are in `loop_closures.yaml`, as pins and sliders."""

from collections import defaultdict
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from operator import itemgetter
import re
from typing import Any
from xml.etree import ElementTree as ET

from klann_ros.kinematics import GROUND
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import Mount
from klann_ros.sanitize.text import listed, printable
from klann_ros.sanitize.yaml_text import load
import numpy as np

from .mechanism import Joint, MAX_JOINTS, MechanismError, PIN, SLIDER

SIDECAR = 'loop_closures.yaml'
_KINDS = {'revolute': PIN, 'continuous': PIN, 'prismatic': SLIDER}
_MAX_SINE = 1e-3  # of the angle of parallel axes
_MAX_GAP, _SAME_PLACE = 1e-3, 1e-6  # in sizes of the robot
_MAX_NUMBER, _MIN_AXIS = 1e6, 1e-6
# The pose of each link at joint zero in the root's frame [m], shape (4, 4), and the first of the
# links that are fixed to it.
Frames = dict[str, tuple[FloatArray, str]]


@dataclass(frozen=True, eq=False)
class _Hinge:
    """A joint of two bodies in space, or a frame of one; the axis of a ball is zero."""

    name: str
    bodies: tuple[str, ...]
    position: FloatArray  # [m]
    axis: FloatArray
    kind: str = PIN


def xml_root(text: str, tag: str) -> ET.Element:
    """Return the root of an XML text without a document type; a MechanismError for another tag."""
    if re.search('<!(DOCTYPE|ENTITY)', text):
        raise MechanismError('it has a document type, as web pages have: save the raw file')
    root = ET.fromstring(text)  # noqa: S314 - without entities, and of limited size
    if root.tag != tag:
        raise MechanismError(f'it has no <{tag}>')
    return root


def read_urdf(text: str, loops: str) -> list[Joint]:
    """
    Return the joints of a planar robot at joint zero, in the plane of its motion [mm].

    Fixed joints make one link of several, whose frames are its points. `loops` is the text of a
    `loop_closures.yaml` of scikit-robot (`closures`: points and axes in the root's frame) or of
    robonex (`pin_loops`, `ball_loops`: points in the frames of two links).
    """
    root = xml_root(text, 'robot')
    if any('xacro' in element.tag for element in root):
        raise MechanismError('it is xacro: `xacro FILE > robot.urdf` makes a URDF of it')
    elements = root.findall('joint')
    if not 0 < len(elements) <= MAX_JOINTS:
        raise MechanismError(f'it has {len(elements)} joints: 1 to {MAX_JOINTS} are read')
    # A key without a value has None.
    closures = defaultdict(tuple, filter(itemgetter(1), (load(loops) or {}).items()))
    frames = _frames(elements)
    size = float(np.ptp([pose[:3, 3] for pose, _ in frames.values()], axis=0).max())
    loop_hinges = [*_loop_hinges(closures, frames, _MAX_GAP * size)]
    if not loop_hinges:
        reason = 'has no closures or pin_loops' if loops else 'is missing beside it or in config'
        raise MechanismError(f'it is open: {SIDECAR} {reason}')
    hinges = [*_tree_hinges(elements, frames, closures), *loop_hinges]
    names = {hinge.name for hinge in hinges}
    for link, (pose, body) in frames.items():
        if body != GROUND:
            name = link if link not in names else f'{link}_frame'
            hinges.append(_Hinge(name, (body,), pose[:3, 3], np.zeros(3)))
    driven = closures['independent'] or closures['actuated_joints']
    joints: list[Joint] = []
    for joint in _planar_joints(hinges, driven):
        # A pin of several links has a joint for each pair in a URDF; a frame may be at a pin.
        for number, pin in enumerate(joints):
            is_pin = joint.kind == pin.kind == PIN and {*joint.links} & {*pin.links}
            if is_pin and abs(pin.position - joint.position) <= 1e3 * _SAME_PLACE * size:
                is_driven = pin.is_driven or joint.is_driven
                joints[number] = replace(pin, links=pin.links + joint.links, is_driven=is_driven)
                break
        else:
            joints.append(joint)
    return joints


def _frames(elements: Sequence[ET.Element]) -> Frames:
    """Return the frames of all links, from the root on."""
    joints: dict[str, list[ET.Element]] = defaultdict(list)
    for element in elements:
        joints[_link(element, 'parent')].append(element)
    links = [link for link in joints if link not in {_link(e, 'child') for e in elements}]
    if len(links) != 1:
        raise MechanismError(f'it has {len(links)} roots instead of one: {listed(links)}')
    frames: Frames = {links[0]: (np.eye(4), GROUND)}
    for parent in links:
        parent_pose, body = frames[parent]
        for element in joints[parent]:
            child = _link(element, 'child')
            if child in frames:
                raise MechanismError(f'the link {printable(child, 60)} has two parents')
            pose = np.eye(4)
            roll, pitch, yaw = _vector(element, 'origin', 'rpy')
            pose[:3, :3] = Mount(rpy=(roll, pitch, yaw)).rotation
            pose[:3, 3] = _vector(element, 'origin', 'xyz')
            moving_body = child if child != GROUND else f'{child}_link'
            is_fixed = element.get('type') == 'fixed'
            frames[child] = (parent_pose @ pose, body if is_fixed else moving_body)
            links.append(child)
    return frames


def _tree_hinges(
    elements: Sequence[ET.Element], frames: Frames, closures: Mapping[str, Any]
) -> Iterator[_Hinge]:
    """Yield the moving joints of a URDF."""
    for element in elements:
        name, kind = element.attrib['name'], element.get('type', '')
        text = f'the joint {printable(name, 60)}'
        # A <mimic> of scikit-robot repeats what a loop determines.
        if element.find('mimic') is not None and name not in closures['dependent']:
            raise MechanismError(f'{text} has <mimic>, which no linkage file describes')
        if name in closures['ball_upgrades']:
            raise MechanismError(f'{text} is a ball: only planar robots are read')
        if kind == 'fixed':
            continue
        if kind not in _KINDS:
            raise MechanismError(f'{text} is {printable(kind, 60)}, not {listed(_KINDS)}')
        pose, body = frames[_link(element, 'child')]
        axis = _vector(element, 'axis', 'xyz', '1 0 0')
        if np.linalg.norm(axis) < _MIN_AXIS:
            raise MechanismError(f'{text} has no axis')
        bodies = (frames[_link(element, 'parent')][1], body)
        yield _Hinge(name, bodies, pose[:3, 3], pose[:3, :3] @ axis, _KINDS[kind])


def _loop_hinges(closures: Mapping[str, Any], frames: Frames, max_gap: float) -> Iterator[_Hinge]:
    """Yield the joints that close loops, whose ends may be `max_gap` apart [m]."""
    loops = [*closures['closures'], *closures['pin_loops'], *closures['ball_loops']]
    for number, loop in enumerate(loops[:MAX_JOINTS], 1):
        name = str(loop.get('name', f'loop{number}'))
        ends = [loop.get('link_a') or loop['parent'], loop.get('link_b') or loop['child']]
        if unknown := [link for link in ends if link not in frames]:
            raise MechanismError(f'{SIDECAR} joins {listed(unknown)}, which no joint has')
        (pose, body), (child_pose, child_body) = (frames[link] for link in ends)
        # A `point`, and its axis, are in the root's frame.
        pose = np.eye(4) if 'point' in loop else pose
        position = pose @ [*_numbers(loop['point' if 'point' in loop else 'parent_xyz']), 1.0]
        axis = _numbers(loop.get('axis', (0.0, 0.0, 0.0)))
        axis = pose[:3, :3] @ axis * (np.linalg.norm(axis) > _MIN_AXIS)
        if 'point' not in loop:
            child_position = child_pose @ [*_numbers(loop['child_xyz']), 1.0]
            gap = float(np.linalg.norm(child_position - position))
            if gap > max_gap:
                raise MechanismError(f'{listed([name])} is {gap:.3g} m open at joint zero')
        yield _Hinge(name, (body, child_body), position[:3], axis)


def _planar_joints(hinges: Sequence[_Hinge], driven: Container[str]) -> Iterator[Joint]:
    """Yield joints in the plane across the pins' axes [mm]."""
    pins = [hinge for hinge in hinges if hinge.kind == PIN and hinge.axis.any()]
    if not pins:
        raise MechanismError('it has no revolute joint')
    normal = pins[0].axis / np.linalg.norm(pins[0].axis)
    # z is up, or y of a horizontal plane; the right is that of the first axes.
    up = np.array([0.0, 0.0, 1.0] if abs(normal[2]) < 0.5 else [0.0, 1.0, 0.0])
    up -= up @ normal * normal
    up /= np.linalg.norm(up)
    right = np.cross(up, normal)
    right *= 1.0 if right.sum() > 0.0 else -1.0
    plane = np.array([right, up])
    for hinge in hinges:
        x, y = np.round(1000.0 * plane @ hinge.position, 12)
        length = float(np.linalg.norm(hinge.axis)) or 1.0
        direction = complex(*np.round(plane @ hinge.axis / length, 15))
        # A slider is across the normal, a pin along it.
        along = complex(hinge.axis @ normal) / length
        if abs(along if hinge.kind == SLIDER else direction) > _MAX_SINE:
            names = listed([pins[0].name, hinge.name])
            raise MechanismError(f'{names} move in different planes: only planar robots are read')
        is_driven = len(hinge.bodies) > 1 and hinge.name in driven
        yield Joint(hinge.name, complex(x, y), hinge.bodies, hinge.kind, direction, is_driven)


def _link(element: ET.Element, tag: str) -> str:
    return element.find(tag).attrib['link']  # type: ignore[union-attr]  # else it is refused


def _vector(element: ET.Element, tag: str, key: str, default: str = '0 0 0') -> FloatArray:
    part = element.find(tag)
    return _numbers((default if part is None else part.get(key, default)).split())


def _numbers(values: Sequence[Any]) -> FloatArray:
    """Return three numbers; a MechanismError for anything else."""
    with suppress(OverflowError, TypeError, ValueError):
        vector = np.array(values, dtype=np.float64)
        if vector.shape == (3,) and np.abs(vector).max() <= _MAX_NUMBER:
            return vector
    raise MechanismError(f'{printable(values, 60)} is not three numbers up to {_MAX_NUMBER:g}')
