"""
Scripts and styles put into one HTML file, and the policy that lets these and nothing else run.

`SHARED` is the folder of what every page can use; its drawing.js is the one renderer of legs.
"""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import hashlib
import json
from pathlib import Path

from .markup import element, joined, Markup

SHARED = Path(__file__).resolve().parent / 'static'
FRAME = tuple(SHARED / f'{name}.css' for name in ('theme', 'base', 'layout', 'cards'))
"""The styles that every page begins with."""


@dataclass(frozen=True)
class Parts:
    """
    The files of a page.

    Attributes
    ----------
    styles, scripts : sequence of pathlib.Path
        In this order: each uses what stands before it.

    """

    styles: Sequence[Path]
    scripts: Sequence[Path]

    def style_elements(self) -> Markup:
        """Return all styles."""
        return joined(element('style', Markup(text(path))) for path in self.styles)

    def script_elements(self) -> Markup:
        """Return all scripts."""
        return joined(element('script', Markup(text(path))) for path in self.scripts)

    def policy(self) -> Markup:
        """Return what the page may do: run these very scripts, and load nothing from anywhere."""
        rules = (
            "default-src 'none'",
            f'script-src {_hashes(self.scripts)}',
            f'style-src {_hashes(self.styles)}',
            "base-uri 'none'",
            "form-action 'none'",
        )
        return element('meta', http_equiv='Content-Security-Policy', content='; '.join(rules))


def text(path: Path) -> str:
    """Return a file of a page."""
    return path.read_text(encoding='utf-8')


def as_script(data: object) -> Markup:
    """Return data as JSON that may stand in a script: no name in it can end that."""
    written = json.dumps(data, ensure_ascii=True, separators=(',', ':'), allow_nan=False)
    return Markup(written.replace('<', '\\u003c'))


def _hashes(paths: Iterable[Path]) -> str:
    digests = (hashlib.sha256(text(path).encode()).digest() for path in paths)
    told = (f"'sha256-{b64encode(digest).decode('ascii')}'" for digest in digests)
    return ' '.join(told) or "'none'"
