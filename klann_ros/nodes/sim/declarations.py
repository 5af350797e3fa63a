"""The parameters of `sim_node`, besides those of its robot."""

from collections.abc import Mapping, Sequence
from typing import Any

from klann_ros.nodes.parameters import Declaration, require
from klann_ros.twin import Floor, Motors, Sensors

_FLOOR, _MOTORS, _SENSORS = Floor(), Motors(), Sensors()


def _number(name: str, default: float, what: str, least: float, most: float) -> Declaration:
    return Declaration(name, default, what, limits=(least, most), any_number=True)


WORLD = (
    Declaration('built', '', 'leg file with the lengths as built and the encoder zero'),
    _number('friction', _FLOOR.friction, "Coulomb's, of the feet on the floor", 0.0, 10.0),
    _number('slope', _FLOOR.slope, 'by how much the floor rises along x [rad]', -0.785, 0.785),
    _number('time_step', 0.0, 'of the engine [s]; 0: 1 ms, of a leg 0.2 ms', 0.0, 0.005),
)
DRIVES = (
    Declaration(
        'motor_speed_factor',
        [1.0],
        "factor of the motors' speeds: one for all, or one for each crank joint",
        constraint='one number, or one for each crank joint, finite',
    ),
    _number('motor_bandwidth', _MOTORS.bandwidth, 'of the speed of a motor [rad/s]', 0.1, 1000.0),
    _number('max_crank_rate', _MOTORS.max_velocity, 'no crank turns faster [rad/s]', 1e-3, 100.0),
    _number('command_timeout', 0.5, 'without a younger command a crank is held [s]', 0.01, 60.0),
)
READINGS = (
    _number('encoder_noise', 0.0, 'standard deviation of crank angles [rad]', 0.0, 10.0),
    _number('velocity_noise', 0.0, 'standard deviation of crank rates [rad/s]', 0.0, 100.0),
    _number('encoder_offset', 0.0, 'by which all crank angles are wrong [rad]', -10.0, 10.0),
    _number('gyro_noise', 0.0, "standard deviation of the IMU's rates [rad/s]", 0.0, 100.0),
    _number(
        'accelerometer_noise',
        0.0,
        "standard deviation of the IMU's accelerations [m/s^2]",
        0.0,
        100.0,
    ),
    _number(
        'accelerometer_offset',
        0.0,
        "by which each of the IMU's accelerations is wrong [m/s^2]",
        -100.0,
        100.0,
    ),
    _number('orientation_noise', 0.0, "standard deviation of the IMU's attitude [rad]", 0.0, 3.2),
    _number('camera_noise', 1e-4, 'standard deviation of measured points [m]', 0.0, 1.0),
    _number('camera_outliers', 0.0, 'share of measured points that are wrong', 0.0, 0.5),
    Declaration('seed', 0, 'of all noise', limits=(0, 2**31 - 1)),
)
OUTPUT = (
    Declaration(
        'cameras', False, 'whether cameras measure the moving points, as camera/LEG/POINT'
    ),
    _number(
        'linear',
        0.0,
        'speed sent as cmd_vel while no other node sends any [m/s]; 0: none',
        -1.0,
        1.0,
    ),
    _number('rate', 100.0, 'messages a second of simulated time [Hz]', 1.0, 1000.0),
    _number('real_time_factor', 1.0, "simulated time by the world's", 0.01, 100.0),
    Declaration('use_clock', False, 'whether /clock is published, and is in the stamps'),
    Declaration('world_frame', 'world', 'frame of ground_truth'),
    Declaration('base_frame', 'base_link', 'frame of the body, and of its IMU'),
    _number('diagnostics_period', 1.0, 'time between diagnostics [s]', 0.01, 3600.0),
)
SIM_PARAMETERS = (*WORLD, *DRIVES, *READINGS, *OUTPUT)


def floor(values: Mapping[str, Any]) -> Floor:
    """Return what it walks on."""
    return Floor(friction=values['friction'], slope=values['slope'])


def motors(values: Mapping[str, Any], joints: Sequence[str]) -> Motors:
    """Return what turns its cranks; a StartError where there are not as many as joints."""
    factors = values['motor_speed_factor']
    fits = len(factors) in (1, len(joints))
    requirement = f'one number, or {len(joints)}, one for each joint'
    require(fits, 'motor_speed_factor', factors, requirement)
    each = factors if len(factors) == len(joints) else factors * len(joints)
    return Motors(
        bandwidth=values['motor_bandwidth'],
        max_velocity=values['max_crank_rate'],
        factors=dict(zip(joints, each, strict=True)),
    )


def sensors(values: Mapping[str, Any]) -> Sensors:
    """Return the sensor noise."""
    return Sensors(**{p.name: values[p.name] for p in READINGS if p.name != 'seed'})
