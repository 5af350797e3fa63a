"""The planar linkage in a URDF, whose loops are in `loop_closures.yaml`, as pins and sliders."""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
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


@dataclass(frozen=True, eq=False)
class _Frame:
    """The frame of a link at joint zero, in the root's, and the first of its fixed links."""

    position: FloatArray  # [m]
    rotation: FloatArray
    body: str


@dataclass(frozen=True, eq=False)
class _Hinge:
    """A joint of two bodies in space; the axis of a ball is zero."""

    name: str
    kind: str
    bodies: tuple[str, ...]
    position: FloatArray  # [m]
    axis: FloatArray


def xml_root(text: str, tag: str) -> ET.Element:
    """Return the root of an XML text without a document type; a MechanismError for another tag."""
    if re.search('<!(DOCTYPE|ENTITY)', text):
        raise MechanismError('it has a document type, which may hold anything')
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
    closures = load(loops) or {}
    frames = _frames(elements)
    size = float(np.ptp([frame.position for frame in frames.values()], axis=0).max())
    loop_hinges = list(_loop_hinges(closures, frames, _MAX_GAP * size))
    if not loop_hinges:
        reason = 'has no closures or pin_loops' if loops else 'is missing beside it or in config'
        raise MechanismError(f'it is open: {SIDECAR} {reason}')
    hinges = [*_tree_hinges(elements, frames, closures), *loop_hinges]
    driven = closures.get('independent') or closures.get('actuated_joints') or ()
    joints: list[Joint] = []
    for joint in _planar_joints(hinges, frames, driven):
        # A pin of several links has a joint for each pair in a URDF; a frame may be at a pin.
        for number, earlier in enumerate(joints):
            distance = 1e-3 * abs(earlier.position - joint.position)
            is_pin = joint.kind == earlier.kind == PIN
            if is_pin and distance <= _SAME_PLACE * size and {*joint.links} & {*earlier.links}:
                merged = replace(earlier, links=(*earlier.links, *joint.links)).renamed({})
                joints[number] = replace(merged, is_driven=joint.is_driven or earlier.is_driven)
                break
        else:
            joints.append(joint)
    return joints


def _frames(elements: Sequence[ET.Element]) -> dict[str, _Frame]:
    """Return the frames of all links, from the root on."""
    children: dict[str, list[ET.Element]] = {}
    for element in elements:
        children.setdefault(_link(element, 'parent'), []).append(element)
    links = [link for link in children if link not in {_link(e, 'child') for e in elements}]
    if len(links) != 1:
        raise MechanismError(f'it has {len(links)} roots instead of one: {listed(links)}')
    frames = {links[0]: _Frame(np.zeros(3), np.eye(3), GROUND)}
    for parent in links:
        frame = frames[parent]
        for element in children.get(parent, ()):
            child = _link(element, 'child')
            if child in frames:
                raise MechanismError(f'the link {printable(child, 60)} has two parents')
            roll, pitch, yaw = _vector(element, 'origin', 'rpy')
            position = frame.position + frame.rotation @ _vector(element, 'origin', 'xyz')
            rotation = frame.rotation @ Mount(rpy=(roll, pitch, yaw)).rotation
            moving_body = child if child != GROUND else f'{child}_link'
            body = frame.body if element.get('type') == 'fixed' else moving_body
            frames[child] = _Frame(position, rotation, body)
            links.append(child)
    return frames


def _tree_hinges(
    elements: Sequence[ET.Element], frames: Mapping[str, _Frame], closures: Mapping[str, Any]
) -> Iterator[_Hinge]:
    """Yield the moving joints of a URDF."""
    # A <mimic> of scikit-robot repeats what a loop determines.
    dependent = closures.get('dependent') or ()
    for element in elements:
        name, kind = element.attrib['name'], element.get('type', '')
        text = f'the joint {printable(name, 60)}'
        if element.find('mimic') is not None and name not in dependent:
            raise MechanismError(f'{text} has <mimic>, which no linkage file describes')
        if name in (closures.get('ball_upgrades') or ()):
            raise MechanismError(f'{text} is a ball: only planar robots are read')
        if kind == 'fixed':
            continue
        if kind not in _KINDS:
            raise MechanismError(f'{text} is {printable(kind, 60)}, not {listed(_KINDS)}')
        frame = frames[_link(element, 'child')]
        bodies = (frames[_link(element, 'parent')].body, frame.body)
        axis = _vector(element, 'axis', 'xyz', '1 0 0')
        if np.linalg.norm(axis) < _MIN_AXIS:
            raise MechanismError(f'{text} has no axis')
        yield _Hinge(name, _KINDS[kind], bodies, frame.position, frame.rotation @ axis)


