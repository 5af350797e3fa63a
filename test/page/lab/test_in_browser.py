"""The lab in a real browser: opened from its file, dragged, turned, read, saved and loaded."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from browser import find
from klann_ros.kinematics import (
    KlannGeometry,
    KlannLeg,
    LinkageLeg,
    shipped_linkages,
    UnreachableError,
)
from klann_ros.kinematics.linkage.file import linkage_from_text, SHIPPED
from klann_ros.page.lab.build import FILE
from klann_ros.untrusted.yaml_text import parse
import numpy as np
import pytest

pytest.importorskip('playwright')
if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)

HOSTILE = '</script><img src=http://a.test/ onerror=bad()>&amp;'
# As SEM 104 prints them [deg].
PRINTED = ['10.5138 67.0074 36.7323 45.7048', '10.6570 67.3283 34.4691 45.7564']
PRINTED += ['10.6570 67.3283 34.4634 45.7220']
# What each joint is at, in metres of the leg's plane.
PLACES = """() => Object.fromEntries(scene.leg.joints.map((node, i) => [
    node.dataset.point, scene.drawing.metresAt(scene.drawing.at(lab.pose.points[i]))]))"""


class Opened:
    """The lab in the browser, with everything that it asked for and complained about."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.requests: list[str] = []
        self.complaints: list[str] = []
        page.on('request', lambda request: self.requests.append(request.url))
        page.on('console', lambda said: self.complaints.append(said.text))
        page.on('pageerror', lambda error: self.complaints.append(str(error)))
        page.goto(FILE.as_uri())
        self.until('Boolean(lab.turn)')

    def until(self, expression: str) -> None:
        """Wait for something; playwright's own waiting needs what the policy forbids."""
        for _ in range(2000):
            if self.page.evaluate(expression):
                return
            self.page.wait_for_timeout(10)
        raise AssertionError(expression)

    def text(self, selector: str) -> str:
        found: str = self.page.locator(selector).text_content()
        return found

    def load(self, text: str) -> None:
        """Load a text as somebody does who has pasted it."""
        self.page.evaluate("document.querySelector('details').open = true")
        self.page.locator('#text').fill(text)
        self.page.locator('#load-text').click()

    def drag(self, name: str, x: float, y: float) -> None:
        """Drag a point by so many pixels."""
        box = self.page.locator(f'[data-grip={name}]').bounding_box()
        at = box['x'] + box['width'] / 2, box['y'] + box['height'] / 2
        self.page.mouse.move(*at)
        self.page.mouse.down()
        self.page.mouse.move(at[0] + x / 2, at[1] + y / 2)
        self.page.mouse.move(at[0] + x, at[1] + y)
        self.page.mouse.up()


@pytest.fixture(scope='module')
def shared(browser: Any) -> Iterator[Opened]:
    context = browser.new_context(locale='en-US', viewport={'width': 1280, 'height': 1000})
    yield Opened(context.new_page())
    context.close()


@pytest.fixture
def lab(shared: Opened) -> Opened:
    """Return the page as it is at first: to open it takes longer than most tests."""
    shared.page.evaluate("speak('en'); crank.isTurning = false; lab.choose('klann')")
    shared.page.evaluate('newton.drawn = 0; newton.run(); document.activeElement.blur()')
    return shared


@pytest.fixture
def visit(browser: Any) -> Iterator[Callable[..., Opened]]:
    contexts = []

    def open_page(**options: Any) -> Opened:
        contexts.append(browser.new_context(**options))
        return Opened(contexts[-1].new_page())

    yield open_page
    for context in contexts:
        context.close()


