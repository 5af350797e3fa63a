"""A robot as an MJCF model of the physics engine MuJoCo: a leg hung up, or a walker on a floor."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, isfinite, pi, sin
from typing import NamedTuple
from xml.etree.ElementTree import Comment, Element, indent, SubElement, tostring

from klann_ros.dynamics import GRAVITY, MassError
from klann_ros.kinematics import KinematicsError, LinkageLeg
from klann_ros.robot import Robot, RobotLeg, WalkerBody
import numpy as np

from .leg_model import equality, LegModel, Names, number, Section, SEPARATOR, touching

MAX_SLOPE = pi / 4.0


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


@dataclass(frozen=True)
class Floor:
    """
    The floor of a walker.

    Attributes
    ----------
    friction : float
        Coulomb friction of feet and body on it, >= 0.
    slope : float
        Angle by which it rises along x, within +- pi/4 [rad].

    """

    friction: float = 0.8
    slope: float = 0.0

    def __post_init__(self) -> None:
        """Refuse invalid floor data."""
        if not (isfinite(self.friction) and self.friction >= 0.0):
            raise ValueError(f'friction = {self.friction!r} is refused: it must be >= 0')
        if not abs(self.slope) <= MAX_SLOPE:
            allowed = f'within +-{MAX_SLOPE:.3f}'
            raise ValueError(f'slope = {self.slope!r} rad is refused: it must be {allowed}')


FLAT = Floor()


def robot_mjcf(
    robot: Robot, *, floor: Floor = FLAT, time_step: float = 0.0, crank: float | None = None
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
        first leg can reach.

    Raises
    ------
    MassError
        The robot has no masses.
    UnreachableError, LoopsOpenError
        A leg does not close at its initial angle.
    ValueError
        The time step is not > 0.

    """
    return _Model(robot, floor, time_step, crank).text()


