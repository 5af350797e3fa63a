"""The page of a search in a real browser: offline, on telephones, with keys."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
import re

from browser import find
from browser_page import OpenedPage
from hostile_leg import LINKAGE
from klann_ros.design import requirements_from, search, SearchResult
from klann_ros.design.leg_file import walker_parameters
from klann_ros.design.page import page
import pytest

Visit = Callable[..., OpenedPage]

pytest.importorskip('playwright')
if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)

pytestmark = pytest.mark.slow
ALL = ('legs', 'none', 'hostile', 'walkers')
FIGURES = dict.fromkeys(('stride', 'lift', 'transmission_angle', 'duty_factor'), 'maximize')


@pytest.fixture(scope='module')
def design() -> SearchResult:
    requirements = requirements_from(
        {'linkage': 'klann', 'vary': 10, 'figures': FIGURES, 'count': 6}
    )
    return search(requirements, evaluations=960)


@pytest.fixture(scope='module')
def pages(design: SearchResult, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp('designs')
    file = folder / 'hostile.yaml'
    file.write_text(LINKAGE)
    hostile = search(
        requirements_from({'linkage': str(file), 'vary': 1, 'count': 2}), evaluations=480
    )
    without_legs = replace(design, legs=(), reasons=('stride is 1 m <b>short</b>',))
    walkers = []
    for leg in design.legs[:2]:
        walker = walker_parameters(leg.leg, {'legs': 8})
        walkers.append(replace(leg, walker=walker, reached={**leg.reached, 'speed': 0.1}))
    with_walkers = replace(
        design, legs=tuple(walkers), requirements=replace(design.requirements, walker={})
    )
    paths = {name: folder / f'{name}.html' for name in ALL}
    results = (design, without_legs, hostile, with_walkers)
    for path, shown in zip(paths.values(), results, strict=True):
        path.write_text(
            page(shown, [f'leg_{n:03d}' for n in range(1, len(shown.legs) + 1)]), encoding='utf-8'
        )
    return paths


@pytest.mark.parametrize('name', ALL)
def test_it_is_self_contained_on_a_phone(visit: Visit, pages: dict[str, Path], name: str) -> None:
    opened = visit(name, viewport={'width': 360, 'height': 760})
    assert opened.requests == [pages[name].as_uri()]
    assert opened.complaints == []
    assert not opened.is_too_wide()


@pytest.mark.parametrize('scheme', ['dark', 'light'])
def test_axe_finds_no_barrier(visit: Visit, scheme: str) -> None:
    assert visit('legs', color_scheme=scheme).barriers() == []


def test_legs_are_chosen_in_the_list_and_in_the_chart_up_to_four(visit: Visit) -> None:
    opened = visit('legs')
    dots = opened.page.locator('.scatter circle')
    buttons = opened.page.locator('.choice tbody button')
    cards = opened.page.locator('.chosen h3')
    assert dots.count() == buttons.count() == 6
    assert cards.count() == 2
    for n in range(1, 5):
        if dots.nth(n).get_attribute('aria-pressed') == 'false':
            dots.nth(n).focus()
            opened.page.keyboard.press('Enter')
    shown = [text.split(',')[0] for text in cards.all_text_contents()]
    assert shown == ['leg_002', 'leg_003', 'leg_004', 'leg_005']
    buttons.nth(4).click()
    assert cards.count() == 3
    assert dots.nth(4).get_attribute('aria-pressed') == 'false'


def test_chosen_legs_have_one_scale_and_one_crank(visit: Visit) -> None:
    opened = visit('legs', reduced_motion='reduce')
    scales = opened.page.eval_on_selector_all(
        '.chosen .drawing', 'drawings => drawings.map((svg) => svg.dataset.scale)'
    )
    assert len(scales) == 2
    assert len(set(scales)) == 1
    before = opened.points('.chosen .drawing')
    opened.page.locator('[type=range]').fill('90')
    assert opened.page.locator('.angle').text_content() == '90 deg'
    after = opened.points('.chosen .drawing')
    # The crank is at 0 deg, then above its axle.
    assert after['B'][0] == pytest.approx(before['A'][0], abs=1e-3)
    assert before['B'][1] == pytest.approx(before['A'][1], abs=1e-3)


def test_the_comparison_names_the_best_in_the_units_of_the_wish(
    visit: Visit, design: SearchResult
) -> None:
    opened = visit('legs')
    strides = [leg.reached['stride'] for leg in design.legs[:2]]
    row = opened.page.locator('.compare tbody tr', has_text=re.compile('^stride '))
    texts = row.locator('td').all_text_contents()
    assert [text.removesuffix(' best') for text in texts] == [f'{s:.4g} m' for s in strides]
    assert [text.endswith('best') for text in texts] == [s == max(strides) for s in strides]


def test_the_list_is_sorted_by_numbers(visit: Visit, design: SearchResult) -> None:
    opened = visit('legs')
    opened.page.locator('.choice thead button', has_text='lift').click()
    cells = opened.page.locator('.choice tbody td:nth-child(3)').all_text_contents()
    assert [float(cell) for cell in cells] == sorted(
        float(f'{leg.reached["lift"]:.4g}') for leg in design.legs
    )


def test_a_command_is_copied_or_selected(visit: Visit) -> None:
    opened = visit('legs')
    row = opened.page.locator('.command', has_text='describe').first
    row.locator('button').click()
    opened.until("document.querySelector('.command [role=status]:not(:empty)') !== null")
    assert row.locator('[role=status]').text_content() in {'Copied', 'Selected: press Ctrl-C'}


def test_a_walker_is_shown_in_three_dimensions_where_there_is_one(
    visit: Visit, pages: dict[str, Path]
) -> None:
    opened = visit('walkers', reduced_motion='reduce')
    canvases = opened.page.locator('canvas')
    assert canvases.count() == 2
    assert not canvases.first.is_visible()
    opened.page.locator('.chosen button').first.click()
    assert canvases.first.is_visible()
    scene = 'designPage.comparison.drawn[0].walker.scene'
    assert opened.page.evaluate(f'{scene}.legs.every((leg) => leg.meshes && leg.points)')
    assert opened.page.evaluate(f'{scene}.legs.length') == 8
    assert opened.requests == [pages['walkers'].as_uri()]
    assert [text for text in opened.complaints if 'GL Driver' not in text] == []
    assert opened.barriers() == []
    assert 'class RobotScene' not in pages['none'].read_text()
