"""A motor with its gear, read from a file, and whether it can turn a crank."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import degrees, inf
from typing import Any

from klann_ros.dynamics import turn_mean
from klann_ros.sanitize.text import did_you_mean, printable, refusal
from klann_ros.sanitize.yaml_text import content_of_file
import numpy as np

from .load import CrankLoad

# Limits of each number of a motor: their products and quotients are finite.
MIN_VALUE, MAX_VALUE = 1e-9, 1e9


class MotorFileError(ValueError):
    """A file without a valid motor; the text says why."""


@dataclass(frozen=True, kw_only=True)
class Motor:
    """
    A DC motor with its gear: its torque falls linearly from the stall torque to 0 at no load.

    Its gear has an efficiency of at most 1, and a ratio of 1 where there is none.
    """

    stall_torque: float  #: of the motor, without its gear [N m], > 0
    no_load_speed: float  #: of the motor, without its gear [rad/s], > 0
    gear_ratio: float  #: turns of the motor for one of the crank, > 0
    efficiency: float  #: of the gear
    continuous_torque: float | None = None  #: permissible rms torque of the motor [N m], > 0

    def __post_init__(self) -> None:
        """Refuse invalid motor data."""
        for name, number in vars(self).items():
            if (name, number) != ('continuous_torque', None):
                _check(name, number)

    @property
    def output_stall_torque(self) -> float:
        """Return the stall torque at the gear's output [N m]."""
        return self.stall_torque * self.gear_ratio * self.efficiency

    @property
    def output_no_load_speed(self) -> float:
        """Return the no-load speed of the gear's output [rad/s]."""
        return self.no_load_speed / self.gear_ratio

    @property
    def holding_torque(self) -> float:
        """Return the largest braking torque at the output: losses of the gear help [N m]."""
        return self.stall_torque * self.gear_ratio / self.efficiency

    def torque(self, speed: float) -> float:
        """Return the output torque at a speed >= 0 [rad/s]; negative beyond no load [N m]."""
        return self.output_stall_torque * (1.0 - speed / self.output_no_load_speed)


MOTOR_KEYS = tuple(field.name for field in fields(Motor))
REQUIRED_KEYS = MOTOR_KEYS[:4]


def motor_from_file(path: str) -> Motor:
    """
    Return the motor in a YAML file: a mapping of its numbers, by the names of `Motor`.

    Raises
    ------
    MotorFileError
        The file cannot be read, or has no valid motor.

    """
    return content_of_file(path, motor_from, 'motor', MotorFileError)


def motor_from(motor: Any) -> Motor:
    """
    Return the motor in a mapping.

    Raises
    ------
    ValueError
        It is not a mapping, a number is missing or invalid, or a key is unknown.

    """
    example = 'such as config/motor_example.yaml is'
    if not isinstance(motor, Mapping):
        raise ValueError(f'it must be a mapping, {example}')  # noqa: TRY004 - as all others
    for key in motor:
        if key not in MOTOR_KEYS:
            hint = did_you_mean(key, MOTOR_KEYS)
            raise ValueError(
                f'{printable(key)}: no such key; there are {", ".join(MOTOR_KEYS)}{hint}'
            )
    missing = [key for key in REQUIRED_KEYS if key not in motor]
    if missing:
        hint = '; gear_ratio: 1 is none' * ('gear_ratio' in missing)
        raise ValueError(f'{", ".join(missing)} missing, {example}{hint}')
    return Motor(**motor)


def _check(name: str, number: Any) -> None:
    is_number = isinstance(number, int | float) and not isinstance(number, bool)
    if not is_number or not MIN_VALUE <= number <= MAX_VALUE:
        allowed = f'a number > 0, at least {MIN_VALUE:g} and at most {MAX_VALUE:g}'
        raise ValueError(refusal(name, number, allowed))
    if name == 'efficiency' and number > 1.0:
        raise ValueError(f'efficiency = {number!r} is refused: a part of 1; 80 % are 0.8')


