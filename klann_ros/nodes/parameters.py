"""Parameters: declared with description and unit, refused with the reason."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.node import Node
from rclpy.parameter import Parameter

from .process import StartError


@dataclass(frozen=True)
class Declared:
    """
    A parameter as it is declared.

    Attributes
    ----------
    name : str
        Its name.
    default : object
        Its default, which fixes its type.
    description : str
        What it is, with the unit in brackets.
    constraint : str
        What its value must be, in words.
    read_only : bool
        Whether it can only be given at start.
    any_number : bool
        Whether an integer and a double are taken alike.

    """

    name: str
    default: Any
    description: str
    constraint: str = ''
    read_only: bool = True
    any_number: bool = False


def declare(node: Node, parameters: Sequence[Declared]) -> dict[str, Any]:
    """
    Declare parameters and return their values by name.

    Raises
    ------
    StartError
        A value has the wrong type; the text says which would be right.

    """
    return {parameter.name: _declare(node, parameter) for parameter in parameters}


def _declare(node: Node, parameter: Declared) -> Any:
    descriptor = ParameterDescriptor(
        description=parameter.description,
        additional_constraints=parameter.constraint,
        read_only=parameter.read_only,
        dynamic_typing=parameter.any_number,
    )
    try:
        value = node.declare_parameter(parameter.name, parameter.default, descriptor).value
    except InvalidParameterTypeException as error:
        kind = Parameter.Type.from_parameter_value(parameter.default).name.lower()
        hint = ' (write 1.0, not 1)' if kind == 'double' else ''
        msg = f'parameter {parameter.name} must be of type {kind}{hint}'
        raise StartError(msg) from error
    if parameter.any_number and (isinstance(value, bool) or not isinstance(value, int | float)):
        msg = f'parameter {parameter.name} must be a number'
        raise StartError(msg)
    if value is None:
        msg = f'parameter {parameter.name} has no value'
        raise StartError(msg)
    return list(value) if isinstance(parameter.default, list) else value


def must(condition: bool, name: str, value: Any, what: str) -> None:
    """
    Refuse a parameter at start.

    Raises
    ------
    StartError
        The condition does not hold.

    """
    if not condition:
        msg = f'{name} = {value!r} is refused: it must be {what}'
        raise StartError(msg)


def must_be_within(name: str, value: float, least: float, most: float) -> None:
    """
    Refuse a parameter that is not within limits.

    Raises
    ------
    StartError
        It is not, or it is no number.

    """
    must(least <= value <= most, name, value, f'within {least:g} .. {most:g}')
