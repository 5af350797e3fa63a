"""Readers of mechanisms in the forms of other programs, by the grammar of their sources."""

from cmath import rect
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
import csv
from dataclasses import replace
from itertools import islice
from math import radians
import re
from typing import Any
from urllib.parse import unquote

from klann_ros.kinematics import GROUND
from klann_ros.sanitize.text import listed, printable, printable_line
from klann_ros.sanitize.yaml_text import load, MAX_FILE_SIZE, YamlError

from .mechanism import Joint, MAX_JOINTS, MechanismError, PIN, PIN_IN_SLOT, SLIDER
from .urdf import read_urdf, SIDECAR, xml_root

INCH = 25.4  # [mm]
_NUMBER = r'[-+.\deE]*'
_PYSLVS_JOINT = re.compile(
    rf'J\[(?P<type>RP|R|P)(?:,A\[(?P<angle>{_NUMBER})\])?(?:,color\[[^][]*\])?,'
    rf'P\[(?P<x>{_NUMBER}),(?P<y>{_NUMBER})\],L\[(?P<links>[^][]*)\]\]'
)
# Between single blanks; the marks of a joint are tttt, or ++++, if it is traced, ..., driven.
_PMKS_JOINT = re.compile(
    rf'(?im)^ ?(?P<links>[^\n=]+?) (?P<type>RP|[RPG]) (?P<x>{_NUMBER}) (?P<y>{_NUMBER})'
    rf'( (?P<angle>[-+]?[.\d]{_NUMBER}))?( (?P<traced>[tf+-])[tf+-]{{2}}(?P<driven>[tf+-]))? ?$'
)
_PMKS_START = r'(?!<)(.*\bmech=|[^|\n]+[\s,](?i:R|P|RP|G)[\s,]+[-.\d]+[\s,]+[-.\d])'
_PMKS_PLUS_DIGITS = '0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_-'
_NO = {'', '0', 'no', 'f', 'false', '-'}  # cells that mark no joint
# Attributes in files of Linkage of what no linkage file can describe.
_LINKAGE2_REFUSED = ('actuator', 'gear', 'fasten', 'fastenlink', 'fastenconnector', 'slideradius')


def read_joints(text: str, form: str, unit: float, read_loops: Callable[[], str]) -> list[Joint]:
    """
    Return the joints in a text, whose form is recognised if it is ''.

    `unit` is that of forms without one [mm]; `read_loops` returns the text of a URDF's sidecar. A
    MechanismError names what is wrong.
    """
    text = text.lstrip('\ufeff').strip()
    if not 0 < len(text) <= MAX_FILE_SIZE:
        raise MechanismError(f'it has {len(text)} characters: 1 to {MAX_FILE_SIZE} are read')
    form = form or next(name for name in FORMS if re.match(FORMS[name][1], text, re.DOTALL))
    reader, _, description = FORMS[form]
    texts = (text, read_loops()) if form == 'urdf' else (text,)
    try:
        joints = [joint for joint in reader(*texts) if joint.links]
    except (AttributeError, csv.Error, LookupError, SyntaxError, TypeError, ValueError) as error:
        reason = printable_line(error)
        if not isinstance(error, csv.Error | MechanismError | SyntaxError | YamlError):
            # Python's words about a missing part mean nothing to users.
            reason = 'a part of it is missing, or is no number'
        raise MechanismError(f'it is no {description}: {reason}') from error
    scale = {'pyslvs': unit, 'pmks': unit, 'csv': unit, 'linkage2': INCH / 96.0}.get(form, 1.0)
    return [replace(joint, position=scale * joint.position) for joint in joints]


def _read_pyslvs(text: str) -> list[Joint]:
    """Read an expression of Pyslvs (expression_parser.py), or its YAML file, with its motors."""
    is_file = re.search(r'\bmechanism[\'"]? ?:', text)
    project: Any = load(text) if is_file else {'mechanism': text}
    expression = re.sub(r'#\[[^#]*#\]|#[^\n]*|\s+', '', project['mechanism'])
    joints = _matched_joints(_PYSLVS_JOINT, expression, 'M[]')
    for base, drive in project.get('input', ()):
        joints[base] = replace(joints[base], is_driven=bool(joints[drive]))
    return joints


