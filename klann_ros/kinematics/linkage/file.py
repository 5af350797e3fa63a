"""A linkage from a YAML file: the only place in the kinematics that reads files."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from importlib import resources
from math import radians
from pathlib import Path
from typing import Any

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.errors import GeometryError
from klann_ros.sanitize.files import is_regular_file, read_regular
from klann_ros.sanitize.text import did_you_mean, printable, printable_line
from klann_ros.sanitize.units import warn_of_lengths
from klann_ros.sanitize.yaml_text import MAX_FILE_SIZE, parse, YamlError

from .file_checks import (
    body_bars,
    check_start_names,
    DEGREES_HINT,
    describe_misspelling,
    linkage_from_signs,
    linkage_from_start,
    schema_error,
)
from .linkage import Linkage
from .structure import Bar, Body, Brace, Structure

# The keys of a linkage, and of no parameter file.
_KEYS = {'pivots', 'bodies', 'crank', 'foot'}
LENGTH_UNITS = {'m': 1.0, 'cm': 0.01, 'mm': 0.001}
NUMBER_DIGITS = 9
"""Digits behind the point of written numbers, in their own units."""

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
        hint = did_you_mean(name, names)
        msg = f'no linkage called {printable(name)} is shipped: there are {", ".join(names)}{hint}'
        raise LinkageFileError(msg)
    return linkage_from_text((SHIPPED / f'{name}.yaml').read_text(encoding='utf-8'), name)


def linkage_from_file(path: str | Path) -> Linkage:
    """
    Return the linkage in a YAML file; `schema.json` is its format.

    Parameters
    ----------
    path : str or pathlib.Path
        The file, or the name of a shipped linkage where no such file exists.

    Raises
    ------
    LinkageFileError
        It cannot be read, or holds no linkage.

    """
    return linkage_from_text(linkage_text(path), str(path))


def linkage_text(path: str | Path) -> str:
    """Return the text of a linkage's file, or of a shipped one; or a LinkageFileError."""
    try:
        return read_regular(path, MAX_FILE_SIZE)
    except (OSError, ValueError) as error:
        hint, names = '', shipped_linkages()
        # A folder of that name, such as a run, hides no shipped linkage.
        if str(path) in names and not is_regular_file(path):
            return (SHIPPED / f'{path}.yaml').read_text(encoding='utf-8')
        if isinstance(error, FileNotFoundError):
            stem = Path(path).stem
            hint = f'; shipped are {", ".join(names)}{did_you_mean(stem, names)}'
            hint = f'; the shipped one is called {stem}' if stem in names else hint
        # Invalid UTF-8 and invalid paths are ValueErrors.
        reason = getattr(error, 'strerror', None) or error
        msg = f'{printable(path)} cannot be read: {printable(reason)}{hint}'
        raise LinkageFileError(msg) from error


def is_linkage(content: Any) -> bool:
    """Return whether a file's content has a key of a linkage."""
    return isinstance(content, Mapping) and not _KEYS.isdisjoint(content)


# Linkages do not change: a text is parsed once for all legs of a walker.
@lru_cache(maxsize=32)
def linkage_from_text(text: str, name: str) -> Linkage:
    """
    Return the linkage in a YAML text.

    Parameters
    ----------
    text : str
        The YAML.
    name : str
        Its name in errors.

    Raises
    ------
    LinkageFileError
        It holds no linkage.

    """
    try:
        return _linkage(parse(text))
    except (GeometryError, YamlError) as error:
        msg = f'{printable(name)} holds no linkage: {printable_line(error)}'
        raise LinkageFileError(msg) from error


def content_with_numbers(text: str, linkage: Linkage) -> Any:
    """Return the content of a linkage's file with other numbers, in its own units."""
    content = parse(text)
    units = content.get('units', {})
    metre = LENGTH_UNITS[units.get('length', 'm')]
    radian = radians(1.0) if units.get('angle', 'rad') == 'deg' else 1.0
    order = [body.angle for body in linkage.structure.bodies]
    bars: list[Any] = [bar for name in order for bar in body_bars(content['bodies'][name])]
    for dimension, number in zip(linkage.structure.dimensions, linkage.numbers, strict=True):
        place = dimension.place
        scale = radian if dimension.kind == 'bend' else metre
        value = round(number / scale, NUMBER_DIGITS)
        if dimension.kind in {'x', 'y'}:
            pivot = content['pivots'][linkage.structure.pivots[place]]
            pivot['xy'.index(dimension.kind)] = value
        elif dimension.kind == 'brace':
            bars[place]['brace']['length'] = value
        elif dimension.kind == 'bend':
            bars[place]['direction' if 'along' in bars[place] else 'bend'] = value
        else:
            bars[place]['length'] = value
    return content