def _loop_hinges(
    closures: Mapping[str, Any], frames: Mapping[str, _Frame], max_gap: float
) -> Iterator[_Hinge]:
    """Yield the joints that close loops, whose ends may be `max_gap` apart [m]."""
    loops: list[dict[str, Any]] = []
    for key in ('closures', 'pin_loops', 'ball_loops'):
        loops += closures.get(key) or ()
    for number, loop in enumerate(loops[:MAX_JOINTS], 1):
        name = str(loop.get('name', f'loop{number}'))
        ends = [loop.get('link_a') or loop['parent'], loop.get('link_b') or loop['child']]
        if unknown := [link for link in ends if link not in frames]:
            raise MechanismError(f'{SIDECAR} joins {listed(unknown)}, which no joint has')
        parent, child = (frames[link] for link in ends)
        axis = _numbers(loop.get('axis', (0.0, 0.0, 0.0)))
        axis = axis * (np.linalg.norm(axis) > _MIN_AXIS)
        if 'point' in loop:
            yield _Hinge(name, PIN, (parent.body, child.body), _numbers(loop['point']), axis)
            continue
        position = parent.position + parent.rotation @ _numbers(loop['parent_xyz'])
        child_position = child.position + child.rotation @ _numbers(loop['child_xyz'])
        gap = float(np.linalg.norm(child_position - position))
        if gap > max_gap:
            raise MechanismError(f'{listed([name])} is {gap:.3g} m open at joint zero')
        yield _Hinge(name, PIN, (parent.body, child.body), position, parent.rotation @ axis)


def _planar_joints(
    hinges: Sequence[_Hinge], frames: Mapping[str, _Frame], driven: Container[str]
) -> Iterator[Joint]:
    """Yield joints, and frames of moving links, in the plane across the pins' axes [mm]."""
    pins = [hinge for hinge in hinges if hinge.kind == PIN and hinge.axis.any()]
    if not pins:
        raise MechanismError('it has no revolute joint')
    first = pins[0]
    normal = first.axis / np.linalg.norm(first.axis)
    # z is up, or y of a horizontal plane.
    vertical = np.array([0.0, 0.0, 1.0] if abs(normal[2]) < 0.5 else [0.0, 1.0, 0.0])
    right = np.cross(vertical, normal)
    right /= np.linalg.norm(right) * (1.0 if right.sum() > 0.0 else -1.0)
    up = np.cross(normal, right)
    up *= 1.0 if up @ vertical > 0.0 else -1.0

    def project(vector: FloatArray, digits: int = 15) -> complex:
        return complex(*np.round([right @ vector, up @ vector], digits))

    for hinge in hinges:
        # A slider is across the normal, a pin along it.
        along = float(hinge.axis @ normal)
        deviation = abs(along if hinge.kind == SLIDER else project(hinge.axis))
        length = float(np.linalg.norm(hinge.axis))
        if deviation > _MAX_SINE * length:
            names = listed([first.name, hinge.name])
            raise MechanismError(f'{names} move in different planes: only planar robots are read')
        joint = Joint(hinge.name, project(1000.0 * hinge.position, 9), hinge.bodies, hinge.kind)
        joint = replace(joint, is_driven=hinge.name in driven)
        yield replace(joint, direction=project(hinge.axis) / (length or 1.0)).renamed({})
    hinge_names = {hinge.name for hinge in hinges}
    for link, frame in frames.items():
        if frame.body != GROUND:
            name = link if link not in hinge_names else f'{link}_frame'
            yield Joint(name, project(1000.0 * frame.position, 9), (frame.body,))


def _link(element: ET.Element, tag: str) -> str:
    return element.find(tag).attrib['link']  # type: ignore[union-attr]  # else it is refused


def _vector(element: ET.Element, tag: str, key: str, default: str = '0 0 0') -> FloatArray:
    part = element.find(tag)
    return _numbers((default if part is None else part.get(key, default)).split())


def _numbers(values: Sequence[Any]) -> FloatArray:
    """Return three numbers; a MechanismError for anything else."""
    try:
        vector = np.array(values, dtype=np.float64)
        if vector.shape == (3,) and np.abs(vector).max() <= _MAX_NUMBER:
            return vector
    except (OverflowError, TypeError, ValueError):
        pass
    text = printable(values, 60)
    raise MechanismError(f'{text} is not three numbers up to {_MAX_NUMBER:g}')