def test_every_shipped_linkage_is_drawn_without_a_request_or_an_error(visit) -> None:
    opened = visit(locale='en-US')
    opened.page.locator('#others').click()
    for name in shipped_linkages():
        # What is drawn of the last one must not be left over.
        opened.page.evaluate('newton.draw(1)')
        opened.page.locator('#linkage').select_option(name)
        linkage = linkage_from_text((SHIPPED / f'{name}.yaml').read_text(encoding='utf-8'), name)
        pose = LinkageLeg(linkage).solve(opened.page.evaluate('lab.alpha'))
        found = opened.page.evaluate(PLACES)
        for point, at in zip(linkage.structure.points, pose.points, strict=True):
            assert np.abs(np.array(found[point]) - at).max() < 1e-9, (name, point)
    assert opened.requests == [FILE.as_uri()]
    assert opened.complaints == []


def test_the_policy_lets_no_other_script_run(visit) -> None:
    opened = visit()
    opened.page.evaluate(
        "document.body.append(Object.assign(document.createElement('script'), {text: 'ran = 1'}))"
    )
    assert opened.page.evaluate('typeof ran') == 'undefined'
    assert 'Content Security Policy' in opened.complaints[0]


def test_a_dragged_joint_changes_the_lengths_that_meet_there(lab: Opened) -> None:
    before = lab.page.evaluate('[...lab.numbers]')
    lab.drag('C', 30, -40)
    names = lab.page.evaluate('lab.linkage.structure.dimensions.map(({ name }) => name)')
    after = lab.page.evaluate('[...lab.numbers]')
    changed = {n for n, a, b in zip(names, before, after, strict=True) if abs(a - b) > 1e-9}
    assert changed == {'B-C', 'C-G', 'bend of C-G', 'D-C'}
    # Everything else stayed where it was.
    places = lab.page.evaluate(PLACES)
    expected = KlannLeg().solve(np.pi / 3).points
    assert np.abs(np.array(places['G']) - expected[6]).max() < 1e-9
    assert np.abs(np.array(places['C']) - expected[2]).max() > 0.01
    assert lab.page.locator('#number-1').input_value() == f'{1000 * after[1]:.8g}'


def test_a_dragged_pivot_keeps_all_lengths(lab: Opened) -> None:
    before = lab.page.evaluate('lab.linkage.structure.dimensions.map((d, n) => lab.numbers[n])')
    lab.drag('E', 12, 9)
    after = lab.page.evaluate('[...lab.numbers]')
    moved = [n for n, (a, b) in enumerate(zip(before, after, strict=True)) if a != b]
    names = lab.page.evaluate('lab.linkage.structure.dimensions.map(({ name }) => name)')
    assert [names[n] for n in moved] == ['E.x', 'E.y']


def test_keys_move_a_point_and_turn_the_crank(lab: Opened) -> None:
    lab.page.locator('[data-grip=H]').focus()
    lab.page.keyboard.press('Shift+ArrowRight')
    assert lab.page.evaluate('lab.numbers[7]') != 0.43
    lab.page.locator('#alpha').focus()
    lab.page.keyboard.press('ArrowRight')
    assert lab.page.evaluate('lab.alpha') == pytest.approx(np.radians(60.25))
    assert lab.page.locator('#alpha').get_attribute('aria-valuetext') == '60.3°'


def test_it_turns_and_stops(lab: Opened) -> None:
    lab.page.locator('#play').click()
    lab.until('lab.alpha > 1.2')
    lab.page.locator('#play').click()
    at = lab.page.evaluate('lab.alpha')
    lab.page.wait_for_timeout(60)
    assert lab.page.evaluate('lab.alpha') == at


def test_the_lectures_twelve_numbers_are_in_the_table(lab: Opened) -> None:
    lab.page.evaluate("lab.choose('jansen')")
    lab.page.locator('#lecture').click()
    rows = lab.page.locator('#iterates tbody tr').all()
    cells = [[cell.text_content() for cell in row.locator('td').all()][:4] for row in rows]
    assert [' '.join(row) for row in cells[1:4]] == PRINTED
    assert (
        lab.text('#verdict')
        == 'Converged after 5 corrections, to the assembly [+ +], the one drawn.'
    )


