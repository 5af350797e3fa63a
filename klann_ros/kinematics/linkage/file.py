"""A linkage from a YAML file: the only place in the kinematics that reads files."""

from collections.abc import Callable, Mapping, Sequence
from importlib import resources
from math import radians
from pathlib import Path
from typing import Any

from klann_ros.kinematics.errors import GeometryError
from klann_ros.untrusted.files import read_plain
from klann_ros.untrusted.text import printable, printable_line
from klann_ros.untrusted.yaml_text import LONGEST, parse, YamlError

from .linkage import Linkage
from .structure import Bar, Body, Brace, Structure

LENGTH_UNITS = {'m': 1.0, 'cm': 0.01, 'mm': 0.001}
SHIPPED = resources.files('klann_ros') / 'linkages'


class LinkageFileError(GeometryError):
    """A file that holds no linkage; the text names the file and says why."""


def shipped_linkages() -> list[str]:
    """Return the names of the linkages that come with the package."""
    names = (entry.name for entry in SHIPPED.iterdir() if entry.name.endswith('.yaml'))
    return sorted(name.removesuffix('.yaml') for name in names)


def shipped_linkage(name: str) -> Linkage:
    """
    Return a linkage that comes with the package.

    Raises
    ------
    LinkageFileError
        There is none of this name.

    """
    names = shipped_linkages()
    if name not in names:
        msg = f'no linkage called {name} is shipped: there are {", ".join(names)}'
        raise LinkageFileError(msg)
    return linkage_from_text((SHIPPED / f'{name}.yaml').read_text(encoding='utf-8'), name)


def linkage_from_file(path: str | Path) -> Linkage:
    """
    Return the linkage in a YAML file; `schema.json` says what is in it.

    Parameters
    ----------
    path : str or pathlib.Path
        The file.

    Raises
    ------
    LinkageFileError
        It cannot be read, or holds no linkage.

    """
    return linkage_from_text(linkage_text(path), str(path))


def linkage_text(path: str | Path) -> str:
    """
    Return the text of a linkage's file.

    Raises
    ------
    LinkageFileError
        It cannot be read.

    """
    try:
        return read_plain(path, LONGEST)
    except (OSError, ValueError) as error:
        # What is no UTF-8, and a path that is none, are ValueErrors.
        reason = getattr(error, 'strerror', None) or error
        msg = f'{printable(path)} cannot be read: {printable(reason)}'
        raise LinkageFileError(msg) from error


def linkage_from_text(text: str, name: str) -> Linkage:
    """
    Return the linkage in a YAML text.

    Parameters
    ----------
    text : str
        The YAML.
    name : str
        What it is called in errors.

    Raises
    ------
    LinkageFileError
        It holds no linkage.

    """
    try:
        content = parse(text)
        _validate(content)
        return _linkage(content)
    except (GeometryError, YamlError) as error:
        msg = f'{printable(name)} holds no linkage: {printable_line(error)}'
        raise LinkageFileError(msg) from error


def _validate(content: Any) -> None:
    # jsonschema takes longer to load than everything else of the kinematics.
    from .schema import complaint  # noqa: PLC0415

    wrong = complaint(content)
    if wrong:
        raise GeometryError(wrong)


def _linkage(content: Mapping[str, Any]) -> Linkage:
    units = content.get('units', {})
    metre = LENGTH_UNITS[units.get('length', 'm')]
    turn = radians if units.get('angle', 'rad') == 'deg' else float
    crank, bodies, start = content['crank'], content['bodies'], content['start']
    if crank not in bodies:
        msg = f'the crank {crank} is none of the bodies: {", ".join(bodies)}'
        raise GeometryError(msg)
    order = [crank, *(name for name in bodies if name != crank)]
    _check_start(start, order)
    structure = Structure(
        tuple(content['pivots']),
        tuple(_body(name, bodies[name]) for name in order),
        content['foot'],
    )
    bars = [bar for name in order for bar in bodies[name]['bars']]
    given: dict[str, Callable[[int], float]] = {
        'length': lambda place: metre * bars[place]['length'],
        'brace': lambda place: metre * bars[place]['brace']['length'],
        'bend': lambda place: turn(bars[place].get('bend', 0.0)),
        'x': lambda place: metre * content['pivots'][structure.pivots[place]][0],
        'y': lambda place: metre * content['pivots'][structure.pivots[place]][1],
    }
    return Linkage(
        structure,
        [given[dimension.kind](dimension.place) for dimension in structure.dimensions],
        start=[turn(start[name]) for name in order],
        name=content['name'],
        source=content.get('source', ''),
    )


def _body(name: str, content: Mapping[str, Any]) -> Body:
    bars = [
        Bar(bar['from'], bar['to'], _brace(bar['brace']) if 'brace' in bar else None)
        for bar in content['bars']
    ]
    return Body(name, tuple(bars), content.get('clockwise', False))


def _brace(brace: Mapping[str, Any]) -> Brace:
    return Brace(brace['from'], brace['side'])


def _check_start(start: Mapping[str, float], bodies: Sequence[str]) -> None:
    for name in bodies:
        if name not in start:
            msg = f'start has no angle for {name}: it needs one for every body'
            raise GeometryError(msg)
    for name in start:
        if name not in bodies:
            msg = f'start has an angle for {name}, which is no body'
            raise GeometryError(msg)
