"""Parameters: declared with description and unit, refused with the reason."""

from collections.abc import Sequence
from dataclasses import dataclass, KW_ONLY
import json
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
    limits : tuple of float, optional
        The least and the greatest value.
    choices : sequence of str
        The only values, where there are any.
    constraint : str
        What its value must be, in words, where neither limits nor choices say it.
    read_only : bool
        Whether it can only be given at start.
    any_number : bool
        Whether an integer and a double are taken alike.

    """

    name: str
    default: Any
    description: str
    _: KW_ONLY
    limits: tuple[float, float] | None = None
    choices: Sequence[str] = ()
    constraint: str = ''
    read_only: bool = True
    any_number: bool = False

    @property
    def allowed(self) -> str:
        """Return what its value must be, in words."""
        if self.limits is not None:
            least, most = self.limits
            return f'within {least:g} .. {most:g}'
        return f'one of {", ".join(self.choices)}' if self.choices else self.constraint

    def allows(self, value: Any) -> bool:
        """Return whether limits and choices allow a value; NaN is within no limits."""
        if self.limits is not None:
            return bool(self.limits[0] <= value <= self.limits[1])
        return not self.choices or value in self.choices

    def refusal(self, value: Any) -> str:
        """Return why a value of the right type is refused; '' if it is not."""
        if self.any_number and (isinstance(value, bool) or not isinstance(value, int | float)):
            return f'parameter {self.name} must be a number'
        if not self.allows(value):
            return f'{self.name} = {value!r} is refused: it must be {self.allowed}'
        return ''


def declare(node: Node, parameters: Sequence[Declared]) -> dict[str, Any]:
    """
    Declare parameters and return their values by name.

    Raises
    ------
    StartError
        A value has the wrong type, or is not allowed; the text says what would be right.

    """
    return {parameter.name: _declare(node, parameter) for parameter in parameters}


def declare_constant(node: Node, name: str, value: str, description: str) -> None:
    """Declare what a node tells of itself and nobody else may set."""
    descriptor = ParameterDescriptor(description=description, read_only=True)
    node.declare_parameter(name, value, descriptor, ignore_override=True)


def usage(parameters: Sequence[Declared]) -> str:
    """Return the part of an executable's help that tells its parameters."""
    lines = [f'  {p.name} ({json.dumps(p.default)}): {p.description}' for p in parameters]
    return '\n'.join(['Parameters are given as --ros-args -p NAME:=VALUE:', *lines])


def _declare(node: Node, parameter: Declared) -> Any:
    descriptor = ParameterDescriptor(
        description=parameter.description,
        additional_constraints=parameter.allowed,
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
    if value is None:
        msg = f'parameter {parameter.name} has no value'
        raise StartError(msg)
    reason = parameter.refusal(value)
    if reason:
        raise StartError(reason)
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
