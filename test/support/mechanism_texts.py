"""Mechanisms of a table, written in the forms of other programs."""

from collections.abc import Sequence

from natural_coordinates import GROUND, Row


def pyslvs_text(rows: Sequence[Row]) -> str:
    """Return the YAML of Pyslvs; the driven link leads from the motor to another joint."""
    joints = []
    for row in rows:
        kind = row.kind if row.kind == 'R' else f'{row.kind}, A[{row.angle}]'
        place = f'P[{row.position.real}, {row.position.imag}]'
        joints.append(f'J[{kind}, color[Green], {place}, L[{", ".join(row.links)}]]')
    pairs = []
    for base, row in enumerate(rows):
        for drive, other in enumerate(rows):
            if row.driven in other.links and drive != base and not pairs:
                pairs.append([base, drive])
    return f'input: {pairs}\nmechanism: "M[{", ".join(joints)}]"\n'


def pmks_text(rows: Sequence[Row]) -> str:
    """Return the URL of PMKS, whose last mark is that of the motor."""
    records = []
    for row in rows:
        place = f'{row.position.real},{row.position.imag},{row.angle}'
        driven = 't' if row.driven else 'f'
        records.append(f'{" ".join(row.links)},{row.kind.lower()},{place},fff{driven}')
    return f'https://designengrlab.github.io/PMKS/pmks.html?mech={"%7C".join(records)}%7C'


def linkage2_text(rows: Sequence[Row]) -> str:
    """Return the XML of Linkage, whose lengths are 1/96 in."""
    lines = ['<linkage2>', '<program zoom="1" units="Millimeters"/>']
    links: dict[str, list[int]] = {}
    for number, row in enumerate(rows):
        pinned = row.links if row.kind == 'R' else row.links[1:]
        for link in pinned:
            links.setdefault(link, []).append(number)
        anchor = ' anchor="true"' if GROUND in pinned else ''
        motor = ' input="true" rpm="15"' if row.driven else ''
        slider = ' slider="true"' if row.line else ''
        place = f'x="{row.position.real:f}" y="{row.position.imag:f}"'
        lines.append(f'<connector id="{number}" {place}{anchor}{motor}{slider}>')
        lines += [f'<slidelimit id="{end}"/>' for end in row.line]
        lines.append('</connector>')
    links.pop(GROUND, None)
    for number, members in enumerate(links.values()):
        connectors = ''.join(f'<connector id="{member}"/>' for member in members)
        lines.append(f'<Link id="{number}" layer="16">{connectors}</Link>')
    return '\n'.join([*lines, '<selected></selected>', '</linkage2>'])


def csv_text(rows: Sequence[Row]) -> str:
    """Return a table of a spreadsheet with decimal commas."""
    lines = ['name;x;y;links;type;angle;driven']
    for number, row in enumerate(rows):
        numbers = [f'{n}'.replace('.', ',') for n in (row.position.real, row.position.imag)]
        angle = f'{row.angle}'.replace('.', ',')
        cells = [f'P{number}', *numbers, ' '.join(row.links), row.kind, angle]
        lines.append(';'.join([*cells, 'x' if row.driven else '']))
    return '\n'.join(lines)


WRITERS = {'pyslvs': pyslvs_text, 'pmks': pmks_text, 'linkage2': linkage2_text, 'csv': csv_text}
