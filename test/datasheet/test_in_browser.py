"""The page of a data sheet in a real browser: offline, alive, for telephones, nights and paper."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
import re

from browser import find
from browser_page import OpenedPage
from hostile_leg import HOSTILE, LINKAGE
from klann_ros.datasheet import data_sheet, motor_from_file
from klann_ros.datasheet.page import page
from klann_ros.kinematics import KlannLeg
from klann_ros.robot import Robot, robot_from_file, robot_of
import numpy as np
import pytest

Visit = Callable[..., OpenedPage]

pytest.importorskip('playwright')
if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)

ROOT = Path(__file__).resolve().parents[2]
# What scrolls sideways within the page.
SCROLLED = """
[...document.querySelectorAll('main *')]
  .filter((node) => node.scrollWidth > node.clientWidth)
  .filter((node) => getComputedStyle(node).overflowX === 'auto')
  .map((node) => [node.className, node.getAttribute('aria-label')])
"""
ALL = ('leg', 'cannot', 'walker', 'partial', 'hostile')


@pytest.fixture(scope='module')
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp('sheets')
    motor = motor_from_file(str(ROOT / 'config' / 'motor_example.yaml'))
    leg = robot_of('sem104')
    hostile = folder / 'hostile.yaml'
    hostile.write_text(LINKAGE)
    walker = robot_from_file(ROOT / 'config' / 'walker6.yaml')
    hostile_robot = robot_from_file(hostile).with_rods(1.0)
    named = replace(hostile_robot.legs[0], name=HOSTILE, crank_joint=HOSTILE)
    sheets = {
        'leg': data_sheet(leg, load=10.0, motor=motor),
        'cannot': data_sheet(leg, speed=-20.0, motor=motor),
        'walker': data_sheet(walker, speed=1.0, load=30.0, motor=motor, samples=180),
        'partial': data_sheet(robot_of('chebyshev'), samples=180),
        'hostile': data_sheet(
            Robot(HOSTILE, (named,), source=HOSTILE), load=1.0, motor=motor, samples=90
        ),
    }
    paths = {name: folder / f'{name}.html' for name in ALL}
    for name, sheet in sheets.items():
        paths[name].write_text(page(sheet), encoding='utf-8')
    return paths


@pytest.mark.parametrize('name', ALL)
def test_it_is_self_contained_on_a_phone(visit: Visit, pages: dict[str, Path], name: str) -> None:
    opened = visit(name, viewport={'width': 360, 'height': 760})
    for button in opened.page.locator('button:visible').all():
        button.click()
        button.click()
    assert opened.requests == [pages[name].as_uri()]
    assert opened.complaints == []
    assert not opened.is_too_wide()
    assert opened.page.evaluate(SCROLLED) == []


@pytest.mark.slow
@pytest.mark.parametrize(('name', 'scheme'), [('walker', 'dark'), ('cannot', 'light')])
def test_axe_finds_no_barrier(visit: Visit, name: str, scheme: str) -> None:
    assert visit(name, color_scheme=scheme).barriers() == []


@pytest.mark.parametrize('degrees', [0.0, 60.0, 200.0])
def test_the_slider_moves_the_leg_and_the_marks_to_an_angle(visit: Visit, degrees: float) -> None:
    opened = visit('leg')
    opened.page.locator('.angle').fill(repr(degrees / 360.0 + 1e-4))
    pose = KlannLeg().solve(np.radians(degrees))
    points = opened.points('.drawing')
    for name, point in zip('ABCDEFGH', pose.points, strict=True):
        assert np.abs(points[name] - point).max() <= 1e-5
    assert opened.page.locator('.at').text_content() == f'{degrees:.1f}°'
    transform = opened.page.locator('.cursor').first.get_attribute('transform')
    x = float(transform.split('(')[1].split()[0])
    assert x == pytest.approx(364 * degrees / 360, abs=0.06)


def test_it_plays_and_pauses_in_the_direction_of_the_crank(visit: Visit) -> None:
    for name, direction in (('leg', 1.0), ('cannot', -1.0)):
        opened = visit(name)
        play = opened.page.locator('.play')
        slider = opened.page.locator('.angle')
        start = slider.input_value()
        play.click()
        while slider.input_value() == start:
            # Playwright's own waiting needs what the policy forbids.
            opened.page.wait_for_timeout(5)
        play.click()
        end = slider.input_value()
        # Of a turn the shorter way.
        rotation = (float(end) - float(start) + 0.5) % 1.0 - 0.5
        assert direction * rotation > 0.0
        assert play.text_content() == 'Play'
        opened.page.wait_for_timeout(60)
        assert slider.input_value() == end


def test_a_motor_that_is_too_weak_is_reported_first(visit: Visit) -> None:
    verdict = visit('cannot').page.locator('header .verdict.bad')
    assert 'The motor cannot turn it' in verdict.inner_text()
    assert 'turns no faster than' in verdict.inner_text()


def test_charts_are_there_without_scripts(visit: Visit) -> None:
    opened = visit('leg', java_script_enabled=False)
    assert opened.page.locator('.chart svg[role=img]').count() == 4
    assert 'switched off' in opened.page.locator('noscript').inner_text()


def test_on_paper_it_is_light_and_has_nothing_to_press(visit: Visit) -> None:
    opened = visit('leg', color_scheme='dark')
    opened.page.emulate_media(media='print')
    paper = opened.page.evaluate('getComputedStyle(document.body).backgroundColor')
    assert paper == 'rgb(255, 255, 255)'
    assert not opened.page.locator('button').first.is_visible()


@pytest.mark.parametrize(('name', 'sides', 'height'), [('leg', 1, 4500), ('walker', 2, 6500)])
def test_it_is_short_on_paper_and_phone(visit: Visit, name: str, sides: int, height: int) -> None:
    opened = visit(name, viewport={'width': 390, 'height': 844})
    assert opened.page.evaluate('document.documentElement.scrollHeight') <= height
    printed = opened.page.pdf(format='A4', prefer_css_page_size=True)
    assert len(re.findall(rb'/Type\s*/Page\b', printed)) == sides


def test_a_hostile_name_is_but_text(visit: Visit) -> None:
    opened = visit('hostile')
    assert opened.page.locator('img').count() == 0
    assert opened.page.evaluate('document.scripts.length') == 4
    assert '<img src=http://a.test/' in opened.page.locator('h1').inner_text()
