"""Arguments of a node without effect, each reported with the nearest name that has one."""

from collections.abc import Collection, Iterator, Sequence
from itertools import islice, pairwise
from typing import Any

from klann_ros.sanitize import yaml_text
from klann_ros.sanitize.files import NotRegularFileError, open_regular, read_regular
from klann_ros.sanitize.text import printable
from rclpy.node import Node

from .parameters import MAX_NAME_LENGTH, overrides, unknown_parameter

# A file may hold any number of names.
MAX_LINES = 10
_MAX_NAMES = 5
# A longer file is not checked [bytes]; one of six legs has 3000.
_MAX_FILE_SIZE = 50_000


def unused_arguments(node: Node, executable: str, arguments: Sequence[str]) -> list[str]:
    """
    Return a line for each argument behind --ros-args that has no effect on a node.

    The node has declared all of its parameters. Nodes may share a parameter file, so a parameter
    of another node of this package is no mistake in a file; behind `-p` it is one.
    """
    rules = list(_behind(arguments, '-p', '--param'))
    files = list(_behind(arguments, '--params-file'))
    lines = [
        *islice(_unknown(node, executable, rules), MAX_LINES + 1),
        *islice(_for_others(node, rules), MAX_LINES + 1),
        *islice(_without_effect(node, files), MAX_LINES + 1),
    ]
    return lines if len(lines) <= MAX_LINES else [*lines[:MAX_LINES], '... and more of the kind']


def unreadable_params_file(arguments: Sequence[str]) -> str:
    """
    Return a line about the first parameter file that is no regular file; '' without one.

    For a pipe without a writer ROS would block for ever and ignore every signal.
    """
    for file in _behind(arguments, '--params-file'):
        # A shell's process substitution, as in `--params-file <(...)`, has a writer.
        if file.startswith(('/dev/fd/', '/proc/self/fd/')):
            continue
        try:
            open_regular(file).close()
        except NotRegularFileError as error:
            return f'{printable(file)} cannot be read: {error.strerror}'
        except (OSError, ValueError):
            continue  # ROS reports it
    return ''


def _behind(arguments: Sequence[str], *flags: str) -> Iterator[str]:
    return (value for flag, value in pairwise(arguments) if flag in flags)


def _unknown(node: Node, executable: str, rules: Sequence[str]) -> Iterator[str]:
    """Yield a line for each name, or each leg, that the node does not know."""
    names = sorted(name for name in overrides(node) if not node.has_parameter(name))
    if not names:
        return
    known = node.list_parameters([], 0).names
    families = {name.partition('.')[0] for name in known if '.' in name}
    typed = {rule.partition(':=')[0].rpartition(':')[2] for rule in rules}
    others = _OtherNodes()
    strangers: dict[str, list[str]] = {}
    for name in names:
        family, dot, _ = name.partition('.')
        if name not in typed and others.has(name, known):
            continue
        if dot and family not in families:
            strangers.setdefault(family, []).append(name)
        elif name in others.owners:
            yield f"parameter {name} is none of {executable}'s; it is {others.owners[name]}'s"
        else:
            yield unknown_parameter(name, executable, known)
    for family, group in strangers.items():
        why = f': {printable(family, MAX_NAME_LENGTH)} is not in legs' if 'legs' in known else ''
        yield f"{_listed(group)}: none of {executable}'s parameters{why}"


def _for_others(node: Node, rules: Sequence[str]) -> Iterator[str]:
    """Yield a line for each `-p NODE:NAME:=VALUE` for a node of another name."""
    for rule in rules:
        of, _, name = rule.partition(':=')[0].rpartition(':')
        if of and name not in overrides(node):
            full_name = node.get_fully_qualified_name()
            yield f'-p {printable(rule, MAX_NAME_LENGTH)} is not for {full_name}'


def _without_effect(node: Node, files: Sequence[str]) -> Iterator[str]:
    """Yield a line for each parameter file for nodes of other names, or without parameters."""
    for file in files:
        try:
            content = yaml_text.load(read_regular(file, _MAX_FILE_SIZE))
        except (OSError, ValueError):
            continue  # ROS has read it all the same
        names = set(_names(content))
        if not names:
            yield f'{printable(file)} holds no parameters (NODE: ros__parameters: NAME: VALUE)'
        elif names.isdisjoint(overrides(node)):
            sections, full_name = _listed([*map(str, content)]), node.get_fully_qualified_name()
            yield f'{printable(file)} has nothing for {full_name}; it is for {sections}'


def _names(content: Any) -> Iterator[str]:
    """Yield the names of the parameters of all nodes in a parameter file."""
    for key, value in content.items() if isinstance(content, dict) else ():
        yield from _flat(value, '') if key == 'ros__parameters' else _names(value)


def _flat(content: Any, prefix: str) -> Iterator[str]:
    for key, value in content.items() if isinstance(content, dict) else ():
        name = f'{prefix}{key}'
        if isinstance(value, dict):
            yield from _flat(value, f'{name}.')
        else:
            yield name


class _OtherNodes:
    """The parameters of all nodes of this package, imported only after a mistake."""

    def __init__(self) -> None:
        from .crank import motion as crank  # noqa: PLC0415
        from .player import controls as player  # noqa: PLC0415
        from .recorder import interface as recorder  # noqa: PLC0415
        from .sim import declarations as sim  # noqa: PLC0415
        from .solver import declarations as solver  # noqa: PLC0415
        from .walker import declarations as walker  # noqa: PLC0415

        own = {
            'player_node': player.declarations(1.0, 0.0, 0.0),
            'recorder_node': recorder.PARAMETERS,
            'walker_node': walker.PARAMETERS,
            'sim_node': sim.PARAMETERS,
            'crank_node': (*crank.MOTION, *crank.PARAMETERS),
            'solver_node': (
                *solver.GEOMETRY,
                *solver.LEGS,
                *solver.SETTINGS,
                *solver.drive(),
                *solver.PUBLISHED,
            ),
        }
        self.owners = {p.name: node for node, of_node in own.items() for p in of_node}
        self._of_legs, self._for_others = solver.OF_LEG, set(solver.FOR_OTHERS)
        self._topics = {topic.rpartition('/')[2] for topic in recorder.TOPICS}

    def has(self, name: str, known: Collection[str]) -> bool:
        """Return whether a file may hold a name for another node than one with `known`."""
        family, _, last = name.rpartition('.')
        if family.startswith('qos_overrides./'):
            is_of_others = not any(other.startswith(f'{family}.') for other in known)
            return is_of_others and family.rpartition('.')[0].rpartition('/')[2] in self._topics
        if family and 'legs' not in known and last in self._of_legs:
            return True
        return name in self.owners or last in self._for_others


def _listed(names: Sequence[str]) -> str:
    shown = ', '.join(printable(name, MAX_NAME_LENGTH) for name in names[:_MAX_NAMES])
    return f'{shown} and {len(names) - _MAX_NAMES} more' if len(names) > _MAX_NAMES else shown
