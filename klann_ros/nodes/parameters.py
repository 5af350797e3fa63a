"""Parameters: declared with description and unit, refused with the reason."""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, KW_ONLY
from functools import partial
from itertools import pairwise
import json
from pathlib import Path
import sys
from typing import Any

from klann_ros.sanitize.text import printable, refusal
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import get_parameter_value, Parameter
import yaml

# Maximum lengths in messages of a refused value and of an unknown name [characters].
_MAX_VALUE_LENGTH = 100
MAX_NAME_LENGTH = 100


class StartError(Exception):
    """A refused start of a node; its text is the one line that the user reads."""


class UnknownParameterError(ParameterNotDeclaredException):
    """A set of an unknown parameter; rclpy answers with the text of this error."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._text = text

    def __str__(self) -> str:
        return self._text


@dataclass(frozen=True)
class Declaration:
    """A parameter as a node declares it."""

    name: str
    default: Any
    # What it sets, with the unit in brackets.
    description: str
    _: KW_ONLY
    limits: tuple[float, float] | None = None
    # The only values, where there are any.
    choices: Sequence[str] = ()
    # The condition on its value, in words, where neither limits nor choices give it.
    constraint: str = ''
    read_only: bool = True

    @property
    def allowed(self) -> str:
        """Return the condition on its value, in words."""
        if self.limits is not None:
            lower, upper = self.limits
            return f'within {lower:g} .. {upper:g}'
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
        """Return the reason for refusing a value of the right type; '' to accept it."""
        return '' if self.allows(value) else refusal(self.name, value, self.allowed)


def number(
    name: str, default: float, text: str, lower: float, upper: float, *, read_only: bool = True
) -> Declaration:
    """Return the declaration of a number within limits."""
    return Declaration(name, default, text, limits=(lower, upper), read_only=read_only)


def require(condition: bool, name: str, value: Any, requirement: str) -> None:
    """Refuse a parameter at start with a StartError where the condition does not hold."""
    if not condition:
        raise StartError(refusal(name, value, requirement))


def declare(node: Node, parameters: Sequence[Declaration]) -> dict[str, Any]:
    """Declare parameters, return their values by name; a StartError names the right value."""
    return {parameter.name: _declare(node, parameter) for parameter in parameters}


def declare_constant(node: Node, name: str, value: Any, description: str) -> None:
    """Declare a read-only parameter that describes the node."""
    descriptor = ParameterDescriptor(description=description, read_only=True)
    node.declare_parameter(name, value, descriptor, ignore_override=True)


def declare_given(node: Node, names: Collection[str], description: str) -> None:
    """Declare those of these parameters that were given, of any type, for other nodes to read."""
    descriptor = ParameterDescriptor(description=description, read_only=True, dynamic_typing=True)
    for name in names:
        override = overrides(node).get(name)
        if override is not None and not node.has_parameter(name):
            node.declare_parameter(name, override.value, descriptor)


def parameter_folders() -> tuple[Path, ...]:
    """Return the folders of this process's parameter files, the last file's first."""
    files = [file for flag, file in pairwise(sys.argv) if flag == '--params-file']
    return tuple(dict.fromkeys(Path(file).parent for file in reversed(files)))


def plain(value: Any) -> Any:
    """Return a parameter's value, a sequence as a list."""
    is_array = not isinstance(value, str | bytes) and hasattr(value, '__len__')
    return list(value) if is_array else value


def overrides(node: Node) -> Mapping[str, Parameter]:
    """Return a node's parameters from the command line and files, declared or not."""
    # rclpy reports declared parameters only.
    parameters: Mapping[str, Parameter] = getattr(node, '_parameter_overrides', {})
    return parameters


def unknown_parameter(name: str, executable: str, declared_names: Collection[str]) -> str:
    """Return a line about an unknown name, with the nearest declared one."""
    nearest_name = _nearest_name(name, declared_names)
    hint = f'did you mean {nearest_name}?' if nearest_name else f'{executable} --help lists them'
    return f"parameter {printable(name, MAX_NAME_LENGTH)} is none of {executable}'s; {hint}"


