"""A robot as an MJCF model of the physics engine MuJoCo: a leg hung up, or a walker on a floor."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, isfinite, pi, sin
from typing import Any, NamedTuple
from xml.etree.ElementTree import Comment, Element, indent, SubElement, tostring

from klann_ros.dynamics import GRAVITY, MassError, Spring, TorsionSpring
from klann_ros.kinematics import FIXED, KinematicsError, LinkageLeg
from klann_ros.kinematics.angles import wrap
from klann_ros.robot import Robot, RobotLeg
from klann_ros.sanitize.text import printable, refusal
import numpy as np

from .tree import spanning_tree

MAX_SLOPE = pi / 4.0
# A robot starts further than this from change points [rad].
CHANGE_POINT_DISTANCE = 0.4


class Accuracy(NamedTuple):
    """The engine's numerical settings for a model."""

    # [s].
    time_step: float
    # MuJoCo's name of the method.
    integrator: str
    # The stiffness of closed loops, by the time step squared.
    closing: float
    # The part of a crank's speed error that a step corrects.
    servo: float


# Of a leg: stiffer loops shake the crank, softer ones open; a softer servo lags, a stiffer shakes.
SUSPENDED = Accuracy(2e-4, 'RK4', 0.01, 2.0)
# Contacts allow no higher order, and a robot must run in real time.
WALKING = Accuracy(5e-4, 'implicitfast', 0.04, 0.5)
# Inertia of a crank's drive, as a multiple of the largest one of its leg at the crank, with which
# the stiffest stable servo turns it evenly.
ROTOR_RATIO = 10.0
# Radius of a foot, and clearance of the lowest foot from the floor at the start [m].
FOOT_RADIUS, GROUND_GAP = 0.004, 1e-4
# Separates the names of a leg and its joint: ros2_control and MoveIt refuse a slash.
SEPARATOR = '_'
# Mass of a massless body, as a part of the leg's: without one its loop would be soft.
MIN_MASS_PART = 1e-4
# Inertia of a point mass, as a part of its mass by the size squared, and the least of a body.
POINT_INERTIA_PART, MIN_INERTIA = 1e-9, 1e-12
# Thickness of drawn bars, as a part of the leg's size.
BAR_THICKNESS = 0.012
# A bar is only drawn.
UNTOUCHED = {'contype': '0', 'conaffinity': '0', 'mass': '0', 'group': '1'}
# Samples of a turn for the leg's inertia at the crank.
INERTIA_SAMPLES = 181


@dataclass(frozen=True)
class Floor:
    """
    The floor of a walker: Coulomb friction of feet and body on it, >= 0, and its slope.

    `slope` is the angle by which it rises along x, within +- pi/4 [rad].
    """

    friction: float = 0.8
    slope: float = 0.0

    def __post_init__(self) -> None:
        """Refuse invalid floor data."""
        if not (isfinite(self.friction) and self.friction >= 0.0):
            raise ValueError(refusal('friction', self.friction, '>= 0'))
        if not abs(self.slope) <= MAX_SLOPE:
            raise ValueError(refusal('slope', self.slope, f'within +-{MAX_SLOPE:.3f} rad'))


FLAT = Floor()


def robot_mjcf(
    robot: Robot,
    *,
    floor: Floor = FLAT,
    time_step: float = 0.0,
    crank: float | None = None,
    compliance: float = 0.0,
) -> str:
    """
    Return a robot as an MJCF model.

    One leg is hung up by `base_link`; a walker stands on a floor on its lowest feet, free to move.
    Points are sites under the names of their frames (`h`, `front_left/h`), x of `base_link` is
    forward and z up. Each joint that turns cranks is a joint of the model, at the angle that it
    has in ROS, with a velocity actuator of its name. Legs on one joint are coupled: the first has
    the joint, the others follow as `LEG/JOINT`.

    Parameters
    ----------
    robot : Robot
        With masses.
    floor : Floor
        The floor of a walker.
    time_step : float
        Of the engine [s]; 0: 0.2 ms for a leg, 0.5 ms for a walker.
    crank : float, optional
        Joint angle at the start [rad]; by default 0, or the middle of the arc that the
        first leg can reach, or one away from change points.
    compliance : float
        Time constant with which the loops of the legs close [s]; they give way under load, as
        joints with play do. 0: they are rigid; the engine takes two time steps or more.

    Raises
    ------
    MassError
        The robot has no masses.
    UnreachableError, LoopsOpenError
        A leg does not close at its initial angle.
    ValueError
        The time step is not > 0.

    """
    return _Model(robot, floor, time_step, crank, compliance).text()


