"""
One leg in a MuJoCo model: a tree of bodies, with equalities that close its loops.

Each body is attached at a point that it shares with an earlier one, or slides along it; where two
bodies lead to the same point otherwise, an equality closes the loop. In the pose in which a leg is
written all joints but the crank are at 0, so it starts closed to the last digit. The bodies are in
`leg_plane`, whose x and y are the linkage's own.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from klann_ros.dynamics import Dynamics, MassError
from klann_ros.dynamics.masses import Spring
from klann_ros.dynamics.motion import body_motion
from klann_ros.kinematics import Linkage, LinkageLeg
from klann_ros.kinematics.linkage.structure import FIXED, Structure
from klann_ros.robot import RobotLeg
from klann_ros.sanitize.text import printable
import numpy as np

# Separates the names of a leg and its joint: ros2_control and MoveIt refuse a slash.
SEPARATOR = '_'
# Mass of a massless body, as a part of the leg's: without one its loop would be soft.
MIN_MASS_PART = 1e-4
# Inertia of a point mass, as a part of its mass by the size squared, and the least of a body.
POINT_INERTIA_PART, MIN_INERTIA = 1e-9, 1e-12
# Thickness of drawn bars, as a part of the leg's size.
BAR_THICKNESS = 0.012
# Samples of a turn for the leg's inertia at the crank.
INERTIA_SAMPLES = 181


class TreeBody(NamedTuple):
    """The place of a body in the tree."""

    body: int
    # Its parent, -1 for the ground.
    parent: int
    # Its point on the axis or the line.
    point: str


class Closing(NamedTuple):
    """The closing of a loop: a point to which two bodies lead."""

    point: str
    # The two bodies, -1 being the ground; the second is constrained to the first.
    first: int
    body: int


def spanning_tree(linkage: Linkage) -> tuple[list[TreeBody], list[Closing]]:
    """Return the tree, each body after its parent, and the closings of the loops."""
    structure = linkage.structure
    visited: list[int] = [FIXED]
    tree: list[TreeBody] = []
    while len(tree) < len(structure.bodies):
        tree.append(next(_next_bodies(structure, visited)))
        visited.append(tree[-1].body)
    joined = {(h.point, h.parent, h.body) for h in tree if not structure.bodies[h.body].slides}
    closing = []
    for point, every in structure.owners.items():
        # One of its bodies has the point; the others are attached or constrained to it.
        first = next((h.parent for h in tree if h.point == point and h.parent in every), every[0])
        closing += [
            Closing(point, first, j)
            for j in every
            if j != first and (point, first, j) not in joined
        ]
    return tree, closing


def joint_rates(linkage: Linkage, tree: Sequence[TreeBody], alpha: float) -> dict[int, float]:
    """Return the rates of the tree's joints per crank rate [rad/rad, m/rad]."""
    moving, leg = body_motion(linkage, alpha), LinkageLeg(linkage)
    sliding = leg.velocity(leg.closed_form(alpha), 1.0).joints
    rates = {}
    for j, parent, _ in tree:
        before = moving.rotation_1[parent, 0] if parent >= 0 else 0.0
        turns = float(moving.rotation_1[j, 0] - before)
        rates[j] = sliding[j] if linkage.structure.bodies[j].slides else turns
    return rates


def _next_bodies(structure: Structure, visited: list[int]) -> Iterator[TreeBody]:
    for j, body in enumerate(structure.bodies):
        along = structure.along[j]
        if j in visited:
            continue
        if along is not None:
            if along in visited:
                yield TreeBody(j, along, body.points[0])
            continue
        for point in body.points:
            parent = next((i for i in structure.owners[point] if i in visited), None)
            if parent is not None:
                yield TreeBody(j, parent, point)


def equality(stiffness: float) -> dict[str, str]:
    """
    Return the attributes of a critically damped equality of a stiffness [1/s^2].

    A violation r follows r.. = -stiffness r - damping r. ; solimp is as hard as the engine allows.
    """
    # Negative numbers are direct values.
    return {
        'solref': f'{number(-stiffness)} {number(-2.0 * stiffness**0.5)}',
        'solimp': '0.9999 0.9999 0.001 0.5 2',
    }


