"""A linkage from a YAML file, by its schema: the only place in the kinematics that reads files."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache, lru_cache
from itertools import chain, islice, product
import json
from math import radians
from pathlib import Path
from reprlib import Repr
from typing import Any

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.errors import GeometryError, NotAssembledError
from klann_ros.sanitize.files import is_regular_file, read_regular
from klann_ros.sanitize.text import did_you_mean, listed, printable, printable_line
from klann_ros.sanitize.units import warn_of_lengths
from klann_ros.sanitize.yaml_text import MAX_FILE_SIZE, parse, YamlError

from .assemblies import describe_assemblies, distance_to_assembly, MAX_NAMED, possible_assemblies
from .change_points import PARALLEL
from .linkage import Linkage
from .points import by_bars, units_of
from .reach import closes_somewhere
from .structure import Bar, Body, Brace, Structure

# The keys of a linkage, and of no parameter file.
_KEYS = {'pivots', 'bodies', 'crank', 'foot', 'links'}
NUMBER_DIGITS = 9
"""Digits behind the point of written numbers, in their own units."""

SHIPPED = Path(__file__).parents[2] / 'linkages'


class LinkageFileError(GeometryError):
    """A file that holds no linkage; the text names the file and says why."""


def shipped_linkages() -> list[str]:
    """Return the names of the linkages that come with the package."""
    return sorted(file.stem for file in SHIPPED.glob('*.yaml'))


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
        hint = ''
        names = shipped_linkages()
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
    """Return the content of a linkage's file, by bars, with other numbers, in its own units."""
    original = parse(text)
    content = by_bars(original)
    if 'points' in original and linkage.is_dyadic:
        # The pose of the points may be a dead point.
        del content['start']
        content['assembly'] = [*linkage.assembly_at(0.0)]
    slots = _slots(content, linkage.structure)
    for dimension, number in zip(linkage.structure.dimensions, linkage.numbers, strict=True):
        holder, key, unit = next(slots)
        holder[key] = round(dimension.sense * number / unit, NUMBER_DIGITS)
    return content


def _slots(content: Mapping[str, Any], structure: Structure) -> Iterator[tuple[Any, Any, float]]:
    """Yield where each dimension is in a file's content, by bars: a list or mapping, key, unit."""
    metre, radian = units_of(content)
    bars = [bar for name in structure.angles for bar in _body_bars(content['bodies'][name])]
    for dimension in structure.dimensions:
        if dimension.kind in {'x', 'y'}:
            pivot = content['pivots'][structure.pivots[dimension.place]]
            yield pivot, 'xy'.index(dimension.kind), metre
            continue
        bar = bars[dimension.place]
        if dimension.kind == 'bend':
            key = 'direction' if 'along' in bar else 'bend'
            bar.setdefault(key, 0.0)
            yield bar, key, radian
        else:
            yield bar['brace'] if dimension.kind == 'brace' else bar, 'length', metre


def _linkage(content: Any) -> Linkage:
    """Return the linkage of a file's content; a GeometryError says what is wrong in it."""
    problem = schema_error(content)
    if problem:
        raise GeometryError(problem)
    has_points = 'points' in content
    content = by_bars(content)
    metre, radian = units_of(content)
    crank = content['crank']
    bodies = content['bodies']
    start = content.get('start')
    if crank not in bodies:
        hint = did_you_mean(crank, bodies)
        raise GeometryError(f'the crank {crank} is none of the bodies: {", ".join(bodies)}{hint}')
    if start is not None:
        _check_start_names(start, bodies)
    try:
        structure = structure_of(content)
        _ = structure.groups
    except GeometryError as error:
        raise GeometryError(f'{error}{_describe_misspelling(content)}') from error
    _check_bends(content, radian)
    numbers = [unit * holder[key] for holder, key, unit in _slots(content, structure)]
    named_numbers = zip(structure.dimensions, numbers, strict=True)
    lengths = {dimension.name: n for dimension, n in named_numbers if dimension.kind != 'bend'}
    units = content.get('units', {})
    angle = f', angle: {units["angle"]}' if 'angle' in units else ''
    warn_of_lengths(lengths, '' if 'length' in units else f'write units: {{length: mm{angle}}}')
    signs = content.get('assembly')
    count = len(structure.groups)
    linkage = Linkage(
        structure,
        numbers,
        # With a start it is first in any assembly: the numbers are checked before the start.
        assembly=signs if start is None and len(signs) == count else (1,) * count,
        at_change_points=content.get('at_change_points', PARALLEL),
        name=content['name'],
        source=content.get('source', ''),
    )
    if start is None:
        _check_assembly(linkage, signs)
        return linkage
    start_guess = []
    for body in structure.bodies:
        start_guess.append((metre if body.slides else radian) * start[body.angle])
    if has_points:
        return _linkage_from_pose(linkage, start_guess, signs)
    return _linkage_from_start(linkage, start_guess, signs, in_degrees=radian != 1.0)


