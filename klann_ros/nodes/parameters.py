"""Parameters: declared with description and unit, refused with the reason."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, KW_ONLY
from difflib import get_close_matches
from functools import partial
import json
from typing import Any

from klann_ros.untrusted.text import printable
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter

# Of a value that is refused, and of a name that is none [characters].
LONGEST_VALUE = LONGEST_NAME = 100


class StartError(Exception):
    """What a node cannot start with; its text is the one line that the user reads."""


class UnknownParameterError(ParameterNotDeclaredException):
    """Somebody sets what is no parameter; rclpy answers with this error's text."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._text = text

    def __str__(self) -> str:
        return self._text


@dataclass(frozen=True)
class Declaration:
    """A parameter as a node declares it."""

    # Its name.
    name: str
    # Its default, which fixes its type.
    default: Any
    # What it is, with the unit in brackets.
    description: str
    _: KW_ONLY
    # The least and the greatest value.
    limits: tuple[float, float] | None = None
    # The only values, where there are any.
    choices: Sequence[str] = ()
    # What its value must be, in words, where neither limits nor choices say it.
    constraint: str = ''
    # Whether it can only be given at start.
    read_only: bool = True
    # Whether an integer and a double are taken alike; where the default is a double, it is held as
    # one.
    any_number: bool = False

    @property
    def allowed(self) -> str:
        """Return what its value must be, in words."""
        if self.limits is not None:
            least, most = self.limits
            return f'within {least:g} .. {most:g}'
        return f'one of {", ".join(self.choices)}' if self.choices else self.constraint

    @property
    def line(self) -> str:
        """Return its line in an executable's help."""
        choices = f': {", ".join(self.choices)}' if self.choices else ''
        return f'  {self.name} ({json.dumps(self.default)}): {self.description}{choices}'

    def allows(self, value: Any) -> bool:
        """Return whether limits and choices allow a value; NaN is within no limits."""
        if self.limits is not None:
            return bool(self.limits[0] <= value <= self.limits[1])
        return not self.choices or value in self.choices

    def refusal(self, value: Any) -> str:
        """Return why a value of the right type is refused; '' if it is not."""
        if self.any_number and (isinstance(value, bool) or not isinstance(value, int | float)):
            return f'parameter {self.name} must be a number'
        return '' if self.allows(value) else refusal(self.name, value, self.allowed)


def refusal(name: str, value: Any, what: str) -> str:
    """Return the line that says that a value is refused, and what it must be."""
    return f'{name} = {printable(repr(value), LONGEST_VALUE)} is refused: it must be {what}'


def must(condition: bool, name: str, value: Any, what: str) -> None:
    """Refuse a parameter at start with a StartError where the condition does not hold."""
    if not condition:
        raise StartError(refusal(name, value, what))


def declare(node: Node, parameters: Sequence[Declaration]) -> dict[str, Any]:
    """Declare parameters, return their values by name; a StartError tells what would be right."""
    return {parameter.name: _declare(node, parameter) for parameter in parameters}


def declare_constant(node: Node, name: str, value: Any, description: str) -> None:
    """Declare what a node tells of itself and nobody else may set."""
    descriptor = ParameterDescriptor(description=description, read_only=True)
    node.declare_parameter(name, value, descriptor, ignore_override=True)


def declare_given(node: Node, names: Collection[str], description: str) -> None:
    """Declare those parameters that are given, whatever they are: others ask the node for them."""
    descriptor = ParameterDescriptor(description=description, read_only=True, dynamic_typing=True)
    for name in names:
        given = overrides(node).get(name)
        if given is not None and not node.has_parameter(name):
            node.declare_parameter(name, given.value, descriptor)


def overrides(node: Node) -> Mapping[str, Parameter]:
    """Return what the command line and parameter files give a node, whether declared or not."""
    # rclpy tells of those only that are declared. Without this no more than that is told.
    given: Mapping[str, Parameter] = getattr(node, '_parameter_overrides', {})
    return given


def unknown_parameter(name: str, executable: str, known: Collection[str]) -> str:
    """Return a line about a name that is no parameter."""
    near = _nearest(name, known)
    hint = f'did you mean {near}?' if near else f'{executable} --help lists them'
    return f"parameter {printable(name, LONGEST_NAME)} is none of {executable}'s; {hint}"


def look_at_sets(node: Node, executable: str) -> None:
    """
    Have a node tell the nearest name of a parameter that it has not, and hold doubles as doubles.

    Parameters
    ----------
    node : rclpy.node.Node
        The node; it has no such callback of its own, as rclpy would add up what both return.
    executable : str
        What users know it by.

    """
    node.add_pre_set_parameters_callback(partial(_as_held, node, executable))