def _linkage(content: Any) -> Linkage:
    wrong = schema_error(content)
    if wrong:
        raise GeometryError(wrong)
    units = content.get('units', {})
    metre = LENGTH_UNITS[units.get('length', 'm')]
    turn = radians if units.get('angle', 'rad') == 'deg' else float
    crank, bodies, start = content['crank'], content['bodies'], content.get('start')
    if crank not in bodies:
        hint = did_you_mean(crank, bodies)
        msg = f'the crank {crank} is none of the bodies: {", ".join(bodies)}{hint}'
        raise GeometryError(msg)
    order = _order(content)
    if start is not None:
        check_start_names(start, order)
    try:
        structure = structure_of(content)
        _ = structure.groups
    except GeometryError as error:
        raise GeometryError(f'{error}{describe_misspelling(content)}') from error
    bars = [bar for name in order for bar in body_bars(bodies[name])]
    _check_bends(content, turn)
    given: dict[str, Callable[[int], float]] = {
        'length': lambda place: metre * bars[place]['length'],
        'brace': lambda place: metre * bars[place]['brace']['length'],
        'bend': lambda place: turn(bars[place].get('bend', bars[place].get('direction', 0.0))),
        'x': lambda place: metre * content['pivots'][structure.pivots[place]][0],
        'y': lambda place: metre * content['pivots'][structure.pivots[place]][1],
    }
    _warn_of_lengths(structure, given, units)
    numbers = [given[dimension.kind](dimension.place) for dimension in structure.dimensions]
    # In any assembly: its numbers are checked before its start.
    plain = Linkage(
        structure,
        numbers,
        assembly=(1,) * len(structure.groups),
        name=content['name'],
        source=content.get('source', ''),
    )
    signs = content.get('assembly')
    if start is None:
        return linkage_from_signs(plain, signs or ())
    start_guess = [
        metre * start[body.angle] if body.slides else turn(start[body.angle])
        for body in structure.bodies
    ]
    return linkage_from_start(plain, start_guess, signs, in_degrees=turn is radians)


def _warn_of_lengths(
    structure: Structure, given: Mapping[str, Callable[[int], float]], units: Mapping[str, str]
) -> None:
    lengths = {
        dimension.name: given[dimension.kind](dimension.place)
        for dimension in structure.dimensions
        if dimension.kind != 'bend'
    }
    angle = f', angle: {units["angle"]}' if 'angle' in units else ''
    warn_of_lengths(lengths, '' if 'length' in units else f'write units: {{length: mm{angle}}}')


def _order(content: Mapping[str, Any]) -> list[str]:
    """Return the names of the bodies, the crank's first."""
    return [content['crank'], *(name for name in content['bodies'] if name != content['crank'])]


def structure_of(content: Mapping[str, Any]) -> Structure:
    """Return the structure of a file's content, which may lack numbers; or a GeometryError."""
    made = tuple(_body(name, content['bodies'][name]) for name in _order(content))
    return Structure(tuple(content['pivots']), made, content['foot'])


def _body(name: str, content: Mapping[str, Any]) -> Body:
    bars = []
    for bar in body_bars(content):
        brace = Brace(bar['brace']['from'], bar['brace']['side']) if 'brace' in bar else None
        bars.append(Bar(bar['from'], bar['to'], brace))
    along = content['slides']['along'] if 'slides' in content else ''
    return Body(name, tuple(bars), content.get('clockwise', False), along=along)


def _check_bends(content: Mapping[str, Any], turn: Callable[[float], float]) -> None:
    for name, body in content['bodies'].items():
        given = {f'bars[{n}].bend': bar.get('bend') for n, bar in enumerate(body.get('bars', ()))}
        given['slides.direction'] = body.get('slides', {}).get('direction')
        for place, angle in given.items():
            if angle is not None and abs(turn(angle)) > TURN:
                limit = '+-360 deg' if turn is radians else f'+-2 pi rad; {DEGREES_HINT}'
                msg = f'bodies.{name}.{place}: {angle:g} must be within {limit}'
                raise GeometryError(msg)
