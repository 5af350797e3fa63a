"""The parameters of `walker_node`, besides those of its legs."""

from collections.abc import Mapping
from dataclasses import Field, fields
from math import inf, isinf
from typing import Any

from klann_ros.nodes.crank_output import COMMAND_TYPE
from klann_ros.nodes.leg_declarations import ENCODER_REMEDIES, ENCODERS
from klann_ros.nodes.parameters import Declaration, number
from klann_ros.walker import ControllerSettings, MotionLimits, OdometryNoise

# A gap in the loop lasts at least this number of command periods.
MIN_GAP_PERIODS = 3.0
# What to do about a publisher of another type, by the type that is taken and the published one.
_TWIST, _TWIST_STAMPED = 'geometry_msgs/msg/Twist', 'geometry_msgs/msg/TwistStamped'
TYPE_REMEDIES = {
    (_TWIST_STAMPED, _TWIST): 'stamped_cmd_vel:=false',
    (_TWIST, _TWIST_STAMPED): 'stamped_cmd_vel:=true',
    **ENCODER_REMEDIES,
}
_LIMITS, _SETTINGS, _NOISE = MotionLimits(), ControllerSettings(), OdometryNoise()


def _limit(limit: Field[float]) -> Declaration:
    """Return the declaration of a limit of the motion, whose parameter is 0 if it is infinite."""
    text = limit.metadata['text']
    default = getattr(_LIMITS, limit.name)
    if isinf(default):
        text = f'{text}; 0: any'
        default = 0.0
    minimum, maximum = limit.metadata['range']
    return number(limit.name, default, text, minimum, maximum, read_only=False)


def _setting(name: str, text: str, minimum: float, maximum: float) -> Declaration:
    default = round(getattr(_SETTINGS, name), 4)
    return number(name, default, text, minimum, maximum, read_only=False)


def _noise(name: str, text: str, minimum: float, maximum: float) -> Declaration:
    return number(name, getattr(_NOISE, name), text, minimum, maximum)


LIMITS = tuple(map(_limit, fields(MotionLimits)))
CONTROL = (
    number('rate', 100.0, 'commands a second [Hz]', 1.0, 1e3),
    COMMAND_TYPE,
    *ENCODERS,
    Declaration(
        'publish_limited_velocity', False, 'whether cmd_vel_out has the motion within its limits'
    ),
    Declaration('open_loop', False, 'whether commands are taken as obeyed, without crank_state'),
    Declaration('stamped_cmd_vel', True, 'whether cmd_vel is a TwistStamped; false: a Twist'),
    _setting('cmd_vel_timeout', 'command timeout: older commands stop it [s]', 0.01, 60.0),
    _setting('feedback_timeout', 'a crank that is silent for longer stops all [s]', 0.01, 60.0),
    _setting('e_stop_timeout', 'a heard e_stop that is silent stops it; 0: never [s]', 0.0, 60.0),
    _setting(
        'max_following_error', 'a crank that does not follow over it is a fault [rad]', 0.02, 100.0
    ),
    _setting('max_tilt', 'greatest tilt of the body; a larger one is a fault [rad]', 0.05, 1.6),
    _setting('max_effort', 'of a crank, by crank_state: a larger one stops; 0: none', 0.0, 1e6),
    _setting('rephase', 'part of its rate by which a crank returns to its phase', 0.0, 0.5),
    _setting('motion_gain', 'of the feedback of the measured motion; 0: none [1/s]', 0.0, 5.0),
    _setting('phase_gain', 'proportional gain of the phase lock [1/s]', 0.0, 100.0),
    _setting('phase_integral', 'integral gain of the phase lock [1/s^2]', 0.0, 100.0),
    Declaration(
        'auto_reset',
        False,
        'whether a new cmd_vel after one of 0 resets a fault; else only ~/reset_fault does',
        read_only=False,
    ),
    Declaration('phase_lock', True, 'whether cranks are kept in phase by their feedback'),
)
ODOMETRY = (
    Declaration('odom_frame', 'odom', 'frame of the odometry'),
    Declaration('base_frame', 'base_link', 'frame of the body'),
    Declaration('publish_tf', True, 'whether odom_frame -> base_frame is sent to /tf'),
    Declaration('use_imu', False, 'whether yaw and attitude are taken from imu'),
    number('linear_scale', 1.0, 'true speed by that of odom, calibrated', 0.1, 10.0),
    number('angular_scale', 1.0, 'true yaw rate by that of odom, calibrated', 0.1, 10.0),
    number('imu_timeout', 0.5, 'an older IMU is not used [s]', 0.01, 60.0),
    number('foot_radius', 0.004, 'of its feet, which are balls [m]', 0.0, 1.0),
    _noise('friction', 'friction coefficient of the feet', 0.01, 10.0),
    _noise('stiction_speed', 'of feet that stick; 0.05 on soft ground [m/s]', 1e-5, 1.0),
    _noise('accelerometer_noise', 'density of the noise [m/s^2/sqrt(Hz)]', 1e-6, 10.0),
    _noise('gyro_noise', 'density of the noise [rad/s/sqrt(Hz)]', 1e-9, 1.0),
    _noise('accelerometer_bias', 'before standstill, standard deviation [m/s^2]', 1e-6, 10.0),
    _noise('gyro_bias', 'before standstill, standard deviation [rad/s]', 1e-9, 1.0),
    _noise('accelerometer_drift', 'random walk of the bias [m/s^2/sqrt(s)]', 0.0, 1.0),
    _noise('gyro_drift', 'random walk of the bias [rad/s/sqrt(s)]', 0.0, 1.0),
    _noise('standstill_yaw_rate', 'of feet that creep at standstill [rad/s]', 0.0, 1.0),
    _noise('heading_error', 'standard deviation of a yaw without covariance [rad]', 0.0, 3.2),
    _noise('advance_error', 'relative error of the advance', 0.0, 10.0),
    _noise('slip_error', 'error relative to the slip of the feet', 0.0, 10.0),
    _noise(
        'slip_yaw_error', 'of the yaw at the reach of the feet, relative to the slip', 0.0, 10.0
    ),
    _noise('contact_error', 'relative to least squares minus friction law', 0.0, 10.0),
    _noise('height_error', 'standard deviation of the height [m]', 0.0, 10.0),
    _noise('tilt_error', 'standard deviation of roll and pitch [rad]', 1e-6, 3.2),
    number('diagnostics_period', 1.0, 'time between diagnostics [s]', 0.01, 3600.0),
)
WALKER_PARAMETERS = (*LIMITS, *CONTROL, *ODOMETRY)


def settings(parameters: Mapping[str, Any]) -> ControllerSettings:
    """Return the controller's settings by the values of the parameters."""
    limits = {limit.name: parameters[limit.name] for limit in LIMITS}
    for name in ('max_curvature', 'max_linear_jerk', 'max_angular_jerk'):
        limits[name] = limits[name] or inf
    max_gap = max(_SETTINGS.max_gap, MIN_GAP_PERIODS / parameters['rate'])
    tuned = _of_fields(ControllerSettings, parameters)
    return ControllerSettings(limits=MotionLimits(**limits), max_gap=max_gap, **tuned)


def noise(parameters: Mapping[str, Any]) -> OdometryNoise:
    """Return the uncertainties of the odometry by the values of the parameters."""
    return OdometryNoise(**_of_fields(OdometryNoise, parameters))


def _of_fields(kind: type, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters that are fields of a dataclass."""
    names = parameters.keys() & {field.name for field in fields(kind)}
    return {name: parameters[name] for name in names}