def usage(groups: Mapping[str, Sequence[Declaration]]) -> str:
    """Return the part of an executable's help that tells its parameters, group by group."""
    lines = ['Parameters are given as --ros-args -p NAME:=VALUE or --ros-args --params-file FILE:']
    for title, parameters in groups.items():
        lines += [f' {title}:' if title else '', *(parameter.line for parameter in parameters)]
    return '\n'.join(filter(None, lines))


def _declare(node: Node, parameter: Declaration) -> Any:
    # What is read only cannot be declared anew, as a number may have to be.
    first = _descriptor(parameter, read_only=parameter.read_only and not parameter.any_number)
    try:
        value = node.declare_parameter(parameter.name, parameter.default, first).value
    except InvalidParameterTypeException as error:
        raise StartError(_wrong_type(node, parameter)) from error
    if value is None:
        raise StartError(f'parameter {parameter.name} has no value')
    reason = parameter.refusal(value)
    if reason:
        raise StartError(reason)
    if parameter.any_number:
        value = float(value) if isinstance(parameter.default, float) else value
        final = _descriptor(parameter, read_only=parameter.read_only)
        node.undeclare_parameter(parameter.name)
        node.declare_parameter(parameter.name, value, final, ignore_override=True)
    return list(value) if isinstance(parameter.default, list) else value


def _descriptor(parameter: Declaration, *, read_only: bool) -> ParameterDescriptor:
    return ParameterDescriptor(
        description=parameter.description,
        additional_constraints=parameter.allowed,
        read_only=read_only,
        dynamic_typing=parameter.any_number,
    )


def _wrong_type(node: Node, parameter: Declaration) -> str:
    kind = Parameter.Type.from_parameter_value(parameter.default).name.lower()
    wrong = overrides(node)[parameter.name].value if parameter.name in overrides(node) else None
    right = _meant(wrong, parameter.default)
    hint = '' if right is None else f' (write {_shown(right)}, not {_shown(wrong)})'
    return f'parameter {parameter.name} must be of type {kind}{hint}'


def _meant(wrong: Any, default: Any) -> Any:
    """Return what a value of the wrong type was most likely meant to be; None if nobody knows."""
    if isinstance(default, list):
        values = wrong if isinstance(wrong, list) else [wrong]
        meant = [_meant(value, default[0]) for value in values]
        return None if None in meant else meant
    if type(wrong) is type(default):
        return wrong
    if isinstance(default, str):
        return None if isinstance(wrong, list | None) else f'"\'{wrong}\'"'
    if type(wrong) is int and isinstance(default, float):
        return float(wrong)
    if isinstance(wrong, float) and type(default) is int and wrong.is_integer():
        return int(wrong)
    return None


def _shown(value: Any) -> str:
    """Return a value as it is typed."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return printable(f'[{", ".join(map(str, value))}]', LONGEST_VALUE)
    return printable(value, LONGEST_VALUE)


def _as_held(node: Node, executable: str, parameters: Sequence[Parameter]) -> list[Parameter]:
    """Return parameters that somebody sets, integers as doubles where doubles are held."""
    for parameter in parameters:
        if not node.has_parameter(parameter.name):
            known = node.list_parameters([], 0).names
            raise UnknownParameterError(unknown_parameter(parameter.name, executable, known))
    return [
        Parameter(parameter.name, value=float(parameter.value))
        if parameter.type_ == Parameter.Type.INTEGER and _is_any_double(node, parameter.name)
        else parameter
        for parameter in parameters
    ]


def _is_any_double(node: Node, name: str) -> bool:
    """Return whether a parameter holds a double, and takes integers as well."""
    is_double = node.get_parameter(name).type_ == Parameter.Type.DOUBLE
    return is_double and bool(node.describe_parameter(name).dynamic_typing)


def _nearest(name: str, known: Collection[str]) -> str:
    """Return the known name that was most likely meant; '' if none is near."""
    family, dot, _ = name[: 2 * LONGEST_NAME].rpartition('.')
    siblings = [other for other in known if dot and other.rpartition('.')[0] == family]
    # What all siblings begin with says nothing of which one is meant.
    start = len(family) + 1 if siblings else 0
    candidates = {other[start:]: other for other in siblings or known}
    near = get_close_matches(name[start:][:LONGEST_NAME], candidates, n=1)
    return candidates[near[0]] if near else ''
