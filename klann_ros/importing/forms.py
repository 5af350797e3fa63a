"""Readers of mechanisms in the forms of other programs, by the grammar of their sources."""

from cmath import rect
from collections.abc import Callable, Iterable
import csv
from dataclasses import replace
from itertools import islice
from math import radians
import re
from typing import Any
from urllib.parse import unquote

from klann_ros.kinematics import GROUND
from klann_ros.sanitize.text import printable, printable_line
from klann_ros.sanitize.yaml_text import load, MAX_FILE_SIZE, YamlError

from .mechanism import Joint, MAX_JOINTS, MechanismError, PIN, PIN_IN_SLOT, SLIDER
from .urdf import read_urdf, SIDECAR, xml_root

INCH = 25.4  # [mm]
MAX_DIGITS = 60
_NUMBER = r'([-+.\deE]*)'
_PYSLVS_JOINT = re.compile(
    rf'J\[(RP|R|P)(?:,A\[{_NUMBER}\])?(?:,color\[[^][]*\])?,P\[{_NUMBER},{_NUMBER}\],L\[([^][]*)\]\]'
)
_PMKS_PLUS = re.compile(r'(?:[\w,-]*\.){4}\S*')
_PMKS_PLUS_DIGITS = '0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_-'
# Attributes in files of Linkage of what no linkage file can describe; the layer of drawings.
_LINKAGE2_REFUSED = ('actuator', 'gear', 'fasten', 'fastenlink', 'fastenconnector', 'slideradius')
_DRAWING_LAYER = '1'


def read_joints(text: str, form: str = '', unit: float = 1.0, loops: str = '') -> list[Joint]:
    """
    Return the joints in a text, whose form is recognised if it is not stated.

    Lengths of forms without a unit are in `unit` [mm]; `loops` is the text of a URDF's
    `loop_closures.yaml`. A MechanismError names what is wrong.
    """
    text = text.lstrip('\ufeff').strip()
    if not form:
        form = 'pmks+' if _PMKS_PLUS.fullmatch(text.rpartition('?')[2]) else 'csv'
        form = 'pyslvs' if re.search(r'\bM ?\[', text) else form
        form = 'linkage2' if text.startswith('<') else form
        form = 'urdf' if form == 'linkage2' and '<robot' in text else form
    if not 0 < len(text) <= MAX_FILE_SIZE:
        raise MechanismError(f'it has {len(text)} characters: 1 to {MAX_FILE_SIZE} are read')
    reader, description = FORMS[form]
    try:
        joints = read_urdf(text, loops) if form == 'urdf' else reader(text)
    except (csv.Error, MechanismError, SyntaxError, YamlError) as error:
        raise MechanismError(f'it is no {description}: {printable_line(error)}') from error
    # Python's words about a missing part mean nothing to users.
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        reason = 'a part of it is missing, or is no number'
        raise MechanismError(f'it is no {description}: {reason}') from error
    joints = [joint for joint in joints if joint.links]
    scale = unit if form in {'pyslvs', 'csv'} else 1.0
    return [replace(joint, position=scale * joint.position) for joint in joints]


def _read_pyslvs(text: str) -> list[Joint]:
    """Read an expression of Pyslvs (expression_parser.py), or its YAML file, with its motors."""
    is_file = re.search(r'\bmechanism[\'"]? ?:', text)
    project: Any = load(text) if is_file else {'mechanism': text}
    expression = re.sub(r'#\[[^#]*#\]|#[^\n]*', '', project['mechanism'])
    expression = re.sub(r'\s+', '', expression)
    remainder = _PYSLVS_JOINT.sub('', expression).replace(',', '')
    if remainder != 'M[]':
        raise MechanismError(f'{printable(remainder, 60)} is left of it')
    joints = []
    for number, match in enumerate(_PYSLVS_JOINT.finditer(expression)):
        kind, angle, x, y, links = match.groups()
        joints.append(_joint(f'P{number}', x, y, links.split(','), kind, angle))
    for base, drive in project.get('input', ()):
        joints[base] = replace(joints[base], is_driven=bool(joints[drive]))
    return joints


def _read_pmks_plus(text: str) -> list[Joint]:
    """Read the URL of PMKS+ (string-transcoder.ts), whose numbers have the base 64."""
    *_, enums, records = unquote(text.rpartition('?')[2]).split('.', 4)
    unit = (INCH, 10.0, 1000.0)[int(enums[0])]
    joint_records, link_records, _ = records.split('..', 2)
    links: dict[str, list[str]] = {}
    for record in link_records.split('.'):
        name, *fields = record.split(',')
        # Y marks a whole link, N a part that is welded to others. An empty joint ends them.
        end = fields.index('', 6)
        for member in fields[6:end] if name.startswith('Y') else ():
            links.setdefault(member, []).append(name[2:])
    joints = []
    for record in joint_records.split('.'):
        name, _, x, y, angle = record.split(',')
        # Bits: a slider, driven, on the ground, welded, traced.
        flags = _PMKS_PLUS_DIGITS.index(name[0])
        members = (*([GROUND] if flags & 4 else []), *links.get(name[1:], []))
        place = unit * complex(_base_64(x), _base_64(y))
        joint = Joint(name[1:], place, members, SLIDER if flags & 1 else PIN)
        joint = replace(joint, direction=rect(1.0, _base_64(angle)), is_driven=bool(flags & 2))
        joints.append(replace(joint, is_traced=bool(flags & 16)).renamed({}))
    return joints


