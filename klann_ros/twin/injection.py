"""
Faults of wiring, encoders, gears and the IMU, injected between a robot and its messages.

A list of faults is a text: `left_crank_reversed, imu_degrees@5, right_crank_zero=0.3`. A fault of
a crank names its joint; without a joint all cranks have it. `=` gives its size, `@` its start [s].
"""

from collections.abc import Mapping, Sequence
from enum import Enum
from math import cos, degrees, isfinite, nan, radians, sin
import re
from typing import Any, NamedTuple

from klann_ros.dynamics import GRAVITY
from klann_ros.kinematics.angles import DEGREES, RPM, yaw_of
from klann_ros.robot import CrankDrive
from klann_ros.sanitize.text import did_you_mean, printable, refusal

from .twin import Imu, SimulatedCrank, TwinError

# Period of the jumps of the heading [s].
JUMP_PERIOD = 2.0
_TERM = re.compile(r'(\w+)(?:=([^@]*))?(?:@(.*))?')


class Injection(Enum):
    """A kind of injected fault by its name in a list: its default size, and what it does."""

    # Factors of the commanded rate.
    REVERSED = 'reversed', -1.0, 'the motor turns backwards: its leads are exchanged'
    DEAD = 'dead', 0.0, 'the motor does not turn'
    SLIPPING = 'slipping', 0.2, 'only this part of the commanded rate arrives at the crank'
    MOTOR_RATIO = 'motor_ratio', 0.25, 'turns of the crank by commanded turn'
    COMMAND_DEGREES = 'command_degrees', 1.0 / DEGREES, 'the driver takes commands as deg/s'
    COMMAND_RPM = 'command_rpm', 1.0 / RPM, 'the driver takes commands as rpm'
    # Factors of the measured angle and velocity.
    ENCODER_REVERSED = 'encoder_reversed', -1.0, 'the encoder counts backwards'
    GEAR_RATIO = 'gear_ratio', 4.0, 'turns of the encoder by turn of the crank'
    DEGREES = 'degrees', DEGREES, 'angle in degrees, velocity in deg/s'
    RPM = 'rpm', RPM, 'velocity in rpm'
    SWAPPED = 'swapped', 0.0, 'the motor is exchanged with that of the next crank'
    ENCODER_SWAPPED = 'encoder_swapped', 0.0, 'the encoder is exchanged with the next one'
    ENCODER_FROZEN = 'encoder_frozen', 0.0, 'the angle stays, the velocity is true'
    ENCODER_ECHO = 'encoder_echo', 0.0, 'the angle stays, the velocity is the commanded one'
    ENCODER_MISSING = 'encoder_missing', 0.0, 'the crank is not in crank_state'
    ZERO = 'zero', 0.3, 'the angle that the encoder shows at zero [rad]'
    DRIVER_REPEATS = 'driver_repeats', 0.0, 'crank_state is its last message, stamp included'
    IMU_FROZEN = 'imu_frozen', 0.0, 'the reading stays'
    IMU_MISSING = 'imu_missing', 0.0, 'there is no imu'
    IMU_DEGREES = 'imu_degrees', 0.0, 'the gyro is in deg/s'
    IMU_G = 'imu_g', 0.0, 'the acceleration is in units of gravity'
    IMU_YAW_REVERSED = 'imu_yaw_reversed', 0.0, 'yaw and yaw rate are clockwise'
    IMU_TURNED = 'imu_turned', 90.0, 'the IMU is turned about z by this angle [deg]'
    IMU_TILTED = 'imu_tilted', 90.0, 'turned about x, as that of a robot on its side [deg]'
    IMU_NO_ORIENTATION = 'imu_no_orientation', 0.0, 'the orientation is (0, 0, 0, 0)'
    IMU_HEADING_JUMPS = 'imu_heading_jumps', 1.0, 'the yaw jumps by this angle every 2 s [rad]'

    def __init__(self, label: str, size: float, description: str) -> None:
        self.label, self.size, self.description = label, size, description

    @property
    def is_of_crank(self) -> bool:
        """Return whether each crank may have it."""
        return not self.label.startswith(('imu', 'driver'))