@dataclass(frozen=True, kw_only=True)
class MotorVerdict:
    """Whether a motor can turn a crank at a speed."""

    motor: Motor
    speed: float  #: of the crank, without its direction [rad/s]
    available: float  #: torque of the gear's output at this speed [N m]
    peak: float  #: largest driving torque, infinite if undefined at an angle [N m]
    peak_at: float  #: angle of the crank joint there [rad]
    braking_peak: float  #: largest braking torque [N m]
    motor_rms: float  #: rms torque at the motor, losses of the gear included [N m]
    fastest: float  #: reached from standstill [rad/s]; 0 if it cannot start

    @property
    def margin(self) -> float:
        """Return available over required peak torque; infinite if none is required."""
        return self.available / self.peak if self.peak else inf

    @property
    def braking_margin(self) -> float:
        """Return available over required braking torque; infinite if none is required."""
        return self.motor.holding_torque / self.braking_peak if self.braking_peak else inf

    @property
    def thermal_margin(self) -> float | None:
        """Return the thermal margin: continuous torque over rms torque; None if unknown."""
        if self.motor.continuous_torque is None:
            return None
        return self.motor.continuous_torque / self.motor_rms if self.motor_rms else inf

    @property
    def faults(self) -> tuple[str, ...]:
        """Return the reasons why it cannot turn the crank at this speed; empty if it can."""
        faults = []
        if self.available <= 0.0:
            max_speed = self.motor.output_no_load_speed
            faults.append(f'even without load it turns no faster than {max_speed:.4g} rad/s')
        elif self.peak == inf:
            angle = f'{degrees(self.peak_at):.1f} deg'
            faults.append(f'links are in line at {angle}, where the torque is undefined')
        elif self.margin < 1.0:
            faults.append(
                f'it gives {self.available:.4g} N m where {self.peak:.4g} N m are needed'
            )
        if self.braking_margin < 1.0:
            faults.append(
                f'it cannot hold back {self.braking_peak:.4g} N m that drive the crank on'
            )
        if not faults and self.fastest < self.speed:
            faults.append(f'it gets no faster than {self.fastest:.4g} rad/s from standstill')
        thermal = self.thermal_margin
        if thermal is not None and thermal < 1.0 and self.motor_rms < inf:
            faults.append(
                f'it overheats: {self.motor_rms:.4g} N m rms at the motor, whose continuous '
                f'torque is {self.motor.continuous_torque:.4g} N m'
            )
        return tuple(faults)

    @property
    def turns(self) -> bool:
        """Return whether the motor can turn it, continuously as far as that is known."""
        return not self.faults


def verdict(motor: Motor, load: CrankLoad, speed: float) -> MotorVerdict:
    """Return whether a motor can turn a crank at a constant speed, < 0 for clockwise [rad/s]."""
    direction = -1.0 if speed < 0.0 else 1.0
    torque = direction * load.torque(speed)
    # Links in line at a change point leave the torque undefined.
    torque = np.where(np.isnan(torque), inf, torque)
    motor_torque = np.where(torque > 0.0, torque / motor.efficiency, torque * motor.efficiency)
    peak_index = int(np.argmax(torque))
    return MotorVerdict(
        motor=motor,
        speed=abs(speed),
        available=motor.torque(abs(speed)),
        peak=max(float(torque[peak_index]), 0.0),
        peak_at=float(load.angles[peak_index]),
        braking_peak=max(-float(torque.min()), 0.0),
        motor_rms=float(np.sqrt(turn_mean(load.angles, motor_torque**2))) / motor.gear_ratio,
        fastest=_fastest(motor, load, direction),
    )


def _fastest(motor: Motor, load: CrankLoad, direction: float) -> float:
    """
    Return the speed w up to which a motor, from standstill, suffices at all angles [rad/s].

    Driving the torque G + S w^2 needs G + S w^2 <= M (1 - w / w_0), braking -(G + S w^2) <= B:
    two parabolas, which are <= 0 up to their first root.
    """
    g = direction * load.static_torque
    s = direction * load.per_speed_squared
    stall_torque = motor.output_stall_torque
    no_load_speed = motor.output_no_load_speed
    if np.isnan(g).any():
        return 0.0
    driving_limits = _first_root(
        s, np.full_like(g, stall_torque / no_load_speed), g - stall_torque
    )
    braking_limits = _first_root(-s, np.zeros_like(g), -g - motor.holding_torque)
    return float(min(no_load_speed, driving_limits.min(), braking_limits.min()))


def _first_root(a: Any, b: Any, c: Any) -> Any:
    """Return the least w >= 0 from which on a w^2 + b w + c > 0; b >= 0; else infinity."""
    with np.errstate(divide='ignore', invalid='ignore'):
        root = np.sqrt(b * b - 4.0 * a * c)
        # No cancellation for b >= 0; NaN or negative if there is no root.
        first_root = -2.0 * c / (b + root)
    first_root = np.where(np.isfinite(first_root) & (first_root >= 0.0), first_root, inf)
    return np.where(c > 0.0, 0.0, first_root)
