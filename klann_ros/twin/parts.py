"""What a simulated robot is made of: motors and sensors, and what these read."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple

from klann_ros.sanitize.text import printable


class TwinError(ValueError):
    """What a twin cannot be made of, or do; the text says why."""


def _must(condition: bool, name: str, value: float, what: str) -> None:
    if not condition:
        raise TwinError(f'{name} = {value!r} is refused: it must be {what}')


@dataclass(frozen=True)
class Motors:
    """
    The drives of the cranks: a velocity servo for each joint.

    Attributes
    ----------
    bandwidth : float
        By 1 - 1/e of the difference in 1 / bandwidth [rad/s], > 0.
    most : float
        No crank turns faster, whatever is asked [rad/s], > 0.
    factors : mapping of str to float
        Factor of a joint's speed; 1 by default.

    """

    bandwidth: float = 50.0
    most: float = 20.0
    factors: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what turns nothing."""
        for name in ('bandwidth', 'most'):
            value = getattr(self, name)
            _must(isfinite(value) and value > 0.0, name, value, 'finite and > 0')
        for joint, factor in self.factors.items():
            _must(isfinite(factor), f'factor of {printable(joint)}', factor, 'finite')


@dataclass(frozen=True)
class Sensors:
    """
    Sensor noise: standard deviations of white noise.

    Attributes
    ----------
    encoder_noise : float
        Of the angle of a crank [rad].
    velocity_noise : float
        Of its rate [rad/s].
    encoder_offset : float
        By which all encoders are wrong [rad].
    gyro_noise : float
        Of each component [rad/s].
    accelerometer_noise : float
        Of each component [m/s^2].
    accelerometer_offset : float
        By which each component is wrong [m/s^2].
    orientation_noise : float
        About each axis [rad].

    """

    encoder_noise: float = 0.0
    velocity_noise: float = 0.0
    encoder_offset: float = 0.0
    gyro_noise: float = 0.0
    accelerometer_noise: float = 0.0
    accelerometer_offset: float = 0.0
    orientation_noise: float = 0.0

    def __post_init__(self) -> None:
        """Refuse invalid noise."""
        for name, value in vars(self).items():
            if name.endswith('_offset'):
                _must(isfinite(value), name, value, 'finite')
            else:
                _must(isfinite(value) and value >= 0.0, name, value, 'finite and >= 0')


class SimulatedCrank(NamedTuple):
    """A crank as its encoder reads it: the joint's angle [rad] and rate [rad/s]."""

    position: float
    velocity: float


class Imu(NamedTuple):
    """
    What an IMU in `base_link` reads.

    Attributes
    ----------
    orientation : (float, float, float, float)
        Of it in the world: x, y, z, w.
    angular_velocity : (float, float, float)
        In its own frame [rad/s].
    linear_acceleration : (float, float, float)
        In its own frame, with what holds it against its weight [m/s^2].

    """

    orientation: tuple[float, ...]
    angular_velocity: tuple[float, ...]
    linear_acceleration: tuple[float, ...]


class Truth(NamedTuple):
    """
    Where `base_link` is, and how it moves, without any error.

    Attributes
    ----------
    position : (float, float, float)
        In the world [m].
    orientation : (float, float, float, float)
        x, y, z, w.
    linear, angular : (float, float, float)
        Its velocity [m/s] and rate [rad/s], in its own frame.

    """

    position: tuple[float, ...]
    orientation: tuple[float, ...]
    linear: tuple[float, ...]
    angular: tuple[float, ...]


# Ideal sensors and motors.
MOTORS, SENSORS = Motors(), Sensors()
