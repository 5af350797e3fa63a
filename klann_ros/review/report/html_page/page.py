"""A review as one HTML file that opens offline."""

from collections.abc import Sequence
import json
from pathlib import Path
from string import Template
from typing import BinaryIO

from klann_ros.review.comparing import Comparison
from klann_ros.review.report.json_report import finite
from klann_ros.review.reviewed import Review

from . import assets, sections
from .figure_tiles import figures
from .markup import element, Markup
from .run_data import run_data

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
    return Template(assets.text('page.html')).substitute(
        title=element('title', f'Review of {names}'),
        policy=element(
            'meta',
            http_equiv='Content-Security-Policy',
            content=assets.content_security_policy(),
        ),
        styles=assets.styles(),
        header=sections.header(reviews, comparison),
        tiles=figures(reviews),
        findings=sections.findings(reviews),
        differences=sections.differences(comparison),
        topics=sections.topics(reviews),
        data=element('script', as_script(data), id='data', type='application/json'),
        scripts=assets.scripts(),
    )


def as_script(data: object) -> Markup:
    """Return data as JSON that may stand in a script: no name in it can end that."""
    text = json.dumps(finite(data), ensure_ascii=True, separators=(',', ':'), allow_nan=False)
    return Markup(text.replace('<', '\\u003c'))
