"""Pages of real runs, opened from their files in a real browser: one for all tests."""

from collections.abc import Iterator
from dataclasses import replace
import math
from pathlib import Path
from typing import Any

from browser_page import OpenedPage
import klann_ros
from klann_ros.kinematics import KlannLeg, LinkageLeg, shipped_linkage
from klann_ros.review.model.compare import compare
from klann_ros.review.page import save
from klann_ros.review.reviewing import review_run
from leg_runs import LegRun
import pytest
from walk_runs import Walking

LEGS = ('front_left', 'front_right', 'rear_left', 'rear_right')
# All that a name may hold in a log, and hostile in HTML, in attributes and in scripts.
HOSTILE = 'x\'"><img src=http://a.test/ onerror=bad()></script><script>bad()</script>&amp;<!--'
KLANN = KlannLeg().geometry
# Wider than a telephone, without a place to break.
LONG = 'run_' + 60 * '2026' + '_end'
LONGER = replace(KLANN, l_ab=1.01 * KLANN.l_ab)
PHASES = {name: k * math.pi / 2 for k, name in enumerate(LEGS)}

RUNS = {
    'klann': LegRun(parameters=KLANN.as_dict()),
    LONG: LegRun(parameters=KLANN.as_dict()),
    'longer': LegRun(legs={'': KlannLeg(LONGER)}, parameters=LONGER.as_dict()),
    # It was solved with another crank than recorded, and stood still.
    'faulty': LegRun(parameters=LONGER.as_dict(), pause=(300, 0.4)),
    'walker': LegRun(
        legs=dict.fromkeys(LEGS, KlannLeg()),
        phases=PHASES,
        parameters={
            **KLANN.as_dict(),
            'legs': list(LEGS),
            **{f'{name}.phase': phase for name, phase in PHASES.items()},
        },
    ),
    'changed': LegRun(parameters=LONGER.as_dict(), later=(200, KLANN.as_dict())),
    'garbled': LegRun(
        parameters=KLANN.as_dict(),
        garbled={0: math.nan, 100: math.inf, 200: 1e300, 300: -1e60, 399: 1e9},
    ),
    'nothing': LegRun(legs={}, poses=False, iterations=False),
    'feet': LegRun(poses=False, iterations=False),
    'bare': LegRun(rates=False, iterations=False),
    'hostile': LegRun(
        legs={HOSTILE: KlannLeg()}, parameters={**KLANN.as_dict(), 'legs': [HOSTILE]}
    ),
    # It thinks that it goes further than it does.
    'walk': Walking(scale=1.1, turning=0.2, space=f'/{HOSTILE}'),
}


def linkage_run(name: str) -> LegRun:
    """Return a run of a shipped linkage."""
    file = Path(klann_ros.__file__).parent / 'linkages' / f'{name}.yaml'
    parameters = {'linkage_description': file.read_text(encoding='utf-8')}
    return LegRun(legs={'': LinkageLeg(shipped_linkage(name))}, parameters=parameters)


@pytest.fixture(scope='session')
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the page of each run, and of two runs side by side."""
    folder = tmp_path_factory.mktemp('pages')
    runs = {**RUNS, **{name: linkage_run(name) for name in ('jansen', 'quick_return')}}
    reviews = {}
    for name, run in runs.items():
        reviews[name] = review_run(run.write(folder / name), rates='f4')
    pages = {}
    two = [reviews['klann'], reviews['longer']]
    for name in (*reviews, 'two'):
        pages[name] = folder / f'{name}.html'
        with pages[name].open('wb') as file:
            if name == 'two':
                save(two, compare(*two), file)
            else:
                save([reviews[name]], None, file)
    return pages


@pytest.fixture(scope='module')
def klann_page(browser: Any, pages: dict[str, Path]) -> Iterator[OpenedPage]:
    page = browser.new_page(viewport={'width': 1280, 'height': 900})
    yield OpenedPage(page, pages['klann'].as_uri())
    page.close()


@pytest.fixture
def klann(klann_page: OpenedPage) -> OpenedPage:
    """Return the page of the run klann as it is at first: to open it takes longer than a test."""
    klann_page.page.evaluate(
        'page.player.speed = 1; page.player.pause(); page.player.go(0); page.switchTo(false)'
    )
    klann_page.page.evaluate('document.activeElement.blur()')
    return klann_page


@pytest.fixture(scope='session')
def runs() -> dict[str, LegRun]:
    return RUNS