def on_change(
    node: Node, declarations: Sequence[Declaration], apply: Callable[[dict[str, Any]], None]
) -> None:
    """Validate declared parameters that are set at run time, then apply the new values by name."""
    tunable = {declared.name: declared for declared in declarations if not declared.read_only}

    def validate(parameters: Sequence[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            declaration = tunable.get(parameter.name)
            reason = declaration.refusal(parameter.value) if declaration else ''
            if reason:
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def apply_set(parameters: Sequence[Parameter]) -> None:
        values = {p.name: p.value for p in parameters if p.name in tunable}
        if values:
            apply(values)

    node.add_on_set_parameters_callback(validate)
    node.add_post_set_parameters_callback(apply_set)


def prepare_sets(node: Node, executable: str) -> None:
    """
    Make a node accept `ros2 param set` and `ros2 param load`.

    A read-only parameter may be set to its present value, a number takes the type of its parameter
    where nothing is lost, and an unknown name is answered with the nearest one. The node has no
    pre-set callback of its own, as rclpy would add up the results of both.
    """
    node.add_pre_set_parameters_callback(partial(_convert_to_declared, node, executable))
    set_changed = node.set_parameters_atomically

    def set_parameters(parameters: list[Parameter]) -> SetParametersResult:
        changed = [p for p in parameters if not _is_unchanged_constant(node, p)]
        if parameters and not changed:
            return SetParametersResult(successful=True)
        return set_changed(changed)

    # No callback can do it: rclpy refuses read-only parameters before it calls any, and a list
    # emptied by the pre-set callback.
    node.set_parameters_atomically = set_parameters


def usage(groups: Mapping[str, Sequence[Declaration]]) -> str:
    """Return the parameters' part of an executable's help, group by group."""
    lines = ['Parameters are given as --ros-args -p NAME:=VALUE or --ros-args --params-file FILE:']
    for title, parameters in groups.items():
        lines += [f' {title}:' if title else '', *(parameter.line for parameter in parameters)]
    return '\n'.join(filter(None, lines))


def _declare(node: Node, parameter: Declaration) -> Any:
    """Declare a parameter; return its value, or raise a StartError for an invalid one."""
    name = parameter.name
    value = parameter.default
    if name in overrides(node):
        value = _in_type_of(plain(overrides(node)[name].value), parameter.default)
        if value is None:
            raise StartError(f'parameter {name} has no value')
        required_type = Parameter.Type.from_parameter_value(parameter.default)
        if Parameter.Type.from_parameter_value(value) != required_type:
            remedy = _likely_meaning(value, parameter.default)
            hint = ''
            if remedy is not None:
                hint = f' (write {_value_text(remedy)}, not {_value_text(value)})'
            type_name = required_type.name.lower()
            raise StartError(f'parameter {name} must be of type {type_name}{hint}')
    reason = parameter.refusal(value)
    if reason:
        raise StartError(reason)
    descriptor = ParameterDescriptor(
        description=parameter.description,
        additional_constraints=parameter.allowed,
        read_only=parameter.read_only,
    )
    node.declare_parameter(name, value, descriptor, ignore_override=True)
    return value


def _in_type_of(value: Any, default: Any) -> Any:
    """Return numbers in the type of a default, where nothing is lost; else the value."""
    if isinstance(default, list) and default and isinstance(value, list):
        return [_in_type_of(number, default[0]) for number in value]
    if type(value) is int and isinstance(default, float):
        return float(value)
    if isinstance(value, float) and type(default) is int and value.is_integer():
        return int(value)
    return value


def _likely_meaning(value: Any, default: Any) -> Any:
    """Return the most likely meaning of a value of the wrong type; None if unknown."""
    if isinstance(default, list):
        members = value if isinstance(value, list) else [value]
        meanings = [_likely_meaning(member, default[0]) for member in members]
        return None if None in meanings else meanings
    if type(value) is type(default):
        return value
    is_text = isinstance(default, str) and not isinstance(value, list)
    return f'"\'{value}\'"' if is_text else None


def _value_text(value: Any) -> str:
    is_list = isinstance(value, Sequence) and not isinstance(value, str)
    return printable(f'[{", ".join(map(str, value))}]' if is_list else value, _MAX_VALUE_LENGTH)


def _convert_to_declared(
    node: Node, executable: str, parameters: Sequence[Parameter]
) -> list[Parameter]:
    """Return parameters in the types of the declared ones; refuse unknown names."""
    for parameter in parameters:
        if not node.has_parameter(parameter.name):
            names = node.list_parameters([], 0).names
            raise UnknownParameterError(unknown_parameter(parameter.name, executable, names))
    return [_with_declared_type(node, parameter) for parameter in parameters]


def _with_declared_type(node: Node, parameter: Parameter) -> Parameter:
    present_value = plain(node.get_parameter(parameter.name).value)
    value = plain(parameter.value)
    # YAML takes 1e-12 for a text.
    if isinstance(present_value, float) and isinstance(value, str):
        with suppress(ValueError):
            value = float(value)
    value = _in_type_of(value, present_value)
    return parameter if value is None else Parameter(parameter.name, value=value)


def _is_unchanged_constant(node: Node, parameter: Parameter) -> bool:
    """Return whether a parameter is read-only, and is set to its present value."""
    name = parameter.name
    if not node.has_parameter(name) or not node.describe_parameter(name).read_only:
        return False
    present_value = plain(node.get_parameter(name).value)
    value = plain(parameter.value)
    if present_value == value and isinstance(present_value, bool) == isinstance(value, bool):
        return True
    # `ros2 param load` parses the text that `ros2 param dump` has written.
    try:
        return bool(get_parameter_value(str(present_value)) == parameter.get_parameter_value())
    except (yaml.YAMLError, AssertionError):
        return False


def _nearest_name(name: str, declared_names: Collection[str]) -> str:
    """Return the declared name that was most likely meant; '' if none is near."""
    from difflib import get_close_matches  # noqa: PLC0415 - only mistakes need it

    family, dot, _ = name[: 2 * MAX_NAME_LENGTH].rpartition('.')
    siblings = [n for n in declared_names if dot and n.rpartition('.')[0] == family]
    # The siblings' common prefix does not distinguish them.
    start = len(family) + 1 if siblings else 0
    full_names = {n[start:]: n for n in siblings or declared_names}
    matches = get_close_matches(name[start:][:MAX_NAME_LENGTH], full_names, n=1)
    return full_names[matches[0]] if matches else ''
