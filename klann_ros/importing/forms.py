"""Readers of mechanisms in the forms of other programs, by the grammar of their sources."""

from cmath import rect
from collections.abc import Callable, Iterable, Sequence
import csv
from dataclasses import replace
from math import inf, radians
import re
from urllib.parse import unquote
from xml.etree import ElementTree as ET

from klann_ros.kinematics import GROUND
from klann_ros.sanitize.text import printable, printable_line
from klann_ros.sanitize.yaml_text import load

from .mechanism import Joint, MAX_JOINTS, Mechanism, MechanismError, PIN, PIN_IN_SLOT, SLIDER

INCH = 25.4  # [mm]
MAX_NUMBER = 1e15
_PYSLVS_JOINT = re.compile(
    r'J\[(RP|R|P)(?:,A\[([-+.\deE]*)\])?(?:,color\[[^][]*\])?,'
    r'P\[([-+.\deE]*),([-+.\deE]*)\],L\[([^][]*)\]\]'
)
# Names of the ground; every name that begins with ground is one, too.
_GROUND_NAMES = {'0', 'gnd', 'grnd', 'frame', 'base', 'fixed'}
_PMKS_PLUS = re.compile(r'(?:[\w,-]*\.){4}\S*')
_PMKS_PLUS_DIGITS = '0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_-'
# The layer of drawings in files of Linkage, and attributes of what no linkage file can describe.
_DRAWING_LAYER = '1'
_LINKAGE2_REFUSED = ('actuator', 'gear', 'fasten', 'fastenlink', 'fastenconnector', 'slideradius')
_COLUMNS = ('name', 'x', 'y', 'links', 'type', 'angle', 'driven', 'traced')


def read_mechanism(text: str, form: str = '') -> Mechanism:
    """
    Return the mechanism in a text, whose form is recognised if it is not stated.

    A MechanismError names what the text lacks, or what no linkage file can describe.
    """
    text = text.lstrip('\ufeff').strip()
    if not text:
        raise MechanismError('it is empty')
    return FORMS[form or _form_of(text)](text)


def _form_of(text: str) -> str:
    if text.startswith('<'):
        return 'linkage2'
    if re.search(r'\bM ?\[', text):
        return 'pyslvs'
    return 'pmks+' if _PMKS_PLUS.fullmatch(text.rpartition('?')[2]) else 'csv'


def _read_pyslvs(text: str) -> Mechanism:
    """Read an expression of Pyslvs (expression_parser.py), or its YAML file, with its motors."""
    motors: Sequence[Sequence[int]] = ()
    joints = []
    try:
        if re.search(r'\bmechanism[\'"]? ?:', text):
            project = load(text)
            text, motors = project['mechanism'], project.get('input', ())
        expression = re.sub(r'\s+', '', re.sub(r'#\[[^#]*#\]|#[^\n]*', '', text))
        remainder = _PYSLVS_JOINT.sub('', expression).replace(',', '')
        if remainder != 'M[]':
            remainder = printable(remainder, 60)
            raise MechanismError(f'{remainder} is not M[J[R, P[x, y], L[link, ...]], ...]')
        for number, match in enumerate(_PYSLVS_JOINT.finditer(expression)):
            kind, angle, x, y, links = match.groups()
            name = f'P{number}'
            direction = radians(_number(angle or '0'))
            joints.append(_joint(name, (x, y), links.split(','), kind, direction))
        for base, drive in motors:
            # The motor at the first joint turns the link that leads to the second.
            if not {base, drive}.issubset(range(len(joints))):
                raise MechanismError(f'input: {printable([base, drive], 60)} are no two joints')
            links = [link for link in joints[base].links if link in joints[drive].links]
            joints[base] = replace(joints[base], driven=(*joints[base].driven, *links))
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise MechanismError(f'no expression of Pyslvs: {printable_line(error)}') from error
    return Mechanism([joint for joint in joints if joint.links], 'Pyslvs expression')


