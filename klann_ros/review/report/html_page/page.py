"""A review as one HTML file that opens offline."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
import hashlib
import json
from pathlib import Path
from string import Template
from typing import BinaryIO

from klann_ros.review.model.comparing import Comparison
from klann_ros.review.model.review import Review
from klann_ros.review.report.json_report import finite

from . import sections
from .markup import element, joined, Markup
from .run_data import run_data

_FOLDER = Path(__file__).resolve().parent / 'static'
_UPLOT = ('uplot/uPlot.iife.min.js', 'uplot/uPlot.min.css')
STYLES = (
    _UPLOT[1],
    'theme.css',
    'page.css',
    'layout.css',
    'cards.css',
    'picture.css',
    'charts.css',
    'tables.css',
    'player.css',
    'phone.css',
    'print.css',
)
# In this order: each uses what stands above it.
SCRIPTS = (
    _UPLOT[0],
    'packed.js',
    'leg.js',
    'run.js',
    'player.js',
    'theme.js',
    'picture.js',
    'axes.js',
    'legend.js',
    'chart.js',
    'envelope.js',
    'leg_charts.js',
    'path_lines.js',
    'path_chart.js',
    'timing_chart.js',
    'controls.js',
    'page.js',
)


def _text(name: str) -> str:
    """Return a file of the page."""
    return (_FOLDER / name).read_text(encoding='utf-8')


def _styles() -> Markup:
    """Return all styles."""
    return joined(element('style', Markup(_text(name))) for name in STYLES)


def _scripts() -> Markup:
    """Return all scripts, with the licence of the library among them."""
    licence = Markup(f'<!-- uPlot\n{_text("uplot/LICENSE")}-->')
    return joined([licence, *(element('script', Markup(_text(name))) for name in SCRIPTS)])


def _content_security_policy() -> str:
    """Return what the page may do: run these very scripts, and load nothing from anywhere."""
    return '; '.join(
        (
            "default-src 'none'",
            f'script-src {_hashes(SCRIPTS)}',
            f'style-src {_hashes(STYLES)}',
            "base-uri 'none'",
            "form-action 'none'",
        )
    )


def _hashes(names: Iterable[str]) -> str:
    digests = (hashlib.sha256(_text(name).encode()).digest() for name in names)
    return ' '.join(f"'sha256-{b64encode(digest).decode('ascii')}'" for digest in digests)


# What the numbers of all runs may take [bytes]; as text it is a third more, below 12 MB. Ten
# minutes of a Klann leg at 200 Hz are kept whole.
MOST = 8.5e6


def save(reviews: Sequence[Review], comparison: Comparison | None, file: BinaryIO) -> None:
    """Write the page of one run, or of two, to an open file."""
    # A path may hold bytes that are no text.
    file.write(page(reviews, comparison).encode(errors='replace'))


def page(reviews: Sequence[Review], comparison: Comparison | None = None) -> str:
    """Return the page of one run, or of two."""
    data = [run_data(review, MOST / len(reviews)) for review in reviews]
    names = ' and '.join(Path(review.recording.path).name for review in reviews)
    return Template(_text('page.html')).substitute(
        title=element('title', f'Review of {names}'),
        policy=element(
            'meta',
            http_equiv='Content-Security-Policy',
            content=_content_security_policy(),
        ),
        styles=_styles(),
        header=sections.header(reviews, comparison),
        tiles=sections.figures(reviews),
        findings=sections.findings(reviews),
        differences=sections.differences(comparison),
        topics=sections.topics(reviews),
        data=element('script', as_script(data), id='data', type='application/json'),
        scripts=_scripts(),
    )


def as_script(data: object) -> Markup:
    """Return data as JSON that may stand in a script: no name in it can end that."""
    text = json.dumps(finite(data), ensure_ascii=True, separators=(',', ':'), allow_nan=False)
    return Markup(text.replace('<', '\\u003c'))
