"""The page of a review: one HTML file, with its scripts and data, that opens offline."""

from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from math import degrees
from pathlib import Path
from string import Template
from typing import BinaryIO, NamedTuple

from klann_ros.review.model.compare import Comparison
from klann_ros.review.model.poses import LegFigures
from klann_ros.review.model.review import Finding, located, Review, Severity
from klann_ros.review.model.topics import DELAY_MEANING, LOWER_BOUND_MEANING, TopicFigures
from klann_ros.sanitize.text import counted, finite, printable
from klann_ros.web import (
    element,
    FRAME,
    joined,
    Markup,
    number,
    Parts,
    scrolling_table,
    SHARED,
    text,
)

from .data import run_data

_OWN = Path(__file__).resolve().parent / 'static'
_UPLOT = SHARED / 'uplot'
# In this order: each uses those before it.
_SCRIPTS = (
    *('packed', 'leg', 'run', 'player', 'picture', 'walk_path', 'legend', 'chart'),
    *('envelope', 'leg_charts', 'path_lines', 'path_chart', 'timing_chart', 'controls', 'page'),
)
PARTS = Parts(
    styles=(
        _UPLOT / 'uPlot.min.css',
        *FRAME,
        SHARED / 'drawing.css',
        _OWN / 'charts.css',
        SHARED / 'tables.css',
        *(_OWN / f'{name}.css' for name in ('player', 'phone', 'print')),
    ),
    scripts=(
        _UPLOT / 'uPlot.iife.min.js',
        *(SHARED / f'{name}.js' for name in ('theme', 'plot', 'drawing')),
        *(_OWN / f'{name}.js' for name in _SCRIPTS),
    ),
)

# Bytes of the numbers of all runs; as text they are a third more, below 12 MB. Ten minutes of a
# Klann leg at 200 Hz are kept whole.
MAX_DATA_SIZE = 8.5e6


def save(
    reviews: Sequence[Review],
    comparison: Comparison | None,
    file: BinaryIO,
    max_bytes: float = MAX_DATA_SIZE,
) -> None:
    """Write the page of one run, or of two, to an open file, its numbers in `max_bytes`."""
    data = [run_data(review, max_bytes / len(reviews)) for review in reviews]
    main = Template(text(_OWN / 'main.html')).substitute(
        header=header(reviews, comparison),
        tiles=figures(reviews),
        findings=findings(reviews),
        differences=differences(comparison),
        topics=topics(reviews),
    )
    licence = Markup(f'<!-- uPlot\n{text(_UPLOT / "LICENSE")}-->')
    title = f'Review of {_names(reviews)}'
    page = PARTS.page(title, Markup(main), licence, data=finite(data))
    # A path may hold bytes that are no text.
    file.write(page.encode(errors='replace'))


def _names(reviews: Sequence[Review]) -> str:
    return ' and '.join(Path(review.recording.path).name for review in reviews)


_TOPIC_HEADS = (
    'Topic',
    'Messages',
    'Rate / Hz',
    'Longest gap / ms',
    'Delay / ms',
    'Lost',
)
# A mark beside the colour: some see none.
_MARKS = {Severity.ERROR: '✕', Severity.WARNING: '!', Severity.NOTE: 'i'}


def header(reviews: Sequence[Review], comparison: Comparison | None) -> Markup:
    """Return the runs and their verdicts."""
    runs = joined(_run(review, index) for index, review in enumerate(reviews))
    faults = 0
    for review in reviews:
        faults += sum(finding.is_fault for finding in review.findings)
    verdicts = [_verdict(faults, 'finding', 'Healthy', 'nothing found')]
    if comparison is not None:
        count = len(comparison.differences)
        verdicts.append(_verdict(count, 'difference', 'Alike', 'no difference'))
    return element('header', element('div', element('h1', _names(reviews)), runs), *verdicts)


def findings(reviews: Sequence[Review]) -> Markup:
    """Return the findings by falling severity; those with a time are buttons that lead there."""
    sections = []
    for index, review in enumerate(reviews):
        if review.findings:
            heading = element('h2', _of_run('Findings', index, len(reviews)))
            list_ = element('ul', *map(_finding, review.findings), class_='findings')
            sections.append(element('section', heading, list_))
    return joined(sections)


def differences(comparison: Comparison | None) -> Markup:
    """Return the differences of two runs, and the parts that could not be compared."""
    if comparison is None:
        return Markup()
    lines = []
    for difference in comparison.differences:
        text = element('span', located(difference.leg, difference.text))
        quantity = element('strong', difference.what)
        lines.append(element('li', quantity, ' ', text, class_='warning'))
    list_ = element('ul', *lines, class_='findings')
    if not lines:
        list_ = element('p', f'{comparison.alike.capitalize()}.', class_='quiet')
    remarks = [element('p', remark, class_='quiet') for remark in comparison.remarks]
    return element('section', element('h2', 'Differences'), list_, *remarks)