def _read_pmks(text: str) -> list[Joint]:
    """Read the joints of PMKS (ConvertTextToData), or its URL with them."""
    records = re.sub(r'(?s)^.*?\bmech=', '', unquote(text), count=1).replace('|', '\n')
    return _matched_joints(_PMKS_JOINT, re.sub(r'[ \t\r,]+', ' ', records))


def _matched_joints(pattern: re.Pattern[str], text: str, frame: str = '') -> list[Joint]:
    """Return the joints P0, P1, ... in a text; a MechanismError for more than their frame."""
    remainder = re.sub(r'[\s,]+', '', pattern.sub('', text))
    if remainder != frame:
        raise MechanismError(f'{printable(remainder, 60)} is left of it')
    rows = [match.groupdict('') for match in pattern.finditer(text)]
    return [_joint({**row, 'name': f'P{number}'}) for number, row in enumerate(rows)]


def _read_pmks_plus(text: str) -> Iterator[Joint]:
    """Read the URL of PMKS+ (string-transcoder.ts), whose numbers have the base 64."""
    *_, enums, records = unquote(text.rpartition('?')[2]).split('.', 4)
    unit = (INCH, 10.0, 1000.0)[int(enums[0])]
    joint_records, link_records, _ = records.split('..', 2)
    links: dict[str, list[str]] = defaultdict(list)
    for record in link_records.split('.'):
        name, *fields = record.split(',')
        # A whole link, or a part that is welded to others. An empty joint ends them.
        end = fields.index('', 6)
        for joint in fields[6:end] if name[0] in 'YAMG0123' else ():
            links[joint].append(name[1:])
    rows = [record.split(',') for record in joint_records.split('.')]
    places = {row[0][1:]: unit * complex(_base_64(row[2]), _base_64(row[3])) for row in rows}
    for (name, _, _, _, angle, *slot), position in zip(rows, places.values(), strict=True):
        # Bits: in a slot, driven, on the ground, welded, traced. P marks a piston's link.
        flags = _PMKS_PLUS_DIGITS.index(name[0])
        carrier, *ends = slot[:3] if any(slot[:3]) else [GROUND * bool(flags & 4)]
        line = places[ends[1]] - places[ends[0]] if ends else rect(1.0, _base_64(angle))
        members = dict.fromkeys([carrier, *(link[1:] for link in links[name[1:]])])
        is_guided = flags & 8 or any(link.startswith('P') for link in links[name[1:]])
        kind = (SLIDER if is_guided else PIN_IN_SLOT) if flags & 1 else PIN
        marks = bool(flags & 2), bool(flags & 16)
        direction = line / (abs(line) or 1.0)
        yield Joint(name[1:], position, tuple(filter(None, members)), kind, direction, *marks)


def _base_64(digits: str) -> float:
    """Return a number in thousandths, negative with a 0 before it; nine digits are enough."""
    number = 0
    for digit in digits[:9]:
        number = 64 * number + _PMKS_PLUS_DIGITS.index(digit)
    return (-number if digits.startswith('0') else number) / 1000.0


def _read_linkage2(text: str) -> Iterable[Joint]:
    """Read a file of Rector's Linkage (linkageDoc.cpp, ReadIn), its lengths in 1/96 in."""
    # Linkage writes & in names as it is, and reads attributes without a space between them.
    text = re.sub(r'(="[^"<]*")(?=\w)', r'\1 ', re.sub(r'&(?!#?\w+;)', '&amp;', text))
    root = xml_root(text, 'linkage2')
    elements = [element for element in root if element.get('layer') != '1']  # of drawings
    for element in elements:
        for attribute in _LINKAGE2_REFUSED:
            if element.get(attribute, 'false') != 'false':
                name = f'{element.tag} {printable(element.get("id"), 60)}'
                raise MechanismError(f'{name} has {attribute}="...", which cannot be described')
    members: dict[str, list[str]] = defaultdict(list)
    # Links are called by their numbers: their identifiers may be there twice.
    for number, link in enumerate(e for e in elements if e.tag in {'Link', 'element'}):
        for connector in link.iterfind('connector'):
            members[connector.get('id', '')].append(f'link{number}')
    joints = {}
    for connector in root.iterfind('connector'):
        name, *cells = (connector.get(key, '') for key in ('id', 'x', 'y', 'input', 'draw'))
        links = ([GROUND] if connector.get('anchor') == 'true' else []) + members[name]
        row = dict(zip(('x', 'y', 'driven', 'traced'), cells, strict=True))
        joints[name] = _joint({**row, 'name': f'P{name}', 'links': ' '.join(links)})
    for slider in root.iterfind('connector[@slider="true"]'):
        name = slider.get('id', '')
        ends = [joints[limit.get('id', '')] for limit in slider.iterfind('slidelimit')]
        carriers = [link for link in ends[0].links if link in ends[-1].links] if ends else []
        if len(ends) != 2 or not carriers:
            connector_name = f'connector {printable(name, 60)}'
            raise MechanismError(f'{connector_name} slides between no points of a link')
        way = ends[1].position - ends[0].position
        joint = replace(joints[name], kind=PIN_IN_SLOT, direction=way / (abs(way) or 1.0))
        joints[name] = replace(joint, links=(carriers[0], *joint.links))
    return joints.values()


