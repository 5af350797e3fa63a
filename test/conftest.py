"""Settings of all tests, and which of them share a worker."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
import gc
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, settings
import pytest

# No test asserts a time, and neither does hypothesis: the machine may be busy.
# What a law needs more examples for says so; scripts/fuzz has millions.
settings.register_profile(
    'untimed', deadline=None, max_examples=20, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile('untimed')

# Tests of real processes on real DDS: they wait more than they compute, so two lines of them run
# side by side, in domains of their own; each is run one by one, so that none starves the others.
ONE_BY_ONE = ('test/nodes/', 'test/packaging/', '/test_real_', '/test_launched_')
# What a browser does for nobody.
FLAGS = [
    '--no-sandbox',
    '--disable-gpu',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-sync',
    '--no-first-run',
    '--disable-quic',
]
# One browser and one set of pages.
TOGETHER = 'test/review/page/'


def pytest_collection_finish() -> None:
    """Spare the garbage collector five thousand tests that stay, again and again."""
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """
    Give whole files to a worker: what a file shares is made once.

    xdist's own groups are marks that it writes into a test's name, which pytest 9.2 no longer
    reads.
    """
    from xdist.scheduler import LoadScopeScheduling

    class Scheduler(LoadScopeScheduling):
        """A file is a scope; those of real processes are two lines."""

        @cached_property
        def lines(self) -> dict[str, str]:
            """Two lines with as many tests each, whole files one after the other."""
            files = Counter(name.split('::')[0] for name in self.collection)
            lengths, lines = [0, 0], {}
            for file, count in files.most_common():
                if any(part in file for part in ONE_BY_ONE):
                    line = lengths.index(min(lengths))
                    lengths[line] += count
                    lines[file] = f'line {line}'
            return lines

        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.split('::', maxsplit=1)[0]
            return TOGETHER if file.startswith(TOGETHER) else self.lines.get(file, file)

    return Scheduler(config, log)


@pytest.fixture(scope='session')
def browser() -> Iterator[Any]:
    """Yield a Chromium for all tests of a worker: two of playwright's loops bar each other."""
    from browser import find
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=find(), args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture
def visit(browser: Any, pages: Mapping[str, Path]) -> Iterator[Callable[..., Any]]:
    """Yield what opens a page of a module by its name; options are those of a browser context."""
    from opened_page import OpenedPage

    contexts = []

    def open_page(name: str, **options: Any) -> OpenedPage:
        contexts.append(browser.new_context(**options))
        return OpenedPage(contexts[-1].new_page(), pages[name].as_uri())

    yield open_page
    for context in contexts:
        context.close()
