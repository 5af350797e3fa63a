"""A robot from the parameters of a node, or from a solver's description."""

from typing import Any

from klann_ros.log import described_solver, DESCRIPTION_TOPIC, LINKAGE_PARAMETER
from klann_ros.robot import Robot, robot_from_parameters
from klann_ros.sanitize.text import printable_line
from rclpy.node import Node
from rclpy.wait_for_message import wait_for_message
from std_msgs.msg import String

from .endpoints import LATCHED
from .leg_declarations import drive, FOR_OTHERS, GEOMETRY_NAMES, LEGS, OF_LEG
from .parameters import declare_given, overrides, parameter_folders, plain, StartError

_OF_ALL = {*GEOMETRY_NAMES, *FOR_OTHERS, LINKAGE_PARAMETER}
_OF_ROBOT = _OF_ALL | {parameter.name for parameter in (*LEGS, *drive())}
_OF_NAMED_LEG = _OF_ALL | OF_LEG
# Discovery of a running solver [s].
_DESCRIPTION_TIMEOUT = 5.0


def declared_robot(node: Node, *, described: bool = False) -> Robot:
    """
    Declare the given parameters of a robot, read-only, and return the robot, or a StartError.

    `described`: wait for a solver's leg_description where no robot is given.
    """
    legs = plain(overrides(node)['legs'].value) if 'legs' in overrides(node) else ()
    leg_names = {str(leg) for leg in legs} if isinstance(legs, list) else set()
    parameters = {}
    for name, parameter in sorted(overrides(node).items()):
        family, _, last = name.rpartition('.')
        is_of_leg = family in leg_names and last in _OF_NAMED_LEG
        if name in _OF_ROBOT or is_of_leg or name.startswith('cranks.'):
            parameters[name] = plain(parameter.value)
    declare_given(node, parameters, 'of the robot: see solver_node --help')
    source = 'the parameters are'
    if not parameters and described:
        parameters = _described_parameters(node)
        source = f'{DESCRIPTION_TOPIC} is'
    if not parameters:
        nor = f', nor by {DESCRIPTION_TOPIC}' * described
        raise StartError(
            f'no robot is given{nor}: --ros-args --params-file FILE, such as '
            'share/klann_ros/config/walker6_two_motors.yaml'
        )
    try:
        return robot_from_parameters(parameters, folders=parameter_folders())
    except (ValueError, TypeError, OSError) as error:
        raise StartError(f'{source} no robot: {printable_line(error)}') from error


def _described_parameters(node: Node) -> dict[str, Any]:
    """Return the parameters in a solver's description (untrusted); none before the timeout."""
    node.get_logger().info(f'waiting for {node.resolve_topic_name(DESCRIPTION_TOPIC)}')
    is_received, message = wait_for_message(
        String, node, DESCRIPTION_TOPIC, qos_profile=LATCHED, time_to_wait=_DESCRIPTION_TIMEOUT
    )
    try:
        return described_solver(message.data, 0).without_files if is_received else {}
    except ValueError as error:
        raise StartError(str(error)) from error