def _read_csv(text: str) -> Iterator[Joint]:
    """Read a table of joints, its columns named by a header, or in the order name, x, y, links."""
    lines = [line for line in text.splitlines() if re.match('(?!sep=|# )[ ,;\t]*[^ ,;\t]', line)]
    delimiter = next((mark for mark in ';\t' if mark in lines[0]), ',')
    header = [cell.strip().lower() for cell in next(csv.reader(lines, delimiter=delimiter))]
    if units := [cell for cell in header if re.match(r'(x|y|angle) *[\[(]', cell)]:
        raise MechanismError(f'{listed(units)}: lengths are in --unit, angles in deg; omit units')
    has_header = {'name', 'x', 'y', 'links'}.issubset(header)
    columns = header if has_header else ('name', 'x', 'y', 'links')
    rows = csv.DictReader(lines[has_header:], columns, restval='', delimiter=delimiter)
    for row in islice(rows, MAX_JOINTS + 1):
        cells = [row['links'], *row.pop(None, [])]
        # A decimal comma between commas makes two cells of a number.
        if len(cells) == 3 and re.fullmatch(r'[-\s\d]+', cells[0] + cells[1]) and cells[2].strip():
            raise MechanismError(f'{listed(cells)} are no links: state them in one cell, or use ;')
        row['links'] = ' '.join(cells)
        for column in {'x', 'y', 'angle'}.intersection(row) if delimiter != ',' else ():
            row[column] = row[column].replace(',', '.')
        yield _joint(row)


def _joint(row: Mapping[str, str]) -> Joint:
    """Return the joint of a table's row, which has name, x, y and links at least."""
    cells = defaultdict(str, {column: cell.strip() for column, cell in row.items()})
    label = f'the joint {printable(cells["name"], 60)}'
    kind = cells['type'].upper() or PIN
    if kind not in {PIN, SLIDER, PIN_IN_SLOT}:
        raise MechanismError(f'{label} is no R, P or RP, but maybe a gear')
    links = []
    for link in filter(None, re.split(r'[\s+/|;,]+', cells['links'])):
        links.append(GROUND if link.lower().startswith((GROUND, 'gnd', 'grnd')) else link)
    try:
        position = complex(float(cells['x']), float(cells['y']))
        direction = rect(1.0, radians(float(cells['angle'] or 0.0)))
    except ValueError:
        raise MechanismError(f'the x, y or angle of {label} is no number') from None
    marks = [cells[mark].lower() not in _NO for mark in ('driven', 'traced')]
    return Joint(cells['name'], position, tuple(links), kind, direction, *marks)


# The reader of a form, the start of its texts (the first that matches counts), its description.
FORMS: dict[str, tuple[Callable[..., Iterable[Joint]], str, str]] = {
    'pyslvs': (_read_pyslvs, r'(?!<).*\bM ?\[', 'M[J[R, P[x, y], L[ground, a]], ...] of Pyslvs'),
    'pmks+': (_read_pmks_plus, r'(?!<)(.*\?)?([\w,%-]*\.){4}[^\n?]*$', 'whole URL of PMKS+'),
    'pmks': (_read_pmks, _PMKS_START, 'URL or text of PMKS, in lines as ground, L1, R, 0, 0'),
    'linkage2': (_read_linkage2, '(?!.*<robot)<', '.linkage2 file of Linkage by D. Rector'),
    'urdf': (read_urdf, '<', f'planar URDF with {SIDECAR} (scikit-robot, robonex)'),
    'csv': (_read_csv, '', 'table: name, x, y, links (type, angle, driven, traced by a header)'),
}
