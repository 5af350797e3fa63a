"""The page of a search in a real browser: offline, on telephones, with keys."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
import re

from browser import find
from browser_page import OpenedPage
from hostile_leg import LINKAGE
from klann_ros.design import requirements_from, search, SearchResult
from klann_ros.design.page import page
import pytest

Visit = Callable[..., OpenedPage]

pytest.importorskip('playwright')
if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)

ALL = ('legs', 'none', 'hostile')
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
    paths = {name: folder / f'{name}.html' for name in ALL}
    for path, shown in zip(paths.values(), (design, without_legs, hostile), strict=True):
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


def test_up_to_four_legs_are_chosen_by_click_and_key(visit: Visit) -> None:
    opened = visit('legs')
    dots, titles = opened.page.locator('.scatter circle'), opened.page.locator('.chosen h3')
    assert dots.count() == 6
    assert titles.count() == 1
    for n in range(1, 5):
        dots.nth(n).focus()
        opened.page.keyboard.press('Enter')
    shown = [text.split(',')[0] for text in titles.all_text_contents()]
    assert shown == ['leg_002', 'leg_003', 'leg_004', 'leg_005']
    dots.nth(4).click()
    assert titles.count() == 3
    assert dots.nth(4).get_attribute('aria-pressed') == 'false'


def test_the_cards_have_the_units_of_the_wish(visit: Visit, design: SearchResult) -> None:
    opened = visit('legs')
    table = opened.page.locator('.chosen table').first
    stride = table.locator(
        'tbody tr', has=opened.page.locator('th', has_text=re.compile('^stride$'))
    )
    assert stride.locator('td').last.text_content() == f'{design.legs[0].reached["stride"]:.4g} m'
