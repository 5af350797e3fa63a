"""The robot of parameters of solver_node, of a linkage's file, or of a shipped name."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from math import isfinite
from pathlib import Path
import re
from typing import Any

from klann_ros.dynamics import (
    ASSUMED_DENSITY,
    MassError,
    Masses,
    masses_from_text,
    rods,
    with_foot,
)
from klann_ros.kinematics import (
    GeometryError,
    is_linkage,
    KlannGeometry,
    Linkage,
    linkage_from_text,
    linkage_text,
    LinkageFileError,
    NUMBERS,
    PRESETS,
    SHIPPED,
    shipped_linkages,
)
from klann_ros.kinematics.angles import TURN
from klann_ros.sanitize.files import is_regular_file, read_regular, with_home
from klann_ros.sanitize.text import did_you_mean, printable, printable_line, refusal
from klann_ros.sanitize.units import warn_of_angle, warn_of_lengths
from klann_ros.sanitize.yaml_text import MAX_FILE_SIZE, parse

from .robot import CrankDrive, Mount, Robot, RobotLeg, Triple, WalkerBody

_GEOMETRY = (*NUMBERS, 'assembly')
_DESCRIPTION = 'linkage_description'
LEG_PARAMETERS = (*_GEOMETRY, 'linkage', _DESCRIPTION)
"""Parameters that define the bars of a leg."""

_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')
_SOLVER_NODE = '/solver_node'
_PARAMETERS = 'ros__parameters'
# Parameters that define a robot, in no other node's section.
_OF_ROBOT = {*NUMBERS, 'assembly', 'legs', 'linkage', 'linkage_description'}
# Keys of a crank joint, `cranks.JOINT.KEY`.
OF_CRANK = tuple(field.name for field in fields(CrankDrive))
# Sections of a parameter file, characters of a name in ROS, and legs of a robot.
_MAX_SECTIONS, _MAX_NAME, _MAX_LEGS = 200, 255, 100


class RobotFileError(ValueError):
    """A file without a valid robot; the text says why."""


def preset_names() -> tuple[str, ...]:
    """Return the names of the shipped legs."""
    return *PRESETS, *shipped_linkages()


def robot_of(name: str) -> Robot:
    """
    Return the robot in a file, or of a shipped name if there is no such file.

    Raises
    ------
    RobotFileError
        There is neither, or the file has no valid robot.

    """
    if not is_regular_file(name):
        if name in PRESETS:
            linkage = PRESETS[name]().linkage
            # Masses as in the parameter file of that name.
            masses = rods(linkage, ASSUMED_DENSITY).by_file
            return Robot(name, (RobotLeg('', linkage, masses=masses),), source=name)
        if name in shipped_linkages():
            return robot_from_file(str(SHIPPED / f'{name}.yaml'))
    return robot_from_file(name)


def robot_from_file(path: str | Path) -> Robot:
    """
    Return the robot in a YAML file: solver_node's parameters, a mapping of lengths, or a linkage.

    Raises
    ------
    RobotFileError
        The file cannot be read, or has no valid robot.

    """
    source = printable(str(path))
    try:
        return robot_from_text(read_regular(str(path), MAX_FILE_SIZE), path)
    except LinkageFileError as error:
        raise RobotFileError(str(error)) from error
    except OSError as error:
        hint = f'; shipped are {", ".join(preset_names())}' * isinstance(error, FileNotFoundError)
        raise RobotFileError(f'{source} cannot be read: {error.strerror}{hint}') from error
    except (ValueError, TypeError) as error:
        raise RobotFileError(f'{source} holds no robot: {printable_line(error)}') from error


def robot_from_text(text: str, path: str | Path) -> Robot:
    """
    Return the robot in the text of a YAML file, whose path names it.

    Raises
    ------
    TypeError, ValueError
        The text has no valid robot.

    """
    source = printable(str(path))
    document = parse(text)
    if is_linkage(document):
        linkage = linkage_from_text(text, str(path))
        masses = masses_from_text(text, linkage, str(path))
        leg = RobotLeg('', linkage, masses=masses, description=text)
        return Robot(Path(path).stem, (leg,), source=source)
    parameters = solver_parameters(document)
    robot = robot_from_parameters(parameters, folders=(Path(path).parent,))
    return replace(robot, name=Path(path).stem or robot.name, source=source)


def robot_from_parameters(
    parameters: Mapping[str, Any], *, folders: Sequence[Path] = (), weigh: bool = True
) -> Robot:
    """
    Return the robot of solver_node's parameters; others are ignored.

    Parameters
    ----------
    parameters : mapping of str
        Nested as in a file, or with dots as in a node.
    folders : sequence of path
        Folders of the parameter files, searched first for a linkage's file.
    weigh : bool
        Whether to read masses; otherwise invalid ones are ignored.

    Raises
    ------
    TypeError, ValueError
        They define no valid robot.

    """
    flat = _flat(parameters)
    names = _names(flat.get('legs', ()))
    drives = _drives(flat)
    legs = []
    joints = set()
    mount_lengths = {}
    for name in names:
        leg = _leg(name, of_leg(flat, name), folders, weigh=weigh)
        legs.append(replace(leg, drive=drives.get(leg.crank_joint, leg.drive)))
        joints.add(leg.crank_joint)
        mount_lengths[f'{name}.mount_xyz'.lstrip('.')] = max(leg.mount.xyz, key=abs)
    for joint in drives:
        if joint not in joints:
            hint = did_you_mean(joint, joints)
            raise ValueError(f'cranks.{printable(joint)}: no leg has this crank_joint{hint}')
    warn_of_lengths(mount_lengths)
    return Robot('robot', tuple(legs), _body(flat) if weigh else None)


def _drives(flat: Mapping[str, Any]) -> dict[str, CrankDrive]:
    """Return encoders and motors that are not as by default, by their joints."""
    drives: dict[str, CrankDrive] = {}
    for name in flat:
        family, _, joint_and_key = name.partition('.')
        joint, _, key = joint_and_key.rpartition('.')
        if family != 'cranks':
            continue
        if key not in OF_CRANK:
            raise ValueError(
                f'{printable(name)} is none of {", ".join(OF_CRANK)} of a crank joint'
            )
        number = _number(flat, name, 0.0)
        if number == 0.0 and key != 'zero':
            raise ValueError(refusal(name, number, 'a ratio, negative or positive, not 0'))
        drives[joint] = replace(drives.get(joint, CrankDrive()), **{key: number})
    return drives


def of_leg(parameters: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the parameters of a leg, with dots: its own override the common ones unless ''."""
    leg_parameters = dict(parameters)
    prefix = f'{name}.'
    for key, parameter in parameters.items():
        if name and key.startswith(prefix) and parameter != '':
            leg_parameters[key.removeprefix(prefix)] = parameter
    return leg_parameters


