"""
A linkage as an MJCF model of the physics engine MuJoCo: a tree of bodies whose loops are closed.

Every body hangs at a point that it shares with one before it, or slides along it; where two bodies
lead to the same point otherwise, an equality closes the loop. The model is written in one pose of
the linkage, in which all joints but the crank are at 0: so it starts closed to the last digit.
"""

from collections.abc import Iterator
from typing import NamedTuple
from xml.etree.ElementTree import Element, indent, SubElement, tostring

from klann_ros.kinematics import LinkageLeg
from klann_ros.kinematics.linkage import joints
from klann_ros.kinematics.linkage.structure import FIXED, Structure
import numpy as np

from .forces import Dynamics

# What weighs nothing would make its loop soft: it gets this part of the whole, and of its inertia.
TINY = 1e-4
# The engine knows no points: their inertia, as a part of their mass by the size squared.
POINT = 1e-9
# How stiff what closes the loops is: ten steps of time; twice as stiff some loops are unstable.
SOLREF, SOLIMP = '0.002 1', '0.9999 0.9999 0.001 0.5 2'
TIME_STEP = 2e-4
# Of bars, as a part of the linkage's size.
BAR = 0.012


class Hung(NamedTuple):
    """
    Where a body hangs in the tree.

    Attributes
    ----------
    body : int
        Which one.
    parent : int
        The one before it, -1 for the ground.
    point : str
        Where it turns, or slides.

    """

    body: int
    parent: int
    point: str


def tree(dynamics: Dynamics) -> tuple[list[Hung], list[tuple[str, int, int]]]:
    """
    Return how the bodies hang, each after its parent, and what closes the loops.

    That is points, each with two bodies that lead to it, -1 being the ground.
    """
    structure = dynamics.linkage.structure
    placed: list[int] = [FIXED]
    hung: list[Hung] = []
    while len(hung) < len(structure.bodies):
        hung.append(next(_next_hung(structure, placed)))
        placed.append(hung[-1].body)
    joined = {(h.point, h.parent, h.body) for h in hung if not structure.bodies[h.body].slides}
    closing = []
    for point, every in structure.owners.items():
        # One of its bodies has the point; the others hang at it, or are pulled to it.
        first = next((h.parent for h in hung if h.point == point and h.parent in every), every[0])
        closing += [
            (point, first, j) for j in every if j != first and (point, first, j) not in joined
        ]
    return hung, closing


def _next_hung(structure: Structure, placed: list[int]) -> Iterator[Hung]:
    for j, body in enumerate(structure.bodies):
        along = structure.along[j]
        if j in placed:
            continue
        if along is not None:
            if along in placed:
                yield Hung(j, along, body.points[0])
            continue
        for point in body.points:
            parent = next((i for i in structure.owners[point] if i in placed), None)
            if parent is not None:
                yield Hung(j, parent, point)


def mjcf(dynamics: Dynamics, alpha: float, *, name: str = 'linkage', crank: str = 'crank') -> str:
    """
    Return a linkage with masses as an MJCF model, hung up in its plane.

    x is to the right and z up; gravity is the dynamics' own. The points are sites under their
    names in small letters, the crank is the joint `crank` with a velocity actuator of that name.

    Parameters
    ----------
    dynamics : Dynamics
        What is written.
    alpha : float
        The crank angle of the pose in which it is written [rad].
    name, crank : str
        What the model and the crank's joint are called.

    Raises
    ------
    CrankAngleError, UnreachableError, LoopsOpenError
        The linkage does not close at this angle.

    """
    return _Writer(dynamics, alpha, name, crank).text()


