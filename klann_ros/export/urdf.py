"""
A robot of any linkage as URDF, moved by the joint_states of its legs alone.

Each leg has a plane with the textbook's axes. Published angles are absolute, those of a URDF are
relative to the parent. So a body is attached to its parent by a link without length, whose mimic
joint turns back the parent's rotation. The joints without mimic are exactly the published ones. A
tree cannot close loops: where two bodies meet, one carries the point, and the published angles let
the other end there too. Each body's first link has its mass, if the file has masses: they
give the centre of mass at the published angles, but no dynamics. Frames and joints of a Klann leg
are those of klann.urdf.xacro. With `loops_urdf` joints are pins and sliders, and loops are closed.
"""

from cmath import phase, rect
from collections.abc import Sequence
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, indent, SubElement, tostring

from klann_ros.kinematics import Bar, body_points, colour_of, FIXED, LinkageLeg, LinkagePose
from klann_ros.robot import Robot, RobotLeg, Triple
from klann_ros.sanitize.text import printable
from klann_ros.sanitize.yaml_text import dump
from klann_ros.twin import spanning_tree, start_angle

from .travel import travel

URDF_HEADER = '<?xml version="1.0" encoding="utf-8"?>\n'
PIN, FRAME = 'klann_pin', 'klann_frame'
LINK_COLOURS = {PIN: '0.15 0.15 0.15 1', FRAME: '0.45 0.45 0.48 1'}
# Width of bars, as a part of the longest; length of sliders in widths; drawn layers of bars.
BAR_WIDTH, SLIDER_LENGTH, LAYERS = 0.05, 1.6, 4
# Radius of a joint's pin in widths.
PIN_RADIUS = 0.6
Loops = dict[str, dict[str, Any]]  # the lists of a `loop_closures.yaml`, by names


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
    root = _robot_element(robot, base_frame)
    joints = {*robot.joint_names(joint_separator)}
    for leg in robot.legs:
        writer = _LegWriter(root, leg, frame_prefix + leg.prefix, joint_separator, joints)
        writer.write(base_frame, frame_id)
    return _text(root)


def loops_urdf(robot: Robot, joint_separator: str) -> dict[str, bytes]:
    """
    Return `robot.urdf`, its joints named by points, and its `loop_closures.yaml`.

    At joint zero a crank is at position 0, or at one that closes all its legs, which mimic the
    first. Points and axes of closures are in `base_link`, as scikit-robot reads them.
    """
    root = _robot_element(robot, 'base_link')
    joints = {*robot.joint_names(joint_separator)}
    loops: Loops = {'closures': {}, 'dependent': {}, 'independent': {}}
    for leg in robot.legs:
        crank = leg.crank_angles(start_angle(robot.on_joint(leg.crank_joint)))
        pose = LinkageLeg(leg.linkage).closed_form(float(crank))
        writer = _LegWriter(root, leg, leg.prefix, joint_separator, joints, pose, loops)
        writer.write('base_link', 'leg_plane')
    sidecar = dump({key: [*named.values()] for key, named in loops.items()}, flow_style=None)
    return {'robot.urdf': _text(root).encode(), 'loop_closures.yaml': f'{sidecar}\n'.encode()}


def _robot_element(robot: Robot, base_frame: str) -> Element:
    """Return a robot's element with its materials and the link of its body."""
    root = Element('robot', name=printable(robot.name))
    materials = dict(LINK_COLOURS)
    for leg in robot.legs:
        for j in range(len(leg.linkage.structure.bodies)):
            red, green, blue = (byte / 255 for byte in bytes.fromhex(colour_of(j)[1:]))
            materials[f'klann_{j}'] = f'{red:.3f} {green:.3f} {blue:.3f} 1'
    for name, colour in materials.items():
        SubElement(SubElement(root, 'material', name=name), 'color', rgba=colour)
    SubElement(root, 'link', name=base_frame)
    return root


def _text(root: Element) -> str:
    indent(root)
    return URDF_HEADER + tostring(root, encoding='unicode') + '\n'


