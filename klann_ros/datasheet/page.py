"""A data sheet as one HTML page that opens offline."""

from collections.abc import Iterable, Iterator
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

from klann_ros.kinematics.angles import TURN
from klann_ros.sanitize.text import printable
from klann_ros.web import element, FRAME, leg_shape, Markup, Parts, scrolling_table, SHARED
import numpy as np

from . import figures
from .chart import Chart, ChartLine, grid
from .figures import Figure, FigureTable
from .load import EDGE_OFFSET
from .sheet import cases, CrankSheet, DataSheet, LegSheet

_STATIC_FILES = Path(__file__).resolve().parent / 'static'
PAGE_PARTS = Parts(
    styles=(*FRAME, SHARED / 'drawing.css', SHARED / 'tables.css', _STATIC_FILES / 'sheet.css'),
    # A script may use those before it.
    scripts=(SHARED / 'theme.js', SHARED / 'drawing.js', _STATIC_FILES / 'sheet.js'),
)
# Part of a curve that is drawn where it grows without bound, relative to its median.
MAX_PEAK = 10.0
# Poses of the animation over a turn.
POSES = 360


def page(sheet: DataSheet) -> str:
    """Return the page of a data sheet."""
    animations = [_animation(leg, sheet.speed) for leg in sheet.legs]
    legs = [_leg_section(sheet, leg, index) for index, leg in enumerate(sheet.legs)]
    cranks = []
    if not sheet.is_single:
        cranks = [_crank_section(crank, sheet) for crank in sheet.cranks if crank.hardest]
    no_scripts = 'The linkage is drawn by scripts, which are switched off here.'
    return PAGE_PARTS.page(
        f'Data sheet of {sheet.name}',
        _header(sheet),
        element('noscript', element('p', no_scripts, class_='quiet')),
        _findings_section(sheet),
        *legs,
        *cranks,
        _walk_section(sheet),
        data=animations,
    )


