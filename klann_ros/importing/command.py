"""`import_linkage`: a linkage file from a mechanism of another program."""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys

from klann_ros.cli import ArgumentParser, decoded_text, NOT_READ, Output
from klann_ros.kinematics import KinematicsError, linkage_from_text, LinkageLeg
from klann_ros.sanitize.files import is_regular_file
from klann_ros.sanitize.text import listed, printable, printable_line
from klann_ros.sanitize.yaml_text import dump, MAX_FILE_SIZE

from .forms import FORMS, INCH, read_joints
from .mechanism import linkage_content, MechanismError
from .urdf import SIDECAR

DESCRIPTION = """\
Write a linkage file (YAML) from a mechanism of another program, by the coordinates of its joints.

SOURCE is a file, - for the standard input, or the text itself, in one of these forms:
"""
EPILOG = """\
The loop_closures.yaml of a URDF is in its folder (of -, the current one), ../config or ./config.
Exit code: 0 written, 2 SOURCE or an option is refused, 3 OUT.yaml cannot be written."""
UNITS = {'mm': 1.0, 'cm': 10.0, 'm': 1000.0, 'in': INCH}


def main(argv: Sequence[str] | None = None) -> int:
    """Import a linkage; return the exit code."""
    return _parser().run(_import, {MechanismError: NOT_READ}, argv)


def _import(options: argparse.Namespace) -> int:
    """Write or print the linkage file; return the exit code."""
    output = Output('-o', options.output)
    folder = Path(options.source).parent
    sidecars = [str(folder / place / SIDECAR) for place in ('.', '../config', 'config')]
    if options.output is not None:
        output.check([options.source, *sidecars])
    text, name = _source(options.source)

    def read_loops() -> str:
        sidecar = next(filter(is_regular_file, sidecars), None)
        return '' if sidecar is None else _source(sidecar)[0]

    try:
        joints = read_joints(text, options.form, UNITS[options.unit], read_loops)
        content = linkage_content(joints, options.crank, options.foot)
        title = Path(name).stem[:150] if Path(name).suffix else 'Imported linkage'
        header = {'name': title, 'source': f'imported from {name}', 'units': {'length': 'mm'}}
        content |= {'assembly': options.assembly} if options.assembly else {}
        yaml = f'{dump({**header, **content}, flow_style=None)}\n'
        LinkageLeg(linkage_from_text(yaml, name)).reachable_arcs()
    except (MechanismError, KinematicsError, OverflowError) as error:
        reason = printable_line(error).removeprefix(f'{name} holds no linkage: ')
        raise MechanismError(f'{name} is refused: {reason}') from error
    if options.output is None:
        print(yaml, end='')
    else:
        output.write(yaml.encode())
        print(f'written: {printable(options.output)}')
    places = [complex(*place) for place in content['points'].values()]
    left_out = listed(joint.name for joint in joints if joint.position not in places)
    note = f'; left out, as on no link of two joints: {left_out}' if left_out else ''
    chosen = f'crank {content["crank"]}, foot {content["foot"]}'
    print(f'import_linkage: {chosen}; others by --crank and --foot{note}', file=sys.stderr)
    return 0


def _source(source: str) -> tuple[str, str]:
    """Return the text of a source, and its printable name."""
    name = 'standard input' if source == '-' else printable(source)
    try:
        return decoded_text(source, MechanismError, MAX_FILE_SIZE, may_be_xml=True), name
    except MechanismError as error:
        if isinstance(error.__cause__, OSError) and any(mark in source for mark in '[?\n<'):
            return source, 'text'
        raise


def _parser() -> ArgumentParser:
    forms = '\n'.join(f'  {form:8}  {description}' for form, (*_, description) in FORMS.items())
    parser = ArgumentParser('import_linkage', DESCRIPTION + forms, EPILOG)
    add = parser.add_argument
    add('source', metavar='SOURCE', help='a file, -, or a text')
    add('-o', '--output', metavar='OUT.yaml', help='the linkage file; printed by default')
    add('--form', choices=FORMS, default='', help='of SOURCE; recognised by default')
    add('--crank', metavar='LINK', default='', help='the driven link')
    add('--foot', metavar='JOINT', default='', help='the published point')
    add('--assembly', metavar='SIGN', type=int, nargs='+', help='at a dead point: 1 or -1 a dyad')
    add('--unit', choices=UNITS, default='mm', help='of a SOURCE that has none; mm by default')
    return parser
