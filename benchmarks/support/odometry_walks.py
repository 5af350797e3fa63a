"""
Simulated walks for the comparison of odometries, recorded once and replayed with sensor noise.

A walk is simulated in MuJoCo with ideal sensors and kept on disk. Errors of real sensors are added
later, so that one walk serves estimators, noises and tunings without being simulated again.
"""

from dataclasses import dataclass, replace
from math import radians
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

from klann_ros.dynamics import Masses
from klann_ros.dynamics.masses import BodyMass
from klann_ros.gait import Feet, Rates, Steering
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import Robot, robot_of, RobotLeg
from klann_ros.robot.robot import Triple
from klann_ros.twin import Floor, Twin
from klann_ros.twin.mjcf import robot_mjcf
from klann_ros.walker import ControllerSettings, MotionLimits, Walker
import numpy as np

CONFIG = Path(__file__).resolve().parents[2] / 'config'
FOOT_RADIUS = 0.004
PERIOD = 0.01
# Standstill before the walk [s].
STANDS = 2.0
FREE = MotionLimits(
    max_linear=10.0, max_angular=10.0, max_linear_acceleration=0.5, max_angular_acceleration=1.0
)
# Size of a rough floor, distance between its random heights, and the greatest of them [m].
EXTENT = 14.0
SPACING = 0.15
ROUGHNESS = 0.01
FLOORS = ('flat', 'slope', 'rough')
# Fractions of the greatest speed and yaw rate: in the first and in the second half of the walk.
COMMANDS = (
    ((1.0, 0.0), (1.0, 0.0)),
    ((0.7, 0.4), (0.7, -0.3)),
    ((0.0, 1.0), (0.0, -1.0)),
    ((-0.8, 0.0), (-0.6, -0.4)),
    ((0.9, -0.2), (0.3, 0.6)),
)


class Kind(NamedTuple):
    """A robot of the comparison: its file, its scale, and the rate of its cranks [rad/s]."""

    file: Path
    scale: float
    rate: float


ROBOTS = {
    'six': Kind(CONFIG / 'walker6_two_motors.yaml', 1.0, 1.0),
    'six half': Kind(CONFIG / 'walker6_two_motors.yaml', 0.5, 1.4),
    'six double': Kind(CONFIG / 'walker6_two_motors.yaml', 2.0, 0.7),
    'eight': Kind(CONFIG / 'walker8_two_motors.yaml', 1.0, 1.0),
    'jansen': Kind(CONFIG / 'walker_jansen.yaml', 1.0, 0.8),
    'strider': Kind(Path(__file__).with_name('walker_strider.yaml'), 1.0, 2.5),
}


@dataclass(frozen=True, eq=False)
class Walk:
    """
    A recorded walk: k samples with ideal sensors, and the truth.

    Attributes
    ----------
    positions, velocities : numpy.ndarray, shape (k, c)
        Angles and rates of the cranks [rad, rad/s].
    orientation : numpy.ndarray, shape (k, 4)
        Quaternion x, y, z, w.
    gyro, force : numpy.ndarray, shape (k, 3)
        Means of rates [rad/s] and specific force [m/s^2] since the last sample.
    position : numpy.ndarray, shape (k, 3)
        Position of base_link in the world [m].
    linear, angular : numpy.ndarray, shape (k, 3)
        Velocity of base_link in its frame [m/s, rad/s].

    """

    positions: FloatArray
    velocities: FloatArray
    orientation: FloatArray
    gyro: FloatArray
    force: FloatArray
    position: FloatArray
    linear: FloatArray
    angular: FloatArray

    @property
    def yaw(self) -> FloatArray:
        """Return the yaw, continuous, 0 at the start [rad], shape (k,)."""
        x, y, z, w = self.orientation.T
        yaw = np.unwrap(np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)))
        return np.asarray(yaw - yaw[0])


def robot(name: str) -> Robot:
    """Return a robot of the comparison, scaled at constant densities."""
    file, scale, _ = ROBOTS[name]
    drawn = robot_of(str(file))
    if scale == 1.0 or drawn.body is None:
        return drawn
    legs = tuple(_scale_leg(leg, scale) for leg in drawn.legs)
    body = replace(
        drawn.body,
        mass=drawn.body.mass * scale**3,
        size=_scale_vector(drawn.body.size, scale),
        centre=_scale_vector(drawn.body.centre, scale),
    )
    return replace(drawn, legs=legs, body=body)


def _scale_vector(vector: Triple, scale: float) -> Triple:
    x, y, z = vector
    return scale * x, scale * y, scale * z


def _scale_leg(leg: RobotLeg, scale: float) -> RobotLeg:
    mount = replace(leg.mount, xyz=_scale_vector(leg.mount.xyz, scale))
    bodies = []
    for body in leg.masses.bodies if leg.masses else ():
        inertia = body.inertia * scale**5
        bodies.append(BodyMass(body.mass * scale**3, body.centre * scale, inertia))
    masses = Masses(tuple(bodies))
    return replace(leg, linkage=leg.linkage.scaled(scale), mount=mount, masses=masses)