def _check_length(name: str) -> None:
    """Refuse a longer name than ROS has: of many nested ones, each is as long as all before."""
    if len(name) > _MAX_NAME:
        raise ValueError(f'{printable(name, 100)} is no name in ROS')


def _flat(parameters: Mapping[Any, Any], prefix: str = '') -> dict[str, Any]:
    """Return nested parameters under their names with dots."""
    _check_length(prefix)
    flat: dict[str, Any] = {}
    for name, parameter in parameters.items():
        if isinstance(parameter, Mapping):
            flat |= _flat(parameter, f'{prefix}{name}.')
        else:
            flat[f'{prefix}{name}'] = parameter
    return flat


def _names(legs: Any) -> Sequence[str]:
    """Return the names of the legs; [''] is the unnamed one, as ROS has no empty lists."""
    names = [name for name in legs if name != ''] if isinstance(legs, list | tuple) else []
    are_names = all(isinstance(name, str) and _NAME.fullmatch(name) for name in names)
    if not are_names or len(set(names)) < len(names) or len(names) > _MAX_LEGS:
        allowed = f'up to {_MAX_LEGS} names of letters, digits and _, a letter first, each once'
        raise ValueError(refusal('legs', names, allowed))
    return names or ('',)


def _leg(
    name: str, parameters: Mapping[str, Any], folders: Sequence[Path], *, weigh: bool
) -> RobotLeg:
    """Return a leg by its parameters, its masses too if they are to be weighed."""
    prefix = f'{name}.' if name else ''
    try:
        linkage, description, file = _linkage(parameters, folders)
    except LinkageFileError:
        raise
    except GeometryError as error:
        raise GeometryError(f'{prefix}{error}') from error
    masses = _masses(parameters, linkage, description, file) if weigh else None
    direction = parameters.get('direction', 1)
    if direction not in (-1, 1):
        raise ValueError(refusal(f'{prefix}direction', direction, '+1 or -1'))
    xyz = _triple(parameters, 'mount_xyz', Mount().xyz, prefix)
    rpy = _triple(parameters, 'mount_rpy', Mount().rpy, prefix)
    if max(map(abs, rpy)) > TURN:
        allowed = 'radians, not degrees: within +-2 pi'
        raise ValueError(refusal(f'{prefix}mount_rpy', list(rpy), allowed))
    phase = _number(parameters, 'phase', 0.0, prefix)
    warn_of_angle(f'{prefix}phase', phase)
    joint = parameters.get('crank_joint') or 'crank'
    if not isinstance(joint, str) or not joint.isprintable():
        raise ValueError(refusal(f'{prefix}crank_joint', joint, 'a text of printable characters'))
    mount = Mount(xyz, rpy)
    return RobotLeg(name, linkage, joint, phase, int(direction), mount, masses, description, file)