class _Model:
    """
    Writes one model.

    A leg is a tree of bodies in its `leg_plane`, whose x and y are the linkage's own; equalities
    close its loops. In the pose in which it is written all joints but the crank are at 0, so it
    starts closed to the last digit.
    """

    def __init__(
        self,
        robot: Robot,
        floor: Floor,
        time_step: float,
        crank: float | None,
        compliance: float,
    ) -> None:
        self.robot, self.floor = robot, floor
        accuracy = WALKING if robot.is_walker else SUSPENDED
        if not (isfinite(time_step) and time_step >= 0.0):
            raise ValueError(refusal('time_step', time_step, '> 0 s'))
        self._accuracy = accuracy._replace(time_step=time_step or accuracy.time_step)
        closing, step = self._accuracy.closing, self._accuracy.time_step
        # A violation r of an equality has r.. = -stiffness r - damping r., critically damped.
        stiffness = closing / step**2
        # Negative numbers are direct values; solimp is as hard as the engine allows.
        direct = f'{_text(-stiffness)} {_text(-2.0 * stiffness**0.5)}'
        self.closed = {'solref': direct, 'solimp': '0.9999 0.9999 0.001 0.5 2'}
        # The engine's usual impedance lets a loop open under load.
        self.loop_closure = {'solref': f'{_text(compliance)} 1'} if compliance else self.closed
        self.equality, self.tendon = Element('equality'), Element('tendon')
        starts = {joint: start_angle(robot.on_joint(joint), crank) for joint in robot.crank_joints}
        self._legs = [_Leg(self, leg, starts[leg.crank_joint]) for leg in robot.legs]
        self._taken = {('body', 'world')}

    def unique(self, kind: str, name: str) -> str:
        """Return a name valid in XML, with `_` appended until it is the only one of its kind."""
        name = printable(name)
        while (kind, name) in self._taken:
            name += '_'
        self._taken.add((kind, name))
        return name

    def text(self) -> str:
        """Return the XML of the model."""
        root = Element('mujoco', model=self.unique('model', self.robot.name))
        root.append(Comment(' Made by klann_ros. Metres, kilograms, seconds, radians. '))
        for origin in dict.fromkeys(leg.masses.origin for leg in self.robot.legs if leg.masses):
            root.append(Comment(f' masses: {origin.replace("--", "- -")} '))
        # As in a URDF: roll, pitch and yaw about fixed axes.
        _add(root, 'compiler', angle='radian', autolimits='true', eulerseq='XYZ')
        self._option(root)
        base = self._base(_add(root, 'worldbody'))
        # Cranks take their names before the legs do, so none of them gets a suffix.
        cranks = {name: self.unique('joint', name) for name in self.robot.crank_joints}
        actuator = Element('actuator')
        root.extend([self.equality, self.tendon, actuator])
        for joint, name in cranks.items():
            inertia = self._write_legs(base, joint, name)
            gain = self._accuracy.servo * inertia / self._accuracy.time_step
            _add(actuator, 'velocity', name=name, joint=name, kv=gain)
        if self.robot.is_walker:
            # With the names that mujoco_ros2_control looks for.
            _add(base, 'site', name='imu', size='0.01')
            sensor = _add(root, 'sensor')
            _add(sensor, 'framequat', name='imu_quat', objtype='site', objname='imu')
            _add(sensor, 'gyro', name='imu_gyro', site='imu')
            _add(sensor, 'accelerometer', name='imu_accel', site='imu')
        indent(root)
        return tostring(root, encoding='unicode') + '\n'

    def _option(self, root: Element) -> None:
        walks = self.robot.is_walker
        _add(
            root,
            'option',
            timestep=self._accuracy.time_step,
            gravity=(0.0, 0.0, -GRAVITY),
            integrator=self._accuracy.integrator,
            iterations='100' if walks else '200',
            tolerance='1e-10' if walks else '1e-14',
            cone='elliptic',
            impratio='10' if walks else '1',
            jacobian='sparse' if walks else 'auto',
        )

    def _base(self, world: Element) -> Element:
        """Return base_link: free above a floor, or hung up."""
        robot, name, slope = self.robot, self.unique('body', 'base_link'), self.floor.slope
        if not robot.is_walker:
            return _add(world, 'body', name=name)
        if robot.body is None:
            needed = 'body_mass [kg], body_size [m]: a walker needs them'
            raise MassError(f'{robot.source or robot.name} has no {needed}')
        euler, touching = (0.0, -slope, 0.0), _touching(self.floor.friction, floor=True)
        plane = {'type': 'plane', 'size': '0 0 1', 'rgba': '0.85 0.85 0.82 1'}
        _add(world, 'geom', **touching, name='floor', euler=euler, **plane)
        height = FOOT_RADIUS + GROUND_GAP - min(leg.foot_height for leg in self._legs)
        pos = -height * sin(slope), 0.0, height * cos(slope)
        base = _add(world, 'body', name=name, pos=pos, euler=euler)
        _add(base, 'freejoint', name=self.unique('joint', name))
        centre, inertia = robot.body.centre, robot.body.inertia
        _add(base, 'inertial', pos=centre, mass=robot.body.mass, diaginertia=inertia)
        box = {'type': 'box', 'pos': centre, 'size': [side / 2.0 for side in robot.body.size]}
        look = {'mass': '0', 'rgba': '0.5 0.6 0.7 0.4'}
        _add(base, 'geom', **_touching(self.floor.friction), **box, **look)
        return base

    def _write_legs(self, base: Element, joint: str, name: str) -> float:
        """Write the legs of a joint; return its least inertia [kg m^2]."""
        inertia = 0.0
        legs = [leg for leg in self._legs if leg.leg.crank_joint == joint]
        for leg in legs:
            min_inertia, max_inertia = leg.inertias()
            rotor = ROTOR_RATIO * max_inertia
            inertia += min_inertia + rotor
            crank_name, mount = name, leg.leg.mount
            if leg is not legs[0]:
                crank_name = self.unique('joint', leg.leg.joint_name(joint, SEPARATOR))
                coupling = {'joint1': crank_name, 'joint2': name, 'polycoef': '0 1 0 0 0'}
                _add(self.equality, 'joint', **self.closed, **coupling)
            plane = self.unique('body', f'{leg.leg.prefix}leg_plane')
            leg.write(
                _add(base, 'body', name=plane, pos=mount.xyz, euler=mount.rpy), crank_name, rotor
            )
        return inertia


