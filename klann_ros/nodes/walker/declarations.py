"""The parameters of `walker_node`, besides those of its legs."""

from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from math import inf
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
# Limits, timeouts and gains can be set at run time.
_tunable = partial(number, read_only=False)
LIMITS = (
    *(
        _tunable(name, getattr(_LIMITS, name), f'greatest {text}', least, most)
        for name, text, least, most in (
            ('max_linear', 'speed forwards [m/s]', 0.0, 100.0),
            ('max_angular', 'yaw rate to the left [rad/s]', 0.0, 100.0),
            ('max_linear_backward', 'speed backwards; negative: as forwards [m/s]', -1.0, 100.0),
            ('max_angular_right', 'yaw rate to the right; negative: as left', -1.0, 100.0),
            ('max_linear_acceleration', 'growth of the speed [m/s^2]', 1e-3, 1e3),
            ('max_angular_acceleration', 'growth of the yaw rate [rad/s^2]', 1e-3, 1e3),
            ('max_linear_deceleration', 'decrease; 0: as growth [m/s^2]', 0.0, 1e3),
            ('max_angular_deceleration', 'decrease; 0: as growth [rad/s^2]', 0.0, 1e3),
            ('max_crank_rate', 'rate of a crank [rad/s]', 1e-3, 1e3),
        )
    ),
    *(
        _tunable(name, 0.0, f'greatest {text}; 0: any', 0.0, 1e3)
        for name, text in (
            ('max_curvature', 'curvature of the path [1/m]'),
            ('max_linear_jerk', 'change of a growth of the speed [m/s^3]'),
            ('max_angular_jerk', 'change of a growth of the yaw rate [rad/s^3]'),
        )
    ),
)
CONTROL = (
    number('rate', 100.0, 'commands a second [Hz]', 1.0, 1e3),
    COMMAND_TYPE,
    *ENCODERS,
    Declaration(
        'publish_limited_velocity', False, 'whether cmd_vel_out has the motion within its limits'
    ),
    Declaration('open_loop', False, 'whether commands are taken as obeyed, without crank_state'),
    Declaration('stamped_cmd_vel', True, 'whether cmd_vel is a TwistStamped; false: a Twist'),
    *(
        _tunable(name, round(getattr(_SETTINGS, name), 4), text, least, most)
        for name, text, least, most in (
            ('cmd_vel_timeout', 'command timeout: older commands stop it [s]', 0.01, 60.0),
            ('feedback_timeout', 'a crank that is silent for longer stops all [s]', 0.01, 60.0),
            ('e_stop_timeout', 'a heard e_stop that is silent stops it; 0: never [s]', 0.0, 60.0),
            (
                'max_following_error',
                'a crank that does not follow over it is a fault [rad]',
                0.02,
                100.0,
            ),
            ('max_tilt', 'greatest tilt of the body; a larger one is a fault [rad]', 0.05, 1.6),
            ('max_effort', 'of a crank, by crank_state: a larger one stops; 0: none', 0.0, 1e6),
            ('rephase', 'part of its rate by which a crank returns to its phase', 0.0, 0.5),
            ('motion_gain', 'of the feedback of the measured motion; 0: none [1/s]', 0.0, 5.0),
            ('phase_gain', 'proportional gain of the phase lock [1/s]', 0.0, 100.0),
            ('phase_integral', 'integral gain of the phase lock [1/s^2]', 0.0, 100.0),
        )
    ),
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
    *(
        number(name, getattr(_NOISE, name), what, least, most)
        for name, what, least, most in (
            ('friction', 'friction coefficient of the feet', 0.01, 10.0),
            ('stiction_speed', 'of feet that stick; 0.05 on soft ground [m/s]', 1e-5, 1.0),
            ('accelerometer_noise', 'density of the noise [m/s^2/sqrt(Hz)]', 1e-6, 10.0),
            ('gyro_noise', 'density of the noise [rad/s/sqrt(Hz)]', 1e-9, 1.0),
            ('accelerometer_bias', 'before standstill, standard deviation [m/s^2]', 1e-6, 10.0),
            ('gyro_bias', 'before standstill, standard deviation [rad/s]', 1e-9, 1.0),
            ('accelerometer_drift', 'random walk of the bias [m/s^2/sqrt(s)]', 0.0, 1.0),
            ('gyro_drift', 'random walk of the bias [rad/s/sqrt(s)]', 0.0, 1.0),
            ('standstill_yaw_rate', 'of feet that creep at standstill [rad/s]', 0.0, 1.0),
            ('heading_error', 'standard deviation of a yaw without covariance [rad]', 0.0, 3.2),
            ('advance_error', 'relative error of the advance', 0.0, 10.0),
            ('slip_error', 'error relative to the slip of the feet', 0.0, 10.0),
            (
                'slip_yaw_error',
                'of the yaw at the reach of the feet, relative to the slip',
                0.0,
                10.0,
            ),
            ('contact_error', 'relative to least squares minus friction law', 0.0, 10.0),
            ('height_error', 'standard deviation of the height [m]', 0.0, 10.0),
            ('tilt_error', 'standard deviation of roll and pitch [rad]', 1e-6, 3.2),
        )
    ),
    number('diagnostics_period', 1.0, 'time between diagnostics [s]', 0.01, 3600.0),
)
WALKER_PARAMETERS = (*LIMITS, *CONTROL, *ODOMETRY)


def settings(values: Mapping[str, Any]) -> ControllerSettings:
    """Return the controller's settings."""
    limits = {p.name: values[p.name] for p in LIMITS}
    for name in ('max_curvature', 'max_linear_jerk', 'max_angular_jerk'):
        limits[name] = limits[name] or inf
    own = {
        each.name: values[each.name] for each in fields(ControllerSettings) if each.name in values
    }
    gap = max(_SETTINGS.max_gap, MIN_GAP_PERIODS / values['rate'])
    return ControllerSettings(limits=MotionLimits(**limits), max_gap=gap, **own)


def noise(values: Mapping[str, Any]) -> OdometryNoise:
    """Return the uncertainties of the odometry."""
    names = {field.name for field in fields(OdometryNoise)}
    return OdometryNoise(**{name: value for name, value in values.items() if name in names})
