"""Settings of all tests, and which of them share a worker."""

from collections.abc import Callable, Iterator, Mapping
import gc
import os
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
# As in the programs, also without scripts/test: see klann_ros/executables.py.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

# Tests of real processes on real DDS: they wait more than they compute, so three of them run side
# by side, in domains of their own, and no more while others compute, so that none starves.
LINES = 3
ONE_BY_ONE = (
    'test/nodes/',
    'test/packaging/',
    'test/examples/test_hardware_driver.py',
    '/test_real_',
    '/test_launched_',
)
# Few tests that take long, in files that would otherwise come last, for one worker.
LONG = (
    'test/benchmarks/',
    'test/calibration/',
    'test/design/',
    'test/viewing/test_launched_',
    'test/review/test_',
    'test/examples/test_hardware_driver.py',
    'test/nodes/commission/',
    'test/nodes/recorder/',
    'test/nodes/sim/',
    'test/nodes/view/',
    'test/nodes/walker/',
    'test/nodes/watchdog/',
    'test/docs/test_',
    'test/log/test_',
    'test/log/read/test_bombs.py',
    'test/web/lab/test_in_browser.py',
    'test/fuzzing/',
    'test/kinematics/foot/',
    'test/synthesis/',
    'test/datasheet/',
    'test/twin/',
)
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


def pytest_collection() -> None:
    """Spare the garbage collector six thousand tests that stay, while they are made."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Collect garbage again, without a look at the tests."""
    gc.freeze()
    gc.enable()
    # A test leaves little garbage.
    gc.set_threshold(50_000, 20, 20)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """
    Give whole files to a worker: what a file shares is made once.

    xdist's own groups are marks that it writes into a test's name, which pytest 9.2 no longer
    reads.
    """
    from xdist.scheduler import LoadScopeScheduling

    class Scheduler(LoadScopeScheduling):
        """A file is a scope; some workers take those of real processes first, some last."""

        def _assign_work_unit(self, node: Any) -> None:
            takes_real = int(node.gateway.id.removeprefix('gw')) < LINES

            def rank(scope: str) -> tuple[bool, bool]:
                is_real = any(part in scope for part in ONE_BY_ONE)
                return is_real == takes_real, scope.startswith(LONG)

            # Of equals the first one, which has the most tests.
            self.workqueue.move_to_end(max(self.workqueue, key=rank), last=False)
            super()._assign_work_unit(node)

        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.split('::', maxsplit=1)[0]
            return TOGETHER if file.startswith(TOGETHER) else file

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
def new_page(browser: Any) -> Iterator[Callable[..., Any]]:
    """Yield what makes pages, each in a context of its own with these options."""
    contexts = []

    def make(**options: Any) -> Any:
        contexts.append(browser.new_context(**options))
        return contexts[-1].new_page()

    yield make
    for context in contexts:
        context.close()


@pytest.fixture
def visit(new_page: Callable[..., Any], pages: Mapping[str, Path]) -> Callable[..., Any]:
    """Return what opens a page of a module by its name; options are those of a browser context."""
    from browser_page import OpenedPage

    return lambda name, **options: OpenedPage(new_page(**options), pages[name].as_uri())
