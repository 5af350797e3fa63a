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
FRAME = tuple(SHARED / f'{name}.css' for name in ('theme', 'base', 'layout', 'cards', 'findings'))
"""The styles that every page begins with."""

COMMENT_LINES = re.compile(r'^ *(?:/\*(?:(?!\*/).)*\*/|//[^\n]*)\n', re.DOTALL | re.MULTILINE)
STRINGS = re.compile(r"""('(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*"|`(?:\\.|[^`\\])*`)""")
# Blanks around operators, in sums, after colons and semicolons, beside keywords. `a :hover` is not
# `a:hover`.
BLANKS = re.compile(
    r' ?([!=<>?,{}&|*]) ?|(?<=[\w)\]]) ([-+/:]) (?=[\w(\[])|(?<=[:;]) |(?<=\bif) (?=\()'
    r'|(?<=\bfor) (?=\()|(?<=\breturn) (?=[\[(`])|(?<=\bconst) (?=\[)'
    r'|(?<=[)\]}]) (?=(?:return|of|throw|continue|break|else)\b)'
)


@dataclass(frozen=True)
class Parts:
    """The files of a page, in this order: each uses what stands before it."""

    styles: Sequence[Path]
    scripts: Sequence[Path]
    # Whether comments and needless blanks are left out, and each sort of files is joined.
    is_compact: bool = False

    def page(self, title: str, *content: str, data: object = None, language: str = 'en') -> str:
        """Return a page with content in its `main`, and data as JSON in the element `data`."""
        json_element = ''
        if data is not None:
            json_element = element('script', as_script(data), id='data', type='application/json')
        head = joined([self.policy(), self.style_elements()])
        body = element('main', *content), json_element, self.script_elements()
        return html_page(title, head, *body, language=language)

    def style_elements(self) -> Markup:
        """Return all styles."""
        return joined(element('style', Markup(style)) for style in self._files(self.styles))

    def script_elements(self) -> Markup:
        """Return all scripts."""
        return joined(element('script', Markup(script)) for script in self._files(self.scripts))

    def _files(self, paths: Iterable[Path]) -> list[str]:
        contents = [*map(text, paths)]
        if not self.is_compact:
            return contents
        joined_files = '\n'.join(map(compact, contents))
        # The first one is that of the whole script.
        first, strict, others = joined_files.partition("'use strict';")
        return [first + strict + others.replace(strict, '') if strict else joined_files]

    def policy(self, scripts: Iterable[str] = (), styles: Iterable[str] = ()) -> Markup:
        """
        Return what the page may do: run these very scripts, and load nothing from anywhere.

        Scripts and styles that the page adds to itself later are named as well.
        """
        rules = (
            "default-src 'none'",
            f'script-src {_hashes([*self._files(self.scripts), *scripts])}',
            f'style-src {_hashes([*self._files(self.styles), *styles])}',
            "base-uri 'none'",
            "form-action 'none'",
        )
        return element('meta', http_equiv='Content-Security-Policy', content='; '.join(rules))


def html_page(title: str, head: Markup, *body: str, language: str = 'en') -> str:
    """Return an HTML page; `head` is its policy and its styles."""
    start = element(
        'head',
        element('meta', charset='utf-8'),
        head,
        element('meta', name_='viewport', content='width=device-width, initial-scale=1'),
        element('meta', name_='color-scheme', content='light dark'),
        element('title', title),
    )
    return f'<!doctype html>\n{element("html", start, element("body", *body), lang=language)}\n'


def text(path: Path) -> str:
    """Return a file of a page."""
    return path.read_text(encoding='utf-8')


def as_script(data: object) -> Markup:
    """Return data as JSON that may stand in a script: no name in it can end that."""
    written = json.dumps(data, ensure_ascii=True, separators=(',', ':'), allow_nan=False)
    return Markup(written.replace('<', '\\u003c'))


def compact(content: str) -> str:
    """Return a file without comments that have lines of their own, needless blanks and lines."""
    code = re.sub(r'^\s+', '', COMMENT_LINES.sub('', content), flags=re.MULTILINE)
    lines = re.sub(r',\n(?=[)\]}])', '\n', code).splitlines(keepends=True)
    # No loop of these files has an empty body.
    tight = re.sub(r';(?=\n?\})', '', ''.join(map(_tight, lines)))
    # A line that such a character ends, or begins, goes on.
    return re.sub(r'(?<=[+&|?:(,>])\n|\n(?=[.?:)\]}])', '', tight)


def _tight(line: str) -> str:
    """Return a line without blanks around operators; one with templates or a regex as it is."""
    if line[-2:-1] in set('{}([,;') and '//' not in line:
        line = line[:-1]
    if line.count('`') not in (0, 2) or re.search(r'/[^ ]', line):
        return line
    # Code and strings, in turn.
    pieces = STRINGS.split(line)
    for index in range(0, len(pieces), 2):
        pieces[index] = BLANKS.sub(r'\1\2', pieces[index])
    return ''.join(pieces)


def _hashes(contents: Iterable[str]) -> str:
    hashes = []
    for content in contents:
        digest = hashlib.sha256(content.encode()).digest()
        hashes.append(f"'sha256-{b64encode(digest).decode('ascii')}'")
    return ' '.join(hashes) or "'none'"
