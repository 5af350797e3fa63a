"""The files of the page: its markup, its style, its scripts, and the library that draws charts."""

from base64 import b64encode
from collections.abc import Iterable
import hashlib
from pathlib import Path

from .markup import element, joined, Markup

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


def text(name: str) -> str:
    """Return a file of the page."""
    return (_FOLDER / name).read_text(encoding='utf-8')


def styles() -> Markup:
    """Return all styles."""
    return joined(element('style', Markup(text(name))) for name in STYLES)


def scripts() -> Markup:
    """Return all scripts, with the licence of the library among them."""
    licence = Markup(f'<!-- uPlot\n{text("uplot/LICENSE")}-->')
    return joined([licence, *(element('script', Markup(text(name))) for name in SCRIPTS)])


def content_security_policy() -> str:
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
    digests = (hashlib.sha256(text(name).encode()).digest() for name in names)
    return ' '.join(f"'sha256-{b64encode(digest).decode('ascii')}'" for digest in digests)