class _LegWriter:
    """
    Writes the links and joints of one leg.

    With the pose at joint zero its joints are pins and sliders, and it adds its closures to
    `loops`; else they are the published angles.
    """

    def __init__(  # noqa: PLR0917 - what the legs of a robot share, and what they do not
        self,
        root: Element,
        leg: RobotLeg,
        prefix: str,
        separator: str,
        joints: set[str],
        pose: LinkagePose | None = None,
        loops: Loops | None = None,
    ) -> None:
        self._root = root
        self._leg = leg
        self._prefix = prefix  # of the names of links
        self._separator = separator
        self._linkage = leg.linkage
        self._structure = leg.linkage.structure
        bars = list(map(complex, leg.linkage.bars))
        lengths = [abs(bar) for n, bar in enumerate(bars) if n not in self._structure.lines]
        # The width of bars [m].
        self._width = BAR_WIDTH * max(lengths, default=leg.linkage.size)
        # Places of points by body, and links without the body's rotation there.
        self._points: dict[tuple[int, str], Place] = {}
        self._unrotated_links: dict[tuple[int, str], str] = {}
        # Each bar as a complex number in its body [m].
        self._bar_vectors = dict(zip(self._structure.bars, bars, strict=True))
        # Names of joints of all legs: a fixed joint must not have the name of a published one.
        self._joints = joints
        self._frames: set[str] = set()
        self._pose = pose
        self._loops: Loops = loops or {}

    def write(self, base_frame: str, frame_id: str) -> None:
        """Write the leg, from its mount on."""
        structure, mount = self._structure, self._leg.mount
        plane = self._new_frame(frame_id)
        foot = self._new_frame(structure.foot.lower())
        self._joint(self._new_joint('mount'), 'fixed', base_frame, plane, mount.xyz, mount.rpy)
        self._ground(self._link(plane))
        for name, pivot in zip(structure.pivots, self._linkage.pivots, strict=True):
            self._points[FIXED, name] = Place(plane, complex(pivot), 0.0)
        travels = travel(self._linkage)
        for j, parent, point in spanning_tree(self._linkage)[0]:
            line = structure.bodies[j].line
            if line is None:
                self._rotating(j, parent, point)
            else:
                self._sliding(j, line, self._points[parent, line.start], travels[j])
        carried = self._points[structure.first_owner(structure.foot), structure.foot]
        self._fixed('foot', carried, foot, 0.0)
        self._sphere(self._link(foot), 0j, 0, 1.5)
        if self._pose:
            self._close_loops(mount.transform(self._pose.points).tolist())

    def _close_loops(self, places: Sequence[Sequence[float]]) -> None:
        """Add the pins that no joint is at, by the places of all points in the base frame [m]."""
        for point, *bodies in spanning_tree(self._linkage)[1]:
            name = self._new_joint(point)
            link_a, link_b = (self._points[j, point].link for j in bodies)
            self._loops['closures'][name] = {
                'name': name,
                'link_a': link_a,
                'link_b': link_b,
                'point': places[self._structure.points.index(point)],
                'axis': self._leg.mount.rotation[:, 2].tolist(),
            }

    def _rotating(self, j: int, owner: int, point: str) -> None:
        """Add the joint of a body that turns about a point, and its bars."""
        body = self._structure.bodies[j]
        first = body.bars[0]
        on = self._points[owner, point]
        sense = body.sense
        frame = FIXED if owner == FIXED else self._structure.frames[owner]
        if self._pose:
            directions = (*self._pose.vectors, 1.0)  # FIXED is the last
            on = on._replace(bend=on.bend - phase(directions[j] / directions[frame]))
            sense *= 1 if j else self._leg.direction
        elif frame != FIXED:
            on = Place(self._unrotated(owner, point, frame), 0j, 0.0)
        link = self._new_frame(_name(first.start, first.end))
        child = link if point == first.start else self._new_frame(f'{link}_{point.lower()}')
        self._moving(j, point, on, child, (0.0, 0.0, float(sense)))
        if child != link:
            self._link(child)
            offset = body_points(self._structure, self._linkage.bars)[j, point]
            self._fixed('bend', Place(child, -offset, 0.0), link, 0.0)
        element = self._link(link)
        self._inertial(element, j)
        self._bar(element, j, self._length(j, first))
        self._points[j, first.start] = Place(link, 0j, 0.0)
        self._points[j, first.end] = Place(link, complex(self._length(j, first)), 0.0)
        self._bars(j, body.bars[1:])

    def _unrotated(self, owner: int, point: str, frame: int) -> str:
        """Return the link at a point of a body without the body's rotation."""
        if (owner, point) not in self._unrotated_links:
            body = self._structure.bodies[frame]
            link = self._new_frame(point.lower())
            name = self._new_joint(f'{body.angle}_back')
            axis = 0.0, 0.0, float(body.sense)
            joint = self._moving_joint(name, 'continuous', self._points[owner, point], link, axis)
            mimicked = self._leg.joint_name(body.angle, self._separator)
            SubElement(joint, 'mimic', joint=mimicked, multiplier='-1', offset='0')
            self._link(link)
            self._unrotated_links[owner, point] = link
        return self._unrotated_links[owner, point]

    def _sliding(self, j: int, line: Bar, on: Place, stroke: tuple[float, float]) -> None:
        body = self._structure.bodies[j]
        direction = complex(self._linkage.bars[self._structure.line_of[j]])
        start = self._pose.joints[j] if self._pose else 0.0
        on = on._replace(at=on.at + start * direction * rect(1.0, -on.bend))
        low, high = (end - start for end in stroke)
        link = self._new_frame(body.angle.lower())
        axis = direction.real, direction.imag, 0.0
        joint = self._moving(j, f'line_{link}', on, link, axis)
        margin = 0.05 * (high - low) + self._width
        limits = {'lower': _number(low - margin), 'upper': _number(high + margin)}
        SubElement(joint, 'limit', limits, effort='1000', velocity='1000')
        element = self._link(link)
        self._inertial(element, j)
        self._box(element, 0j, phase(direction), SLIDER_LENGTH * self._width, j)
        self._points[j, line.end] = Place(link, 0j, 0.0)
        self._bars(j, body.rigid)

    def _bars(self, j: int, bars: tuple[Bar, ...]) -> None:
        """Write bars of a written body, each bent from its start."""
        for bar in bars:
            begin = self._points[j, bar.start]
            bend = phase(self._bar_vectors[j, bar])
            link = self._new_frame(_name(bar.start, bar.end))
            self._fixed(f'bend_{bar.start.lower()}', begin, link, bend)
            length = self._length(j, bar)
            self._bar(self._link(link), j, length)
            self._points[j, bar.end] = Place(link, complex(length), bend)

    def _length(self, j: int, bar: Bar) -> float:
        return abs(self._bar_vectors[j, bar])

    def _new_frame(self, name: str) -> str:
        return self._prefix + _new(name, self._frames)

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

    def _moving(self, j: int, pin: str, on: Place, child: str, axis: Triple) -> Element:
        body = self._structure.bodies[j]
        kind = 'prismatic' if body.slides else 'continuous'
        if not self._pose:
            name = self._leg.joint_name(body.angle, self._separator)
            return self._moving_joint(name, kind, on, child, axis)
        name = self._new_joint(pin)
        joint = self._moving_joint(name, kind, on, child, axis)
        group, key = ('dependent', name) if j else ('independent', self._leg.crank_joint)
        if (driver := self._loops[group].setdefault(key, name)) != name:
            SubElement(joint, 'mimic', joint=driver)
        return joint

    def _moving_joint(self, name: str, kind: str, on: Place, child: str, axis: Triple) -> Element:
        xyz = on.at.real, on.at.imag, 0.0
        joint = self._joint(name, kind, on.link, child, xyz, (0.0, 0.0, -on.bend))
        SubElement(joint, 'axis', xyz=_numbers(axis))
        return joint

    def _inertial(self, link: Element, j: int) -> None:
        """Write the mass of a body into its first link, whose frame is the body's."""
        if self._leg.masses and self._leg.masses.bodies[j].mass:
            mass, centre, inertia = self._leg.masses.bodies[j]
            inertial = SubElement(link, 'inertial')
            SubElement(inertial, 'origin', xyz=_numbers((centre.real, centre.imag, 0.0)))
            SubElement(inertial, 'mass', value=_number(mass))
            # A plate: the moments about the axes in its plane add up to the one about its normal.
            half = _number(inertia / 2.0)
            moments = {'ixx': half, 'iyy': half, 'izz': _number(inertia)}
            SubElement(inertial, 'inertia', moments, ixy='0', ixz='0', iyz='0')

    def _ground(self, plane: Element) -> None:
        pivots = list(map(complex, self._linkage.pivots))
        for n, pivot in enumerate(pivots):
            side = pivots[n - 1] - pivot
            if n or len(pivots) > 2:
                self._box(plane, pivot + side / 2.0, phase(side), abs(side), FIXED)
            self._sphere(plane, pivot, -1, 1.0)

    def _bar(self, link: Element, j: int, length: float) -> None:
        self._box(link, complex(length / 2.0), 0.0, length, j)
        self._sphere(link, 0j, j % LAYERS, 1.0)

    def _box(self, link: Element, centre: complex, turn: float, length: float, j: int) -> None:
        visual = self._visual(link, centre, turn, j % LAYERS if j != FIXED else j)
        size = length, self._width, self._width / 2.0
        SubElement(SubElement(visual, 'geometry'), 'box', size=_numbers(size))
        SubElement(visual, 'material', name=f'klann_{j}' if j != FIXED else FRAME)

    def _sphere(self, link: Element, centre: complex, layer: int, scale: float) -> None:
        """Draw a pin, whose radius is a multiple of that of a joint."""
        visual = self._visual(link, centre, 0.0, layer)
        radius = _number(PIN_RADIUS * scale * self._width)
        SubElement(SubElement(visual, 'geometry'), 'sphere', radius=radius)
        SubElement(visual, 'material', name=PIN)

    def _visual(self, link: Element, centre: complex, turn: float, layer: int) -> Element:
        visual = SubElement(link, 'visual')
        xyz = centre.real, centre.imag, layer * self._width / 2.0
        SubElement(visual, 'origin', xyz=_numbers(xyz), rpy=_numbers((0.0, 0.0, turn)))
        return visual


def _name(start: str, end: str) -> str:
    """Return the link's name of a bar: 'ab', or 'a_b2' for points with long names."""
    separator = '_' if len(start) > 1 or len(end) > 1 else ''
    return f'{start}{separator}{end}'.lower()


def _new(name: str, names: set[str]) -> str:
    """Return an unused name, and mark it as used."""
    while name in names:
        name += '_'
    names.add(name)
    return name


def _numbers(vector: tuple[float, ...]) -> str:
    return ' '.join(map(_number, vector))


def _number(number: float) -> str:
    return repr(float(number) + 0.0)