def _animation(leg: LegSheet, speed: float) -> dict[str, Any]:
    """Return the data of a leg's animation: its shape, and its poses with the foot's stance."""
    is_solved = np.asarray(np.isfinite(leg.points).all(axis=(1, 2)))
    frames = np.arange(0, len(leg.alphas), max(1, len(leg.alphas) // POSES))
    if leg.turns_fully:
        # Uniform: the samples are denser at extremes.
        turns = leg.linkage.change_points.period
        uniform = TURN * np.arange(POSES * turns) / POSES - EDGE_OFFSET
        frames = np.unique(np.searchsorted(leg.alphas, uniform) % len(leg.alphas))
    frames = frames[is_solved[frames]]
    stands = np.zeros(is_solved.shape, bool)
    if leg.shown_stance:
        stands = leg.shown_stance.holds(leg.alphas)
    shape = leg_shape(leg.linkage)
    for point in shape['points']:
        point['name'] = printable(point['name'], 12)
    coordinates = leg.points[frames]
    rounded = [float(f'{metres:.6g}') for metres in coordinates.ravel()]
    return {
        'shape': shape,
        'foot': leg.linkage.foot,
        'turns': leg.linkage.change_points.period if leg.turns_fully else 0,
        'isClockwise': speed < 0.0,
        'angles': np.degrees(leg.alphas[frames]).round(4).tolist(),
        'points': np.reshape(rounded, coordinates.shape).tolist(),
        'stands': stands[frames].tolist(),
    }


def _header(sheet: DataSheet) -> Markup:
    source = element('strong', sheet.source, class_='path') if sheet.source else Markup()
    about = element('p', element('span', figures.summary(sheet)))
    verdict = Markup()
    if sheet.motor is not None:
        can_turn = sheet.motor_turns
        claim = '✓ The motor can turn it' if can_turn else '! The motor cannot turn it'
        reason = element('span', figures.motor_reason(sheet))
        style = f'verdict {"good" if can_turn else "bad"}'
        verdict = element('p', element('strong', claim), reason, class_=style)
    title = element('div', element('h1', sheet.name), element('p', source), about)
    return element('header', title, verdict)


def _findings_section(sheet: DataSheet) -> Markup:
    if not sheet.no_forces:
        return Markup()
    mark = element('span', '!', class_='mark', aria_hidden='true')
    note = element('div', element('strong', 'Forces'), f': {sheet.no_forces}.')
    return element('section', element('ul', element('li', mark, note), class_='findings'))


def _leg_section(sheet: DataSheet, leg: LegSheet, index: int) -> Markup:
    """Return the section of a leg; a single leg's has the charts and motor of its crank, too."""
    charts = [*_leg_charts(leg)]
    motor = Markup()
    if sheet.is_single:
        crank = sheet.cranks[0]
        charts = [*_crank_charts(crank, sheet, leg), *charts]
        if crank.motor:
            motor = _table(_motor_table(crank))
    tables = [_table(table, leg.title) for table in _tables(sheet, leg)]
    title = 'Motion'
    if leg.title:
        title = f'{"Legs" if len(leg.names) > 1 else "Leg"} {leg.title}'
    return element(
        'section',
        element('h2', title),
        element('dl', *map(_tile, figures.foot_figures(leg, sheet.speed)), class_='tiles'),
        _remark(leg.no_stance if leg.has_foot else ''),
        _remark(_about(leg)),
        element(
            'div',
            element('div', _drawing(leg, index), motor, class_='beside'),
            element('div', *map(Chart.figure, charts[:2]), class_='beside'),
            class_='stage',
        ),
        grid(charts[2:]),
        element('div', *tables, class_='tables'),
    )


def _about(leg: LegSheet) -> str:
    linkage = leg.linkage
    origin = ': '.join(filter(None, (linkage.name, linkage.source)))
    return '; '.join(
        filter(None, (origin, figures.turning_text(leg), *figures.near_miss_texts(leg)))
    )


def _remark(text: str) -> Markup:
    """Return a clause as a sentence in a muted paragraph; nothing for ''."""
    return element('p', f'{text[:1].upper()}{text[1:]}.', class_='quiet') if text else Markup()


def _tile(figure: Figure) -> Markup:
    quantity = element('b', figure.value, element('small', f' {figure.unit}'))
    description = element('dd', quantity, element('span', figure.note))
    return element('div', element('dt', figure.name), description)


def _drawing(leg: LegSheet, index: int) -> Markup:
    text = f'The linkage, and the path of its {figures.point_title(leg)}'
    text += '; thick where it is on the ground.' if leg.has_foot else '.'
    scale = {'type': 'range', 'min': '0', 'max': '1', 'step': 'any', 'value': '0'}
    controls = element(
        'div',
        element('button', 'Play', type='button', class_='play'),
        element('input', **scale, aria_label='Crank angle', class_='angle'),
        element('output', class_='at'),
        class_='controls',
    )
    return element(
        'figure',
        element('svg', role='img', aria_label=text, class_='drawing'),
        element('figcaption', text),
        controls,
        class_='card leg-view',
        data_leg=str(index),
    )


def _leg_charts(leg: LegSheet) -> Iterator[Chart]:
    """Yield the charts of transmission angles and joint reactions."""
    spans = _spans(leg)
    if leg.transmission:
        lines = []
        for index, dyad in enumerate(leg.transmission):
            angles = np.degrees(dyad.angle)
            lines.append(ChartLine(dyad.name, angles, index, is_dashed=index > 0))
        text = 'How well the links push each other: 90 deg is best, 0 and 180 deg are in line.'
        limits = [('40 and 140 deg', 40.0), ('', 140.0)]
        yield Chart('Transmission angles', 'deg', leg.alphas, lines, text, spans, limits)
    for name, forces in cases(leg)[-1:]:
        lines = []
        for index, joint in enumerate(forces.joints):
            heights = joint.force
            if joint.greatest.value == inf:
                heights = np.where(heights > MAX_PEAK * np.nanmedian(heights), np.nan, heights)
            lines.append(ChartLine(joint.name, heights, index, is_dashed=index % 2 > 0))
        text = f'The magnitude of the force in each joint, {name}.'
        yield Chart('Joint reactions', 'N', leg.alphas, lines, text, spans)


def _spans(leg: LegSheet) -> list[tuple[float, float]]:
    stance = leg.shown_stance
    return [(stance.start, stance.end)] if stance else []


def _crank_charts(crank: CrankSheet, sheet: DataSheet, leg: LegSheet | None) -> Iterator[Chart]:
    """Yield the charts of a crank's torque and power; over its crank angle with its only leg."""
    named_turns = cases(crank)
    if not named_turns:
        return
    direction = -1.0 if sheet.speed < 0.0 else 1.0
    limits = [('the motor gives', direction * crank.motor.available)] if crank.motor else []
    chart = partial(
        Chart,
        angles=named_turns[0][1].alphas,
        spans=_spans(leg) if leg else [],
        axis='crank angle / deg' if leg else f'angle of {crank.joint} / deg',
        moves=leg is not None,
    )

    def lines(quantity: str) -> list[ChartLine]:
        chart_lines = []
        for index, (name, turn) in enumerate(named_turns):
            is_dashed = len(named_turns) > 1 and index == 0
            chart_lines.append(ChartLine(name, getattr(turn, quantity), index, is_dashed))
        return chart_lines

    text = 'The torque for a constant speed, counter-clockwise positive.'
    yield chart('Torque at the crank', 'N m', lines=lines('torque'), text=text, limits=limits)
    text = 'Negative where the linkage drives the motor.'
    yield chart('Power at the crank', 'W', lines=lines('power'), text=text)


def _tables(sheet: DataSheet, leg: LegSheet) -> Iterator[FigureTable]:
    # This order fills three columns of a page.
    if leg.linkage.change_points:
        yield figures.change_point_table(leg)
    yield figures.bar_table(leg)
    if sheet.is_single:
        yield from _crank_tables(sheet.cranks, sheet)
    if leg.masses:
        yield figures.mass_table(leg, leg.masses)
    if leg.transmission:
        yield figures.transmission_table(leg)
    if cases(leg):
        yield figures.joint_force_table(leg)


def _crank_tables(cranks: Iterable[CrankSheet], sheet: DataSheet) -> Iterator[FigureTable]:
    for crank in cranks:
        if crank.motor is not None and not sheet.is_single:
            yield _motor_table(crank)
        if crank.hardest is not None:
            yield figures.crank_force_table(crank, sheet.speed)


def _motor_table(crank: CrankSheet) -> FigureTable:
    lines = []
    for figure in figures.motor_figures(crank):
        quantity = f'{figure.value} {figure.unit}'.rstrip()
        lines.append((figure.name, element('span', quantity, class_='quantity'), figure.note))
    return FigureTable('Motor', ('Figure', 'Value', 'Remark'), tuple(lines))


def _crank_section(crank: CrankSheet, sheet: DataSheet) -> Markup:
    tables = [_table(table, crank.joint) for table in _crank_tables([crank], sheet)]
    return element(
        'section',
        element('h2', figures.crank_title(crank)),
        _remark(f'it turns {", ".join(crank.legs)}' if any(crank.legs) else ''),
        grid(_crank_charts(crank, sheet, None)),
        element('div', *tables, class_='tables'),
    )


def _walk_section(sheet: DataSheet) -> Markup:
    if sheet.no_walk:
        return element('section', element('h2', 'Walking'), _remark(sheet.no_walk))
    walk = sheet.walk
    table = figures.support_table(sheet)
    if walk is None or table is None:
        return Markup()
    chart = partial(
        Chart, unit='mm', angles=walk.alphas, axis='rotation of the cranks / deg', moves=False
    )
    margin = ChartLine('margin', 1e3 * walk.margin)
    text = 'The centre of mass in the support polygon; negative is outside.'
    charts = [chart('Static margin', lines=[margin], text=text)]
    if walk.stable_fraction:
        height = ChartLine('above its mean', 1e3 * (walk.height - np.nanmean(walk.height)))
        text = 'The height of the body from its mean.'
        charts.append(chart('Height of the body', lines=[height], text=text))
    return element(
        'section',
        element('h2', 'Walking'),
        *(element('p', f'Warning: {warning}.') for warning in walk.warnings),
        element('dl', *map(_tile, figures.walk_figures(sheet)), class_='tiles'),
        grid(charts),
        element('div', _table(table), class_='tables'),
    )


def _table(table: FigureTable, owner: str = '') -> Markup:
    note = element('p', table.note, class_='quiet') if table.note else Markup()
    scrolling = scrolling_table(f'{table.title} {owner}'.rstrip(), table.heads, table.rows)
    return element('div', element('h3', table.title), scrolling, note)
