"""A data sheet as text."""

from collections.abc import Iterable, Iterator

from klann_ros.sanitize.text import printable, printable_line

from . import figures
from .figures import Figure, FigureTable
from .sheet import cases, DataSheet, LegSheet

# A longer cell shifts its own line only [characters].
MAX_COLUMN = 40


def text(sheet: DataSheet) -> str:
    """Return the data sheet as lines."""
    return '\n'.join(_lines(sheet)).rstrip() + '\n'


def _lines(sheet: DataSheet) -> Iterator[str]:
    yield f'{printable(sheet.name)}: {printable_line(figures.about(sheet))}'
    if sheet.source and sheet.source != sheet.name:
        yield f'from {printable(sheet.source)}'
    verdict = figures.motor_line(sheet)
    if verdict:
        yield f'{verdict[:1].upper()}{verdict[1:]}.'
    if sheet.no_forces:
        yield f'Forces: {sheet.no_forces}.'
    for leg in sheet.legs:
        yield from _leg(leg, sheet)
    several = not sheet.is_single
    for crank in sheet.cranks:
        title = figures.crank_title(crank)
        if crank.hardest is not None:
            turns = f', which turns {", ".join(crank.legs)}' if several and any(crank.legs) else ''
            yield from _table(figures.crank_forces(crank, sheet.speed), f'{title}{turns}')
        if crank.motor is not None:
            yield from _heading(f'Motor of {title.lower()}' if several else 'Motor')
            yield from _figures(figures.motor_figures(crank))
    yield from _walk(sheet)


def _leg(leg: LegSheet, sheet: DataSheet) -> Iterator[str]:
    if leg.title:
        legs = 'Leg' if len(leg.names) == 1 else 'Legs'
        yield from _heading(f'{legs} {leg.title}')
    linkage = leg.linkage
    yield ''
    for about in (linkage.name, linkage.source):
        if about:
            yield printable_line(about)
    yield f'T{figures.turning(leg)[1:]}.'
    yield from _table(figures.bars(leg))
    yield from _heading(f'Foot {linkage.structure.foot}')
    yield from _figures(figures.foot_figures(leg, sheet.speed))
    if leg.no_stance:
        yield f'  {printable_line(leg.no_stance)}.'
    yield from _table(figures.transmission(leg))
    if leg.masses:
        yield from _table(figures.masses(leg))
    if cases(leg):
        yield from _table(figures.joint_forces(leg))


def _walk(sheet: DataSheet) -> Iterator[str]:
    if sheet.no_walk:
        yield from _heading('Walking')
        yield f'  {printable_line(sheet.no_walk)}.'
    if sheet.walk is not None:
        yield from _heading('Walking')
        yield from (f'  Warning: {warning}.' for warning in sheet.walk.warnings)
        yield from _figures(figures.walk_figures(sheet))
        table = figures.supports(sheet)
        if table:
            yield from _table(table)


def _heading(title: str) -> list[str]:
    return ['', printable_line(title)]


def _figures(of: Iterable[Figure]) -> Iterator[str]:
    rows = list(of)
    width = max((len(figure.name) for figure in rows), default=0)
    for figure in rows:
        line = f'  {figure.name:<{width}}  {figure.value:>9} {figure.unit:<6} {figure.note}'
        yield line.rstrip()


def _table(table: FigureTable, title: str = '') -> Iterator[str]:
    yield from _heading(title or table.title)
    rows = [tuple(map(printable, row)) for row in (table.heads, *table.rows)]
    columns = list(zip(*rows, strict=True))
    widths = [min(max(map(len, column)), MAX_COLUMN) for column in columns]
    # Words are aligned left, numbers right.
    numbers = [
        c[-1].lstrip('-')[:1].isdigit() or c[-1] in ('any', figures.UNKNOWN_VALUE) for c in columns
    ]
    alignments = ['<', *('>' if is_number else '<' for is_number in numbers[1:])]
    for row in rows:
        cells = [
            f'{cell:{side}{w}}' for cell, side, w in zip(row, alignments, widths, strict=True)
        ]
        yield f'  {"  ".join(cells)}'.rstrip()
    if table.note:
        yield f'  {printable_line(table.note)}'