def test_a_guess_may_lead_elsewhere_or_nowhere(lab: Opened) -> None:
    for box, value in zip(lab.page.locator('#guess input').all(), (60, 15, 45, 60), strict=True):
        box.fill(str(value))
    lab.page.locator('#iterate').select_option('2')
    assert lab.page.locator('.iterate-bars').get_attribute('d').startswith('M')
    lab.page.evaluate('lab.setNumber(1, 0.33); lab.turnTo(Math.PI * 11 / 12)')
    lab.until("document.getElementById('verdict').textContent.includes('no root')")


def test_why_it_jams_is_said_with_its_millimetres(lab: Opened) -> None:
    lab.page.locator('#number-1').fill('330')
    lab.page.locator('#alpha').fill('165')
    assert lab.text('#state') == 'At 165.0° it jams.'
    geometry = KlannGeometry.sem104().varied(l_bc=0.33)
    with pytest.raises(UnreachableError) as info:
        KlannLeg(geometry).closed_form(np.radians(165.0))
    short = 1000.0 * info.value.shortfall
    assert lab.text('#why-text') == (
        f'Dyad 1 does not close: B and D are {short:.1f} mm further apart than BC + DC.'
    )
    lab.until("document.getElementById('turn-text').textContent.includes('194.5° to 136.6°')")
    assert lab.page.locator('.reach').get_attribute('d').count('Z') == 2


def test_another_assembly_is_taken_by_a_button(lab: Opened) -> None:
    lab.page.locator('#assemblies button', has_text='[+ \N{MINUS SIGN}]').click()
    assert lab.page.evaluate('lab.linkage.signs') == [1, -1]
    pressed = "document.querySelector('#assemblies [aria-pressed=true]').textContent"
    lab.until(f"{pressed}.startsWith('[+ \N{MINUS SIGN}]')")


def test_a_refused_number_is_said_and_changes_nothing(lab: Opened) -> None:
    for value in ('0', '-5', '1e300'):
        lab.page.locator('#number-0').fill(value)
        assert lab.text('#refusal').startswith('Refused: A-B')
        assert lab.page.evaluate('lab.numbers[0]') == 0.12
    lab.page.locator('#number-0').fill('121')
    assert not lab.page.locator('#refusal').is_visible()


def test_the_second_transmission_angle_is_the_courses(lab: Opened) -> None:
    lab.until('Boolean(lab.turn)')
    assert 'dyad 1 31.2° to 156.2°dyad 2 59.0° to 128.1°' in lab.text('#legend')


def test_in_portuguese_it_says_the_same(visit) -> None:
    opened = visit(locale='pt-BR')
    assert opened.page.locator('html').get_attribute('lang') == 'pt-BR'
    assert opened.text('h1') == 'Laboratório de mecanismos'
    assert '491,0 mm' in opened.text('#tiles')
    opened.page.locator('[data-language=en]').click()
    assert opened.text('h1') == 'Linkage lab'
    assert '491.0 mm' in opened.text('#tiles')
    both = opened.page.evaluate(
        '[Object.keys(TEXTS.en), Object.keys(TEXTS.pt), Object.keys(TITLES)]'
    )
    assert both[0] == both[1]
    assert both[2] == shipped_linkages()
    assert opened.complaints == []


def saved_by(lab: Opened, button: str, folder: Path) -> str:
    with lab.page.expect_download() as download:
        lab.page.locator(button).click()
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path.read_text(encoding='utf-8')


def test_what_is_saved_is_loaded_by_solver_node_and_by_the_page(
    lab: Opened, tmp_path: Path
) -> None:
    lab.drag('C', 25, -30)
    numbers = lab.page.evaluate('[...lab.numbers]')
    lab.page.locator('#name').fill('My leg: "1"')
    text = saved_by(lab, '#save-linkage', tmp_path)
    linkage = linkage_from_text(text, 'file')
    assert linkage.numbers == pytest.approx(numbers, rel=1e-15, abs=1e-18)
    assert linkage.name == 'My leg: "1"'
    (values,) = parse(saved_by(lab, '#save-parameters', tmp_path)).values()
    geometry = KlannGeometry(**values['ros__parameters'])
    assert geometry.l_bc == pytest.approx(numbers[1], rel=1e-14)
    assert {path.name for path in tmp_path.iterdir()} == {
        'my_leg_1.yaml',
        'my_leg_1_parameters.yaml',
    }
    lab.page.evaluate("lab.choose('jansen')")
    lab.page.locator('#file').set_input_files(tmp_path / 'my_leg_1.yaml')
    lab.until('lab.name === \'My leg: "1"\'')
    assert lab.page.evaluate('[...lab.numbers]') == pytest.approx(numbers, rel=1e-15, abs=1e-18)
    assert lab.page.locator('#linkage').input_value() == ''