def structure_of(content: Mapping[str, Any]) -> Structure:
    """Return the structure of a file's content, which may lack numbers; or a GeometryError."""
    names = dict.fromkeys([content['crank'], *content['bodies']])
    bodies = [_body(name, content['bodies'][name]) for name in names]
    return Structure(tuple(content['pivots']), tuple(bodies), content['foot'])


def _body(name: str, content: Mapping[str, Any]) -> Body:
    bars = []
    for bar in _body_bars(content):
        brace = Brace(bar['brace']['from'], bar['brace']['side']) if 'brace' in bar else None
        bars.append(Bar(bar['from'], bar['to'], brace))
    along = content['slides']['along'] if 'slides' in content else ''
    return Body(name, tuple(bars), content.get('clockwise', False), along=along)


def _check_bends(content: Mapping[str, Any], radian: float) -> None:
    for name, body in content['bodies'].items():
        angles = {
            f'bars[{n}].bend': bar.get('bend', 0.0) for n, bar in enumerate(body.get('bars', ()))
        }
        angles['slides.direction'] = body.get('slides', {}).get('direction', 0.0)
        for place, angle in angles.items():
            if abs(radian * angle) > TURN:
                limit = f'+-2 pi rad; {DEGREES_HINT}' if radian == 1.0 else '+-360 deg'
                raise GeometryError(f'bodies.{name}.{place}: {angle:g} must be within {limit}')


# Reading error of a start from a drawing [rad].
MAX_START_ERROR = radians(30.0)
# Maximum sine of a dyad in line, by coordinates that are rounded.
MIN_POSE_SINE = 1e-4
DEGREES_HINT = 'for degrees write units: {angle: deg}'


def _check_start_names(start: Mapping[str, float], bodies: Collection[str]) -> None:
    """Refuse a start that has not an angle for every body, and for nothing else."""
    for name in [*start, *bodies]:
        if name not in bodies:
            hint = did_you_mean(name, bodies)
            raise GeometryError(f'start has an angle for {name}, which is no body{hint}')
        if name not in start:
            raise GeometryError(f'start has no angle for {name}: it needs one for every body')


def _describe_misspelling(content: Mapping[str, Any]) -> str:
    """Return a hint at points of a file in one body alone, which join nothing; empty for none."""
    points: dict[str, dict[str, None]] = {}
    for name, body in content['bodies'].items():
        points[name] = dict.fromkeys(
            bar[end] for bar in _body_bars(body) for end in ('from', 'to')
        )
    uses = Counter(chain([content['foot'], *content['pivots']], *points.values()))
    loose = [(name, point) for name in points for point in points[name] if uses[point] == 1]
    for name, point in loose:
        other_uses = [use for use in uses if use not in points[name]]
        # Above all one that nothing else leads to, such as a pivot.
        single = [use for use in other_uses if uses[use] == 1]
        hint = did_you_mean(point, single) or did_you_mean(point, other_uses)
        if not hint and len(single) == 1:
            hint = f'; did you mean {single[0]}?'
        if hint:
            return f'; the point {point} is in the body {name} alone{hint}'
    names = listed((f'{point} of {name}' for name, point in loose), 5)
    return f'; in one body alone, and so joining nothing, are the points {names}' if loose else ''


def _body_bars(body: Mapping[str, Any]) -> list[Any]:
    """Return the bars of a body in a file, the line that it slides along being the first."""
    line = [body['slides']] if 'slides' in body else []
    return [*line, *body.get('bars', ())]


