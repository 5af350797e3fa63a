"""Klann legs in robot_description: the URDF that `urdf/klann.urdf.xacro` generates."""

from collections import defaultdict
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import NamedTuple
from xml.parsers import expat

from klann_ros.kinematics import GeometryError, KlannGeometry, KlannLeg
from klann_ros.kinematics.arrays import IndexArray
from klann_ros.log.read.block import MessageBlock
from klann_ros.log.records import Topic
from klann_ros.review.model.recording import LegSolver
from klann_ros.review.model.times import nanoseconds, Series
from klann_ros.robot.robot import SEPARATORS
from klann_ros.sanitize.cdr import CdrCursor
from klann_ros.sanitize.text import printable
import numpy as np

from .solvers import last_change

MAX_DESCRIPTION_SIZE = 4 * 1024 * 1024
"""Longest description that is read [characters]."""

_Vector = tuple[float, ...]
_ZERO = (0.0, 0.0, 0.0)


@dataclass
class _Joint:
    kind: str
    parent: str = ''
    child: str = ''
    xyz: _Vector = _ZERO
    rpy: _Vector = _ZERO
    # As the format has it where none is given.
    axis: _Vector = (1.0, 0.0, 0.0)
    mimics: tuple[str, float, float] | None = None


@dataclass
class _Robot:
    """The joints of a robot, and the lengths of the boxes that show its links."""

    joints: dict[str, _Joint] = field(default_factory=dict)
    boxes: dict[str, float] = field(default_factory=dict)


class _ExpectedJoint(NamedTuple):
    """
    A joint that `klann.urdf.xacro` generates.

    It turns about z (`turns` is the sign), compensates another joint (`back`), or is a bend. `on`
    is its parent joint, '' for the plane of the leg. Each number of its origin is a dimension or
    zero.
    """

    name: str
    on: str = ''
    x: str = ''
    y: str = ''
    bend: str = ''
    bend_sign: int = 1
    turns: int = 0
    back: str = ''


_JOINTS = (
    _ExpectedJoint('alpha', y='y_a', turns=1),
    _ExpectedJoint('alpha_back', 'alpha', x='l_ab', turns=1, back='alpha'),
    _ExpectedJoint('gamma', 'alpha_back', turns=-1),
    _ExpectedJoint('bend_c', 'gamma', x='l_bc', bend='angle_bcg'),
    _ExpectedJoint('beta', x='x_d', turns=1),
    _ExpectedJoint('delta', x='x_e', y='y_e', turns=1),
    _ExpectedJoint('delta_back', 'delta', x='l_ef', turns=1, back='delta'),
    _ExpectedJoint('theta', 'delta_back', turns=-1),
    _ExpectedJoint('bend_g', 'theta', x='l_fg', bend='angle_fgh', bend_sign=-1),
    _ExpectedJoint('foot', 'bend_g', x='l_gh'),
)
# A tree cannot close loops: these bars end freely, and have the length of the box on this joint.
_BAR_LENGTHS = {'l_dc': 'beta', 'l_cg': 'bend_c'}


class _ForeignUrdfError(ValueError):
    """A URDF that `klann.urdf.xacro` did not generate."""


def klann_legs_in_urdf(text: str) -> dict[str, dict[str, float]]:
    """
    Return the lengths [m], pivots [m] and bends [rad] of the legs in a URDF, by the legs' names.

    They are the arguments of `KlannGeometry` without the assembly, which no URDF has. Of
    other robots, and of an invalid URDF, nothing is returned. The text is untrusted: a document
    type declaration is refused, so nothing is expanded or fetched.
    """
    if len(text) > MAX_DESCRIPTION_SIZE:
        return {}
    try:
        robot = _Reader().read(text)
    except (_ForeignUrdfError, expat.ExpatError, UnicodeEncodeError):
        return {}
    crank = _JOINTS[0].name
    prefixes = (name.removesuffix(crank) for name in robot.joints if name.endswith(crank))
    found = {}
    for prefix in (each for each in prefixes if not each or each[-1] in SEPARATORS):
        try:
            found[prefix[:-1]] = _dimensions(robot, prefix)
        except (KeyError, _ForeignUrdfError):  # noqa: PERF203, RUF100 - another robot's joint
            continue
    return found


def _dimensions(robot: _Robot, prefix: str) -> dict[str, float]:
    """Return the dimensions of the leg whose joints have a prefix."""
    plane = robot.joints[f'{prefix}{_JOINTS[0].name}'].parent
    found: dict[str, float] = {}
    for made in _JOINTS:
        joint = robot.joints[f'{prefix}{made.name}']
        on = robot.joints[f'{prefix}{made.on}'].child if made.on else plane
        mimics = (f'{prefix}{made.back}', -1.0, 0.0) if made.back else None
        kind = 'continuous' if made.turns else 'fixed'
        # The axis of a fixed joint is arbitrary.
        axis = (0.0, 0.0, float(made.turns)) if made.turns else joint.axis
        if (joint.parent, joint.kind, joint.axis, joint.mimics) != (on, kind, axis, mimics):
            raise _ForeignUrdfError(made.name)
        places = (made.x, made.y, '', '', '', made.bend)
        for name, value in zip(places, (*joint.xyz, *joint.rpy), strict=True):
            if name:
                found[name] = value
            elif value:
                raise _ForeignUrdfError(made.name)
        if made.bend_sign < 0:
            found[made.bend] *= -1
    for name, on in _BAR_LENGTHS.items():
        found[name] = robot.boxes[robot.joints[f'{prefix}{on}'].child]
    return found