_MOTOR_FACTORS = set([*Injection][:6])
_ANGLE_FACTORS = {Injection.ENCODER_REVERSED, Injection.GEAR_RATIO, Injection.DEGREES}
_VELOCITY_FACTORS = {*_ANGLE_FACTORS, Injection.RPM}
_FROZEN = {Injection.ENCODER_FROZEN, Injection.ENCODER_ECHO}
_EXCHANGES = {Injection.SWAPPED, Injection.ENCODER_SWAPPED}


class InjectedFault(NamedTuple):
    """A fault of a joint, '' if of none; its size in the unit of its kind, and its start [s]."""

    kind: Injection
    joint: str
    size: float
    start: float


def described_faults(drives: Mapping[str, CrankDrive]) -> list[InjectedFault]:
    """Return encoders and motors as a robot file describes them, by their joints."""
    faults = []
    for joint, drive in drives.items():
        sizes = {
            Injection.MOTOR_RATIO: 1.0 / drive.motor_ratio,
            Injection.GEAR_RATIO: drive.encoder_ratio,
            Injection.ZERO: drive.zero * drive.encoder_ratio,
        }
        faults += [InjectedFault(kind, joint, size, 0.0) for kind, size in sizes.items()]
    return faults


def injected_faults(text: str, joints: Sequence[str]) -> list[InjectedFault]:
    """Return the faults in a list for cranks of these joints; a TwinError names the wrong one."""
    targets: dict[str, list[tuple[Injection, str]]] = {}
    for kind in Injection:
        # All motors are exchanged by pairs.
        cranks = joints[:-1:2] if kind in _EXCHANGES else joints
        targets[kind.label] = [(kind, joint) for joint in (cranks if kind.is_of_crank else ('',))]
        for joint in joints if kind.is_of_crank else ():
            targets[f'{joint}_{kind.label}'] = [(kind, joint)]
    faults = []
    for term in filter(None, (part.strip() for part in text.split(','))):
        match = _TERM.fullmatch(term)
        name, size, start = match.groups() if match else (term, None, None)
        if name not in targets:
            labels = ', '.join(kind.label for kind in Injection)
            hint = f'{did_you_mean(name, targets)}; there are {labels}'
            raise TwinError(f'fault {printable(name)} is unknown{hint}; of a crank JOINT_FAULT')
        for kind, joint in targets[name]:
            magnitude = _number(term, size, kind.size)
            faults.append(InjectedFault(kind, joint, magnitude, _number(term, start, 0.0)))
    return faults


def _number(term: str, text: str | None, default: float) -> float:
    try:
        number = default if text is None else float(text)
    except ValueError:
        number = nan
    if not isfinite(number):
        raise TwinError(refusal('fault', term, 'FAULT=SIZE@START, with finite numbers'))
    return number


