"""The dimensions of Klann legs in a URDF that `urdf/klann.urdf.xacro` made; a stranger's XML."""

from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple
from xml.parsers import expat

from klann_ros.robot.robot import SEPARATORS

LONGEST = 4 * 1024 * 1024
"""No robot needs a longer description [characters]."""

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
    """What of a robot tells its legs: its joints, and how long the box is that a link shows."""

    joints: dict[str, _Joint] = field(default_factory=dict)
    boxes: dict[str, float] = field(default_factory=dict)


class _Made(NamedTuple):
    """
    A joint as `klann.urdf.xacro` makes it.

    It turns about z (`turns` is the sign), turns back what another one has turned, or is a bend.
    `on` is the joint on whose child it hangs, '' for the leg's plane. What stands at its origin is
    a dimension, or zero.
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
    _Made('alpha', y='y_a', turns=1),
    _Made('alpha_back', 'alpha', x='l_ab', turns=1, back='alpha'),
    _Made('gamma', 'alpha_back', turns=-1),
    _Made('bend_c', 'gamma', x='l_bc', bend='angle_bcg'),
    _Made('beta', x='x_d', turns=1),
    _Made('delta', x='x_e', y='y_e', turns=1),
    _Made('delta_back', 'delta', x='l_ef', turns=1, back='delta'),
    _Made('theta', 'delta_back', turns=-1),
    _Made('bend_g', 'theta', x='l_fg', bend='angle_fgh', bend_sign=-1),
    _Made('foot', 'bend_g', x='l_gh'),
)
# A tree cannot close loops, so that nothing hangs at the end of these: they are as long as the
# box that shows them, which hangs on this joint.
_SHOWN = {'l_dc': 'beta', 'l_cg': 'bend_c'}


class _NotOursError(ValueError):
    """What no `klann.urdf.xacro` makes."""


def klann_legs_in_urdf(text: str) -> dict[str, dict[str, float]]:
    """
    Return the lengths [m], pivots [m] and bends [rad] of the legs in a URDF, by the legs' names.

    They are the arguments of `KlannGeometry` but for the assembly, which a URDF does not tell. Of
    another robot nothing is returned, nor of what is no URDF, and never an error: the text may be
    anybody's. A document type declaration is refused, so nothing is expanded or fetched.
    """
    if len(text) > LONGEST:
        return {}
    try:
        robot = _Reader().read(text)
    except (_NotOursError, expat.ExpatError, UnicodeEncodeError):
        return {}
    crank = _JOINTS[0].name
    prefixes = (name.removesuffix(crank) for name in robot.joints if name.endswith(crank))
    found = {}
    for prefix in (each for each in prefixes if not each or each[-1] in SEPARATORS):
        try:
            found[prefix[:-1]] = _leg(robot, prefix)
        except (KeyError, _NotOursError):  # noqa: PERF203, RUF100 - another robot's joint
            continue
    return found


def _leg(robot: _Robot, prefix: str) -> dict[str, float]:
    """Return the dimensions of the leg whose joints have a prefix."""
    plane = robot.joints[f'{prefix}{_JOINTS[0].name}'].parent
    found: dict[str, float] = {}
    for made in _JOINTS:
        joint = robot.joints[f'{prefix}{made.name}']
        on = robot.joints[f'{prefix}{made.on}'].child if made.on else plane
        mimics = (f'{prefix}{made.back}', -1.0, 0.0) if made.back else None
        kind = 'continuous' if made.turns else 'fixed'
        # One that is fixed has no axis that matters.
        axis = (0.0, 0.0, float(made.turns)) if made.turns else joint.axis
        if (joint.parent, joint.kind, joint.axis, joint.mimics) != (on, kind, axis, mimics):
            raise _NotOursError(made.name)
        places = (made.x, made.y, '', '', '', made.bend)
        for name, value in zip(places, (*joint.xyz, *joint.rpy), strict=True):
            if name:
                found[name] = value
            elif value:
                raise _NotOursError(made.name)
        if made.bend_sign < 0:
            found[made.bend] *= -1
    for name, on in _SHOWN.items():
        found[name] = robot.boxes[robot.joints[f'{prefix}{on}'].child]
    return found


class _Reader:
    """Reads what tells legs out of a URDF."""

    def __init__(self) -> None:
        self._robot = _Robot()
        self._path: list[str] = []
        self._joint = _Joint('')
        self._link = ''

    def read(self, text: str) -> _Robot:
        # Whatever the text says about its encoding: it is decoded already.
        parser = expat.ParserCreate('utf-8')
        parser.StartElementHandler = self._begin
        parser.EndElementHandler = self._end
        parser.StartDoctypeDeclHandler = self._refuse
        parser.Parse(text.encode(), True)
        return self._robot

    def _refuse(self, *_: object) -> None:
        raise _NotOursError('a document type')

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        self._path.append(tag)
        if len(self._path) > 5:
            return
        try:
            self._take('/'.join(self._path), attributes)
        except (KeyError, ValueError):
            raise _NotOursError(tag) from None

    def _end(self, _: str) -> None:
        self._path.pop()

    def _take(self, path: str, told: dict[str, str]) -> None:
        joint = self._joint
        if path == 'robot/link':
            self._link = told['name']
        elif path == 'robot/link/visual/geometry/box':
            self._robot.boxes.setdefault(self._link, _numbers(told['size'])[0])
        elif path == 'robot/joint':
            self._joint = _Joint(told['type'])
            if self._robot.joints.setdefault(told['name'], self._joint) is not self._joint:
                raise ValueError('two joints of one name')
        elif path == 'robot/joint/parent':
            joint.parent = told['link']
        elif path == 'robot/joint/child':
            joint.child = told['link']
        elif path == 'robot/joint/origin':
            joint.xyz = _numbers(told.get('xyz', '0 0 0'))
            joint.rpy = _numbers(told.get('rpy', '0 0 0'))
        elif path == 'robot/joint/axis':
            joint.axis = _numbers(told['xyz'])
        elif path == 'robot/joint/mimic':
            factor, offset = told.get('multiplier', '1'), told.get('offset', '0')
            multiplier, angle, _ = _numbers(f'{factor} {offset} 0')
            joint.mimics = told['joint'], multiplier, angle


def _numbers(text: str) -> _Vector:
    numbers = tuple(map(float, text.split()))
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise ValueError('these are not three numbers')
    return numbers