class _Writer:
    """Writes the elements of one model."""

    def __init__(self, dynamics: Dynamics, alpha: float, name: str, crank: str) -> None:
        self._dynamics, self._name, self._crank = dynamics, name, crank
        self._pose = LinkageLeg(dynamics.linkage).closed_form(alpha)
        structure = dynamics.linkage.structure
        places = (complex(x, y) for x, y in self._pose.points)
        self._points = dict(zip(structure.points, places, strict=True))
        self._hung, self._closing = tree(dynamics)
        # Where the bodies' frames are in this pose.
        self._origins = {h.body: self._points[h.point] for h in self._hung} | {FIXED: 0j}
        self._size = float(np.ptp(self._pose.points, axis=0).max())
        self._mass = max(dynamics.masses.total, 1e-6)

    def text(self) -> str:
        """Return the model."""
        root = Element('mujoco', model=self._name)
        SubElement(root, 'compiler', angle='radian', autolimits='true')
        x, y = self._dynamics.gravity.real, self._dynamics.gravity.imag
        SubElement(
            root,
            'option',
            timestep=f'{TIME_STEP:g}',
            gravity=f'{x:.17g} 0 {y:.17g}',
            integrator='implicitfast',
            iterations='200',
            tolerance='1e-14',
        )
        elements = {FIXED: SubElement(root, 'worldbody')}
        for point in self._dynamics.linkage.structure.pivots:
            at = _at(self._points[point])
            SubElement(
                elements[FIXED], 'site', name=point.lower(), pos=at, size=_number(self._radius)
            )
        for hung in self._hung:
            elements[hung.body] = self._body(elements[hung.parent], hung)
        equality = SubElement(root, 'equality')
        names = {FIXED: 'world', **dict(enumerate(self._dynamics.linkage.joint_names))}
        for point, first, j in self._closing:
            SubElement(
                equality,
                'connect',
                body1=names[j],
                body2=names[first],
                anchor=_at(self._points[point] - self._origins[j]),
                solref=SOLREF,
                solimp=SOLIMP,
            )
        actuator = SubElement(root, 'actuator')
        stiff = 1e4 * self._mass * self._size**2
        SubElement(actuator, 'velocity', name=self._crank, joint=self._crank, kv=_number(stiff))
        indent(root)
        return tostring(root, encoding='unicode') + '\n'

    @property
    def _radius(self) -> float:
        return BAR * self._size / 2.0

    def _body(self, parent: Element, hung: Hung) -> Element:
        j, structure = hung.body, self._dynamics.linkage.structure
        body, origin = structure.bodies[j], self._origins[hung.body]
        at = _at(origin - self._origins[hung.parent])
        element = SubElement(parent, 'body', name=body.angle, pos=at)
        self._joint(element, hung)
        mass = self._dynamics.masses.bodies[j]
        own = structure.frames[j]
        turned = self._pose.vectors[own] if own != FIXED else 1.0 + 0j
        centre = self._points[body.points[0]] + complex(mass.centre * turned) - origin
        weight = mass.mass or TINY * self._mass
        inertia = mass.inertia or POINT * weight * self._size**2
        # A plate: what it has about the axes in its plane adds up to what it has about the other.
        flat = f'{_number(inertia / 2.0)} {_number(inertia)} {_number(inertia / 2.0)}'
        SubElement(element, 'inertial', pos=_at(centre), mass=_number(weight), diaginertia=flat)
        for bar in body.rigid:
            ends = ' '.join(_at(self._points[p] - origin) for p in (bar.start, bar.end))
            SubElement(
                element, 'geom', type='capsule', fromto=ends, size=_number(self._radius),
                contype='0', conaffinity='0', mass='0',
            )  # fmt: skip
        for point in body.points:
            if point not in structure.pivots and self._has_site(point, j):
                place = _at(self._points[point] - origin)
                SubElement(
                    element, 'site', name=point.lower(), pos=place, size=_number(self._radius)
                )
        return element

    def _has_site(self, point: str, j: int) -> bool:
        """Return whether a body is the first in the tree that has a point."""
        bodies = self._dynamics.linkage.structure.bodies
        return j == next(h.body for h in self._hung if point in bodies[h.body].points)

    def _joint(self, element: Element, hung: Hung) -> None:
        j, structure = hung.body, self._dynamics.linkage.structure
        body = structure.bodies[j]
        if body.slides:
            along = joints.line(self._dynamics.linkage, self._pose.vectors, j)
            SubElement(
                element, 'joint', name=body.angle, type='slide', axis=_at(complex(along)),
                ref=_number(self._pose.joints[j]),
            )  # fmt: skip
            return
        # Counter-clockwise from x to z is about -y.
        name = self._crank if j == 0 else body.angle
        ref = self._pose.joints[0] * structure.senses[0] if j == 0 else 0.0
        SubElement(element, 'joint', name=name, type='hinge', axis='0 -1 0', ref=_number(ref))


def _at(place: complex) -> str:
    return f'{_number(place.real)} 0 {_number(place.imag)}'


def _number(value: float) -> str:
    return f'{float(value) + 0.0:.17g}'
