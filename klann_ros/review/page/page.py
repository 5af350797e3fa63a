"""A review as one HTML file that opens offline."""

from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import BinaryIO

from klann_ros.review.model.comparing import Comparison
from klann_ros.review.model.review import Review
from klann_ros.review.report.json_report import finite
from klann_ros.web.markup import element, joined, Markup
from klann_ros.web.parts import as_script, FRAME, Parts, SHARED, text

from . import sections
from .run_data import run_data

_OWN = Path(__file__).resolve().parent / 'static'
_UPLOT = SHARED / 'uplot'
PARTS = Parts(
    styles=(
        _UPLOT / 'uPlot.min.css',
        *FRAME,
        SHARED / 'drawing.css',
        _OWN / 'charts.css',
        SHARED / 'tables.css',
        _OWN / 'player.css',
        _OWN / 'phone.css',
        _OWN / 'print.css',
    ),
    # In this order: each uses what stands above it.
    scripts=(
        _UPLOT / 'uPlot.iife.min.js',
        SHARED / 'theme.js',
        SHARED / 'drawing.js',
        _OWN / 'packed.js',
        _OWN / 'leg.js',
        _OWN / 'run.js',
        _OWN / 'player.js',
        _OWN / 'picture.js',
        _OWN / 'way.js',
        _OWN / 'axes.js',
        _OWN / 'legend.js',
        _OWN / 'chart.js',
        _OWN / 'envelope.js',
        _OWN / 'leg_charts.js',
        _OWN / 'path_lines.js',
        _OWN / 'path_chart.js',
        _OWN / 'timing_chart.js',
        _OWN / 'controls.js',
        _OWN / 'page.js',
    ),
)

# What the numbers of all runs may take [bytes]; as text it is a third more, below 12 MB. Ten
# minutes of a Klann leg at 200 Hz are kept whole.
MOST = 8.5e6


def save(
    reviews: Sequence[Review],
    comparison: Comparison | None,
    file: BinaryIO,
    most: float = MOST,
) -> None:
    """Write the page of one run, or of two, to an open file; parameters as `page`."""
    # A path may hold bytes that are no text.
    file.write(page(reviews, comparison, most).encode(errors='replace'))


def page(
    reviews: Sequence[Review], comparison: Comparison | None = None, most: float = MOST
) -> str:
    """Return the page of one run, or of two; all its numbers take so many bytes at the most."""
    data = [run_data(review, most / len(reviews)) for review in reviews]
    names = ' and '.join(Path(review.recording.path).name for review in reviews)
    licence = Markup(f'<!-- uPlot\n{text(_UPLOT / "LICENSE")}-->')
    return Template(text(_OWN / 'page.html')).substitute(
        title=element('title', f'Review of {names}'),
        policy=PARTS.policy(),
        styles=PARTS.style_elements(),
        header=sections.header(reviews, comparison),
        tiles=sections.figures(reviews),
        findings=sections.findings(reviews),
        differences=sections.differences(comparison),
        topics=sections.topics(reviews),
        data=element('script', as_script(finite(data)), id='data', type='application/json'),
        scripts=joined([licence, PARTS.script_elements()]),
    )