def _read_pmks_plus(text: str) -> Mechanism:
    """Read the URL of PMKS+ (string-transcoder.ts), whose numbers have the base 64."""
    links: dict[str, list[str]] = {}
    joints = []
    try:
        *_, enums, records = unquote(text.rpartition('?')[2]).split('.', 4)
        unit = (INCH, 10.0, 1000.0)[int(enums[0])]
        joint_records, link_records, _ = records.split('..', 2)
        for record in link_records.split('.'):
            name, *fields = record.split(',')
            # Y marks a whole link, N a part that is welded to others. An empty joint ends them.
            end = fields.index('', 6)
            for member in fields[6:end] if name.startswith('Y') else ():
                links.setdefault(member, []).append(name[2:])
        for record in joint_records.split('.'):
            name, _, x, y, angle = record.split(',')
            flags = _PMKS_PLUS_DIGITS.index(name[0])
            members = [GROUND] if flags & 4 else []
            members += links.get(name[1:], [])
            kind = SLIDER if flags & 1 else PIN
            position = f'{_base_64(x)}', f'{_base_64(y)}'
            joint = _joint(name[1:], position, members, kind, _base_64(angle))
            driven = joint.links if flags & 2 else ()
            joints.append(replace(joint, driven=driven, is_traced=bool(flags & 16)))
    except (IndexError, ValueError) as error:
        raise MechanismError(f'no whole URL of PMKS+: {printable_line(error)}') from error
    return Mechanism(joints, 'PMKS+ URL', unit)


def _base_64(digits: str) -> float:
    """Return a number in thousandths, negative with a 0 before it; nine digits are enough."""
    number = 0
    for digit in digits[:9]:
        number = 64 * number + _PMKS_PLUS_DIGITS.index(digit)
    return (-number if digits.startswith('0') else number) / 1000.0


def _read_linkage2(text: str) -> Mechanism:
    """Read a file of Rector's Linkage (linkageDoc.cpp, ReadIn), its lengths in 1/96 in."""
    if '<!DOCTYPE' in text or '<!ENTITY' in text:
        raise MechanismError('it has a document type, which may hold anything')
    try:
        # Without entities, and of limited size. Linkage writes & in names as it is.
        root = ET.fromstring(re.sub(r'&(?!#?\w+;)', '&amp;', text))  # noqa: S314
    except (ET.ParseError, ValueError) as error:
        raise MechanismError(f'it is no XML: {printable_line(error)}') from error
    if root.tag != 'linkage2':
        raise MechanismError('it is no <linkage2>; a URDF, such as <robot>, lacks its loops')
    if root.find('ratios/ratio') is not None:
        raise MechanismError('it has gears or chains')
    links: dict[str, list[str]] = {}
    for number, link in enumerate(_linkage2_elements(root, 'Link', 'element')):
        for connector in link.iterfind('connector'):
            links.setdefault(connector.get('id', ''), []).append(f'link{number}')
    joints = {}
    for connector in _linkage2_elements(root, 'connector'):
        name = connector.get('id', '')
        position = connector.get('x', ''), connector.get('y', '')
        members = [GROUND] if connector.get('anchor') == 'true' else []
        joint = _joint(f'P{name}', position, [*members, *links.get(name, [])], PIN, 0.0)
        driven = joint.links if connector.get('input') == 'true' else ()
        joints[name] = replace(joint, driven=driven, is_traced=connector.get('draw') == 'true')
    for slider in root.iterfind('connector[@slider="true"]'):
        name = slider.get('id', '')
        ends = [joints.get(limit.get('id', '')) for limit in slider.iterfind('slidelimit')]
        if name in joints:
            joints[name] = _in_slot(joints[name], *ends)
    joined = [joint for joint in joints.values() if joint.links]
    return Mechanism(joined, 'Linkage file', INCH / 96.0)


