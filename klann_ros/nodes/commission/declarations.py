"""The parameters of `commission_node`, besides those of its robot."""

from dataclasses import replace

from klann_ros.nodes.crank_output import COMMAND_TYPE
from klann_ros.nodes.leg_declarations import ENCODERS
from klann_ros.nodes.parameters import number
from klann_ros.walker import CommissioningSettings

_SETTINGS = CommissioningSettings()
COMMISSION_PARAMETERS = (
    *ENCODERS,
    number('angle', round(_SETTINGS.angle, 4), 'each crank turns so far [rad]', 0.02, 0.6),
    number('rate', _SETTINGS.rate, 'so fast [rad/s]', 0.02, 1.0),
    number(
        'max_angle',
        round(_SETTINGS.max_angle, 4),
        'a turn ends where an encoder turns by more [rad]',
        0.02,
        1000.0,
    ),
    number('feedback_timeout', _SETTINGS.timeout, 'or is silent for longer [s]', 0.05, 5.0),
    replace(COMMAND_TYPE, description='type of crank_command, as of walker_node'),
)
