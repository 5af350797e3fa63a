"""A data sheet as text."""

from collections.abc import Iterable, Iterator

from klann_ros.sanitize.text import printable, printable_line

from . import figures
from .figures import Figure, FigureTable
from .sheet import cases, DataSheet, LegSheet

# A longer cell shifts its own line only [characters].
MAX_COLUMN = 40


def sheet_text(sheet: DataSheet) -> str:
    """Return the data sheet as lines of text."""
    return '\n'.join(_lines(sheet)).rstrip() + '\n'


def _lines(sheet: DataSheet) -> Iterator[str]:
    yield f'{printable(sheet.name)}: {printable_line(figures.summary(sheet))}'
    if sheet.source and sheet.source != sheet.name:
        yield f'from {printable(sheet.source)}'
    verdict = figures.motor_line(sheet)
    if verdict:
        yield f'{verdict[:1].upper()}{verdict[1:]}.'
    if sheet.no_forces:
        yield f'Forces: {sheet.no_forces}.'
    for leg in sheet.legs:
        yield from _leg_lines(leg, sheet)
    for crank in sheet.cranks:
        title = figures.crank_title(crank)
        if crank.hardest is not None:
            has_names = not sheet.is_single and any(crank.legs)
            legs = f', which turns {", ".join(crank.legs)}' if has_names else ''
            yield from _table_lines(
                figures.crank_force_table(crank, sheet.speed), f'{title}{legs}'
            )
        if crank.motor is not None:
            yield from _heading('Motor' if sheet.is_single else f'Motor of {title.lower()}')
            yield from _figure_lines(figures.motor_figures(crank))
    yield from _walk_lines(sheet)


def _leg_lines(leg: LegSheet, sheet: DataSheet) -> Iterator[str]:
    """Yield the lines about a leg: linkage, bars, foot, transmission, masses, joint forces."""
    if leg.title:
        legs = 'Leg' if len(leg.names) == 1 else 'Legs'
        yield from _heading(f'{legs} {leg.title}')
    linkage = leg.linkage
    yield ''
    for about in (linkage.name, linkage.source):
        if about:
            yield printable_line(about)
    yield f'T{figures.turning_text(leg)[1:]}.'
    for text in figures.near_miss_texts(leg):
        yield f'Warning: {text}.'
    if linkage.change_points:
        yield from _table_lines(figures.change_point_table(leg))
    yield from _table_lines(figures.bar_table(leg))
    title = figures.point_title(leg)
    yield from _heading(f'{title[:1].upper()}{title[1:]}')
    yield from _figure_lines(figures.foot_figures(leg, sheet.speed))
    if leg.no_stance and leg.has_foot:
        yield f'  {printable_line(leg.no_stance)}.'
    yield from _table_lines(figures.transmission_table(leg))
    if leg.masses:
        yield from _table_lines(figures.mass_table(leg, leg.masses))
    if cases(leg):
        yield from _table_lines(figures.joint_force_table(leg))


def _walk_lines(sheet: DataSheet) -> Iterator[str]:
    if sheet.no_walk:
        yield from _heading('Walking')
        yield f'  {printable_line(sheet.no_walk)}.'
    if sheet.walk is not None:
        yield from _heading('Walking')
        for warning in sheet.walk.warnings:
            yield f'  Warning: {warning}.'
        yield from _figure_lines(figures.walk_figures(sheet))
        table = figures.support_table(sheet)
        if table:
            yield from _table_lines(table)


def _heading(title: str) -> list[str]:
    return ['', printable_line(title)]


def _figure_lines(shown_figures: Iterable[Figure]) -> Iterator[str]:
    all_figures = list(shown_figures)
    width = max((len(figure.name) for figure in all_figures), default=0)
    for figure in all_figures:
        line = f'  {figure.name:<{width}}  {figure.value:>9} {figure.unit:<6} {figure.note}'
        yield line.rstrip()


def _table_lines(table: FigureTable, title: str = '') -> Iterator[str]:
    """Yield the lines of a table: its title, its head and rows in aligned columns, its note."""
    yield from _heading(title or table.title)
    columns: list[list[str]] = []
    for column in zip(table.heads, *table.rows, strict=True):
        cells = list(map(printable, column))
        width = min(max(map(len, cells)), MAX_COLUMN)
        is_first = not columns
        # The last cell tells a column of numbers; the first column has names.
        has_digits = cells[-1].lstrip('-')[:1].isdigit()
        is_number = has_digits or cells[-1] in {'any', figures.UNKNOWN_VALUE}
        align = str.rjust if is_number and not is_first else str.ljust
        columns.append([align(cell, width) for cell in cells])
    for row in zip(*columns, strict=True):
        yield f'  {"  ".join(row)}'.rstrip()
    if table.note:
        yield f'  {printable_line(table.note)}'
