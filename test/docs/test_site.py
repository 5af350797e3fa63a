"""The manual as static files in a real browser: below a path, from a disk, without a network."""

from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
import subprocess
import sys
from threading import Thread
from typing import Any

from browser import find
from browser_page import OpenedPage
import pytest

pytest.importorskip('playwright')
pytest.importorskip('furo')
if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)

ROOT = Path(__file__).resolve().parents[2]
# The pages with figures; the check `docs` builds all.
SOURCES = ('index', 'theory', 'teoria', 'examples', 'exemplos', 'lab')
FIGURES = {'theory': 12, 'teoria': 12, 'examples': 5, 'exemplos': 5}
SCROLL = """async () => {
    for (let top = 0; top < document.documentElement.scrollHeight; top += 400) {
        scrollTo({ top, behavior: 'instant' });
        await new Promise((done) => setTimeout(done, 40));
    }
    return document.querySelectorAll('.interactive').length;
}"""
# axe does not read formulas: to it the head of their column is empty.
READABLE = {'rules': {'empty-table-header': {'enabled': False}}}
Visit = Callable[..., OpenedPage]


class QuietHandler(SimpleHTTPRequestHandler):
    """A handler of requests that prints nothing."""

    def log_message(self, *_: Any) -> None:
        """Print nothing."""


@pytest.fixture(scope='module')
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the pages below a path of a server's folder."""
    work = tmp_path_factory.mktemp('site')
    folder = work / 'server' / 'course' / 'legs'
    pages = ','.join(f'docs/{name}.md' for name in SOURCES)
    options = ['-b', 'html', '-c', 'docs', '-d', work / 'doctrees', '-q']
    options += ['-D', 'root_doc=docs/index', '-D', f'include_patterns={pages}', '.', folder]
    command = [sys.executable, '-m', 'sphinx', *map(str, options)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return folder


@pytest.fixture(scope='module')
def address(site: Path) -> Iterator[str]:
    """Serve the folder above the site."""
    handler = partial(QuietHandler, directory=site.parents[1])
    server = ThreadingHTTPServer(('127.0.0.1', 0), handler)
    Thread(target=server.serve_forever, daemon=True).start()
    yield f'http://127.0.0.1:{server.server_port}/course/legs/'
    server.shutdown()
    server.server_close()


@pytest.fixture
def visit(browser: Any, address: str) -> Iterator[Visit]:
    """Open pages of the site in a browser without any other network."""
    contexts = []

    def open_page(name: str, base: str = address, **options: Any) -> OpenedPage:
        context = browser.new_context(**options)
        contexts.append(context)
        context.route(
            lambda url: not url.startswith((address, 'data:', 'file:')),
            lambda route: route.abort(),
        )
        return OpenedPage(context.new_page(), f'{base}docs/{name}.html')

    yield open_page
    for context in contexts:
        context.close()


@pytest.mark.parametrize(
    ('name', 'scheme', 'width'),
    [
        ('theory', 'light', 1280),
        ('teoria', 'dark', 390),
        ('examples', 'dark', 1280),
        ('exemplos', 'light', 390),
    ],
)
def test_a_page_needs_nothing_from_outside_and_has_no_barrier(
    visit: Visit, address: str, name: str, scheme: str, width: int
) -> None:
    opened = visit(name, color_scheme=scheme, viewport={'width': width, 'height': 900})
    assert opened.page.evaluate(SCROLL) == FIGURES[name]
    assert [url for url in opened.requests if not url.startswith((address, 'data:'))] == []
    assert opened.complaints == []
    assert not opened.is_too_wide()
    language = opened.page.evaluate('document.documentElement.lang')
    assert language == ('en' if name in {'theory', 'examples'} else 'pt-BR')
    assert opened.barriers(READABLE) == []