class Section(NamedTuple):
    """The sections of a model that a leg writes to, besides its plane."""

    # The sections of the model.
    equality: Element
    tendon: Element
    # The names of the elements.
    unique: 'Names'


class LegModel:
    """
    Writes a leg in its pose at an angle of its crank's joint [rad].

    A MassError refuses a leg without mass; other errors are of a linkage that does not close.
    """

    def __init__(self, leg: RobotLeg, dynamics: Dynamics, crank: float) -> None:
        if not dynamics.masses.total > 0.0:
            raise MassError(f'{leg.name or "the leg"} weighs nothing: its motion is undefined')
        self.leg, self._dynamics, self._crank = leg, dynamics, crank
        alpha = float(leg.crank_angles(crank))
        self._pose = LinkageLeg(leg.linkage).closed_form(alpha)
        structure = leg.linkage.structure
        places = (complex(x, y) for x, y in self._pose.points)
        self._points = dict(zip(structure.points, places, strict=True))
        self._tree, self._closing = spanning_tree(leg.linkage)
        # The origins of the bodies' frames in this pose.
        self._origins = {h.body: self._points[h.point] for h in self._tree} | {FIXED: 0j}
        self._size = float(np.ptp(self._pose.points, axis=0).max())
        self._crank_name = ''
        self._bodies: dict[int, str] = {}
        self._sites: dict[str, str] = {}

    @property
    def foot(self) -> complex:
        """Return the foot's place in the plane [m]."""
        return self._points[self.leg.linkage.structure.foot]

    def inertias(self) -> tuple[float, float]:
        """Return the least and the greatest inertia at the crank [kg m^2]."""
        inertia, _ = self._dynamics.reduced_inertia(np.linspace(0.0, 2.0 * np.pi, INERTIA_SAMPLES))
        there = inertia[np.isfinite(inertia)]
        return float(there.min()), float(there.max())

    def write(
        self, plane: Element, section: Section, crank_name: str, stiffness: float, rotor: float
    ) -> None:
        """
        Write the leg into the body of its plane, with a name for its crank's joint.

        `stiffness` is that of the closings [1/s^2], `rotor` the inertia of the crank's drive at
        the crank [kg m^2].
        """
        self._crank_name = crank_name
        self._bodies[FIXED] = plane.attrib['name']
        elements = {FIXED: plane}
        for point in self.leg.linkage.structure.pivots:
            self._site(plane, section, point, self._points[point])
        for tree_body in self._tree:
            parent = elements[tree_body.parent]
            elements[tree_body.body] = self._body(parent, section, tree_body, rotor)
        for point, first, j in self._closing:
            SubElement(
                section.equality, 'connect', equality(stiffness), body1=self._bodies[j],
                body2=self._bodies[first], anchor=at(self._points[point] - self._origins[j]),
            )  # fmt: skip
        for spring in self._dynamics.masses.springs:
            self._spring(plane, section, spring)

    def foot_geom(self, radius: float, friction: float) -> None:
        """Put a ball that touches the floor on the foot of a written leg."""
        element, place = self._foot
        SubElement(
            element, 'geom', touching(friction), type='sphere', pos=at(place),
            size=number(radius), mass='0',
        )  # fmt: skip

    @property
    def _radius(self) -> float:
        return BAR_THICKNESS * self._size / 2.0

    def _body(
        self, parent: Element, section: Section, tree_body: TreeBody, rotor: float
    ) -> Element:
        j, structure = tree_body.body, self.leg.linkage.structure
        body, origin = structure.bodies[j], self._origins[tree_body.body]
        self._bodies[j] = section.unique('body', self.leg.prefix + body.angle)
        where = at(origin - self._origins[tree_body.parent])
        element = SubElement(parent, 'body', name=self._bodies[j], pos=where)
        self._joint(element, section, tree_body, rotor)
        self._inertial(element, j)
        for bar in body.rigid:
            ends = ' '.join(at(self._points[p] - origin) for p in (bar.start, bar.end))
            SubElement(
                element, 'geom', type='capsule', fromto=ends, size=number(self._radius),
                contype='0', conaffinity='0', mass='0', group='1',
            )  # fmt: skip
        for point in body.points:
            # On the first body in the tree that has it.
            if point not in structure.pivots and point not in self._sites:
                self._site(element, section, point, self._points[point] - origin)
        return element

    def _inertial(self, element: Element, j: int) -> None:
        structure = self.leg.linkage.structure
        mass = self._dynamics.masses.bodies[j]
        own = structure.frames[j]
        turned = self._pose.vectors[own] if own != FIXED else 1.0 + 0j
        first = self._points[structure.bodies[j].points[0]]
        centre = first + complex(mass.centre * turned) - self._origins[j]
        weight = mass.mass or MIN_MASS_PART * self._dynamics.masses.total
        inertia = max(mass.inertia or POINT_INERTIA_PART * weight * self._size**2, MIN_INERTIA)
        # A plate: the moments about the axes in its plane add up to the one about its normal.
        flat = f'{number(inertia / 2.0)} {number(inertia / 2.0)} {number(inertia)}'
        SubElement(element, 'inertial', pos=at(centre), mass=number(weight), diaginertia=flat)

    def _site(self, element: Element, section: Section, point: str, place: complex) -> None:
        self._sites[point] = section.unique('site', self.leg.prefix + point.lower())
        if point == self.leg.linkage.structure.foot:
            # For the ball: its element and the place in it.
            self._foot = element, place
        SubElement(
            element, 'site', name=self._sites[point], pos=at(place), size=number(self._radius)
        )

    def _joint(
        self, element: Element, section: Section, tree_body: TreeBody, rotor: float
    ) -> None:
        j, structure = tree_body.body, self.leg.linkage.structure
        body = structure.bodies[j]
        if j == 0:
            # It has the angle q of its robot's joint: alpha = direction q + phase.
            sense = structure.senses[0] * self.leg.direction
            SubElement(
                element, 'joint', name=self._crank_name, type='hinge', axis=f'0 0 {sense}',
                ref=number(self._crank), armature=number(rotor),
            )  # fmt: skip
            return
        name = section.unique('joint', self.leg.joint_name(body.angle, SEPARATOR))
        if body.slides:
            along = self.leg.linkage.line(self._pose.vectors, j)
            SubElement(
                element, 'joint', name=name, type='slide', axis=at(complex(along)),
                ref=number(self._pose.joints[j]),
            )  # fmt: skip
            return
        SubElement(element, 'joint', name=name, type='hinge', axis='0 0 1')

    def _spring(self, plane: Element, section: Section, spring: Spring) -> None:
        ends = [self._end(plane, section, end) for end in spring.ends]
        spatial = SubElement(
            section.tendon, 'spatial', stiffness=number(spring.stiffness),
            springlength=number(spring.free_length), width=number(self._radius / 2.0),
        )  # fmt: skip
        for name in ends:
            SubElement(spatial, 'site', site=name)

    def _end(self, plane: Element, section: Section, end: Any) -> str:
        if isinstance(end, str):
            return self._sites[end]
        name = section.unique('site', f'{self.leg.prefix}spring')
        SubElement(plane, 'site', name=name, pos=at(complex(*end)), size=number(self._radius))
        return name


class Names:
    """Names, unique for each kind of element, and valid in XML."""

    def __init__(self) -> None:
        self._taken = {('body', 'world')}

    def __call__(self, kind: str, name: str) -> str:
        """Return a name, with `_` appended until it is unique."""
        name = printable(name)
        while (kind, name) in self._taken:
            name += '_'
        self._taken.add((kind, name))
        return name


def touching(friction: float, *, floor: bool = False) -> dict[str, str]:
    """Return the attributes of a geom that touches only the floor, or of the floor."""
    own, other = ('1', '2') if floor else ('2', '1')
    # Stiff contact: in a soft one the feet sink and creep, which shortens a walk.
    return {
        'contype': own,
        'conaffinity': other,
        'friction': f'{number(friction)} 0.005 0.0001',
        'solref': '0.003 1',
    }


def at(place: complex) -> str:
    """Return a place, or a direction, in a leg's plane."""
    return f'{number(place.real)} {number(place.imag)} 0'


def number(value: float) -> str:
    """Return a number to the last digit."""
    return repr(float(value) + 0.0).removesuffix('.0')