def write_mjcf(walker: Robot, floor: Floor, *, height_seed: int | None, second: bool) -> str:
    """
    Return the MJCF of a robot on a floor.

    Parameters
    ----------
    walker : Robot
        The robot.
    floor : Floor
        Its friction and slope.
    height_seed : int, optional
        Seed of the heights of a rough floor.
    second : bool
        Whether contacts are those of the second model: softer, with less damping, and a pyramid
        of friction instead of a cone.

    """
    # Our own text.
    root = ET.fromstring(robot_mjcf(walker, floor=floor, time_step=1e-3))  # noqa: S314
    plane = root.find('worldbody/geom')
    option = root.find('option')
    if plane is None or option is None:
        raise AssertionError('a walker has a floor')
    if height_seed is not None:
        count = int(EXTENT / SPACING) + 1
        asset = ET.SubElement(root, 'asset')
        half = EXTENT / 2.0
        height = 2.0 * ROUGHNESS
        heights = np.random.default_rng(height_seed).uniform(0.0, 1.0, (count, count))
        ET.SubElement(
            asset, 'hfield', name='heights', nrow=str(count), ncol=str(count),
            size=f'{half} {half} {height} 0.1', elevation=' '.join(map(str, heights.ravel())),
        )  # fmt: skip
        del plane.attrib['size']
        plane.attrib |= {'type': 'hfield', 'hfield': 'heights', 'pos': f'0 0 {-height}'}
    if second:
        option.attrib |= {'cone': 'pyramidal', 'impratio': '1'}
        for geom in root.iter('geom'):
            if geom.get('solref'):
                geom.attrib |= {'solref': '0.006 0.7', 'solimp': '0.8 0.95 0.002'}
    return ET.tostring(root, encoding='unicode')


def simulate_walk(name: str, floor_kind: str, seed: int, *, second: bool, seconds: float) -> Walk:
    """Simulate a walk."""
    rng = np.random.default_rng([seed, second, FLOORS.index(floor_kind)])
    friction = rng.uniform(0.4, 1.0)
    slope = radians(rng.uniform(-3.0, 3.0)) if floor_kind == 'slope' else 0.0
    height_seed = seed if floor_kind == 'rough' else None
    drawn = robot(name)
    feet = Feet(drawn, foot_radius=FOOT_RADIUS)
    steering = Steering(feet)
    mjcf = write_mjcf(drawn, Floor(friction, slope), height_seed=height_seed, second=second)
    twin = Twin(drawn, mjcf=mjcf, seed=seed)
    walker = Walker(steering, ControllerSettings(limits=FREE))
    scale = rng.uniform(0.6, 1.0)
    max_linear = scale * steering.speed * ROBOTS[name].rate
    max_angular = scale * steering.motion(Rates(-1.0, 1.0)).angular * ROBOTS[name].rate
    first_command, second_command = COMMANDS[seed % len(COMMANDS)]
    samples = []
    for k in range(round((STANDS + seconds) / PERIOD)):
        now = k * PERIOD
        imu = twin.imu()
        truth = twin.truth()
        cranks = twin.cranks()
        walker.feedback(dict(cranks), now)
        if now >= STANDS:
            is_first_half = now < STANDS + seconds / 2.0
            linear, angular = first_command if is_first_half else second_command
            walker.controller.command(linear * max_linear, angular * max_angular, now)
        command = walker.controller.step(now)
        for joint, rate in zip(feet.joints, command.velocity if command else (), strict=True):
            twin.command(joint, rate)
        positions, velocities = zip(*cranks.values(), strict=True)
        samples.append(
            (
                *(*positions, *velocities, *truth.orientation),
                *(*imu.angular_velocity, *imu.linear_acceleration),
                *(*truth.position, *truth.linear, *truth.angular),
            )
        )
        twin.step(now + PERIOD)
    count = len(feet.joints)
    ends = np.cumsum([count, count, 4, 3, 3, 3, 3])
    return Walk(*np.split(np.array(samples), ends, axis=1))


def recorded(
    folder: Path, name: str, floor: str, seed: int, *, second: bool = False, seconds: float = 24.0
) -> Walk:
    """Return a walk from a folder; it is simulated and written there if it is not there yet."""
    kind = 'second' if second else 'first'
    path = folder / f'{name.replace(" ", "_")}-{floor}-{kind}-{seed:02}.npz'
    if not path.exists():
        walk = simulate_walk(name, floor, seed, second=second, seconds=seconds)
        folder.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix('.part.npz')
        np.savez(unfinished, **vars(walk))
        unfinished.rename(path)
    with np.load(path) as arrays:
        return Walk(**arrays)
