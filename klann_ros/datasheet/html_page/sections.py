"""The parts of the page, from the head to the tables."""

from collections.abc import Iterable, Iterator
from math import degrees

from klann_ros.datasheet import figures
from klann_ros.datasheet.figures import Figure, Table
from klann_ros.datasheet.sheet import CrankSheet, DataSheet, LegForces, LegSheet
from klann_ros.web.markup import element, joined, Markup, scrolling_table
import numpy as np

from .chart import Chart, ChartLine, grid


def header(sheet: DataSheet) -> Markup:
    """Return what the page is about, and whether the motor can turn it."""
    from_ = element('strong', sheet.source, class_='path') if sheet.source else Markup()
    about = element('p', element('span', figures.about(sheet)))
    title = element('div', element('h1', sheet.name), element('p', from_), about)
    return element('header', title, _verdict(sheet))


def _verdict(sheet: DataSheet) -> Markup:
    if sheet.motor is None:
        return Markup()
    good = sheet.motor_turns
    word = '✓ The motor can turn it' if good else '! The motor cannot turn it'
    line = figures.motor_line(sheet)
    rest = line.partition(', ' if good else ': ')[2]
    kind = f'verdict {"good" if good else "bad"}'
    return element('p', element('strong', word), element('span', rest), class_=kind)


def notes(sheet: DataSheet) -> Markup:
    """Return why there are no forces, or not all."""
    if not sheet.no_forces:
        return Markup()
    mark = element('span', '!', class_='mark', aria_hidden='true')
    item = element(
        'li', mark, element('div', element('strong', 'Forces'), f': {sheet.no_forces}.')
    )
    return element('section', element('ul', item, class_='findings'))


def legs(sheet: DataSheet) -> Markup:
    """Return the sections of the legs, with the crank's charts beside an only one."""
    return joined(_leg(sheet, leg, number) for number, leg in enumerate(sheet.legs))


def _leg(sheet: DataSheet, leg: LegSheet, number: int) -> Markup:
    alone = sheet.is_single
    own = [*_leg_charts(leg)]
    crank = [*_crank_charts(sheet.cranks[0], sheet, leg)] if alone and sheet.cranks else []
    beside = crank or own
    below = own if crank else []
    name = f'{"Legs" if len(leg.names) > 1 else "Leg"} {leg.title}' if leg.title else 'Motion'
    return element(
        'section',
        element('h2', name),
        element('dl', *map(_tile, figures.foot_figures(leg, sheet.speed)), class_='tiles'),
        _quiet(leg.no_stance),
        _quiet(_about(leg)),
        element(
            'div',
            element('div', _drawing(leg, number), *_motor(sheet), class_='beside'),
            element(
                'div',
                *(chart.figure() for chart in beside[:2]),
                class_='beside',
                tabindex='0',
                role='group',
                aria_label='Charts',
            ),
            class_='stage',
        ),
        grid([*beside[2:], *below]),
        element('div', *map(_table, _tables(sheet, leg)), class_='tables'),
    )


def _about(leg: LegSheet) -> str:
    linkage = leg.linkage
    known = ': '.join(filter(None, (linkage.name, linkage.source)))
    turns = 'the crank turns fully'
    if not leg.turns_fully:
        arcs = ', '.join(f'{degrees(a):.3f} to {degrees(b):.3f}' for a, b in leg.arcs)
        turns = f'the crank does not turn fully; it reaches {arcs or "nothing"} deg'
    return '; '.join(filter(None, (known, turns)))


def _quiet(text: str) -> Markup:
    if not text:
        return Markup()
    return element('p', f'{text[:1].upper()}{text[1:]}.', class_='quiet')


def _tile(figure: Figure) -> Markup:
    note = figure.note
    value = element('b', figure.value, element('small', f' {figure.unit}'))
    return element('div', element('dt', figure.name), element('dd', value, element('span', note)))


def _motor(sheet: DataSheet) -> list[Markup]:
    """Return the motor's table, where it stands beside the charts of its crank."""
    if not sheet.is_single:
        return []
    return [_table(_motor_table(crank)) for crank in sheet.cranks if crank.motor]


def _drawing(leg: LegSheet, number: int) -> Markup:
    foot = leg.linkage.structure.foot
    text = f'The leg, and the path of its foot {foot}; thick where it is on the ground.'
    slider = element(
        'input',
        type='range',
        min='0',
        max='1',
        step='any',
        value='0',
        aria_label='Crank angle',
        class_='angle',
    )
    controls = element(
        'div',
        element('button', 'Play', type='button', class_='play'),
        slider,
        element('output', class_='at'),
        class_='controls',
    )
    return element(
        'figure',
        element('svg', role='img', aria_label=text, class_='drawing'),
        element('figcaption', text),
        controls,
        class_='card leg-view',
        data_leg=str(number),
    )


def _leg_charts(leg: LegSheet) -> Iterator[Chart]:
    spans = _spans(leg)
    if leg.transmission:
        lines = [
            ChartLine(each.name, np.degrees(each.angles), number, is_dashed=number > 0)
            for number, each in enumerate(leg.transmission)
        ]
        text = 'How well the links push each other: 90 deg is best, 0 and 180 deg are in line.'
        limits = [('40 and 140 deg', 40.0), ('', 140.0)]
        yield Chart('Transmission angles', 'deg', leg.alphas, lines, text, spans, limits)
    for what, forces in (('loaded', leg.loaded), ('empty', leg.empty)):
        if forces is not None:
            yield _joint_chart(leg, what, forces)
            break


