"""The motors and sensors of a simulated robot, their readings, and the engine itself."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from math import isfinite
from typing import Any, NamedTuple

from klann_ros.sanitize.text import printable, refusal


class TwinError(ValueError):
    """An invalid simulated robot or command; the text says why."""


class NoMujocoError(ImportError):
    """The physics engine is not installed; the text says how to install it."""


def engine() -> Any:
    """Return the module of the physics engine, imported when it is used, or a NoMujocoError."""
    try:
        return import_module('mujoco')
    except ImportError as error:
        raise NoMujocoError(
            "the physics engine is not installed: pip install 'klann_ros[sim]'"
        ) from error


def _require(condition: bool, name: str, value: float, rule: str) -> None:
    if not condition:
        raise TwinError(refusal(name, value, rule))


@dataclass(frozen=True)
class Motors:
    """
    The drives of the cranks: a velocity servo for each joint.

    Attributes
    ----------
    bandwidth : float
        Of the first-order response of the speed [rad/s], > 0.
    max_velocity : float
        Saturation of the speed [rad/s], > 0.
    factors : mapping of str to float
        Factor of a joint's speed; 1 by default.

    """

    bandwidth: float = 50.0
    max_velocity: float = 20.0
    factors: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse invalid motors."""
        for name in ('bandwidth', 'max_velocity'):
            value = getattr(self, name)
            _require(isfinite(value) and value > 0.0, name, value, 'finite and > 0')
        for joint, factor in self.factors.items():
            _require(isfinite(factor), f'factor of {printable(joint)}', factor, 'finite')


# Standard deviation of a point that a camera mistakes for another [m].
OUTLIER_SIZE = 0.05


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
        Constant error of all encoders [rad].
    gyro_noise : float
        Of each component [rad/s].
    accelerometer_noise : float
        Of each component [m/s^2].
    accelerometer_offset : float
        Constant error of each component [m/s^2].
    orientation_noise : float
        About each axis [rad].
    camera_noise : float
        Of each coordinate of a measured point [m].
    camera_outliers : float
        Share of the measured points that are wrong, by some OUTLIER_SIZE.

    """

    encoder_noise: float = 0.0
    velocity_noise: float = 0.0
    encoder_offset: float = 0.0
    gyro_noise: float = 0.0
    accelerometer_noise: float = 0.0
    accelerometer_offset: float = 0.0
    orientation_noise: float = 0.0
    camera_noise: float = 0.0
    camera_outliers: float = 0.0

    def __post_init__(self) -> None:
        """Refuse invalid noise."""
        for name, value in vars(self).items():
            if name.endswith('_offset'):
                _require(isfinite(value), name, value, 'finite')
            else:
                _require(isfinite(value) and value >= 0.0, name, value, 'finite and >= 0')


class SimulatedCrank(NamedTuple):
    """A crank as its encoder reads it: the joint's angle [rad] and rate [rad/s]."""

    position: float
    velocity: float


class Imu(NamedTuple):
    """
    The reading of an IMU in `base_link`.

    Attributes
    ----------
    orientation : (float, float, float, float)
        Of it in the world: x, y, z, w.
    angular_velocity : (float, float, float)
        In its own frame [rad/s].
    linear_acceleration : (float, float, float)
        Specific force in its own frame, gravity included [m/s^2].

    """

    orientation: tuple[float, ...]
    angular_velocity: tuple[float, ...]
    linear_acceleration: tuple[float, ...]


class Truth(NamedTuple):
    """
    The true pose and velocity of `base_link`.

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
