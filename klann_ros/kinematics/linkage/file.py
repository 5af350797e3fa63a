"""A linkage from a YAML file: the only place in the kinematics that reads files."""

from cmath import rect
from collections.abc import Mapping
from importlib import resources
from math import radians
from pathlib import Path
from typing import Any

from klann_ros.kinematics.dyad import joint
from klann_ros.kinematics.errors import GeometryError

from .description import Bar, Body, chained, Description
from .linkage import Linkage
from .yaml_text import parse

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
        return Path(path).read_text(encoding='utf-8')
    except (OSError, ValueError) as error:
        # What is no UTF-8, and a path that is none, are ValueErrors.
        reason = getattr(error, 'strerror', None) or error
        msg = f'{path} cannot be read: {reason}'
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
        return Linkage(_description(content))
    except GeometryError as error:
        msg = f'{name} holds no linkage: {error}'
        raise LinkageFileError(msg) from error


def _validate(content: Any) -> None:
    # jsonschema takes longer to load than everything else of the kinematics.
    from .schema import complaint  # noqa: PLC0415

    wrong = complaint(content)
    if wrong:
        raise GeometryError(wrong)


def _description(content: Mapping[str, Any]) -> Description:
    units = content.get('units', {})
    metre = LENGTH_UNITS[units.get('length', 'm')]
    in_degrees = units.get('angle', 'rad') == 'deg'

    def angle(value: float) -> float:
        return radians(value) if in_degrees else float(value)

    crank = content['crank']
    if crank not in content['bodies']:
        msg = f'the crank {crank} is none of the bodies: {", ".join(content["bodies"])}'
        raise GeometryError(msg)
    order = [crank, *(name for name in content['bodies'] if name != crank)]
    return Description(
        name=content['name'],
        source=content.get('source', ''),
        pivots={name: metre * complex(x, y) for name, (x, y) in content['pivots'].items()},
        bodies=tuple(_body(name, content['bodies'][name], metre, angle) for name in order),
        foot=content['foot'],
        start={name: angle(value) for name, value in content['start'].items()},
    )


def _body(name: str, content: Mapping[str, Any], metre: float, angle: Any) -> Body:
    bars: list[Bar] = []
    for bar in content['bars']:
        length = metre * bar['length']
        if 'brace' in bar:
            vector = _braced(name, bar, length, metre * bar['brace']['length'], bars)
        else:
            vector = rect(length, angle(bar.get('bend', 0.0)))
        bars.append(Bar(bar['from'], bar['to'], vector))
    return Body(name, tuple(bars), content.get('clockwise', False))


def _braced(
    body: str, bar: Mapping[str, Any], length: float, brace: float, bars: list[Bar]
) -> complex:
    """Return the vector of a bar whose new point a brace holds, by the triangle of both."""
    places = chained(bars)
    ends = bar['from'], bar['brace']['from']
    for end in ends:
        if end not in places:
            msg = f'bodies.{body}: {end} is no point of it yet, so nothing can be braced from it'
            raise GeometryError(msg)
    p, q = (places[end] for end in ends)
    side = 1 if bar['brace']['side'] == 'left' else -1
    found = joint((p.real, p.imag), (q.real, q.imag), length, brace, side)
    if found is None:
        msg = (
            f'bodies.{body}: {bar["from"]}-{bar["to"]} ({length:g} m) and the brace '
            f'{ends[1]}-{bar["to"]} ({brace:g} m) do not meet: {ends[0]} and {ends[1]} are '
            f'{abs(q - p):g} m apart'
        )
        raise GeometryError(msg)
    return complex(*found) - p
