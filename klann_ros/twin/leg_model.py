"""
One leg in a model of the physics engine MuJoCo: bodies, sites, joints, loops, crank and springs.

It is written in one pose, in which all joints but the crank are at 0: so it starts closed to the
last digit. Its bodies hang in `leg_plane`, whose x and y are the linkage's own.
"""

from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from klann_ros.dynamics import Dynamics, MassError
from klann_ros.dynamics.masses import Spring
from klann_ros.kinematics import LinkageLeg
from klann_ros.kinematics.linkage.structure import FIXED
from klann_ros.robot import RobotLeg
import numpy as np

from .leg_tree import spanning_tree, TreeBody
from .model_text import at, Names, number, SEPARATOR, touching

# What weighs nothing would make its loop soft: it gets this part of the whole, and of its inertia.
TINY = 1e-4
# The engine knows no points: their inertia, as a part of their mass by the size squared.
POINT = 1e-9
LEAST_INERTIA = 1e-12
# Bars are drawn so thick, as a part of the leg's size.
BAR = 0.012
# Among this many crank angles the leg's inertia at the crank is greatest and least.
INERTIA_SAMPLES = 181


class Stiffness(NamedTuple):
    """How stiff loops are closed: a violation r goes by r.. = -stiffness r - damping r. ."""

    # In 1/s^2.
    stiffness: float
    # In 1/s.
    damping: float

    @classmethod
    def critical(cls, stiffness: float) -> 'Stiffness':
        """Return one that goes to 0 as fast as it can without overshooting."""
        return cls(stiffness, 2.0 * stiffness**0.5)

    @property
    def attributes(self) -> dict[str, str]:
        """Return the attributes of an equality; solimp is as hard as the engine allows."""
        # The numbers are meant as they are where they are negative.
        return {
            'solref': f'{number(-self.stiffness)} {number(-self.damping)}',
            'solimp': '0.9999 0.9999 0.001 0.5 2',
        }


class Section(NamedTuple):
    """Where a leg writes to, besides its plane."""

    # The sections of the model.
    equality: Element
    tendon: Element
    # Returns a name that its kind ('body', 'joint', 'site') does not have yet.
    unique: Names