def _linkage2_elements(root: ET.Element, *tags: str) -> list[ET.Element]:
    """Return the elements that are no drawings; a MechanismError for one of a refused kind."""
    elements = []
    for element in root:
        if element.tag in tags and element.get('layer') != _DRAWING_LAYER:
            for attribute in _LINKAGE2_REFUSED:
                if element.get(attribute, 'false') != 'false':
                    name = f'{element.tag} {printable(element.get("id"), 60)}'
                    raise MechanismError(f'{name} has {attribute}="...": it cannot be described')
            elements.append(element)
    return elements


def _in_slot(joint: Joint, *ends: Joint | None) -> Joint:
    """Return a joint as a pin in the slot of the link that has both ends of the slot."""
    if len(ends) == 2 and ends[0] and ends[1] and ends[0].position != ends[1].position:
        way = ends[1].position - ends[0].position
        for carrier in ends[0].links:
            if carrier in ends[1].links:
                links = (carrier, *(link for link in joint.links if link != carrier))
                direction = way / abs(way)
                return replace(joint, links=links, kind=PIN_IN_SLOT, direction=direction)
    raise MechanismError(f'{printable(joint.name, 60)} slides between no two points of a link')


def _read_csv(text: str) -> Mechanism:
    """Read a table of joints, its columns named by a header, or in the order name, x, y, links."""
    lines = text.splitlines()
    delimiter = next((character for character in ';\t' if character in lines[0]), ',')
    joints: list[Joint] = []
    try:
        rows = [[*map(str.strip, row)] for row in csv.reader(lines, delimiter=delimiter)]
        columns = [cell.lower() for cell in rows[0]]
        has_header = {'name', 'x', 'y', 'links'}.issubset(columns)
        # One joint more than are read is refused.
        start, end = int(has_header), MAX_JOINTS + 2
        for row in filter(any, rows[start:end]):
            cells = dict.fromkeys(_COLUMNS, '')
            cells |= zip(columns if has_header else _COLUMNS[:3], row, strict=False)
            if not has_header:
                cells['links'] = ' '.join(row[3:])
            if delimiter != ',':
                cells = {column: cell.replace(',', '.') for column, cell in cells.items()}
            links = re.split(r'[\s+/|;]+', cells['links'])
            kind = cells['type'].upper() or PIN
            angle = radians(_number(cells['angle'] or '0'))
            joint = _joint(cells['name'], (cells['x'], cells['y']), links, kind, angle)
            # The name of the driven link, or any mark for all that the joint has.
            motor = cells['driven']
            driven = (motor,) if motor in joint.links else joint.links if motor else ()
            joints.append(replace(joint, driven=driven, is_traced=bool(cells['traced'])))
    except (csv.Error, MechanismError) as error:
        place = f'no table of joints (name, x, y, links) in line {len(joints) + 1}'
        raise MechanismError(f'{place}: {printable_line(error)}') from error
    return Mechanism(joints, 'table of joints')


def _joint(
    name: str, position: Iterable[str], links: Iterable[str], kind: str, angle: float
) -> Joint:
    """Return a joint of texts, its angle in rad; a MechanismError for one of another kind."""
    if kind not in {PIN, SLIDER, PIN_IN_SLOT}:
        noun = 'a gear' if kind == 'G' else 'no R, P or RP'
        raise MechanismError(f'the joint {printable(name, 60)} is {noun}')
    members = []
    for link in filter(None, map(str.strip, links)):
        is_ground = link.lower() in _GROUND_NAMES or link.lower().startswith(GROUND)
        members.append(GROUND if is_ground else link)
    x, y = map(_number, position)
    return Joint(name, complex(x, y), tuple(members), kind, rect(1.0, angle)).renamed({})


def _number(text: str) -> float:
    """Return the number in a text; a MechanismError for none, or one of no use."""
    try:
        number = float(text)
    except ValueError:
        number = inf
    if not abs(number) < MAX_NUMBER:
        raise MechanismError(f'{printable(repr(text), 60)} is no number')
    return number


FORMS: dict[str, Callable[[str], Mechanism]] = {
    'pyslvs': _read_pyslvs,
    'pmks+': _read_pmks_plus,
    'linkage2': _read_linkage2,
    'csv': _read_csv,
}
"""The readers by their forms."""