def _linkage(parameters: Mapping[str, Any], folders: Sequence[Path]) -> tuple[Linkage, str, str]:
    """Return a leg's linkage, its text and its file's name; both '' for a Klann leg."""
    text = str(parameters.get(_DESCRIPTION) or '')
    file = str(parameters.get('linkage') or '')
    if file and not text:
        for folder in folders:
            if is_regular_file(folder / file):
                file = str(folder / file)
                break
        else:
            file = str(with_home(file))
        text = linkage_text(file)
    if text:
        return linkage_from_text(text, file or _DESCRIPTION), text, file
    geometry = {name: parameters[name] for name in _GEOMETRY if name in parameters}
    if not geometry and not parameters.get('legs'):
        raise TypeError(f'none of {", ".join(_GEOMETRY)} is in it')
    return KlannGeometry(**geometry).linkage, '', ''


def _masses(
    parameters: Mapping[str, Any], linkage: Linkage, text: str, file: str
) -> Masses | None:
    """Return the masses of a leg's bodies; None without any."""
    masses = None
    density = None
    if 'bar_density' in parameters:
        density = _number(parameters, 'bar_density', 0.0)
        masses = rods(linkage, density).by_file
    if text:
        masses = masses_from_text(text, linkage, file, density=density)
    foot_mass = _number(parameters, 'foot_mass', 0.0)
    return with_foot(masses, linkage, foot_mass) if masses else None


def _body(flat: Mapping[str, Any]) -> WalkerBody | None:
    if flat.keys().isdisjoint(('body_mass', 'body_size', 'body_centre')):
        return None
    for name in ('body_mass', 'body_size'):
        if name not in flat:
            raise MassError(f'{name} is missing: a body has body_mass [kg] and body_size [m]')
    body = WalkerBody(
        _number(flat, 'body_mass', 0.0),
        _triple(flat, 'body_size', (0.0, 0.0, 0.0)),
        _triple(flat, 'body_centre', (0.0, 0.0, 0.0)),
    )
    max_size = max(body.size, key=abs)
    max_offset = max(body.centre, key=abs)
    warn_of_lengths({'body_size': max_size, 'body_centre': max_offset})
    for name, smallest in (('body_mass', body.mass), ('body_size', min(body.size))):
        if smallest <= 0.0:
            raise MassError(f'{name} = {flat[name]!r} is refused: it must be > 0')
    return body


