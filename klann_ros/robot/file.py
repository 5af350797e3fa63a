"""A robot from what tells it: parameters of solver_node, a linkage's file, or a shipped name."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from klann_ros.dynamics import MassError, Masses, masses_from_text, rods
from klann_ros.kinematics import (
    KlannGeometry,
    Linkage,
    linkage_from_text,
    LinkageFileError,
    shipped_linkages,
)
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.klann.geometry import NUMBERS, PRESETS
from klann_ros.kinematics.linkage.file import is_linkage, linkage_text, SHIPPED
from klann_ros.untrusted.files import read_plain
from klann_ros.untrusted.text import printable, printable_line
from klann_ros.untrusted.yaml_text import LONGEST, parse

from .robot import Body, Mount, Robot, RobotLeg, Triple

_GEOMETRY = (*NUMBERS, 'assembly')
# Whose parameters these are, the last word last.
_SECTIONS = ('/**', 'solver_node', '/solver_node')
_BODY = ('body_mass', 'body_size', 'body_centre')


class RobotFileError(ValueError):
    """A file that holds no robot; the text says why."""


def preset_names() -> tuple[str, ...]:
    """Return the names of the legs that come with the package."""
    return *PRESETS, *shipped_linkages()


def robot_of(name: str) -> Robot:
    """
    Return the robot in a file, or the one of a shipped name if no file is called so.

    Raises
    ------
    RobotFileError
        There is neither, or the file holds no robot.

    """
    if not Path(name).exists():
        if name in PRESETS:
            linkage = PRESETS[name]().linkage
            # As the parameter file of that name has it.
            return Robot(name, (RobotLeg('', linkage, masses=rods(linkage, 1.0)),), source=name)
        if name in shipped_linkages():
            return robot_from_file(str(SHIPPED / f'{name}.yaml'))
    return robot_from_file(name)


def robot_from_file(path: str | Path) -> Robot:
    """
    Return the robot in a YAML file: solver_node's parameters, a mapping of lengths, or a linkage.

    Raises
    ------
    RobotFileError
        The file cannot be read, or holds no robot.

    """
    shown = printable(str(path))
    try:
        text = read_plain(str(path), LONGEST)
        content = parse(text)
        if is_linkage(content):
            linkage = linkage_from_text(text, str(path))
            leg = RobotLeg('', linkage, masses=_own_masses(text, linkage, str(path)))
            return Robot(Path(path).stem, (leg,), source=shown)
        return robot_from_parameters(_parameters(content), path)
    except LinkageFileError as error:
        raise RobotFileError(str(error)) from error
    except OSError as error:
        also = f'; shipped are {", ".join(preset_names())}' * isinstance(error, FileNotFoundError)
        raise RobotFileError(f'{shown} cannot be read: {error.strerror}{also}') from error
    except (ValueError, TypeError) as error:
        raise RobotFileError(f'{shown} holds no robot: {printable_line(error)}') from error


def robot_from_parameters(parameters: Mapping[str, Any], path: str | Path = '') -> Robot:
    """
    Return the robot that solver_node's parameters tell; others among them do not matter.

    Parameters
    ----------
    parameters : mapping of str
        Nested as in a file, or with dots as in a node.
    path : path, optional
        The file: a linkage that it names is looked for beside it, too.

    Raises
    ------
    TypeError, ValueError
        They are no robot.

    """
    flat = dict(_flat(parameters))
    names = _names(flat.get('legs', ()))
    legs = tuple(_leg(name, of_leg(flat, name), path) for name in names)
    return Robot(Path(path).stem or 'robot', legs, _body(flat), source=printable(str(path)))


def of_leg(parameters: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the parameters of a leg, with dots: its own before those of all; '' is no value."""
    prefix = f'{name}.'
    own = {
        key.removeprefix(prefix): value
        for key, value in parameters.items()
        if name and key.startswith(prefix) and value != ''
    }
    return {**parameters, **own}


def _parameters(content: Any) -> Mapping[str, Any]:
    """Return the parameters in a file: those for every node, then solver_node's own."""
    if not isinstance(content, dict):
        msg = 'it must be a mapping, such as config/sem104.yaml is'
        raise TypeError(msg)
    sections = {
        name: value['ros__parameters']
        for name, value in content.items()
        if isinstance(value, dict) and isinstance(value.get('ros__parameters'), dict)
    }
    if not sections:
        return content
    known = [sections[name] for name in _SECTIONS if name in sections]
    made: dict[str, Any] = {}
    for section in known or list(sections.values())[:1]:
        made.update(section)
    return made