def _base_64(digits: str) -> float:
    """Return a number in thousandths, negative with a 0 before it; nine digits are enough."""
    places = [_PMKS_PLUS_DIGITS.index(digit) for digit in digits[8::-1]]
    number = sum(place * 64.0**power for power, place in enumerate(places))
    return (-number if digits.startswith('0') else number) / 1000.0


def _read_linkage2(text: str) -> list[Joint]:
    """Read a file of Rector's Linkage (linkageDoc.cpp, ReadIn), its lengths in 1/96 in."""
    # Linkage writes & in names as it is.
    root = xml_root(re.sub(r'&(?!#?\w+;)', '&amp;', text), 'linkage2')
    elements = [element for element in root if element.get('layer') != _DRAWING_LAYER]
    links: dict[str, list[str]] = {}
    # Links come first: their numbers are their names, as their identifiers may be there twice.
    elements.sort(key=lambda element: element.tag not in {'Link', 'element'})
    for number, element in enumerate(elements):
        name = f'{element.tag} {printable(element.get("id"), 60)}'
        for attribute in _LINKAGE2_REFUSED:
            if element.get(attribute, 'false') != 'false':
                raise MechanismError(f'{name} has {attribute}="...", which cannot be described')
        for connector in element.iterfind('connector') if element.tag != 'selected' else ():
            links.setdefault(connector.get('id', ''), []).append(f'link{number}')
    joints = {}
    for element in root.iterfind('connector'):
        name = element.get('id', '')
        flags = {flag for flag in ('anchor', 'input', 'draw') if element.get(flag) == 'true'}
        members = [GROUND, *links.get(name, [])] if 'anchor' in flags else links.get(name, [])
        joint = _joint(f'P{name}', element.get('x', ''), element.get('y', ''), members)
        joint = replace(joint, position=INCH / 96.0 * joint.position, is_traced='draw' in flags)
        joints[name] = replace(joint, is_driven='input' in flags)
    for slider in root.iterfind('connector[@slider="true"]'):
        name = slider.get('id', '')
        ends = [joints[limit.get('id', '')] for limit in slider.iterfind('slidelimit')]
        carriers = [link for link in ends[0].links if link in ends[-1].links] if ends else []
        if len(ends) != 2 or not carriers:
            raise MechanismError(
                f'connector {printable(name, 60)} slides between no points of a link'
            )
        way = ends[1].position - ends[0].position
        joint = replace(joints[name], kind=PIN_IN_SLOT, direction=way / (abs(way) or 1.0))
        joints[name] = replace(joint, links=(carriers[0], *joint.links)).renamed({})
    return list(joints.values())


def _read_csv(text: str) -> list[Joint]:
    """Read a table of joints, its columns named by a header, or in the order name, x, y, links."""
    lines = text.splitlines()
    delimiter = next((mark for mark in ';\t' if mark in lines[0]), ',')
    columns = [cell.strip().lower() for cell in next(csv.reader(lines, delimiter=delimiter))]
    has_header = {'name', 'x', 'y', 'links'}.issubset(columns)
    header = columns if has_header else ('name', 'x', 'y', 'links')
    reader = csv.DictReader(lines[has_header:], header, 'more', '', delimiter=delimiter)
    joints = []
    for row in islice(reader, MAX_JOINTS + 1):
        links = re.split(r'[\s+/|;,]+', ' '.join([row['links'], *row.pop('more', [])]))
        cells = {column: cell.strip() for column, cell in row.items()}
        if delimiter != ',':
            cells |= {name: cells.get(name, '').replace(',', '.') for name in ('x', 'y', 'angle')}
        kind = cells.get('type') or PIN
        joint = _joint(cells['name'], cells['x'], cells['y'], links, kind, cells.get('angle'))
        joint = replace(joint, is_driven=_is_marked(cells.get('driven', '')))
        joints.append(replace(joint, is_traced=_is_marked(cells.get('traced', ''))))
    return joints


def _is_marked(cell: str) -> bool:
    """Return whether a cell says yes."""
    return cell.lower() not in {'', '0', 'no', 'false', '-'}


def _joint(  # noqa: PLR0917 - in the order of a row
    name: str, x: str, y: str, links: Iterable[str], kind: str = PIN, angle: str | None = None
) -> Joint:
    """Return a joint of texts, its angle in degrees."""
    if kind not in {PIN, SLIDER, PIN_IN_SLOT}:
        raise MechanismError(f'the joint {printable(name, 60)} is no R, P or RP, but maybe a gear')
    members = []
    for link in filter(None, map(str.strip, links)):
        members.append(GROUND if link.lower().startswith(GROUND) else link)
    try:
        # More digits count for nothing.
        position = complex(float(x[:MAX_DIGITS]), float(y[:MAX_DIGITS]))
        direction = rect(1.0, radians(float(angle or 0.0)))
    except ValueError:
        problem = f'the x, y or angle of the joint {printable(name, 60)} is no number'
        raise MechanismError(problem) from None
    return Joint(name, position, tuple(members), kind, direction).renamed({})


# The reader of each form, and its description.
FORMS: dict[str, tuple[Callable[..., list[Joint]], str]] = {
    'pyslvs': (_read_pyslvs, 'M[J[R, P[x, y], L[ground, L1]], ...] of Pyslvs, or YAML with it'),
    'pmks+': (_read_pmks_plus, 'whole URL of PMKS+'),
    'linkage2': (_read_linkage2, '.linkage2 file of Linkage by D. Rector'),
    'urdf': (read_urdf, f'planar URDF with {SIDECAR} (scikit-robot, robonex)'),
    'csv': (_read_csv, 'table: name, x, y, links (type, angle, driven, traced by a header)'),
}
