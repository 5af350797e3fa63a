"""
A robot of any linkage as URDF, moved by the joint_states of its legs alone.

Each leg has a plane with the textbook's axes. Published angles are absolute, those of a URDF are
relative to the parent. So a body is attached to its parent by a link without length, whose mimic
joint turns back the parent's rotation. The joints without mimic are exactly the published ones. A
tree cannot close loops: where two bodies meet, one carries the point, and the published angles let
the other end there too. For the same reason no link has a mass. Frames and joints of a Klann leg
are those of klann.urdf.xacro.
"""

from cmath import phase
from typing import NamedTuple
from xml.etree.ElementTree import Element, indent, SubElement, tostring

from klann_ros.kinematics import Bar, body_points, colour_of, FIXED
from klann_ros.robot import Robot, RobotLeg, Triple
from klann_ros.sanitize.text import printable
from klann_ros.twin import spanning_tree

from .travel import travel

URDF_HEADER = '<?xml version="1.0" encoding="utf-8"?>\n'
PIN, FRAME = 'klann_pin', 'klann_frame'
LINK_COLOURS = {PIN: '0.15 0.15 0.15 1', FRAME: '0.45 0.45 0.48 1'}
# Width of bars, as a part of the longest; length of sliders in widths; drawn layers of bars.
BAR_WIDTH, SLIDER_LENGTH, LAYERS = 0.05, 1.6, 4


class Place(NamedTuple):
    """The place of a point of a body."""

    link: str  # that carries it
    at: complex  # in the link [m]
    bend: float  # the link's rotation from its body's angle [rad]


def urdf(
    robot: Robot,
    *,
    base_frame: str = 'base_link',
    frame_id: str = 'leg_plane',
    frame_prefix: str = '',
    joint_separator: str = '_',
) -> str:
    """
    Return a robot as URDF, its legs moved by joint_states.

    Parameters
    ----------
    robot : Robot
        The robot.
    base_frame, frame_id : str
        The frame of the body, and of each leg's plane.
    frame_prefix : str
        Prefix of every frame but `base_frame`.
    joint_separator : str
        Separator between the names of a leg and its joint, as in solver_node's parameter.

    Raises
    ------
    ValueError
        Two legs have joints of one name.
    ExportError
        A linkage reaches no angle.

    """
    taken = {*robot.joint_names(joint_separator)}
    root = Element('robot', name=printable(robot.name))
    materials = dict(LINK_COLOURS)
    for leg in robot.legs:
        for j in range(len(leg.linkage.structure.bodies)):
            red, green, blue = (part / 255 for part in bytes.fromhex(colour_of(j)[1:]))
            materials[f'klann_{j}'] = f'{red:.3f} {green:.3f} {blue:.3f} 1'
    for name, colour in materials.items():
        SubElement(SubElement(root, 'material', name=name), 'color', rgba=colour)
    SubElement(root, 'link', name=base_frame)
    for leg in robot.legs:
        writer = _LegWriter(root, leg, frame_prefix + leg.prefix, joint_separator, taken)
        writer.write(base_frame, frame_id)
    indent(root)
    return URDF_HEADER + tostring(root, encoding='unicode') + '\n'