def _flat(parameters: Mapping[str, Any], prefix: str = '') -> list[tuple[str, Any]]:
    found = []
    for name, value in parameters.items():
        if isinstance(value, Mapping):
            found += _flat(value, f'{prefix}{name}.')
        else:
            found.append((f'{prefix}{name}', value))
    return found


def _names(legs: Any) -> Sequence[str]:
    """Return the names of the legs; '' stands for the unnamed one."""
    names = [name for name in legs if name] if isinstance(legs, list | tuple) else []
    if not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        raise ValueError(f'legs = {printable(repr(legs), 100)} is refused: names, each once')
    return names or ('',)


def _leg(name: str, own: Mapping[str, Any], path: str | Path) -> RobotLeg:
    linkage, masses = _linkage(own, path)
    direction = own.get('direction', 1)
    if direction not in (-1, 1):
        raise ValueError(f'{name} direction = {direction!r} is refused: it must be +1 or -1')
    where = Mount(_triple(own, 'mount_xyz', Mount().xyz), _triple(own, 'mount_rpy', Mount().rpy))
    if max(map(abs, where.rpy)) > TURN:
        msg = f'{name} mount_rpy = {where.rpy} is refused: radians, not degrees: within +-2 pi'
        raise ValueError(msg)
    phase = _number(own, 'phase', 0.0)
    joint = str(own.get('crank_joint') or 'crank')
    return RobotLeg(name, linkage, joint, phase, int(direction), where, masses)


def _linkage(own: Mapping[str, Any], path: str | Path) -> tuple[Linkage, Masses | None]:
    """Return a leg's bars, and what they weigh if that is told."""
    text, file = own.get('linkage_description') or '', own.get('linkage') or ''
    if file and not text:
        beside = Path(path).parent / file
        file = str(beside if path and beside.exists() else Path(file).expanduser())
        text = linkage_text(file)
    if text:
        linkage = linkage_from_text(text, file or 'linkage_description')
    else:
        numbers = {name: own[name] for name in _GEOMETRY if name in own}
        if not numbers and not own.get('legs'):
            msg = f'none of {", ".join(_GEOMETRY)} is in it'
            raise TypeError(msg)
        linkage = KlannGeometry(**numbers).linkage
    if 'bar_density' in own:
        density = _number(own, 'bar_density', 0.0)
        return linkage, rods(linkage, density, foot_mass=_number(own, 'foot_mass', 0.0))
    return linkage, _own_masses(text, linkage, file) if text else None


def _own_masses(text: str, linkage: Linkage, name: str) -> Masses | None:
    """Return the masses that a linkage's file holds, None if it holds none."""
    content = parse(text)
    tells = 'density' in content or any('mass' in body for body in content['bodies'].values())
    return masses_from_text(text, linkage, name) if tells else None


def _body(flat: Mapping[str, Any]) -> Body | None:
    if not any(name in flat for name in _BODY):
        return None
    missing = [name for name in _BODY[:2] if name not in flat]
    if missing:
        raise MassError(f'{missing[0]} is missing: a body has body_mass [kg] and body_size [m]')
    body = Body(
        _number(flat, 'body_mass', 0.0),
        _triple(flat, 'body_size', (0.0, 0.0, 0.0)),
        _triple(flat, 'body_centre', (0.0, 0.0, 0.0)),
    )
    for name, values in (('body_mass', (body.mass,)), ('body_size', body.size)):
        if min(values) <= 0.0:
            raise MassError(f'{name} = {flat[name]!r} is refused: it must be > 0')
    return body


def _number(own: Mapping[str, Any], name: str, otherwise: float) -> float:
    value = own.get(name, otherwise)
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f'{name} = {printable(repr(value), 100)} is refused: a finite number')
    return float(value)


def _triple(own: Mapping[str, Any], name: str, otherwise: Triple) -> Triple:
    values = own.get(name, otherwise)
    if not isinstance(values, list | tuple) or len(values) != 3:
        raise ValueError(f'{name} = {printable(repr(values), 100)} is refused: three numbers')
    x, y, z = (_number({name: value}, name, 0.0) for value in values)
    return x, y, z
