"""
A robot as URDF, moved by the joint_states of its legs alone: any linkage, not the Klann leg only.

Each leg has a plane with the textbook's axes. The published angles are absolute, those of a URDF
relative to the parent, so a body that hangs on another one hangs on a link without length that
turns back as far as its parent has turned. The joints that nothing mimics are exactly the
published ones. A tree cannot close loops: where two bodies meet one of them carries the point, and
the angles see to it that the other one ends there too. For the same reason no link has a mass.
Of a Klann leg's the frames and joints are those of klann.urdf.xacro.
"""

from cmath import phase
from typing import NamedTuple
from xml.etree.ElementTree import Element, indent, SubElement, tostring

from klann_ros.dynamics.masses import body_places
from klann_ros.kinematics.linkage.structure import Bar, FIXED
from klann_ros.plotting.drawing import colour_of
from klann_ros.robot import Robot, RobotLeg
from klann_ros.robot.robot import Triple
from klann_ros.sanitize.text import printable

from .travel import ExportError, travel

URDF_HEADER = '<?xml version="1.0" encoding="utf-8"?>\n'
PIN, FRAME = 'klann_pin', 'klann_frame'
LINK_COLOURS = {PIN: '0.15 0.15 0.15 1', FRAME: '0.45 0.45 0.48 1'}
# Width of bars, as a part of the longest; sliders are drawn this number of widths long.
WIDTH, BLOCK = 0.05, 1.6


class Place(NamedTuple):
    """Where a point of a body is."""

    # The link that carries it.
    link: str
    # Where in it [m].
    at: complex
    # How far the link is turned from its body's angle [rad].
    bend: float


def urdf(
    robot: Robot,
    *,
    base_frame: str = 'base_link',
    frame_id: str = 'leg_plane',
    frame_prefix: str = '',
    joint_separator: str = '_',
) -> str:
    """
    Return a robot as URDF, in which its legs are moved by joint_states.

    Parameters
    ----------
    robot : Robot
        The text.
    base_frame, frame_id : str
        What carries the legs, and the plane of each.
    frame_prefix : str
        What goes before every frame but `base_frame`.
    joint_separator : str
        What stands between the names of a leg and of its joint, as solver_node publishes them.

    Raises
    ------
    ValueError
        Two legs have joints of one name.
    ExportError
        A linkage is no tree that its own points tell, or reaches no angle.

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
        _Leg(root, leg, frame_prefix + leg.prefix, joint_separator, taken).write(
            base_frame, frame_id
        )
    indent(root)
    return URDF_HEADER + tostring(root, encoding='unicode') + '\n'


class _Leg:
    """Writes the links and joints of one leg."""

    def __init__(
        self, root: Element, leg: RobotLeg, links: str, separator: str, taken: set[str]
    ) -> None:
        self._root, self._leg, self._links = root, leg, links
        self._separator = separator
        self._linkage, self._structure = leg.linkage, leg.linkage.structure
        self._places, self._travel = body_places(leg.linkage), travel(leg.linkage)
        self._width = WIDTH * max(
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
        rest = [*range(len(structure.bodies))]
        while rest:
            j = next((j for j in rest if self._hang(j)), None)
            if j is None:
                names = ', '.join(structure.angles[j] for j in rest)
                raise ExportError(f'{names}: nothing that stands before carries a point of them')
            rest.remove(j)
        carried = self._points[structure.first_owner(structure.foot), structure.foot]
        self._fixed('foot', carried, foot, 0.0)
        self._sphere(self._link(foot), 0j, 0, 1.5)

    def _hang(self, j: int) -> bool:
        """Write a body that hangs on one that is there; return whether there is one."""
        body = self._structure.bodies[j]
        if body.line is not None:
            along = self._structure.along[j]
            on = self._points.get((FIXED if along is None else along, body.line.start))
            if on is None:
                return False
            self._slide(j, body.line, on)
            return True
        for point in body.points:
            owner = next(
                (i for i in self._structure.owners[point] if (i, point) in self._points), None
            )
            if owner is not None:
                self._turn(j, owner, point)
                return True
        return False

    def _turn(self, j: int, owner: int, point: str) -> None:
        body, on = self._structure.bodies[j], self._points[owner, point]
        first, frame = body.bars[0], FIXED if owner == FIXED else self._structure.frames[owner]
        if frame != FIXED:
            on = Place(self._back(owner, point, frame), 0j, 0.0)
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

    def _back(self, owner: int, point: str, frame: int) -> str:
        """Return the link at a point that has no part in its body's turning."""
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

    def _slide(self, j: int, line: Bar, on: Place) -> None:
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
        size = BLOCK * self._width, self._width, self._width / 2.0
        self._box(self._link(link), 0j, phase(direction), self._layer(j), size, f'klann_{j}')
        self._points[j, line.end] = Place(link, 0j, 0.0)
        self._bars(j, body.rigid)

    def _bars(self, j: int, bars: tuple[Bar, ...]) -> None:
        """Write the bars of a body that has a link, each bent from where it begins."""
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

    # Elements.

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
        """Join a link that is bent so far from its body's angle."""
        turn = 0.0, 0.0, bend - on.bend if name != 'foot' else 0.0
        xyz = on.at.real, on.at.imag, 0.0
        self._joint(self._new_joint(name), 'fixed', on.link, child, xyz, turn)

    def _moving(self, j: int, kind: str, on: Place, child: str, axis: Triple) -> Element:
        name = self._leg.joint_name(self._structure.bodies[j].angle, self._separator)
        return self._joined(name, kind, on, child, axis)

    def _joined(self, name: str, kind: str, on: Place, child: str, axis: Triple) -> Element:
        xyz, rpy = (on.at.real, on.at.imag, 0.0), (0.0, 0.0, -on.bend)
        joint = self._joint(name, kind, on.link, child, xyz, rpy)
        SubElement(joint, 'axis', xyz=_numbers(axis))
        return joint

    # Visual geometry.

    def _layer(self, j: int) -> int:
        """Return how many bars lie below a body's."""
        return j % 4

    def _ground(self, plane: Element) -> None:
        pivots = [complex(at) for at in self._linkage.pivots]
        for n, at in enumerate(pivots):
            way = pivots[n - 1] - at
            if n or len(pivots) > 2:
                size = abs(way), self._width, self._width / 2.0
                self._box(plane, at + way / 2.0, phase(way), -1, size, FRAME)
            self._sphere(plane, at, -1, 1.0)

    def _bar(self, link: Element, j: int, length: float) -> None:
        size = length, self._width, self._width / 2.0
        self._box(link, complex(length / 2.0), 0.0, self._layer(j), size, f'klann_{j}')
        self._sphere(link, 0j, self._layer(j), 1.0)

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
    """Return what the link of a bar is called: 'ab', or 'a_b2' where points have long names."""
    between = '_' if len(start) > 1 or len(end) > 1 else ''
    return f'{start}{between}{end}'.lower()


def _new(name: str, taken: set[str]) -> str:
    """Return a name that is not taken, and take it."""
    while name in taken:
        name += '_'
    taken.add(name)
    return name


def _numbers(values: tuple[float, ...]) -> str:
    return ' '.join(map(_number, values))


def _number(value: float) -> str:
    return repr(float(value) + 0.0)