def _is_finite(number: Any) -> bool:
    return isinstance(number, int | float) and not isinstance(number, bool) and isfinite(number)


def _number(parameters: Mapping[str, Any], name: str, default: float, prefix: str = '') -> float:
    number = parameters.get(name, default)
    if not _is_finite(number):
        raise ValueError(refusal(f'{prefix}{name}', number, 'finite'))
    return float(number)


def _triple(parameters: Mapping[str, Any], name: str, default: Triple, prefix: str = '') -> Triple:
    triple = parameters.get(name, default)
    if not isinstance(triple, list | tuple) or list(map(_is_finite, triple)) != [True] * 3:
        raise ValueError(refusal(f'{prefix}{name}', triple, 'three finite numbers'))
    x, y, z = map(float, triple)
    return x, y, z


def solver_parameters(document: Any) -> dict[str, Any]:
    """
    Return the parameters of solver_node in a ROS 2 parameter file, by their dotted names.

    As in ROS, all sections apply that match the node's full name, wildcards included, in the order
    of the file; the last value wins. The node is `/solver_node`, or the solver_node in a
    namespace. If it has no robot, the parameters are those of another node that has one, such as
    sim_node; if no node has one, there are none. A file without sections is a mapping of
    parameters.

    Raises
    ------
    TypeError, ValueError
        The content is no mapping, or defines several robots.

    """
    if not isinstance(document, dict):
        raise TypeError('it must be a mapping, such as config/sem104.yaml is')
    sections = list(_sections(document, ''))
    if not sections:
        return _flat(document)
    if len(sections) > _MAX_SECTIONS:
        raise ValueError(f'it has {len(sections)} sections of nodes, more than {_MAX_SECTIONS}')
    # Each name once, in the order of the file.
    node_names = list(dict.fromkeys(name for name, _ in sections if '*' not in name))
    solver_names = [name for name in node_names if name.endswith(_SOLVER_NODE)]
    robots = {name: _parameters(sections, name) for name in solver_names or [_SOLVER_NODE]}
    if not any(map(_defines_robot, robots.values())):
        all_nodes = {name: _parameters(sections, name) for name in node_names}
        robots = {name: node for name, node in all_nodes.items() if _defines_robot(node)}
    first_robot = next(iter(robots.values()), {})
    if any(robot != first_robot for robot in robots.values()):
        names = printable(', '.join(robots), 200)
        raise ValueError(f'it defines several robots, {names}: write one file for each')
    return first_robot


def _sections(document: Mapping[Any, Any], prefix: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield each section's full name and parameters; namespaces may be nested."""
    for key, section in document.items():
        if not isinstance(section, dict):
            continue
        name = f'{prefix}/{str(key).strip("/")}'
        _check_length(name)
        nested = dict(section)
        parameters = nested.pop(_PARAMETERS, None)
        if isinstance(parameters, dict):
            yield name, _flat(parameters)
        yield from _sections(nested, name)


def _parameters(sections: list[tuple[str, Mapping[str, Any]]], node: str) -> dict[str, Any]:
    """Return the parameters of a node by its full name."""
    node_parameters: dict[str, Any] = {}
    for pattern, parameters in sections:
        if _matches(pattern, node):
            node_parameters |= parameters
    return node_parameters


def _matches(pattern: str, node: str) -> bool:
    """Return whether a section's name, with the wildcards * and **, matches a node's full name."""
    tokens = node.split('/')[1:]
    # Numbers of tokens that the pattern matches so far.
    counts = {0}
    for wanted in pattern.split('/')[1:]:
        if wanted == '**':
            counts = set(range(min(counts, default=len(tokens) + 1), len(tokens) + 1))
        else:
            inside = (n for n in counts if n < len(tokens))
            counts = {n + 1 for n in inside if wanted in {'*', tokens[n]}}
    return len(tokens) in counts


def _defines_robot(parameters: Mapping[str, Any]) -> bool:
    return not _OF_ROBOT.isdisjoint(parameters)