class _Reader:
    """Reads joints and boxes of a URDF."""

    def __init__(self) -> None:
        self._robot = _Robot()
        self._path: list[str] = []
        self._joint = _Joint('')
        self._link = ''

    def read(self, text: str) -> _Robot:
        # The text is decoded already, whatever encoding it declares.
        parser = expat.ParserCreate('utf-8')
        parser.StartElementHandler = self._begin
        parser.EndElementHandler = self._end
        parser.StartDoctypeDeclHandler = self._refuse
        parser.Parse(text.encode(), True)
        return self._robot

    def _refuse(self, *_: object) -> None:
        raise _ForeignUrdfError('a document type')

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        self._path.append(tag)
        if len(self._path) > 5:
            return
        try:
            self._take('/'.join(self._path), attributes)
        except (KeyError, ValueError):
            raise _ForeignUrdfError(tag) from None

    def _end(self, _: str) -> None:
        self._path.pop()

    def _take(self, path: str, attributes: dict[str, str]) -> None:
        joint = self._joint
        if path == 'robot/link':
            self._link = attributes['name']
        elif path == 'robot/link/visual/geometry/box':
            self._robot.boxes.setdefault(self._link, _numbers(attributes['size'])[0])
        elif path == 'robot/joint':
            self._joint = _Joint(attributes['type'])
            if self._robot.joints.setdefault(attributes['name'], self._joint) is not self._joint:
                raise ValueError('two joints of one name')
        elif path == 'robot/joint/parent':
            joint.parent = attributes['link']
        elif path == 'robot/joint/child':
            joint.child = attributes['link']
        elif path == 'robot/joint/origin':
            joint.xyz = _numbers(attributes.get('xyz', '0 0 0'))
            joint.rpy = _numbers(attributes.get('rpy', '0 0 0'))
        elif path == 'robot/joint/axis':
            joint.axis = _numbers(attributes['xyz'])
        elif path == 'robot/joint/mimic':
            factor, offset = attributes.get('multiplier', '1'), attributes.get('offset', '0')
            multiplier, angle, _ = _numbers(f'{factor} {offset} 0')
            joint.mimics = attributes['joint'], multiplier, angle


def _numbers(text: str) -> _Vector:
    numbers = tuple(map(float, text.split()))
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise ValueError('these are not three numbers')
    return numbers


TEXT, NAME = 'std_msgs/msg/String', 'robot_description'
# Different descriptions of one namespace that are read.
_MAX_DESCRIPTIONS = 32
# Bytes of a String message beside its text.
_MESSAGE_OVERHEAD = 16


class _Described(NamedTuple):
    """Dimensions of legs by their names, since a log time [ns]."""

    time: int
    legs: dict[str, dict[str, float]]


class Descriptions:
    """Collects the legs of robot descriptions, by the namespace of the topic."""

    def __init__(self) -> None:
        self._last: dict[str, bytes] = {}
        self._found: dict[str, list[_Described]] = defaultdict(list)

    def add(self, topic: Topic, block: MessageBlock, rows: IndexArray) -> None:
        """Add the descriptions of a topic in a block."""
        namespace, _, name = topic.name.rpartition('/')
        if (topic.type, name) != (TEXT, NAME):
            return
        for row in rows[block.sizes[rows] <= MAX_DESCRIPTION_SIZE + _MESSAGE_OVERHEAD].tolist():
            data = block.message(row)
            # It is usually repeated.
            if (
                data != self._last.get(topic.name)
                and len(self._found[namespace]) < _MAX_DESCRIPTIONS
            ):
                self._last[topic.name] = data
                time = int(nanoseconds(block.heads['log_time'][[row]])[0])
                self._found[namespace].append(_Described(time, klann_legs_in_urdf(_text(data))))

    def described(self, solver: LegSolver, namespace: str, name: str, poses: Series) -> LegSolver:
        """Return a solver with the described leg, if its own is unknown."""
        spaces = [space for space, found in self._found.items() if any(d.legs for d in found)]
        # A single description holds for every namespace.
        space = namespace if namespace in spaces or len(spaces) != 1 else spaces[0]
        found = sorted(self._found.get(space, ()), key=lambda described: described.time)
        assembly = _assembly(poses)
        legs = [_klann_leg(described.legs.get(name), assembly) for described in found]
        if solver.leg is not None or not legs or legs[-1] is None:
            return solver
        times = [described.time for described in found]
        source = f'{printable(f"{space}/{NAME}")}, assembly mode from its poses'
        return replace(solver, leg=legs[-1], leg_time=last_change(times, legs), source=source)


def _text(data: bytes) -> str:
    try:
        return CdrCursor(data).string().decode()
    except ValueError:
        return ''


def _assembly(poses: Series) -> tuple[int, int]:
    """Return the assembly mode of most poses of a Klann leg, which no URDF has."""
    _, gamma, beta, delta, theta = poses.values.T
    with np.errstate(over='ignore', invalid='ignore'):
        sums = [float(np.nansum(np.sign(np.sin(both)))) for both in (gamma + beta, delta + theta)]
    return (1 if sums[0] >= 0 else -1), (1 if sums[1] >= 0 else -1)


def _klann_leg(numbers: dict[str, float] | None, assembly: tuple[int, int]) -> KlannLeg | None:
    try:
        return None if numbers is None else KlannLeg(KlannGeometry(**numbers, assembly=assembly))
    except GeometryError:
        return None