class _Leg:
    """
    Writes a leg in its pose at an angle of its crank's joint [rad].

    A MassError refuses a leg without mass; other errors are of a linkage that does not close.
    """

    def __init__(self, model: _Model, leg: RobotLeg, crank: float) -> None:
        self._model, self.leg, self._crank = model, leg, crank
        self._dynamics = model.robot.dynamics(leg)
        if not self._dynamics.masses.total > 0.0:
            raise MassError(f'{leg.name or "the leg"} weighs nothing: its motion is undefined')
        self._structure = leg.linkage.structure
        self._pose = LinkageLeg(leg.linkage).closed_form(float(leg.crank_angles(crank)))
        places = (complex(x, y) for x, y in self._pose.points)
        self._points = dict(zip(self._structure.points, places, strict=True))
        self._size = float(np.ptp(self._pose.points, axis=0).max())
        self._radius = BAR_THICKNESS * self._size / 2.0
        self._tree, self._closing = spanning_tree(leg.linkage)
        # The origins of the bodies' frames in this pose.
        self._origins = {h.body: self._points[h.point] for h in self._tree} | {FIXED: 0j}
        # The names of the points' sites, and the element and the place in it of the foot's.
        self._sites: dict[str, str] = {}
        # The names of the bodies' hinges.
        self._hinges: dict[int, str] = {}
        # The crank has the angle q of its robot's joint: alpha = direction q + phase.
        self._crank_sense = self._structure.senses[0] * leg.direction
        self._foot: tuple[Element, complex] | None = None

    @property
    def foot_height(self) -> float:
        """Return the height of the foot in base_link [m]."""
        foot = self._points[self._structure.foot]
        return float(self.leg.mount.transform([foot.real, foot.imag])[2])

    def inertias(self) -> tuple[float, float]:
        """Return the least and the greatest inertia at the crank [kg m^2]."""
        turns = self.leg.linkage.change_points.period
        alphas = np.linspace(0.0, 2.0 * pi * turns, INERTIA_SAMPLES * turns)
        inertia, _ = self._dynamics.reduced_inertia(alphas)
        return float(np.nanmin(inertia)), float(np.nanmax(inertia))

    def write(self, plane: Element, crank_name: str, rotor: float) -> None:
        """Write it into the body of its plane; the crank's drive has the inertia of a rotor."""
        structure, masses, origins = self._structure, self._dynamics.masses, self._origins
        elements = {FIXED: plane}
        for point in structure.pivots:
            self._site(plane, point, self._points[point])
        for j, parent, _ in self._tree:
            body, origin = structure.bodies[j], origins[j]
            name = self._model.unique('body', self.leg.prefix + body.angle)
            element = _add(elements[parent], 'body', name=name, pos=origin - origins[parent])
            elements[j] = element
            self._joint(element, j, crank_name, rotor)
            self._inertial(element, j)
            for bar in body.rigid:
                start, end = (self._points[p] - origin for p in (bar.start, bar.end))
                ends, size = f'{_text(start)} {_text(end)}', self._radius
                _add(element, 'geom', type='capsule', fromto=ends, size=size, **UNTOUCHED)
            for point in body.points:
                # On the first body in the tree that has it.
                if point not in self._sites:
                    self._site(element, point, self._points[point] - origin)
        for point, first, j in self._closing:
            names = {'body1': elements[j].get('name'), 'body2': elements[first].get('name')}
            anchor = self._points[point] - origins[j]
            _add(
                self._model.equality, 'connect', **self._model.loop_closure, **names, anchor=anchor
            )
        for spring in masses.springs:
            self._spring(plane, spring)
        for torsion_spring in masses.torsion_springs:
            self._torsion_spring(torsion_spring)
        if self._foot and self._model.robot.is_walker:
            element, place = self._foot
            ball = {'type': 'sphere', 'pos': place, 'size': FOOT_RADIUS, 'mass': '0'}
            _add(element, 'geom', **_touching(self._model.floor.friction), **ball)

    def _joint(self, element: Element, j: int, crank_name: str, rotor: float) -> None:
        body = self._structure.bodies[j]
        if j == 0:
            axis = 0.0, 0.0, self._crank_sense
            at_start = {'ref': self._crank, 'armature': rotor}
            self._hinges[0] = crank_name
            _add(element, 'joint', name=crank_name, type='hinge', axis=axis, **at_start)
            return
        name = self._model.unique('joint', self.leg.joint_name(body.angle, SEPARATOR))
        if body.slides:
            along = complex(self.leg.linkage.line(self._pose.vectors, j))
            ref = self._pose.joints[j]
            _add(element, 'joint', name=name, type='slide', axis=along, ref=ref)
        else:
            self._hinges[j] = name
            _add(element, 'joint', name=name, type='hinge', axis='0 0 1')

    def _inertial(self, element: Element, j: int) -> None:
        mass, frame = self._dynamics.masses.bodies[j], self._structure.frames[j]
        direction = self._pose.vectors[frame] if frame != FIXED else 1.0
        first = self._points[self._structure.bodies[j].points[0]]
        centre = first + complex(mass.centre * direction) - self._origins[j]
        weight = mass.mass or MIN_MASS_PART * self._dynamics.masses.total
        inertia = max(mass.inertia or POINT_INERTIA_PART * weight * self._size**2, MIN_INERTIA)
        # A plate: the moments about the axes in its plane add up to the one about its normal.
        plate = inertia / 2.0, inertia / 2.0, inertia
        _add(element, 'inertial', pos=centre, mass=weight, diaginertia=plate)

    def _site(self, element: Element, point: str, place: complex) -> None:
        self._sites[point] = name = self._model.unique('site', self.leg.prefix + point.lower())
        if point == self._structure.foot:
            self._foot = element, place
        _add(element, 'site', name=name, pos=place, size=self._radius)

    def _spring(self, plane: Element, spring: Spring) -> None:
        ends = []
        for end in spring.ends:
            if isinstance(end, str):
                ends.append(self._sites[end])
            else:
                ends.append(self._model.unique('site', f'{self.leg.prefix}spring'))
                _add(plane, 'site', name=ends[-1], pos=complex(*end), size=self._radius)
        numbers = {'stiffness': spring.stiffness, 'springlength': spring.free_length}
        spatial = _add(self._model.tendon, 'spatial', **numbers, width=self._radius / 2.0)
        for name in ends:
            _add(spatial, 'site', site=name)

    def _torsion_spring(self, spring: TorsionSpring) -> None:
        """Write it as a tendon, whose length is the rotation between its bodies."""
        structure = self._structure
        parents = {h.body: h.parent for h in self._tree}
        turns = Counter[int]()
        for body, sign in zip(spring.body_indices(structure), (-1, 1), strict=True):
            j = body
            while j != FIXED:
                turns[j] += sign
                j = parents[j]
        turns[0] *= self._crank_sense
        # Only the crank's joint is not at 0 at the start.
        rest = turns[0] * self._crank - spring.deflection(structure, self._pose.vectors)
        numbers = {'stiffness': spring.stiffness, 'springlength': rest}
        fixed = _add(self._model.tendon, 'fixed', **numbers)
        for j, name in self._hinges.items():
            if turns[j]:
                _add(fixed, 'joint', joint=name, coef=turns[j])


