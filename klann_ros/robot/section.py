"""The section of a ROS 2 parameter file that defines a robot."""

from collections.abc import Iterator, Mapping
import re
from typing import Any

from klann_ros.kinematics.klann.geometry import NUMBERS
from klann_ros.sanitize.text import printable

_NODE = '/solver_node'
_PARAMETERS = 'ros__parameters'
# What defines a robot, and is in no other node's section.
_OF_ROBOT = {*NUMBERS, 'assembly', 'legs', 'linkage', 'linkage_description'}


def solver_section(content: Any) -> Mapping[str, Any]:
    """
    Return the parameters that a file gives to solver_node.

    ROS's own rule applies: every section that matches the node's full name, wildcards included,
    in the order of the file, the last value winning. The node is `/solver_node`, or the one
    solver_node of the file's sections where that is in a namespace. A file without any parameter
    for it may define the robot of one other node, such as sim_node. A file without sections is a
    mapping of parameters.

    Raises
    ------
    TypeError, ValueError
        The content is no mapping, or defines robots of several nodes.

    """
    if not isinstance(content, dict):
        msg = 'it must be a mapping, such as config/sem104.yaml is'
        raise TypeError(msg)
    sections = list(_sections(content, ''))
    if not sections:
        return content
    plain = dict.fromkeys(name for name, _ in sections if '*' not in name)
    own = [name for name in plain if name.endswith(_NODE)] or [_NODE]
    candidates = {name: _given(sections, name) for name in own}
    if not any(map(_is_robot, candidates.values())):
        others = {name: _given(sections, name) for name in plain}
        candidates = {name: given for name, given in others.items() if _is_robot(given)}
    robots = list(candidates.values())
    if any(robot != robots[0] for robot in robots):
        names = printable(', '.join(candidates), 200)
        raise ValueError(f'it defines several robots, {names}: write one file for each')
    return robots[0] if robots else {}


def _sections(content: Mapping[Any, Any], prefix: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield each section's full name and parameters; namespaces may be nested."""
    for key, value in content.items():
        name = f'{prefix}/{str(key).strip("/")}'
        if not isinstance(value, dict):
            continue
        if isinstance(value.get(_PARAMETERS), dict):
            yield name, value[_PARAMETERS]
        yield from _sections({k: v for k, v in value.items() if k != _PARAMETERS}, name)


def _given(sections: list[tuple[str, Mapping[str, Any]]], node: str) -> dict[str, Any]:
    """Return the parameters of a node by its full name."""
    given: dict[str, Any] = {}
    for name, parameters in sections:
        tokens = {'**': r'(/[^/]+)*', '*': r'/[^/]+'}
        pattern = ''.join(tokens.get(t, re.escape(f'/{t}')) for t in name.split('/')[1:])
        if re.fullmatch(pattern, node):
            _merge(given, parameters)
    return given


def _merge(given: dict[str, Any], other: Mapping[str, Any]) -> None:
    for name, value in other.items():
        if isinstance(value, dict) and isinstance(given.get(name), dict):
            given[name] = dict(given[name])
            _merge(given[name], value)
        else:
            given[name] = value


def _is_robot(parameters: Mapping[str, Any]) -> bool:
    return not _OF_ROBOT.isdisjoint(parameters)