def _linkage_from_pose(
    plain: Linkage, start: Sequence[float], signs: Sequence[int] | None
) -> Linkage:
    """Return a linkage in the assembly of its points; at a dead point, in the one of `signs`."""
    u = plain.vectors(start[0], start[1:])
    choices: list[tuple[int, ...]] = []
    for block in plain.blocks:
        sine = block.sine(u)
        is_in_line = block.two_branches and abs(sine) <= MIN_POSE_SINE
        choices.append((1, -1) if is_in_line else (1 if sine > 0.0 else -1,))
    modes = [[*mode] for mode in product(*choices)]
    if len(modes) == 1:
        return _linkage_from_start(plain, start, signs, in_degrees=True)
    if plain.is_dyadic and signs in modes:
        return plain.in_assembly(signs, start[0])
    group = plain.structure.groups[choices.index((1, -1))]
    names = ' and '.join(plain.structure.angles[j] for j in group)
    advice = f'state one of them by assembly: {" or ".join(map(str, modes[:MAX_NAMED]))}'
    raise GeometryError(
        f'the points are at a dead point of {names}, from which two motions go on: '
        f'{advice if plain.is_dyadic else "give another pose"}'
    )


def _linkage_from_start(
    plain: Linkage, start: Sequence[float], signs: Sequence[int] | None, *, in_degrees: bool
) -> Linkage:
    """
    Return a linkage, which is in any assembly, in the one that its start leads to.

    `start` is an angle for every body, the crank's first [rad], or a distance [m]; `signs` is the
    assembly that the file states beside it. A GeometryError names the assemblies that there are.
    """
    if not in_degrees:
        _check_degrees(plain, tuple(start))
    try:
        linkage = plain.from_start(start)
        if signs is None or linkage.assembly == tuple(signs):
            return linkage
        stated = f'and {list(signs)} is stated: leave one of them out'
        problem = f'the start leads to the assembly {list(linkage.assembly)}, {stated}'
    except NotAssembledError as error:
        problem = str(error)
    assemblies = describe_assemblies(plain, start[0], in_degrees=in_degrees)
    raise GeometryError(f'{problem}; {assemblies}')


def _check_assembly(linkage: Linkage, signs: Sequence[int]) -> None:
    """Refuse signs that are not the linkage's assembly, or with which it closes nowhere."""
    if not linkage.is_dyadic:
        needs = 'which its coupled loops need: no assembly tells their branch'
        raise GeometryError(f'it has no start, {needs}')
    count = len(linkage.structure.groups)
    if len(signs) == count and closes_somewhere(linkage):
        return
    modes = [list(mode) for mode in islice(possible_assemblies(linkage), MAX_NAMED)]
    possible = ', '.join(map(str, modes))
    if not possible:
        raise GeometryError('it closes at no crank angle, in whatever assembly: check its lengths')
    msg = f'assembly {signs} is refused: possible are {possible}'
    if len(signs) != count:
        names = linkage.structure.angles
        blocks = '; '.join(', '.join(names[j] for j in g) for g in linkage.structure.groups)
        msg += f', a sign for each of the loops that are solved one after the other ({blocks})'
    raise GeometryError(msg)


def _check_degrees(linkage: Linkage, start: tuple[float, ...]) -> None:
    """Refuse a start [rad] that can only be degrees."""
    by_body = [*zip(linkage.structure.bodies, start, strict=True)]
    from_degrees = tuple(x if body.slides else radians(x) for body, x in by_body)
    is_large = any(abs(x) > TURN for body, x in by_body if not body.slides)
    closes = distance_to_assembly(linkage, start) <= MAX_START_ERROR
    if closes and not is_large:
        return
    closes_in_degrees = distance_to_assembly(linkage, from_degrees) <= MAX_START_ERROR
    if closes_in_degrees or (is_large and not closes):
        coordinates = ', '.join(f'{body.angle} {x:g}' for body, x in by_body)
        assemblies = describe_assemblies(linkage, from_degrees[0], in_degrees=True)
        raise GeometryError(
            f'the start ({coordinates}) is in radians near no pose in which it closes; '
            f'{DEGREES_HINT}; {assemblies}'
        )