def start_angle(legs: Sequence[RobotLeg], crank: float | None = None) -> float:
    """Return a joint angle that closes all of its legs, at no change point of theirs."""
    if crank is not None:
        return crank
    first = legs[0]
    arcs = LinkageLeg(first.linkage).reachable_arcs()
    middles = [first.direction * ((start + end) / 2.0 - first.phase) for start, end in arcs]
    for angle in (0.0, *middles, *CHANGE_POINT_DISTANCE * np.arange(1.0, 16.0)):
        try:
            for leg in legs:
                LinkageLeg(leg.linkage).closed_form(float(leg.crank_angles(angle)))
        except KinematicsError:
            continue
        if not any(is_near_change(leg, angle) for leg in legs):
            return float(angle)
    return 0.0


def is_near_change(leg: RobotLeg, angle: float) -> bool:
    """Return whether a leg is near a change point: nothing decides how it starts there."""
    alpha = float(leg.crank_angles(angle))
    betas = [point.beta for point in leg.linkage.change_points.points]
    return any(abs(wrap(alpha - beta)) < CHANGE_POINT_DISTANCE for beta in betas)


def _touching(friction: float, *, floor: bool = False) -> dict[str, str]:
    """Return the attributes of a geom that touches only the floor, or of the floor."""
    category, partner = ('1', '2') if floor else ('2', '1')
    contact = {
        'contype': category,
        'conaffinity': partner,
        'friction': f'{_text(friction)} 0.005 0.0001',
    }
    # Stiff contact: in a soft one the feet sink and creep, which shortens a walk.
    return {**contact, 'solref': '0.003 1'}


def _add(parent: Element, tag: str, /, **attributes: Any) -> Element:
    return SubElement(parent, tag, {name: _text(value) for name, value in attributes.items()})


def _text(value: Any) -> str:
    """Return an attribute: numbers to the last digit, places in a leg's plane with z = 0."""
    if isinstance(value, str):
        return value
    if isinstance(value, complex):
        value = value.real, value.imag, 0.0
    return ' '.join(repr(float(v) + 0.0).removesuffix('.0') for v in np.atleast_1d(value))