class FaultInjector:
    """
    Change commands and readings as the faults do, from their starts on.

    Commands and readings of cranks are by joint; times are since the start of the robot [s].
    """

    def __init__(self, faults: Sequence[InjectedFault], joints: Sequence[str]) -> None:
        self._faults, self._joints = faults, joints
        # The first readings since the faults began.
        self._angles: dict[str, float] = {}
        self._imu: Imu | None = None

    def is_active(self, kind: Injection, time: float) -> bool:
        """Return whether there is a fault of a kind at a time."""
        return any(fault.kind is kind for fault in self._active(time))

    def _active(self, time: float) -> list[InjectedFault]:
        return [fault for fault in self._faults if time >= fault.start]

    def commands(self, velocities: Mapping[str, float], time: float) -> dict[str, float]:
        """Return the rates at which motors are driven for commands [rad/s]."""
        rates = self._exchanged(velocities, Injection.SWAPPED, time)
        for fault in self._active(time):
            if fault.kind in _MOTOR_FACTORS:
                rates[fault.joint] *= fault.size
        return rates

    def cranks(
        self, cranks: Mapping[str, SimulatedCrank], velocities: Mapping[str, float], time: float
    ) -> dict[str, SimulatedCrank]:
        """Return what encoders read, at commanded velocities; without those that are missing."""
        readings = self._exchanged(cranks, Injection.ENCODER_SWAPPED, time)
        for kind, joint, size, _ in self._active(time):
            if kind is Injection.ENCODER_MISSING:
                readings.pop(joint, None)
            if joint not in readings:
                continue
            angle, velocity = readings[joint]
            angle *= size if kind in _ANGLE_FACTORS else 1.0
            angle += size if kind is Injection.ZERO else 0.0
            velocity *= size if kind in _VELOCITY_FACTORS else 1.0
            if kind in _FROZEN:
                angle = self._angles.setdefault(joint, angle)
            if kind is Injection.ENCODER_ECHO:
                velocity = velocities[joint]
            readings[joint] = SimulatedCrank(angle, velocity)
        return readings

    def _exchanged(
        self, by_joint: Mapping[str, Any], kind: Injection, time: float
    ) -> dict[str, Any]:
        """Return what motors or encoders get that are exchanged with those of the next crank."""
        exchanged = dict(by_joint)
        for fault in self._active(time):
            if fault.kind is kind:
                following = (self._joints.index(fault.joint) + 1) % len(self._joints)
                joints = fault.joint, self._joints[following]
                exchanged |= zip(
                    joints, [exchanged[joint] for joint in reversed(joints)], strict=True
                )
        return exchanged

    def imu(self, imu: Imu, time: float) -> Imu:
        """Return what the IMU reads."""
        for kind, _, size, start in self._active(time):
            orientation, rates, force = imu
            match kind:
                case Injection.IMU_FROZEN:
                    imu = self._imu = self._imu or imu
                case Injection.IMU_DEGREES:
                    imu = imu._replace(angular_velocity=tuple(map(degrees, rates)))
                case Injection.IMU_G:
                    imu = imu._replace(linear_acceleration=tuple(a / GRAVITY for a in force))
                case Injection.IMU_YAW_REVERSED:
                    mirrored = _product(_about(2, -2.0 * yaw_of(*orientation)), orientation)
                    imu = Imu(mirrored, (*rates[:2], -rates[2]), force)
                case Injection.IMU_TURNED | Injection.IMU_TILTED:
                    mount = _about(2 if kind is Injection.IMU_TURNED else 0, radians(size))
                    mounted = _product(orientation, mount)
                    imu = Imu(mounted, _in_mount(rates, mount), _in_mount(force, mount))
                case Injection.IMU_NO_ORIENTATION:
                    imu = imu._replace(orientation=(0.0, 0.0, 0.0, 0.0))
                case Injection.IMU_HEADING_JUMPS:
                    jumped = _about(2, size * ((time - start) // JUMP_PERIOD))
                    imu = imu._replace(orientation=_product(jumped, orientation))
        return imu


def _about(axis: int, angle: float) -> tuple[float, ...]:
    """Return the quaternion (x, y, z, w) of a rotation [rad] about an axis."""
    vector = [0.0, 0.0, 0.0]
    vector[axis] = sin(angle / 2.0)
    return (*vector, cos(angle / 2.0))


def _product(first: Sequence[float], second: Sequence[float]) -> tuple[float, ...]:
    a, b, c, w = first
    x, y, z, v = second
    return (
        w * x + a * v + b * z - c * y,
        w * y - a * z + b * v + c * x,
        w * z + a * y - b * x + c * v,
        w * v - a * x - b * y - c * z,
    )


def _in_mount(vector: Sequence[float], mount: Sequence[float]) -> tuple[float, ...]:
    """Return a vector of the body in the axes of a sensor that is mounted turned."""
    x, y, z, w = mount
    return _product(_product((-x, -y, -z, w), (*vector, 0.0)), mount)[:3]