def _joint_chart(leg: LegSheet, what: str, forces: LegForces) -> Chart:
    lines = [
        ChartLine(joint.name, joint.force, number, is_dashed=number % 2 > 0)
        for number, joint in enumerate(forces.joints)
    ]
    text = f'How large the force in each joint is, {what}.'
    return Chart('Joint reactions', 'N', leg.alphas, lines, text, _spans(leg))


def _spans(leg: LegSheet) -> list[tuple[float, float]]:
    return [(leg.stance.start, leg.stance.end)] if leg.stance else []


def _crank_charts(crank: CrankSheet, sheet: DataSheet, leg: LegSheet | None) -> Iterator[Chart]:
    columns = [(name, of) for name, of in (('empty', crank.empty), ('loaded', crank.loaded)) if of]
    if not columns:
        return
    spans = _spans(leg) if leg else []
    way = -1.0 if sheet.speed < 0.0 else 1.0
    limits = [('the motor gives', way * crank.motor.available)] if crank.motor else []
    axis = 'crank angle / deg' if leg else f'angle of {crank.joint} / deg'
    angles, moves = columns[0][1].alphas, leg is not None
    lines = [
        ChartLine(name, turn.torque, number, is_dashed=name == 'empty' and len(columns) > 1)
        for number, (name, turn) in enumerate(columns)
    ]
    text = 'What keeps the speed, counter-clockwise positive.'
    yield Chart('Torque at the crank', 'N m', angles, lines, text, spans, limits, axis, moves)
    lines = [
        ChartLine(name, turn.power, number, is_dashed=name == 'empty' and len(columns) > 1)
        for number, (name, turn) in enumerate(columns)
    ]
    text = 'Negative where the leg drives the motor.'
    yield Chart('Power at the crank', 'W', angles, lines, text, spans, (), axis, moves)


def _tables(sheet: DataSheet, leg: LegSheet) -> Iterator[Table]:
    alone = sheet.is_single
    if alone:
        yield from _crank_tables(sheet.cranks, sheet)
    yield figures.bars(leg)
    if leg.transmission:
        yield figures.transmission(leg)
    if leg.empty or leg.loaded:
        yield figures.joint_forces(leg)
    if leg.masses:
        yield figures.masses(leg)


def _crank_tables(cranks: Iterable[CrankSheet], sheet: DataSheet) -> Iterator[Table]:
    for crank in cranks:
        if crank.motor is not None and not sheet.is_single:
            yield _motor_table(crank)
        if crank.hardest is not None:
            yield figures.crank_forces(crank, sheet.speed)


def _motor_table(crank: CrankSheet) -> Table:
    rows = [
        (each.name, f'{each.value} {each.unit}'.rstrip(), each.note)
        for each in figures.motor_figures(crank)
    ]
    return Table('Motor', ('What', 'Value', 'Remark'), tuple(rows))


def cranks(sheet: DataSheet) -> Markup:
    """Return the sections of a walker's cranks."""
    if sheet.is_single:
        return Markup()
    return joined(_crank(crank, sheet) for crank in sheet.cranks if crank.hardest)


def _crank(crank: CrankSheet, sheet: DataSheet) -> Markup:
    return element(
        'section',
        element('h2', figures.crank_title(crank)),
        _quiet(f'it turns {", ".join(crank.legs)}' if any(crank.legs) else ''),
        grid(_crank_charts(crank, sheet, None)),
        element('div', *map(_table, _crank_tables([crank], sheet)), class_='tables'),
    )


def walking(sheet: DataSheet) -> Markup:
    """Return how a walker walks."""
    if sheet.no_walk:
        return element('section', element('h2', 'Walking'), _quiet(sheet.no_walk))
    table = figures.supports(sheet)
    if sheet.walk is None or table is None:
        return Markup()
    walk = sheet.walk
    axis = 'turned by the cranks / deg'
    margin = Chart(
        'Static margin',
        'mm',
        walk.alphas,
        [ChartLine('margin', 1e3 * walk.margin)],
        'How far the centre of mass is inside the feet that stand; negative is outside.',
        axis=axis,
        moves=False,
    )
    height = Chart(
        'Height of the body',
        'mm',
        walk.alphas,
        [ChartLine('above its mean', 1e3 * (walk.height - np.nanmean(walk.height)))],
        'How the body goes up and down, from its mean.',
        axis=axis,
        moves=False,
    )
    charts = [margin, height] if walk.rests else [margin]
    return element(
        'section',
        element('h2', 'Walking'),
        *(element('p', f'Warning: {warning}.') for warning in walk.warnings),
        element('dl', *map(_tile, figures.walk_figures(sheet)), class_='tiles'),
        grid(charts),
        element('div', _table(table), class_='tables'),
    )


def _table(table: Table) -> Markup:
    note = element('p', table.note, class_='quiet') if table.note else Markup()
    content = scrolling_table(table.title, table.heads, table.rows)
    return element('div', element('h3', table.title), content, note)