class LegModel:
    """
    Writes one leg.

    Parameters
    ----------
    leg : RobotLeg
        Which leg.
    dynamics : Dynamics
        The leg with its masses.
    crank : float
        The angle of the joint that turns its crank, in the pose in which it is written [rad].

    Attributes
    ----------
    crank_name : str
        What its crank's joint is called in the model, once it is written.
    mass : float
        Of all of it [kg].

    Raises
    ------
    CrankAngleError, UnreachableError, LoopsOpenError
        The linkage does not close at this angle.
    MassError
        It weighs nothing.

    """

    def __init__(self, leg: RobotLeg, dynamics: Dynamics, crank: float) -> None:
        if not dynamics.masses.total > 0.0:
            raise MassError(f'{leg.name or "the leg"} weighs nothing: it would move anyhow')
        self.leg, self._dynamics, self._crank = leg, dynamics, crank
        alpha = float(leg.crank_angles(crank))
        self._pose = LinkageLeg(leg.linkage).closed_form(alpha)
        structure = leg.linkage.structure
        places = (complex(x, y) for x, y in self._pose.points)
        self._points = dict(zip(structure.points, places, strict=True))
        self._tree, self._closing = spanning_tree(leg.linkage)
        # Where the bodies' frames are in this pose.
        self._origins = {h.body: self._points[h.point] for h in self._tree} | {FIXED: 0j}
        self._size = float(np.ptp(self._pose.points, axis=0).max())
        self.mass = dynamics.masses.total
        self.crank_name = ''
        self._bodies: dict[int, str] = {}
        self._sites: dict[str, str] = {}
        self._foot: tuple[Element, complex] | None = None

    @property
    def foot(self) -> complex:
        """Return where the foot is in the plane [m]."""
        return self._points[self.leg.linkage.structure.foot]

    def inertias(self) -> tuple[float, float]:
        """Return the least and the greatest inertia that the crank feels [kg m^2]."""
        inertia, _ = self._dynamics.reduced_inertia(np.linspace(0.0, 2.0 * np.pi, INERTIA_SAMPLES))
        there = inertia[np.isfinite(inertia)]
        return float(there.min()), float(there.max())

    def write(
        self, plane: Element, section: Section, crank_name: str, stiffness: Stiffness, rotor: float
    ) -> None:
        """
        Write the leg.

        Parameters
        ----------
        plane : Element
            The body whose x and y are the linkage's.
        section : Section
            Where all else goes.
        crank_name : str
            What its crank's joint is called.
        stiffness : Stiffness
            Of what closes its loops.
        rotor : float
            The inertia of what drives its crank, at the crank [kg m^2].

        """
        self.crank_name = crank_name
        self._bodies[FIXED] = plane.attrib['name']
        elements = {FIXED: plane}
        for point in self.leg.linkage.structure.pivots:
            self._site(plane, section, point, self._points[point])
        for tree_body in self._tree:
            parent = elements[tree_body.parent]
            elements[tree_body.body] = self._body(parent, section, tree_body, rotor)
        for point, first, j in self._closing:
            SubElement(
                section.equality,
                'connect',
                stiffness.attributes,
                body1=self._bodies[j],
                body2=self._bodies[first],
                anchor=at(self._points[point] - self._origins[j]),
            )
        for spring in self._dynamics.masses.springs:
            self._spring(plane, section, spring)

    def foot_geom(self, radius: float, friction: float) -> None:
        """Put a ball that touches the floor on the foot; the leg is written before."""
        if self._foot is None:
            raise AssertionError('the leg is written before')
        element, place = self._foot
        SubElement(
            element, 'geom', touching(friction), type='sphere', pos=at(place),
            size=number(radius), mass='0',
        )  # fmt: skip

    @property
    def _radius(self) -> float:
        return BAR * self._size / 2.0

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
            if point not in structure.pivots and self._has_site(point, j):
                self._site(element, section, point, self._points[point] - origin)
        return element

    def _inertial(self, element: Element, j: int) -> None:
        structure = self.leg.linkage.structure
        mass = self._dynamics.masses.bodies[j]
        own = structure.frames[j]
        turned = self._pose.vectors[own] if own != FIXED else 1.0 + 0j
        first = self._points[structure.bodies[j].points[0]]
        centre = first + complex(mass.centre * turned) - self._origins[j]
        weight = mass.mass or TINY * self.mass
        inertia = max(mass.inertia or POINT * weight * self._size**2, LEAST_INERTIA)
        # A plate: what it has about the axes in its plane adds up to what it has about the other.
        flat = f'{number(inertia / 2.0)} {number(inertia / 2.0)} {number(inertia)}'
        SubElement(element, 'inertial', pos=at(centre), mass=number(weight), diaginertia=flat)

    def _site(self, element: Element, section: Section, point: str, place: complex) -> None:
        self._sites[point] = section.unique('site', self.leg.prefix + point.lower())
        if point == self.leg.linkage.structure.foot:
            self._foot = element, place
        SubElement(
            element, 'site', name=self._sites[point], pos=at(place), size=number(self._radius)
        )

    def _has_site(self, point: str, j: int) -> bool:
        """Return whether a body is the first in the tree that has a point."""
        bodies = self.leg.linkage.structure.bodies
        return j == next(h.body for h in self._tree if point in bodies[h.body].points)

    def _joint(
        self, element: Element, section: Section, tree_body: TreeBody, rotor: float
    ) -> None:
        j, structure = tree_body.body, self.leg.linkage.structure
        body = structure.bodies[j]
        if j == 0:
            # It stands where the joint does that turns the crank: alpha = direction q + phase.
            sense = structure.senses[0] * self.leg.direction
            SubElement(
                element, 'joint', name=self.crank_name, type='hinge', axis=f'0 0 {sense}',
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
