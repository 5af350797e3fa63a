"""The live page as it is served: one HTML file, and styles and scripts beside it."""

from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from string import Template
from urllib.parse import quote

from klann_ros.web import element, FRAME, html_page, joined, Markup, SHARED, text

from .runs import ListedRun

_STATIC_FILES = Path(__file__).resolve().parent / 'static'
_UPLOT = SHARED / 'uplot'
_STYLES = (
    _UPLOT / 'uPlot.min.css',
    *FRAME,
    SHARED / 'drawing.css',
    SHARED / 'tables.css',
    _STATIC_FILES / 'live.css',
)
_LIVE_SCRIPTS = 'space connection picture walker history drive tables live'
# In this order: each uses those above it.
_SCRIPTS = (
    _UPLOT / 'uPlot.iife.min.js',
    *(SHARED / f'{name}.js' for name in ('theme', 'drawing')),
    *(_STATIC_FILES / f'{name}.js' for name in _LIVE_SCRIPTS.split()),
)
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
    **{path.name: ('text/javascript', text(path)) for path in _SCRIPTS},
}


def _styles() -> Markup:
    return joined(
        element('link', rel='stylesheet', href=f'/static/{path.name}') for path in _STYLES
    )


def note_page(title: str, note: str) -> str:
    """Return a page with one note."""
    return _small_page(title, element('p', note))


def list_page(runs: Sequence[ListedRun], token: str) -> str:
    """Return a page that lists runs, each of which leads to its review and its calibration."""
    lines = []
    for run in runs:
        path = f'/runs/{quote(run.name, safe="")}'
        time = datetime.fromtimestamp(run.time / 1e9, timezone.utc)
        lines.append(
            element(
                'li',
                element('a', run.name, href=f'{path}?token={token}'),
                element('span', f' {time:%Y-%m-%d %H:%M:%S} UTC ', class_='quiet'),
                element('a', 'calibrate', href=f'{path}/calibrate?token={token}'),
            )
        )
    back = element('p', element('a', 'The live page', href=f'/?token={token}'))
    return _small_page('Runs', element('ul', *lines) if lines else element('p', NO_RUNS), back)


def _small_page(title: str, *content: Markup) -> str:
    return html_page(title, _styles(), element('main', element('h1', title), *content))


_LICENCE = Markup(f'<!-- uPlot\n{text(_UPLOT / "LICENSE")}-->')
_LOADED = (element('script', src=f'/static/{path.name}', defer=True) for path in _SCRIPTS)
HTML = Template(text(_STATIC_FILES / 'live.html')).substitute(
    styles=_styles(), scripts=joined([_LICENCE, *_LOADED])
)