def topics(reviews: Sequence[Review]) -> Markup:
    """Return a table of the topics."""
    sections = []
    for index, review in enumerate(reviews):
        title = _of_run('Topics', index, len(reviews))
        table = scrolling_table(title, _TOPIC_HEADS, map(_topic, review.topics), 'stacks')
        heading = element('h2', title)
        sections.append(element('section', heading, table, _legend(review.topics)))
    return joined(sections)


def _run(review: Review, index: int) -> Markup:
    recording = review.recording
    start = datetime.fromtimestamp(recording.start / 1e9, timezone.utc)
    size = sum(size for _, size in recording.files) / 1e6
    facts = f'{start:%Y-%m-%d %H:%M:%S} UTC · {recording.duration:.2f} s · {size:.1f} MB'
    key = element('span', class_=f'key key-{index}', aria_hidden='true')
    path = element('strong', recording.path, class_='path')
    return element('p', key, path, ' ', element('span', facts))


def _verdict(count: int, noun: str, praise: str, meaning: str) -> Markup:
    if not count:
        head = element('strong', f'✓ {praise}')
        return element('p', head, element('span', meaning), class_='verdict good')
    head = element('strong', f'! {counted(count, noun)}')
    return element('p', head, element('span', 'see below'), class_='verdict bad')


def _finding(finding: Finding) -> Markup:
    kind = finding.severity.name.lower()
    mark = element('span', _MARKS[finding.severity], class_='mark', aria_hidden='true')
    text = [
        element('strong', f'{finding.severity.name.capitalize()}: {finding.check}'),
        ' ',
        element('span', located(finding.leg, finding.text)),
        element('em', finding.meaning),
    ]
    if finding.time is None:
        return element('li', mark, element('div', *text), class_=kind)
    time = element('span', f'at {finding.time:.3f} s →', class_='when')
    data = {'data_time': repr(finding.time), 'data_leg': printable(finding.leg)}
    button = element('button', *text, time, type='button', **data)
    return element('li', mark, button, class_=kind)


def _legend(topics_: Sequence[TopicFigures]) -> Markup:
    meanings = [DELAY_MEANING]
    if any(topic.has_unknown_losses for topic in topics_):
        meanings.append(LOWER_BOUND_MEANING)
    return element('p', f'{"; ".join(meanings)}.', class_='quiet')


def _topic(topic: TopicFigures) -> Sequence[str]:
    return (
        topic.name,
        str(topic.count),
        number(topic.rate, '.1f'),
        number(1e3 * topic.longest_gap, '.1f'),
        number(1e3 * topic.latency_p50, '.2f'),
        topic.lost_in_words,
    )


def _of_run(title: str, index: int, run_count: int) -> str:
    return f'{title} of run {"AB"[index]}' if run_count > 1 else title


def figures(reviews: Sequence[Review]) -> Markup:
    """Return the key figures of every leg, of two runs both: tiles of one, a table of several."""
    rows: list[tuple[str, list[_Figure]]] = []
    sources: dict[str, str] = {}
    for index, review in enumerate(reviews):
        for leg in review.legs:
            run = f'run {"AB"[index]}' if len(reviews) > 1 else ''
            title = ', '.join(filter(None, (run, leg.recording.title)))
            rows.append((title, [*_figures(leg.figures)]))
            if leg.recording.solver.source:
                sources[title] = leg.recording.solver.source
    if not rows:
        return Markup()
    _, first_row = rows[0]
    if len(rows) > 1:
        heads = ['Leg', *(f'{figure.name}, {figure.unit}' for figure in first_row)]
        cells = [[title, *(figure.text for figure in row)] for title, row in rows]
        table = scrolling_table('Figures', heads, cells, 'stacks')
    else:
        table = element('dl', *map(_tile, first_row), class_='tiles')
    if len(set(sources.values())) == 1:
        # Once where all legs have their geometry from there.
        sources = {'': next(iter(sources.values()))}
    lines = []
    for title, source in sources.items():
        subject = f'Geometry of {title}' if title else 'Geometry'
        lines.append(element('p', f'{subject}: {source}.', class_='quiet'))
    return element('section', element('h2', 'Figures'), table, *lines)


class _Figure(NamedTuple):
    """A figure of a leg."""

    name: str
    text: str
    unit: str


def _tile(figure: _Figure) -> Markup:
    cell = element('dd', element('b', figure.text), ' ', element('span', figure.unit))
    return element('div', element('dt', figure.name), cell)


def _figures(figures: LegFigures) -> Iterator[_Figure]:
    for name, figure, form, unit in (
        ('Turns', figures.turns, '.3f', 'of the crank'),
        ('Stride', 1e3 * figures.stride, '.1f', 'mm'),
        ('Lift', 1e3 * figures.lift, '.1f', 'mm'),
        ('Foot on the ground', figures.duty_factor, '.1%', 'of a turn'),
        ('Stance off a line', figures.straightness, '.2%', 'of its length'),
        ('Transmission angle', degrees(figures.worst_transmission_angle), '.1f', 'deg at least'),
    ):
        yield _Figure(name, number(figure, form), unit)