# jsonschema types an error's attributes with a marker for unset ones: hence Any.
TYPES = {
    'array': 'a list',
    'boolean': 'true or false',
    'integer': 'a whole number',
    'number': 'a number',
    'object': 'a mapping',
    'string': 'a text',
}


def schema_error(content: Any, package: str = __package__) -> str:
    """
    Return the first error of a file's content, with its place; empty if there is none.

    The schema is the one in the package, for a linkage by default.
    """
    schema = _schema(package)
    if content is None:
        keys = [*schema['required'], *schema.get('else', {}).get('required', ()), 'start']
        return f'it is empty: it must have {", ".join(keys)}'
    # jsonschema takes longer to load than everything else of the kinematics.
    from jsonschema import Draft202012Validator  # noqa: PLC0415
    from jsonschema.exceptions import best_match  # noqa: PLC0415

    error = best_match(Draft202012Validator(schema).iter_errors(content))
    if error is None:
        return ''
    keys = [f'[{key}]' if isinstance(key, int) else f'.{key}' for key in error.absolute_path]
    place = ''.join(keys).lstrip('.')
    instance = _shortened(error.instance)
    text = f'{instance} is not allowed by the rule {error.validator}'
    if error.validator in _SCHEMA_ERRORS:
        text = _SCHEMA_ERRORS[error.validator](error, instance)
    return f'{place}: {text}' if place else text


@cache
def _schema(package: str) -> dict[str, Any]:
    from importlib import resources  # noqa: PLC0415 - it loads archives

    text = (resources.files(package) / 'schema.json').read_text(encoding='utf-8')
    schema: dict[str, Any] = json.loads(text)
    if package != __package__:
        # Requirements have the parts of a linkage.
        schema['$defs'] = {**_schema(__package__)['$defs'], **schema.get('$defs', {})}
    return schema


def _shortened(instance: Any) -> str:
    shortener = Repr()
    shortener.maxstring = shortener.maxother = shortener.maxlong = 40
    return shortener.repr(instance)


def _missing(error: Any, _: str) -> str:
    names = [name for name in error.validator_value if name not in error.instance]
    return f'{", ".join(names)} {"are" if len(names) > 1 else "is"} missing'


def _unknown(error: Any, _: str) -> str:
    allowed = list(error.schema['properties'])
    unknown = [key for key in error.instance if key not in allowed]
    hint = did_you_mean(unknown[0], allowed)
    names = ', '.join(map(_shortened, unknown))
    return f'{names} is unknown here: there can be {", ".join(allowed)}{hint}'


def _type(error: Any, instance: str) -> str:
    if 'propertyNames' in error.absolute_schema_path:
        return f'the name {instance} is no text: write it in quotation marks'
    kinds = error.validator_value
    if isinstance(kinds, str):
        kinds = [kinds]
    return f'{instance} must be {" or ".join(TYPES[kind] for kind in kinds)}'


def _count(error: Any, instance: str) -> str:
    limits = error.schema
    if 'minItems' in limits and limits['minItems'] == limits.get('maxItems'):
        return f'{instance} must be [x, y]'
    limit = error.validator_value
    return f'there must be {limit} or {"more" if error.validator.startswith("min") else "fewer"}'


# Texts by the rule of the schema: of an error, and of the shortened instance.
_SCHEMA_ERRORS: dict[str, Callable[[Any, str], str]] = {
    'required': _missing,
    'additionalProperties': _unknown,
    'type': _type,
    'exclusiveMinimum': lambda error, text: f'{text} must be > {error.validator_value:g}',
    'minimum': lambda error, text: f'{text} must be >= {error.validator_value:g}',
    'maximum': lambda error, text: f'{text} must be <= {error.validator_value:g}',
    'enum': lambda e, text: f'{text} must be one of {", ".join(map(str, e.validator_value))}',
    # Rules that several keys break together: the schema has their texts.
    **dict.fromkeys(('not', 'anyOf'), lambda error, _: error.schema['errorMessage']),
    'uniqueItems': lambda *_: 'a name is there twice',
    **dict.fromkeys(('minItems', 'maxItems', 'minProperties', 'maxProperties'), _count),
    **dict.fromkeys(
        ('pattern', 'minLength', 'maxLength'),
        lambda _, text: f'{text} is no name: letters, digits and _, a letter first',
    ),
}