class _Model:
    """Writes one model."""

    def __init__(self, robot: Robot, floor: Floor, time_step: float, crank: float | None) -> None:
        self._robot, self._floor = robot, floor
        accuracy = WALKING if robot.is_walker else SUSPENDED
        if not (isfinite(time_step) and time_step >= 0.0):
            raise ValueError(f'time_step = {time_step!r} s is refused: it must be > 0')
        self._accuracy = accuracy._replace(time_step=time_step or accuracy.time_step)
        starts = {joint: start_angle(robot.on_joint(joint), crank) for joint in robot.crank_joints}
        self._legs = [
            LegModel(leg, robot.dynamics(leg), starts[leg.crank_joint]) for leg in robot.legs
        ]
        self._unique = Names()

    def text(self) -> str:
        """Return the model."""
        root = Element('mujoco', model=self._unique('model', self._robot.name))
        root.append(Comment(' Made by klann_ros. Metres, kilograms, seconds, radians. '))
        # As in a URDF: roll, pitch and yaw about fixed axes.
        SubElement(root, 'compiler', angle='radian', autolimits='true', eulerseq='XYZ')
        self._option(root)
        world = SubElement(root, 'worldbody')
        base = self._base(world)
        # Before those of the legs: a crank's joint keeps its own name.
        self._cranks = {name: self._unique('joint', name) for name in self._robot.crank_joints}
        section = Section(SubElement(root, 'equality'), SubElement(root, 'tendon'), self._unique)
        actuator = SubElement(root, 'actuator')
        for joint in self._robot.crank_joints:
            self._on_joint(base, section, actuator, joint)
        if self._robot.is_walker:
            _imu(base, SubElement(root, 'sensor'))
        indent(root)
        return tostring(root, encoding='unicode') + '\n'

    def _option(self, root: Element) -> None:
        walks = self._robot.is_walker
        SubElement(
            root,
            'option',
            timestep=number(self._accuracy.time_step),
            gravity=f'0 0 {number(-GRAVITY)}',
            integrator=self._accuracy.integrator,
            iterations='100' if walks else '200',
            tolerance='1e-10' if walks else '1e-14',
            cone='elliptic',
            impratio='10' if walks else '1',
            jacobian='sparse' if walks else 'auto',
        )

    def _base(self, world: Element) -> Element:
        """Return base_link: free above a floor, or hung up."""
        name = self._unique('body', 'base_link')
        if not self._robot.is_walker:
            return SubElement(world, 'body', name=name)
        body, slope = _body(self._robot), self._floor.slope
        euler = _triple((0.0, -slope, 0.0))
        SubElement(
            world, 'geom', touching(self._floor.friction, floor=True), name='floor', type='plane',
            size='0 0 1', euler=euler, rgba='0.85 0.85 0.82 1',
        )  # fmt: skip
        lowest = min(
            float(leg.leg.mount.transform([leg.foot.real, leg.foot.imag])[2]) for leg in self._legs
        )
        height = FOOT_RADIUS + GROUND_GAP - lowest
        pos = _triple((-height * sin(slope), 0.0, height * cos(slope)))
        base = SubElement(world, 'body', name=name, pos=pos, euler=euler)
        SubElement(base, 'freejoint', name=self._unique('joint', name))
        centre = _triple(body.centre)
        SubElement(
            base, 'inertial', pos=centre, mass=number(body.mass), diaginertia=_triple(body.inertia)
        )
        size = _triple([side / 2.0 for side in body.size])
        SubElement(
            base, 'geom', touching(self._floor.friction), type='box', pos=centre, size=size,
            mass='0', rgba='0.5 0.6 0.7 0.4',
        )  # fmt: skip
        return base

    def _on_joint(self, base: Element, section: Section, actuator: Element, joint: str) -> None:
        """Write the legs of a joint, and its actuator."""
        name = self._cranks[joint]
        step = self._accuracy.time_step
        stiffness = self._accuracy.closing / step**2
        turned, legs = 0.0, [leg for leg in self._legs if leg.leg.crank_joint == joint]
        for leg in legs:
            least, most = leg.inertias()
            rotor = ROTOR_RATIO * most
            turned += least + rotor
            crank_name = name
            if leg is not legs[0]:
                crank_name = self._unique('joint', leg.leg.joint_name(joint, SEPARATOR))
                SubElement(
                    section.equality, 'joint', equality(stiffness), joint1=crank_name,
                    joint2=name, polycoef='0 1 0 0 0',
                )  # fmt: skip
            mount = leg.leg.mount
            plane = SubElement(
                base, 'body', name=self._unique('body', f'{leg.leg.prefix}leg_plane'),
                pos=_triple(mount.xyz), euler=_triple(mount.rpy),
            )  # fmt: skip
            leg.write(plane, section, crank_name, stiffness, rotor)
            if self._robot.is_walker:
                leg.foot_geom(FOOT_RADIUS, self._floor.friction)
        gain = self._accuracy.servo * turned / step
        SubElement(actuator, 'velocity', name=name, joint=name, kv=number(gain))


def start_angle(legs: Sequence[RobotLeg], crank: float | None = None) -> float:
    """Return a joint angle that closes all of its legs."""
    if crank is not None:
        return crank
    first = legs[0]
    arcs = LinkageLeg(first.linkage).reachable_arcs()
    middles = [first.direction * ((start + end) / 2.0 - first.phase) for start, end in arcs]
    for angle in (0.0, *middles):
        try:
            for leg in legs:
                LinkageLeg(leg.linkage).closed_form(float(leg.crank_angles(angle)))
        except KinematicsError:
            continue
        return angle
    return 0.0


def _body(robot: Robot) -> WalkerBody:
    if robot.body is None:
        name = robot.source or robot.name
        raise MassError(f'{name} has no body_mass [kg], body_size [m]: a walker needs them')
    return robot.body


def _imu(base: Element, sensor: Element) -> None:
    """Put an IMU into the body, with the names that mujoco_ros2_control looks for."""
    SubElement(base, 'site', name='imu', size='0.01')
    SubElement(sensor, 'framequat', name='imu_quat', objtype='site', objname='imu')
    SubElement(sensor, 'gyro', name='imu_gyro', site='imu')
    SubElement(sensor, 'accelerometer', name='imu_accel', site='imu')


def _triple(values: Sequence[float]) -> str:
    return ' '.join(map(number, np.asarray(values, dtype=np.float64)))