class _LegWriter:
    """Writes the links and joints of one leg."""

    def __init__(
        self, root: Element, leg: RobotLeg, links: str, separator: str, taken: set[str]
    ) -> None:
        self._root, self._leg, self._links = root, leg, links
        self._separator = separator
        self._linkage, self._structure = leg.linkage, leg.linkage.structure
        self._places = body_points(leg.linkage.structure, leg.linkage.bars)
        self._travel = travel(leg.linkage)
        self._width = BAR_WIDTH * max(
            (abs(bar) for n, bar in enumerate(map(complex, leg.linkage.bars))
             if n not in self._structure.lines),
            default=leg.linkage.size,
        )  # fmt: skip
        self._points: dict[tuple[int, str], Place] = {}
        self._backs: dict[tuple[int, str], str] = {}
        self._numbers = {(j, bar): n for n, (j, bar) in enumerate(self._structure.bars)}
        # Of all legs: a fixed joint must not have the name of another leg's published joint.
        self._joints = taken
        self._frames: set[str] = set()

    def write(self, base_frame: str, frame_id: str) -> None:
        """Write the leg, from its mount on."""
        structure, mount = self._structure, self._leg.mount
        plane = self._new_frame(frame_id)
        foot = self._new_frame(structure.foot.lower())
        self._joint(self._new_joint('mount'), 'fixed', base_frame, plane, mount.xyz, mount.rpy)
        self._ground(self._link(plane))
        for name, at in zip(structure.pivots, self._linkage.pivots, strict=True):
            self._points[FIXED, name] = Place(plane, complex(at), 0.0)
        for j, parent, point in spanning_tree(self._linkage)[0]:
            line = structure.bodies[j].line
            if line is None:
                self._rotating(j, parent, point)
            else:
                self._sliding(j, line, self._points[parent, line.start])
        carried = self._points[structure.first_owner(structure.foot), structure.foot]
        self._fixed('foot', carried, foot, 0.0)
        self._sphere(self._link(foot), 0j, 0, 1.5)

    def _rotating(self, j: int, owner: int, point: str) -> None:
        body, on = self._structure.bodies[j], self._points[owner, point]
        first, frame = body.bars[0], FIXED if owner == FIXED else self._structure.frames[owner]
        if frame != FIXED:
            on = Place(self._unrotated(owner, point, frame), 0j, 0.0)
        link = self._new_frame(_name(first.start, first.end))
        child = link if point == first.start else self._new_frame(f'{link}_{point.lower()}')
        self._moving(j, 'continuous', on, child, (0.0, 0.0, float(body.sense)))
        if child != link:
            self._link(child)
            self._fixed('bend', Place(child, -self._places[j, point], 0.0), link, 0.0)
        element = self._link(link)
        self._bar(element, j, self._length(j, first))
        self._points[j, first.start] = Place(link, 0j, 0.0)
        self._points[j, first.end] = Place(link, complex(self._length(j, first)), 0.0)
        self._bars(j, body.bars[1:])

    def _unrotated(self, owner: int, point: str, frame: int) -> str:
        """Return the link at a point of a body without the body's rotation."""
        if (owner, point) not in self._backs:
            body = self._structure.bodies[frame]
            link = self._new_frame(point.lower())
            name = self._new_joint(f'{body.angle}_back')
            axis = 0.0, 0.0, float(body.sense)
            joint = self._joined(name, 'continuous', self._points[owner, point], link, axis)
            mimicked = self._leg.joint_name(body.angle, self._separator)
            SubElement(joint, 'mimic', joint=mimicked, multiplier='-1', offset='0')
            self._link(link)
            self._backs[owner, point] = link
        return self._backs[owner, point]

    def _sliding(self, j: int, line: Bar, on: Place) -> None:
        body = self._structure.bodies[j]
        direction = complex(self._linkage.bars[self._structure.line_of[j]])
        least, greatest = self._travel[j]
        link = self._new_frame(body.angle.lower())
        axis = direction.real, direction.imag, 0.0
        joint = self._moving(j, 'prismatic', on, link, axis)
        beyond = 0.05 * (greatest - least) + self._width
        SubElement(
            joint, 'limit', lower=_number(least - beyond), upper=_number(greatest + beyond),
            effort='1000', velocity='1000',
        )  # fmt: skip
        size = SLIDER_LENGTH * self._width, self._width, self._width / 2.0
        self._box(self._link(link), 0j, phase(direction), j % LAYERS, size, f'klann_{j}')
        self._points[j, line.end] = Place(link, 0j, 0.0)
        self._bars(j, body.rigid)

    def _bars(self, j: int, bars: tuple[Bar, ...]) -> None:
        """Write bars of a written body, each bent from its start."""
        for bar in bars:
            begin = self._points[j, bar.start]
            bend = phase(complex(self._linkage.bars[self._numbers[j, bar]]))
            link = self._new_frame(_name(bar.start, bar.end))
            self._fixed(f'bend_{bar.start.lower()}', begin, link, bend)
            length = self._length(j, bar)
            self._bar(self._link(link), j, length)
            self._points[j, bar.end] = Place(link, complex(length), bend)

    def _length(self, j: int, bar: Bar) -> float:
        return abs(complex(self._linkage.bars[self._numbers[j, bar]]))

    def _new_frame(self, name: str) -> str:
        return self._links + _new(name, self._frames)

    def _new_joint(self, name: str) -> str:
        return _new(self._leg.joint_name(name, self._separator), self._joints)

    def _link(self, name: str) -> Element:
        return SubElement(self._root, 'link', name=name)

    def _joint(  # noqa: PLR0917 - the attributes of a joint
        self, name: str, kind: str, parent: str, child: str, xyz: Triple, rpy: Triple
    ) -> Element:
        joint = SubElement(self._root, 'joint', name=name, type=kind)
        SubElement(joint, 'parent', link=parent)
        SubElement(joint, 'child', link=child)
        SubElement(joint, 'origin', xyz=_numbers(xyz), rpy=_numbers(rpy))
        return joint

    def _fixed(self, name: str, on: Place, child: str, bend: float) -> None:
        """Join a link at an angle `bend` to its body's."""
        rpy = 0.0, 0.0, bend - on.bend if name != 'foot' else 0.0
        xyz = on.at.real, on.at.imag, 0.0
        self._joint(self._new_joint(name), 'fixed', on.link, child, xyz, rpy)

    def _moving(self, j: int, kind: str, on: Place, child: str, axis: Triple) -> Element:
        name = self._leg.joint_name(self._structure.bodies[j].angle, self._separator)
        return self._joined(name, kind, on, child, axis)

    def _joined(self, name: str, kind: str, on: Place, child: str, axis: Triple) -> Element:
        xyz, rpy = (on.at.real, on.at.imag, 0.0), (0.0, 0.0, -on.bend)
        joint = self._joint(name, kind, on.link, child, xyz, rpy)
        SubElement(joint, 'axis', xyz=_numbers(axis))
        return joint

    def _ground(self, plane: Element) -> None:
        pivots = [complex(at) for at in self._linkage.pivots]
        for n, at in enumerate(pivots):
            side = pivots[n - 1] - at
            if n or len(pivots) > 2:
                size = abs(side), self._width, self._width / 2.0
                self._box(plane, at + side / 2.0, phase(side), -1, size, FRAME)
            self._sphere(plane, at, -1, 1.0)

    def _bar(self, link: Element, j: int, length: float) -> None:
        size = length, self._width, self._width / 2.0
        self._box(link, complex(length / 2.0), 0.0, j % LAYERS, size, f'klann_{j}')
        self._sphere(link, 0j, j % LAYERS, 1.0)

    def _box(  # noqa: PLR0917 - the attributes of a box
        self, link: Element, at: complex, turn: float, layer: int, size: Triple, material: str
    ) -> None:
        visual = self._visual(link, at, turn, layer)
        SubElement(SubElement(visual, 'geometry'), 'box', size=_numbers(size))
        SubElement(visual, 'material', name=material)

    def _sphere(self, link: Element, at: complex, layer: int, size: float) -> None:
        visual = self._visual(link, at, 0.0, layer)
        radius = _number(0.6 * size * self._width)
        SubElement(SubElement(visual, 'geometry'), 'sphere', radius=radius)
        SubElement(visual, 'material', name=PIN)

    def _visual(self, link: Element, at: complex, turn: float, layer: int) -> Element:
        visual = SubElement(link, 'visual')
        xyz = at.real, at.imag, layer * self._width / 2.0
        SubElement(visual, 'origin', xyz=_numbers(xyz), rpy=_numbers((0.0, 0.0, turn)))
        return visual


def _name(start: str, end: str) -> str:
    """Return the link's name of a bar: 'ab', or 'a_b2' for points with long names."""
    between = '_' if len(start) > 1 or len(end) > 1 else ''
    return f'{start}{between}{end}'.lower()


def _new(name: str, taken: set[str]) -> str:
    """Return an unused name, and mark it as used."""
    while name in taken:
        name += '_'
    taken.add(name)
    return name


def _numbers(values: tuple[float, ...]) -> str:
    return ' '.join(map(_number, values))


def _number(value: float) -> str:
    return repr(float(value) + 0.0)
