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
import re

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
    is_compact : bool
        Leave out the scripts' comments and indentation.

    """

    styles: Sequence[Path]
    scripts: Sequence[Path]
    is_compact: bool = False

    def page(self, title: str, *content: str, data: object = None) -> str:
        """Return a page with content in its `main`, and data as JSON in the element `data`."""
        given = {'id': 'data', 'type': 'application/json'}
        json_element = element('script', as_script(data), **given) if data is not None else ''
        head = joined([self.policy(), self.style_elements()])
        return html_page(
            title, head, element('main', *content), json_element, self.script_elements()
        )

    def style_elements(self) -> Markup:
        """Return all styles."""
        return joined(element('style', Markup(text(path))) for path in self.styles)

    def script_elements(self) -> Markup:
        """Return all scripts."""
        return joined(element('script', Markup(script)) for script in self._scripts())

    def _scripts(self) -> list[str]:
        scripts = map(text, self.scripts)
        return [_compact(script) for script in scripts] if self.is_compact else list(scripts)

    def policy(self) -> Markup:
        """Return what the page may do: run these very scripts, and load nothing from anywhere."""
        rules = (
            "default-src 'none'",
            f'script-src {_hashes(self._scripts())}',
            f'style-src {_hashes(map(text, self.styles))}',
            "base-uri 'none'",
            "form-action 'none'",
        )
        return element('meta', http_equiv='Content-Security-Policy', content='; '.join(rules))


def html_page(title: str, head: Markup, *body: str) -> str:
    """Return an HTML page; `head` is its policy and its styles."""
    metas = {'viewport': 'width=device-width, initial-scale=1', 'color-scheme': 'light dark'}
    start = element(
        'head',
        element('meta', charset='utf-8'),
        head,
        *(element('meta', name_=name, content=content) for name, content in metas.items()),
        element('title', title),
    )
    return f'<!doctype html>\n{element("html", start, element("body", *body), lang="en")}\n'


def text(path: Path) -> str:
    """Return a file of a page."""
    return path.read_text(encoding='utf-8')


def as_script(data: object) -> Markup:
    """Return data as JSON that may stand in a script: no name in it can end that."""
    written = json.dumps(data, ensure_ascii=True, separators=(',', ':'), allow_nan=False)
    return Markup(written.replace('<', '\\u003c'))


def _compact(script: str) -> str:
    """Return a script without indentation, and comments that have lines of their own."""
    code = re.sub(
        r'^ *(?:/\*(?:(?!\*/).)*\*/|//[^\n]*)\n', '', script, flags=re.DOTALL | re.MULTILINE
    )
    return re.sub(r'^\s+', '', code, flags=re.MULTILINE)


def _hashes(contents: Iterable[str]) -> str:
    digests = (hashlib.sha256(content.encode()).digest() for content in contents)
    hashes = (f"'sha256-{b64encode(digest).decode('ascii')}'" for digest in digests)
    return ' '.join(hashes) or "'none'"
