"""`import_linkage`: a linkage file from a mechanism of another program."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
import sys
from typing import Any

from klann_ros.cli import ArgumentParser, NOT_READ, Output
from klann_ros.kinematics import linkage_from_text, LinkageFileError
from klann_ros.sanitize.files import read_regular
from klann_ros.sanitize.text import printable, printable_line
from klann_ros.sanitize.yaml_text import dump, MAX_FILE_SIZE

from .forms import FORMS, INCH, read_mechanism
from .mechanism import linkage_content, MechanismError

DESCRIPTION = """\
Write a linkage file (YAML) from a mechanism of another program, by the coordinates of its joints.

SOURCE is a file, - for the standard input, or the text itself, in one of these forms:
  pyslvs    expression of Pyslvs, M[J[R, P[x, y], L[ground, L1]], ...], or its YAML file
  pmks+     URL of PMKS+
  linkage2  .linkage2 file of Linkage by D. Rector
  csv       table of joints: name, x, y, links; with a header also type, angle [deg], driven,
            traced"""
EPILOG = """\
Gears, chains, several motors and linear actuators are refused.
Exit code: 0 written, 2 SOURCE or an option is refused, 3 OUT.yaml cannot be written."""
UNITS = {'mm': 1.0, 'cm': 10.0, 'm': 1000.0, 'in': INCH}
# Characters of a text that is no path.
TEXT_MARKS = ('[', '?', '\n', '|', '<')


def main(argv: Sequence[str] | None = None) -> int:
    """Import a linkage; return the exit code."""
    return _parser().run(_import, {MechanismError: NOT_READ}, argv)


def _import(options: argparse.Namespace) -> int:
    """Write or print the linkage file; return the exit code."""
    output = Output('-o', options.output)
    if options.output is not None:
        output.check([options.source])
    text, name = _source(options.source)
    try:
        mechanism = read_mechanism(text, options.form)
        unit = UNITS.get(options.unit, 0.0)
        content = linkage_content(mechanism, options.crank, options.foot, unit)
        stem = Path(name).stem if Path(name).suffix else 'Imported linkage'
        title = printable(options.name or stem, 150)
        source = f'imported from {printable(name)} ({mechanism.form})'
        yaml = file_text(title, source, content)
        linkage_from_text(yaml, name)
    except (MechanismError, LinkageFileError) as error:
        reason = printable_line(error).removeprefix(f'{printable(name)} holds no linkage: ')
        raise MechanismError(f'{printable(name)} is refused: {reason}') from error
    if options.output is None:
        print(yaml, end='')
    else:
        output.write(yaml.encode())
        print(f'written: {printable(options.output)}')
    chosen = f'crank {content["crank"]}, foot {content["foot"]}'
    print(f'import_linkage: {chosen}; others by --crank and --foot', file=sys.stderr)
    return 0


def file_text(name: str, source: str, content: Mapping[str, Any]) -> str:
    """Return the text of a linkage file."""
    header = {'name': name, 'source': source, 'units': {'length': 'mm'}}
    return f'{dump({**header, **content}, flow_style=None)}\n'


def _source(source: str) -> tuple[str, str]:
    """Return the text of a source, and its name."""
    try:
        if source != '-':
            return read_regular(source, MAX_FILE_SIZE), source
        data = sys.stdin.buffer.read(MAX_FILE_SIZE + 1)
        if len(data) <= MAX_FILE_SIZE:
            return data.decode(), 'the standard input'
        reason: object = f'it is longer than {MAX_FILE_SIZE} bytes'
    except (OSError, ValueError) as error:
        if isinstance(error, OSError) and any(mark in source for mark in TEXT_MARKS):
            return source, 'the text'
        reason = getattr(error, 'strerror', None) or error
    raise MechanismError(f'{printable(source)} cannot be read: {reason}')


def _parser() -> ArgumentParser:
    parser = ArgumentParser('import_linkage', DESCRIPTION, EPILOG)
    add = parser.add_argument
    add('source', metavar='SOURCE', help='a file, -, or a text')
    add('-o', '--output', metavar='OUT.yaml', help='the linkage file; printed by default')
    add('--form', choices=FORMS, default='', help='of SOURCE; recognised by default')
    add('--crank', metavar='LINK', default='', help='the driven link')
    add('--foot', metavar='JOINT', default='', help='the published point')
    add('--unit', choices=UNITS, help='of SOURCE; by default as its form has it, else mm')
    add('--name', metavar='NAME', default='', help='of the linkage; by default that of the file')
    return parser
