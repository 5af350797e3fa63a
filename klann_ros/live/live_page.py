"""The live page as it is served: one HTML file, and styles and scripts beside it."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from string import Template
from urllib.parse import quote

from klann_ros.review import Row, verdict_chip
from klann_ros.web import (
    breakable,
    element,
    FRAME,
    html_page,
    joined,
    Markup,
    number,
    scrolling_table,
    SHARED,
    text,
)

from .runs import ListedRun

_STATIC_FILES = Path(__file__).resolve().parent / 'static'
_UPLOT = SHARED / 'uplot'
_STYLES = (
    _UPLOT / 'uPlot.min.css',
    *FRAME,
    SHARED / 'drawing.css',
    SHARED / 'tables.css',
    SHARED / 'sortable.css',
    _STATIC_FILES / 'live.css',
)
_LIVE_SCRIPTS = 'space connection picture walker stage history drive tables live'
# In this order: each uses those above it.
_SCRIPTS = (
    _UPLOT / 'uPlot.iife.min.js',
    *(SHARED / f'{name}.js' for name in ('theme', 'plot', 'drawing', 'solids', 'orbit', 'scene')),
    *(_STATIC_FILES / f'{name}.js' for name in _LIVE_SCRIPTS.split()),
)
_LIST_SCRIPT = SHARED / 'sortable.js'
# Loaded by the page for a walker.
_THREE = SHARED / 'three' / 'three.min.js'
_RUN_HEADS = ('Run', 'Verdict', 'Finding', 'Duration / s', 'Last change (UTC)', 'Calibration')
# Nothing is loaded from anywhere else, nothing runs that is not a file of this server, and no
# other page has this one in itself.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

NO_RUNS = (
    'No runs in this folder yet. Press "Keep this moment" of a recorder on the live page, or '
    'start recorder_node with a new folder in it as output.'
)


# Content types and texts; only these files are served, and no path is built from a request.
FILES = {
    **{path.name: ('text/css', text(path)) for path in _STYLES},
    **{path.name: ('text/javascript', text(path)) for path in (*_SCRIPTS, _LIST_SCRIPT, _THREE)},
}


def _styles() -> Markup:
    return joined(
        element('link', rel='stylesheet', href=f'/static/{path.name}') for path in _STYLES
    )


def _script(path: Path) -> Markup:
    return element('script', src=f'/static/{path.name}', defer=True)


def note_page(title: str, note: str) -> str:
    """Return a page with one note."""
    return _small_page(title, element('p', note))


def list_page(runs: Sequence[ListedRun], rows: Mapping[str, Row | None], token: str) -> str:
    """Return a page of runs with verdicts, which lead to their reviews and calibrations."""
    cells = []
    for run in runs:
        path = f'/runs/{quote(run.name, safe="")}'
        time = datetime.fromtimestamp(run.time / 1e9, timezone.utc)
        row = rows.get(run.name)
        cells.append(
            (
                element('a', breakable(run.name), href=f'{path}?token={token}'),
                _verdict(run, run.name in rows, row),
                element('span', row.reason if row else '', class_='reason'),
                number(row.duration if row else None, '.1f'),
                f'{time:%Y-%m-%d %H:%M:%S}',
                element('a', 'calibrate', href=f'{path}/calibrate?token={token}'),
            )
        )
    table = element('p', NO_RUNS)
    if cells:
        table = scrolling_table('Runs', _RUN_HEADS, cells, 'sortable')
    back = element('p', element('a', 'The live page', href=f'/?token={token}'))
    return _small_page('Runs', element('section', table), back, _script(_LIST_SCRIPT))


def _verdict(run: ListedRun, is_judged: bool, row: Row | None) -> Markup:
    if row is not None:
        return verdict_chip(row)
    if is_judged:
        text = 'not checked'
    elif run.is_changing:
        text = 'changing'
    else:
        text = 'in review'
    return element('span', text, class_='chip')


def _small_page(title: str, *content: Markup) -> str:
    return html_page(title, _styles(), element('main', element('h1', title), *content))


_LICENCE = Markup(f'<!-- uPlot\n{text(_UPLOT / "LICENSE")}-->')
HTML = Template(text(_STATIC_FILES / 'live.html')).substitute(
    styles=_styles(), scripts=joined([_LICENCE, *map(_script, _SCRIPTS)])
)
