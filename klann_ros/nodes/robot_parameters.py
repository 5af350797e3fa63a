"""The robot that a node's parameters tell: those of solver_node, and what all weighs."""

from collections.abc import Iterator, Mapping
from typing import Any

from klann_ros.log.run_parameters import LINKAGE_PARAMETER
from klann_ros.robot import Robot, robot_from_parameters
from klann_ros.sanitize.text import printable_line
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from .parameters import overrides, parameter_folders, plain, StartError
from .solver import declarations as solver

_OF_ROBOT = frozenset(
    (
        *solver.GEOMETRY_NAMES,
        *solver.FOR_OTHERS,
        LINKAGE_PARAMETER,
        *(p.name for p in (*solver.LEGS, *solver.drive())),
    )
)
_OF_LEG = frozenset(
    (
        *solver.GEOMETRY_NAMES,
        *solver.FOR_OTHERS,
        LINKAGE_PARAMETER,
        *(p.name.partition('.')[2] for p in (*solver.drive('LEG.'), *solver.place('LEG'))),
    )
)


def declared_robot(node: Node) -> Robot:
    """
    Declare what a node is given of a robot, read-only, and return the robot.

    Raises
    ------
    StartError
        It is none; the text says why.

    """
    given = dict(_given(node))
    descriptor = ParameterDescriptor(
        description='of the robot: see solver_node --help', read_only=True, dynamic_typing=True
    )
    for name in given:
        node.declare_parameter(name, descriptor=descriptor)
    if not given:
        raise StartError(
            'no robot is given: --ros-args --params-file FILE, such as '
            'share/klann_ros/config/walker6_two_motors.yaml'
        )
    try:
        return robot_from_parameters(given, folders=parameter_folders())
    except (ValueError, TypeError, OSError) as error:
        raise StartError(f'the parameters are no robot: {printable_line(error)}') from error


def _given(node: Node) -> Iterator[tuple[str, Any]]:
    """Yield the parameters of the robot that are set."""
    parameters: Mapping[str, Any] = overrides(node)
    legs = parameters['legs'].value if 'legs' in parameters else ()
    names = {str(leg) for leg in legs} if isinstance(legs, list | tuple) else set()
    for name, parameter in sorted(parameters.items()):
        family, _, last = name.rpartition('.')
        if name in _OF_ROBOT or (family in names and last in _OF_LEG):
            yield name, plain(parameter.value)
