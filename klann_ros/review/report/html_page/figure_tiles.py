"""The key figures of a run: tiles of a single leg, a table of several."""

from collections.abc import Iterator, Sequence
from math import degrees, isnan
from typing import NamedTuple

from klann_ros.review.figures import LegFigures
from klann_ros.review.reviewed import Review

from .markup import element, Markup, NOT_TOLD
from .tables import scrolling_table


class _Figure(NamedTuple):
    """A figure: its name, its value, its unit or what it is of."""

    name: str
    value: str
    unit: str


def figures(reviews: Sequence[Review]) -> Markup:
    """Return the key figures of every leg; of two runs both."""
    found = [
        (_title(leg.recording.title, n, len(reviews)), list(_figures(leg.figures)))
        for n, review in enumerate(reviews)
        for leg in review.legs
    ]
    if not found:
        return Markup()
    content = (
        _table(found)
        if len(found) > 1
        else element('dl', *map(_tile, found[0][1]), class_='tiles')
    )
    sources = (
        element(
            'p', f'{title}{": " * bool(title)}the geometry is that of {source}.', class_='quiet'
        )
        for title, source in _sources(reviews).items()
    )
    return element('section', element('h2', 'Figures'), content, *sources)


def _sources(reviews: Sequence[Review]) -> dict[str, str]:
    """Return who tells the geometry, once where all legs have it from there."""
    told = {
        _title(leg.recording.title, n, len(reviews)): leg.recording.solver.source
        for n, review in enumerate(reviews)
        for leg in review.legs
        if leg.recording.solver.source
    }
    sources = set(told.values())
    return {'': sources.pop()} if len(sources) == 1 else told


def _table(found: Sequence[tuple[str, Sequence[_Figure]]]) -> Markup:
    heads = ['Leg', *(f'{figure.name}, {figure.unit}' for figure in found[0][1])]
    rows = ([title, *(figure.value for figure in figures)] for title, figures in found)
    return scrolling_table('Figures', heads, rows)


def _tile(figure: _Figure) -> Markup:
    value = element('dd', element('b', figure.value), ' ', element('span', figure.unit))
    return element('div', element('dt', figure.name), value)


def _figures(figures: LegFigures) -> Iterator[_Figure]:
    mu = degrees(figures.worst_transmission_angle)
    yield _figure('Turns', figures.turns, '.3f', 'of the crank')
    yield _figure('Stride', 1e3 * figures.stride, '.1f', 'mm')
    yield _figure('Lift', 1e3 * figures.lift, '.1f', 'mm')
    yield _figure('Duty', figures.duty_factor, '.1%', 'on the ground')
    yield _figure('Straightness', figures.straightness, '.2%', 'off, of the stance')
    yield _figure('Transmission', mu, '.1f', 'deg from in line')
    yield _figure('Residual', figures.worst_residual, '.1e', 'm, worst')


def _figure(name: str, number: float, form: str, unit: str) -> _Figure:
    return _Figure(name, NOT_TOLD if isnan(number) else format(number, form), unit)


def _title(title: str, number: int, of: int) -> str:
    run = f'run {"AB"[number]}' if of > 1 else ''
    return ', '.join(part for part in (run, title) if part)