def test_names_from_a_file_are_texts(lab: Opened) -> None:
    text = (SHIPPED / 'klann.yaml').read_text(encoding='utf-8')
    lab.load(text.replace('name: Klann leg', f"name: '{HOSTILE}'"))
    assert lab.page.locator('#name').input_value() == HOSTILE
    lab.load(text.replace('crank: alpha', f"crank: '{HOSTILE}'"))
    assert 'is no name' in lab.text('#refusal')
    assert lab.page.locator('img').count() == 0
    assert lab.complaints == []


@pytest.mark.parametrize(
    'content', [b'x' * 10_000_000, b'\xff\xfe', b'[' * 500_000, b'a: &b [*b]']
)
def test_bombs_are_refused_in_a_line(lab: Opened, tmp_path: Path, content: bytes) -> None:
    path = tmp_path / 'bomb.yaml'
    path.write_bytes(content)
    lab.page.locator('#file').set_input_files(path)
    lab.until("!document.getElementById('refusal').hidden")
    assert len(lab.text('#refusal')) < 300
    assert lab.page.evaluate('lab.name') == 'Klann leg'


@pytest.mark.parametrize('locale', ['en-US', 'pt-BR'])
def test_it_fits_a_telephone_and_is_dragged_by_touch(visit, locale: str) -> None:
    size = {'width': 390, 'height': 844}
    opened = visit(locale=locale, viewport=size, has_touch=True, is_mobile=True)
    opened.page.evaluate("document.querySelector('details').open = true; lab.choose('trotbot')")
    assert opened.page.evaluate('document.documentElement.scrollWidth') == 390
    opened.page.evaluate("lab.choose('klann')")
    grip = opened.page.locator('[data-grip=H]')
    grip.scroll_into_view_if_needed()
    box = grip.bounding_box()
    assert box['width'] >= 24
    x, y = box['x'] + box['width'] / 2, box['y'] + box['height'] / 2
    finger = opened.page.context.new_cdp_session(opened.page)
    for kind, points in (
        ('touchStart', [{'x': x, 'y': y}]),
        ('touchMove', [{'x': x + 5, 'y': y - 20}]),
        ('touchMove', [{'x': x + 10, 'y': y - 40}]),
        ('touchEnd', []),
    ):
        finger.send('Input.dispatchTouchEvent', {'type': kind, 'touchPoints': points})
    opened.until('Math.abs(lab.numbers[7] - 0.43) > 0.02')


def test_axe_finds_no_barrier(visit) -> None:
    axe = pytest.importorskip('axe_playwright_python.sync_playwright')
    opened = visit(color_scheme='light')
    opened.page.evaluate("document.querySelector('details').open = true")
    opened.page.evaluate('lab.setNumber(1, 0.33); lab.turnTo(Math.PI * 11 / 12)')
    opened.page.locator('#number-0').fill('-1')
    # In the dark nothing but colours is other than in the light.
    for scheme, options in (('light', None), ('dark', {'runOnly': ['color-contrast']})):
        opened.page.emulate_media(color_scheme=scheme)
        opened.page.wait_for_timeout(150)
        found = axe.Axe().run(opened.page, options=options).response
        assert found['passes']
        told = [
            (one['id'], [node['html'][:120] for node in one['nodes']][:3])
            for one in found['violations']
        ]
        assert told == [], scheme
