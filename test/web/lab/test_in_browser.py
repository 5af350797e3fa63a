"""The lab in a real browser: opened from its file, dragged, turned, read, saved and loaded."""

from collections.abc import Callable, Iterator
import json
from pathlib import Path
import re
from typing import Any, NamedTuple

from browser import find
from browser_page import OpenedPage
from change_point_linkages import change_point_file
from klann_equations import f, phi
from klann_ros.design import requirements_from_file
from klann_ros.kinematics import (
    KlannGeometry,
    KlannLeg,
    LinkageLeg,
    shipped_linkage,
    shipped_linkages,
    UnreachableError,
)
from klann_ros.kinematics.linkage.file import linkage_from_text, SHIPPED
from klann_ros.robot import robot_from_text, robot_of
from klann_ros.sanitize.yaml_text import parse
from klann_ros.web.lab.build import LAB_FILE
import numpy as np
import pytest
from yaml_tables import read_table

pytest.importorskip('playwright')
if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)

FILES = read_table(Path(__file__).with_name('files.yaml'))
TEXT = (SHIPPED / 'klann.yaml').read_text(encoding='utf-8')
HOSTILE = '</script><img src=http://a.test/ onerror=bad()>&amp;'
# As SEM 104 prints them [deg].
PRINTED = ['10.5138 67.0074 36.7323 45.7048', '10.6570 67.3283 34.4691 45.7564']
PRINTED += ['10.6570 67.3283 34.4634 45.7220'] * 3
# The four-bar course: estimates [deg] and corrections [rad, deg] of each step, as it prints them
# but for its slips: it has 72.1377 in row 4, and so other last digits from there on.
FOUR_BAR_ESTIMATES = ['15.000 80.000', '21.812 71.864', '21.560 72.139', '21.5577 72.1376']
FOUR_BAR_DEGREES = ['6.812° -8.136°', '-0.252° 0.275°', '-0.00235° -0.00138°']
FOUR_BAR_STEPS = read_table(
    Path(__file__).parents[2] / 'kinematics' / 'four_bar' / 'iterations.yaml'
)
FOUR_BAR_ROOT = 21.557634918, 72.137650451
# Without their files' word they would be legs.
COUPLER_POINTS = {
    'chebyshev',
    'chebyshev_lambda',
    'hoecken',
    'peaucellier',
    'roberts',
    'stephenson',
}
METRES_A_PIXEL = '1 / (pixelsPerUnit(scene.svg, scene.drawing) * scene.drawing.plane.scale)'
# What each joint is at, in metres of the leg's plane.
PLACES = """() => Object.fromEntries(scene.leg.joints.map((node, i) => [
    node.dataset.point, scene.drawing.metresAt(scene.drawing.at(lab.pose.points[i]))]))"""
# What is shown of a linkage: places, fields, and what is read in each language.
SHOWN = """() => ({
    alpha: lab.alpha,
    places: Object.fromEntries(scene.leg.joints.map((node, i) => [
        node.dataset.point, scene.drawing.metresAt(scene.drawing.at(lab.pose.points[i]))])),
    fields: numbers.rows.map(({ label, field, scale }) => [
        label.textContent, field.input.value, scale === 1000 ? 'mm' : 'deg']),
    spoken: Object.fromEntries(['en', 'pt'].map((language) => {
        speak(language);
        const named = [...document.querySelectorAll('[aria-label]')];
        return [language, document.body.innerText + named.map((node) => node.ariaLabel)];
    })),
})"""
IS_LEG = """(text) => {
    const { linkage, content } = readFile(text, lab.shipped.klann);
    return isLeg(linkage.structure, content);
}"""
LEG_WORDS = {'en': r'\b(foot|stride|lift)\b', 'pt': r'\b(p\u00e9|passada|eleva\w+)\b'}
# The timers by which panels are drawn soon after an edit; that of the link changes no panel.
SOON = """
const { setTimeout: start, clearTimeout: cancel } = window;
window.pending = new Set();
window.setTimeout = (call, delay) => {
    const id = start(() => { pending.delete(id); call(); }, delay);
    if (delay < 300) pending.add(id);
    return id;
};
window.clearTimeout = (id) => { pending.delete(id); cancel(id); };
"""


class Opened(OpenedPage):
    """The lab in the browser, with everything that it asked for and complained about."""

    def __init__(self, page: Any, fragment: str = '') -> None:
        page.add_init_script(SOON)
        super().__init__(page, LAB_FILE.as_uri() + fragment)
        self.until('Boolean(lab.turn)')

    def await_panels(self) -> None:
        """Wait until panels drawn later neither move nor replace what the pointer is to meet."""
        self.until('!pending.size')

    def text(self, selector: str) -> str:
        text: str = self.page.locator(selector).text_content()
        return text

    def load(self, text: str) -> None:
        """Load a text as somebody does who has pasted it."""
        self.page.locator('#text').fill(text)
        self.page.locator('#load-text').click()

    def drag(self, name: str, x: float, y: float) -> None:
        """Drag a point by so many pixels."""
        grip = self.page.locator(f'[data-grip={name}]')
        # A page that has just been scrolled may still take the pointer for elsewhere.
        for _ in range(200):
            box = grip.bounding_box()
            grip_x = box['x'] + box['width'] / 2
            grip_y = box['y'] + box['height'] / 2
            self.page.mouse.move(grip_x, grip_y)
            if grip.evaluate("(node) => node.matches(':hover')"):
                break
            self.page.wait_for_timeout(10)
        self.page.mouse.down()
        self.page.mouse.move(grip_x + x / 2, grip_y + y / 2)
        self.page.mouse.move(grip_x + x, grip_y + y)
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
    shared.page.evaluate('lab.clearHistory(); pathPanel.take([]); scrollTo(0, 0)')
    shared.await_panels()
    return shared


@pytest.fixture
def visit(new_page: Callable[..., Any]) -> Callable[..., Opened]:
    return lambda *, fragment='', **options: Opened(new_page(**options), fragment)


class Tour(NamedTuple):
    """What the page shows of all shipped linkages, each chosen once."""

    linkages: dict[str, dict[str, Any]]
    requests: list[str]
    complaints: list[str]


@pytest.fixture(scope='module')
def tour(browser: Any) -> Iterator[Tour]:
    context = browser.new_context(locale='en-US')
    opened = Opened(context.new_page())
    opened.page.locator('#others').click()
    linkages = {}
    for name in shipped_linkages():
        # What is drawn of the last one must not be left over.
        opened.page.evaluate('newton.draw(1)')
        opened.page.locator('#linkage').select_option(name)
        opened.until('lab.turn && lab.turn.linkage === lab.linkage')
        linkages[name] = opened.page.evaluate(SHOWN)
        opened.page.evaluate("speak('en')")
    yield Tour(linkages, opened.requests, opened.complaints)
    context.close()


@pytest.mark.slow
def test_every_shipped_linkage_is_drawn_without_a_request_or_an_error(tour: Tour) -> None:
    for name, shown in tour.linkages.items():
        linkage = shipped_linkage(name)
        pose = LinkageLeg(linkage).solve(shown['alpha'])
        for point, place in zip(linkage.structure.points, pose.points, strict=True):
            assert np.abs(np.array(shown['places'][point]) - place).max() < 1e-9, (name, point)
    assert tour.requests == [LAB_FILE.as_uri()]
    assert tour.complaints == []


def test_the_policy_lets_no_other_script_run(visit) -> None:
    opened = visit()
    opened.page.evaluate(
        "document.body.append(Object.assign(document.createElement('script'), {text: 'ran = 1'}))"
    )
    assert opened.page.evaluate('typeof ran') == 'undefined'
    assert 'Content Security Policy' in opened.complaints[0]


def test_a_dragged_joint_changes_the_lengths_that_meet_there(lab: Opened) -> None:
    names = np.array(lab.page.evaluate('lab.linkage.structure.dimensions.map(({ name }) => name)'))
    first_numbers = np.array(lab.page.evaluate('[...lab.numbers]'))
    lab.drag('C', 30, -40)
    numbers = np.array(lab.page.evaluate('[...lab.numbers]'))
    changed = names[abs(numbers - first_numbers) > 1e-9]
    assert {*changed.tolist()} == {'B-C', 'C-G', 'bend of C-G', 'D-C'}
    # Everything else stayed where it was, but for the rounding.
    places = lab.page.evaluate(PLACES)
    expected = KlannLeg().solve(np.pi / 3).points
    pixel = lab.page.evaluate(METRES_A_PIXEL)
    assert np.abs(np.array(places['G']) - expected[6]).max() < 2.0 * pixel
    assert np.abs(np.array(places['C']) - expected[2]).max() > 0.01
    assert lab.page.locator('#number-1').input_value() == f'{1000 * numbers[1]:.8g}'
    # A pivot keeps all lengths.
    lab.drag('E', 12, 9)
    last_numbers = np.array(lab.page.evaluate('[...lab.numbers]'))
    assert names[last_numbers != numbers].tolist() == ['E.x', 'E.y']


@pytest.mark.slow
def test_a_drag_gives_numbers_as_coarse_as_a_pixel(lab: Opened) -> None:
    pixel = 1000 * lab.page.evaluate(METRES_A_PIXEL)
    step = lab.page.evaluate(f'roundStep({pixel})')
    assert pixel / 2.5 <= step <= pixel
    lab.drag('E', 12.3, 9.7)
    lab.drag('C', 30.1, -40.2)
    lab.drag('B', 7.3, 5.9)
    for name in ('A-B', 'B-C', 'C-G', 'D-C', 'E.x', 'E.y'):
        index = f"lab.linkage.structure.dimensions.findIndex(({{ name }}) => name === '{name}')"
        steps = 1000 * lab.page.evaluate(f'lab.numbers[{index}]') / step
        assert steps == pytest.approx(round(steps), abs=1e-9), name
    assert len(f'{lab.page.evaluate("lab.alpha * 360 / TAU"):.10g}') <= 5
    assert lab.page.evaluate('!lab.pose.error')
    lab.page.locator('#numbers input[type=range]').first.fill('123.456789')
    assert len(lab.page.locator('#number-0').input_value()) <= 5


STATE = (
    '[lab.numbers, lab.linkage.signs, lab.guess, lab.name, lab.source, lab.pose.points ?? null]'
)


def test_every_edit_is_undone_and_redone(lab: Opened) -> None:
    page = lab.page
    edits = (
        lambda: lab.drag('C', 30, -40),
        lambda: page.locator('#number-0').fill('101.5'),
        lambda: page.locator('#assemblies button', has_text='[+ \N{MINUS SIGN}]').click(),
        lambda: page.locator('#guess input').first.fill('33'),
        lambda: page.locator('#name').fill('Mine'),
        lambda: page.locator('#random').click(),
        lambda: page.locator('#reset').click(),
        lambda: page.locator('#linkage').select_option('jansen'),
        lambda: page.locator('#four-bar-lecture').click(),
        lambda: lab.load(TEXT.replace('length: 120', 'length: 130')),
    )
    states = [page.evaluate(STATE)]
    for edit in edits:
        page.evaluate(f'window.stateBefore = JSON.stringify({STATE})')
        edit()
        page.evaluate('document.activeElement.blur()')
        lab.until(f'JSON.stringify({STATE}) !== stateBefore')
        lab.await_panels()
        states.append(page.evaluate(STATE))
    assert page.evaluate('lab.past.length') == len(edits)
    for state in states[-2::-1]:
        page.keyboard.press('Control+z')
        assert page.evaluate(STATE) == state
    assert page.locator('#undo').is_disabled()
    for keys, state in zip(['Control+Shift+Z', 'Control+y'] * 5, states[1:], strict=True):
        page.keyboard.press(keys)
        assert page.evaluate(STATE) == state
    assert page.locator('#redo').is_disabled()
    page.locator('#undo').click()
    assert page.evaluate(STATE) == states[-2]
    page.locator('#redo').click()
    assert page.evaluate(STATE) == states[-1]


@pytest.mark.slow
def test_a_number_is_undone_while_it_is_edited_and_the_crank_stays(lab: Opened) -> None:
    field = lab.page.locator('#number-1')
    field.fill('33')
    field.fill('330')
    lab.page.evaluate('lab.turnTo(2)')
    lab.page.keyboard.press('Control+z')
    assert field.input_value() == '350'
    assert lab.page.evaluate('lab.numbers[1]') == pytest.approx(0.35)
    assert lab.page.evaluate('lab.alpha') == 2
    # A refused number is no edit.
    field.fill('0')
    assert lab.page.evaluate('lab.past.length') == 0
    field.press('ArrowUp')
    assert field.input_value() == '351'


@pytest.mark.slow
def test_an_entry_holds_as_long_as_it_is_legal(lab: Opened) -> None:
    page = lab.page
    first = page.evaluate(STATE)
    link = page.evaluate('linkOf(lab)')
    field = page.locator('#number-0')
    typed = (
        ('10 cm', 100), ('0.11 m', 110), ('4 in', 101.6), ('4.25 inches', 107.95), ('1.15e2', 115),
        ('1.1e1cm', 110), ('0.000012 km', 12),
    )  # fmt: skip
    for text, millimetres in typed:
        field.fill(text[:-1])
        # A unit may be half written.
        assert not page.locator('#refusal').is_visible(), text
        page.keyboard.type(text[-1])
        page.keyboard.press('Tab')
        assert page.evaluate('1000 * lab.numbers[0]') == pytest.approx(millimetres, rel=1e-15)
        assert field.input_value() == f'{millimetres:g}'
        page.keyboard.press('Control+z')
        assert page.evaluate(STATE) == first
    bend = page.locator('#number-3')
    bend.fill('0.1 rad')
    assert page.evaluate('lab.numbers[3]') == pytest.approx(0.1, rel=1e-15)
    page.evaluate('lab.undo()')
    # Every beginning of these is legal, and the entry is not.
    past = page.evaluate('lab.past.length')
    for text in (
        '10 kg',
        '10 c',
        '12 degrees',
        '1 000',
        '100,5',
        '10 cm cm',
        '1e',
        '\N{MINUS SIGN}',
        '40 x',
    ):
        field.fill(text[:-1])
        page.keyboard.type(text[-1])
        page.keyboard.press('Tab')
        assert page.evaluate(STATE) == first, text
        assert page.evaluate('lab.past.length') == past, text
        assert page.evaluate('linkOf(lab)') == link, text
        assert field.input_value() == '120', text
        reason = page.locator('#numbers .reason:visible').all_text_contents()
        assert [f'Refused: {line}' for line in reason] == [lab.text('#refusal')], text
        assert field.get_attribute('aria-invalid') == 'true'
    field.fill('121')
    assert page.locator('.reason:visible').count() == 0
    assert not page.locator('#refusal').is_visible()
    # The crank's angle is no edit.
    crank_field = page.locator('#alpha-number')
    for text, degrees in (('90', 90), ('1.2 rad', 68.7549354), ('-10', 350), ('70 kg', 350)):
        crank_field.fill(text)
        page.keyboard.press('Enter')
        assert float(crank_field.input_value()) == pytest.approx(degrees, rel=1e-7), text
        alpha = page.evaluate('lab.alpha % TAU')
        assert alpha == pytest.approx(np.radians(degrees - 360 * (degrees > 180)), rel=1e-7)
    assert page.locator('.reason:visible').count() == 1
    page.locator('#alpha').fill('45')
    assert crank_field.input_value() == '45'
    assert page.locator('.reason:visible').count() == 0
    # The guess is in degrees.
    page.locator('#guess input').first.fill('0.5 rad')
    assert page.evaluate('lab.guess[0]') == pytest.approx(0.5, rel=1e-15)
    page.locator('#path-points').fill('0 0\n5cm 0\n5cm 1in')
    assert page.evaluate('pathPanel.points') == [[0, 0], [0.05, 0], [0.05, 0.0254]]


@pytest.mark.slow
def test_the_fields_have_the_numbers_of_describe(tour: Tour) -> None:
    for name, shown in tour.linkages.items():
        (leg,) = robot_of(name).legs
        rows = zip(shown['fields'], leg.linkage.dimensions.items(), strict=True)
        for row, (dimension, value) in rows:
            label, text, unit = row
            sign = -1.0 if label.startswith('\N{MINUS SIGN}') else 1.0
            label = re.sub(r' \(.*\)$', '', label.lstrip('\N{MINUS SIGN}'))
            assert label == re.sub('^(bend|direction) of', r'\1', dimension)
            factor = sign * (1000.0 if unit == 'mm' else 180.0 / np.pi)
            assert float(text) == pytest.approx(factor * value, rel=1e-7, abs=1e-9), row


def test_parameters_have_the_signs_and_numbers_of_sem104(lab: Opened) -> None:
    def parameters() -> dict[str, float]:
        fields = 'numbers.rows.map(({ label, field }) => [label.textContent, field.input.value])'
        named = {}
        for label, text in lab.page.evaluate(fields):
            if match := re.search(r'\((\w+)(?: = (.*) mm)?\)$', label):
                named[match[1]] = float(match[2] or text)
        return named

    (leg,) = robot_of('sem104').legs
    expected = {}
    for name, value in leg.linkage.dimensions.items():
        expected[name] = np.degrees(value) if name.startswith('angle') else 1000.0 * value
    assert parameters() == pytest.approx(expected)
    assert parameters()['angle_fgh'] == 40.0
    # Of a leg elsewhere they are not the pivots' places.
    lab.page.locator('#number-9').fill('10')
    lab.page.locator('#number-12').fill('-20')
    assert parameters() == pytest.approx(
        expected | {'x_d': 340, 'x_e': 280, 'y_a': 110, 'y_e': 250}
    )
    lab.page.locator('#number-8').fill('35')
    assert parameters()['angle_fgh'] == 35.0
    (node,) = parse(lab.page.evaluate('textToSave(true)')).values()
    saved = node['ros__parameters']
    assert saved['angle_fgh'] == pytest.approx(np.radians(35.0))
    assert saved['x_d'] == pytest.approx(0.34)


@pytest.mark.parametrize(
    'name',
    [
        'klann',
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ('walker_six_bar', 'stephenson', 'quick_return')
        ),
    ],
)
def test_a_link_opens_the_same_state(lab: Opened, visit, name: str) -> None:
    page = lab.page
    page.locator('#linkage').select_option(name)
    page.evaluate('lab.setNumber(0, 1.0123456789 * lab.numbers[0]); newton.guessAtRandom()')
    page.evaluate("lab.setName('A & b = 1 % # + \u00e9'); lab.turnTo(lab.alpha + 0.01)")
    if name == 'klann':
        page.locator('#assemblies button', has_text='[+ \N{MINUS SIGN}]').click()
    if name == 'quick_return':
        lab.load(page.evaluate('textToSave(false)'))
    lab.until('location.hash === linkOf(lab)')
    fragment, state, alpha = page.evaluate(f'[location.hash, {STATE}, lab.alpha]')
    if name == 'klann':
        linked = visit(locale='en-US', fragment=fragment)
    else:
        page.evaluate("lab.choose('four_bar'); location.hash = ''")
        page.evaluate('(fragment) => { location.hash = fragment; }', fragment)
        lab.until("lab.source !== 'four_bar'")
        linked = lab
    assert not linked.page.locator('#refusal').is_visible()
    linked_state, linked_alpha = linked.page.evaluate(f'[{STATE}, lab.alpha]')
    assert linked_alpha == alpha
    assert linked_state[0] == pytest.approx(state[0], rel=1e-15)
    assert linked_state[1] == state[1]
    assert linked_state[2] == pytest.approx(state[2], rel=1e-12)
    assert linked_state[3:5] == state[3:5]
    assert np.abs(np.array(linked_state[5]) - np.array(state[5])).max() < 1e-12
    assert linked.complaints == []


def test_a_hostile_link_is_refused_in_a_line_and_changes_nothing(lab: Opened) -> None:
    lab.drag('C', 30, -40)
    first_state = lab.page.evaluate(STATE)
    open_links = f"""(links) => links.map((link) => {{
        lab.refusal = null;
        lab.attempt(() => openLink(lab, link));
        return [document.getElementById('refusal').textContent, JSON.stringify({STATE})];
    }})"""
    links = [*FILES['links'], 'file=' + '[' * 10_000, 'x' * 1_000_000]
    for link, (line, state) in zip(links, lab.page.evaluate(open_links, links), strict=True):
        assert 10 < len(line) < 300, link[:60]
        assert json.loads(state) == first_state, link[:60]
    lab.page.evaluate("lab.refusal = null; lab.tell('pose'); location.hash = 'linkage=nothing'")
    lab.until("document.getElementById('refusal').textContent.includes('nothing')")
    assert lab.page.locator('img').count() == 0
    assert lab.complaints == []
    assert lab.page.evaluate('lab.past.length') == 1


def test_keys_move_a_point_and_turn_the_crank(lab: Opened) -> None:
    lab.page.locator('[data-grip=H]').focus()
    lab.page.keyboard.press('Shift+ArrowRight')
    assert lab.page.evaluate('lab.numbers[7]') != 0.43
    lab.page.locator('#alpha').focus()
    lab.page.keyboard.press('ArrowRight')
    assert lab.page.evaluate('lab.alpha') == pytest.approx(np.radians(60.25))
    assert lab.page.locator('#alpha').get_attribute('aria-valuetext') == '60.3°'


@pytest.mark.slow
def test_it_turns_and_stops(lab: Opened) -> None:
    lab.page.locator('#play').click()
    lab.until('lab.alpha > 1.2')
    lab.page.locator('#play').click()
    alpha = lab.page.evaluate('lab.alpha')
    lab.page.wait_for_timeout(60)
    assert lab.page.evaluate('lab.alpha') == alpha


@pytest.mark.slow
def test_all_numbers_of_the_lecture_are_in_the_table(lab: Opened) -> None:
    lab.page.evaluate("lab.choose('jansen')")
    lab.page.locator('#lecture').click()
    iterates = lab.page.locator('#iterates tbody tr').all()
    for iterate, printed in zip(iterates[1:], PRINTED, strict=True):
        assert iterate.locator('td').all_text_contents()[:4] == printed.split()
    verdict = 'Converged after 5 corrections, to the assembly [+ +], the one drawn.'
    assert lab.text('#verdict') == verdict


def matrices(lab: Opened) -> list[list[str]]:
    """Return the cells of f, Phi and the correction of the step that is shown."""
    cells = []
    for table in lab.page.locator('#step table').all():
        texts = table.locator('td').all_text_contents()
        cells.append([text.replace('\N{MINUS SIGN}', '-') for text in texts])
    return cells


@pytest.mark.slow
def test_the_four_bar_course_rounds_its_corrections(lab: Opened) -> None:
    lab.page.locator('#four-bar-lecture').click()
    rows = lab.page.locator('#iterates tbody tr').all()
    estimates = [' '.join(row.locator('td').all_text_contents()[:2]) for row in rows]
    assert estimates[:4] == FOUR_BAR_ESTIMATES
    assert len(estimates) == 5
    # Beyond the slip of the fourth row only Phi is printed.
    for row, step in enumerate(FOUR_BAR_STEPS):
        lab.page.locator('#iterate').select_option(str(row + 1))
        f_cells, phi_cells, correction_cells = matrices(lab)
        assert [*map(float, phi_cells)] == step['phi']
        if row < 3:
            assert [*map(float, f_cells)] == step['f']
            radians = [float(cell.removesuffix(' rad')) for cell in correction_cells[::2]]
            assert radians == step['correction']
            assert ' '.join(correction_cells[1::2]) == FOUR_BAR_DEGREES[row]
    assert lab.page.locator('#slips').is_visible()
    # With its slip the course goes on to its printed result, but for the second slip.
    lab.page.evaluate('lab.setGuess([21.5577, 72.1377].map((angle) => (angle * TAU) / 360))')
    assert not lab.page.locator('#slips').is_visible()
    lab.page.locator('#iterate').select_option('1')
    assert matrices(lab)[0] == ['-0.000040', '-0.000171']
    lab.page.locator('#rounded').click()
    result = [f'{angle:.6f}' for angle in FOUR_BAR_ROOT]
    assert lab.text('#iterates tbody tr:last-child')[1:].startswith(''.join(result))
    lab.page.locator('#rounded').click()
    # No lecture is vouched for where none has the linkage.
    for name, is_offered in (('jansen', False), ('klann', True), ('slider_crank', False)):
        lab.page.locator('#linkage').select_option(name)
        assert lab.page.locator('#rounded').is_visible() == is_offered
    text = (SHIPPED / 'slider_crank.yaml').read_text(encoding='utf-8')
    for name, letter in (('crank', 'theta2'), ('rod', 'theta3'), ('piston', 'theta4')):
        text = re.sub(rf'\b{name}:(?! crank)', f'{letter}:', text)
    lab.load(
        text.replace('crank: crank', 'crank: theta2').replace('theta2: crank', 'crank: theta2')
    )
    assert lab.page.evaluate('lab.linkage.structure.angles') == ['theta2', 'theta3', 'theta4']
    assert not lab.page.locator('#rounded').is_visible()


@pytest.mark.slow
def test_feet_strides_and_lifts_are_of_legs(lab: Opened, tour: Tour) -> None:
    for name, shown in tour.linkages.items():
        text = (SHIPPED / f'{name}.yaml').read_text(encoding='utf-8')
        is_leg = 'leg: false' not in text
        for language, words in LEG_WORDS.items():
            spoken = shown['spoken'][language]
            assert bool(re.search(words, spoken, re.IGNORECASE)) == is_leg, (name, language)
        # Of a user's file that does not say so it is decided by what the point belongs to.
        unsaid = text.replace('leg: false\n', '')
        decided = lab.page.evaluate(IS_LEG, unsaid)
        assert decided == (is_leg or name in COUPLER_POINTS), name
        # `describe` decides alike, with the file's word and without it.
        assert robot_of(name).legs[0].has_foot == is_leg, name
        assert robot_from_text(unsaid, name).legs[0].has_foot == decided, name
    for language, words in LEG_WORDS.items():
        lab.page.evaluate(f"speak('{language}')")
        lab.load(TEXT.replace('foot: H', 'foot: H\nleg: false'))
        lab.until('lab.turn && lab.turn.linkage === lab.linkage')
        assert 'leg: false' in lab.page.evaluate('textToSave(false)')
        assert not re.search(words, lab.text('#tiles'), re.IGNORECASE)


@pytest.mark.slow
def test_a_guess_may_lead_elsewhere_or_nowhere(lab: Opened) -> None:
    for box, angle in zip(lab.page.locator('#guess input').all(), (60, 15, 45, 60), strict=True):
        box.fill(str(angle))
    lab.page.locator('#iterate').select_option('2')
    assert lab.page.locator('.iterate-bars').get_attribute('d').startswith('M')
    lab.page.evaluate('lab.setNumber(1, 0.33); lab.turnTo(Math.PI * 11 / 12)')
    lab.until("document.getElementById('verdict').textContent.includes('no root')")


def test_a_jam_is_explained_with_its_gap(lab: Opened) -> None:
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


def test_the_circles_of_a_jam_are_around_the_ends_of_the_dyad(lab: Opened) -> None:
    # Its loop passes this dyad from F to P and Q, not from P to Q.
    lab.page.evaluate("lab.choose('walker_six_bar')")
    ends = lab.page.evaluate("""() => {
      const { points } = lab.linkage.structure;
      return ['P', 'Q'].map((name) => lab.pose.points[points.indexOf(name)]);
    }""")
    lab.page.evaluate('lab.setNumber(7, 0.02)')
    centres = lab.page.evaluate('scene.jamCircles().map(([centre]) => centre)')
    np.testing.assert_allclose(centres, ends, rtol=0.0, atol=1e-12)


def test_another_assembly_is_taken_by_a_button(lab: Opened) -> None:
    lab.page.locator('#assemblies button', has_text='[+ \N{MINUS SIGN}]').click()
    assert lab.page.evaluate('lab.linkage.signs') == [1, -1]
    pressed = "document.querySelector('#assemblies [aria-pressed=true]').textContent"
    lab.until(f"{pressed}.startsWith('[+ \N{MINUS SIGN}]')")


def test_a_refused_number_is_explained_and_changes_nothing(lab: Opened) -> None:
    def refusal(n: int, text: str) -> str:
        lab.page.locator(f'#number-{n}').fill(text)
        assert lab.page.evaluate('[lab.numbers[0], lab.numbers[3]]') == [0.12, np.pi / 18.0]
        return lab.text('#refusal')

    assert refusal(0, '0') == 'Refused: A-B = 0 mm: a length must be > 0'
    assert refusal(0, '-5') == 'Refused: A-B = -5 mm: a length must be > 0'
    assert refusal(0, '1e300').startswith('Refused: A-B = 1e+300 mm: it must be within')
    # The field cuts a longer text off; a program may set one.
    read = '(text) => { try { return decimalOf(text); } catch (refusal) { return `${refusal}`; } }'
    for text in ('9' * 5000, f'120.{"0" * 5000}', '1e999'):
        assert 'is not a number' in str(lab.page.evaluate(read, text))
    assert refusal(0, '1,5') == ('Refused: 1,5 is not a number: write a decimal point, as in 12.5')
    unit = 'x is no unit here: write a number alone, or with mm, cm, m, in'
    lab.page.locator('#number-0').fill('1x')
    lab.page.keyboard.press('Enter')
    assert lab.text('#refusal') == f'Refused: {unit}'
    assert refusal(0, 'x') == 'Refused: x is not a number'
    assert refusal(3, '400') == (
        'Refused: bend of C-G = 400°: an angle between bars must be within ±360°'
    )
    lab.page.locator('#number-0').fill('121')
    assert not lab.page.locator('#refusal').is_visible()


def test_the_second_transmission_angle_is_the_courses(lab: Opened) -> None:
    lab.until('Boolean(lab.turn)')
    assert 'dyad 1 31.2° to 156.2°dyad 2 59.0° to 128.1°' in lab.text('#legend')
    # The worst is the furthest from 90 deg, and can be found in the chart.
    worst = 'Worst transmission angle23.8°180° \N{MINUS SIGN} 156.2°, dyad 1, at 165.6°'
    assert worst in lab.text('#tiles')


@pytest.mark.slow
def test_fit_shows_why_it_jams(lab: Opened) -> None:
    lab.page.locator('#number-1').fill('900')
    jammed = lab.page.evaluate('linkOf(lab)')
    lab.page.locator('#fit').click()
    inside = """() => {
        const frame = scene.svg.getBoundingClientRect();
        return [scene.reach, scene.gaps].every((node) => {
            const box = node.getBoundingClientRect();
            return box.left >= frame.left && box.right <= frame.right
                && box.top >= frame.top && box.bottom <= frame.bottom;
        });
    }"""
    assert lab.page.evaluate(inside)
    lab.page.evaluate("lab.choose('klann')")
    lab.page.evaluate('(link) => readLink(link)', jammed)
    assert lab.page.evaluate('Boolean(lab.pose.error)')
    assert lab.page.evaluate(inside)
    # What is closed again is as large as before.
    lab.page.locator('#reset').click()
    assert lab.page.evaluate('scene.drawing.plane.scale') == pytest.approx(
        lab.page.evaluate("lab.choose('klann'); scene.drawing.plane.scale"), rel=0.05
    )


@pytest.mark.slow
def test_f_and_phi_of_each_step_are_those_of_the_lectures(lab: Opened) -> None:
    lab.page.locator('#lecture').click()
    for row, degrees in enumerate([[15.0, 60.0, 45.0, 60.0], None]):
        alpha, *x = lab.page.evaluate(f'newton.found.x[{row}]')
        assert degrees is None or np.degrees(x) == pytest.approx(degrees)
        lab.page.locator('#iterate').select_option(str(row + 1))
        geometry = KlannGeometry.sem104()
        expected = f(geometry, alpha, x), phi(geometry, x)
        *terms, correction_cells = matrices(lab)
        for cells, matrix in zip(terms, expected, strict=True):
            assert [*map(float, cells)] == pytest.approx(1e3 * matrix.ravel(), abs=6e-4)
        correction = -np.linalg.solve(expected[1], expected[0])
        radians = [float(cell.removesuffix(' rad')) for cell in correction_cells[::2]]
        assert radians == pytest.approx(correction, abs=6e-7)
        angles = [float(cell.removesuffix('°')) for cell in correction_cells[1::2]]
        assert angles == pytest.approx(np.degrees(correction), abs=6e-5)
    lab.page.evaluate("document.querySelector('details:has(#equations)').open = true")
    equations = lab.page.locator('#equations li').all_text_contents()
    minus, a, b, g = '\u2212\u03b1\u03b2\u03b3'
    assert equations[0] == f'f₁ = L(AB) cos {a} + L(BC) cos {g} {minus} L(DC) cos {b} {minus} x(D)'
    assert f'{minus} L(CG) cos({g} {minus} 10°)' in equations[2]
    # As the four-bar lecture prints them.
    lab.page.locator('#linkage').select_option('four_bar')
    equations = lab.page.locator('#equations li').all_text_contents()
    loop = f'{minus} L(O2A) cos \u03b82 {minus} L(AB) cos \u03b83 + L(O4B) cos \u03b84 + x(O4)'
    assert equations[0] == f'f₁ = {loop}'
    printed = [['-27.138', '26.675'], ['51.764', '-147.721', '-193.185', '26.047']]
    assert matrices(lab)[:2] == printed


def test_the_portuguese_page_has_the_same_content(visit) -> None:
    opened = visit(locale='pt-BR')
    assert opened.page.locator('html').get_attribute('lang') == 'pt-BR'
    assert opened.text('h1') == 'Laboratório de mecanismos'
    assert '491,0 mm' in opened.text('#tiles')
    field = opened.page.locator('#number-0')
    field.fill('120,5')
    assert opened.page.evaluate('lab.numbers[0]') == 0.1205
    field.blur()
    field.fill('119.5')
    assert opened.text('#refusal') == (
        'Recusado: 119.5 não é um número: use a vírgula decimal, como em 12,5'
    )
    field.blur()
    assert field.input_value() == '120,5'
    opened.page.locator('#number-3').fill('400,5')
    assert opened.text('#refusal').startswith('Recusado: ângulo C-G = 400,5°: um ângulo')
    opened.page.locator('#number-0').fill('120')
    assert re.findall(r'\d\.\d', opened.page.evaluate('document.body.innerText')) == []
    opened.page.locator('[data-language=en]').click()
    assert opened.text('h1') == 'Linkage lab'
    assert '491.0 mm' in opened.text('#tiles')
    english, portuguese, titles = opened.page.evaluate(
        '[TEXTS.en, TEXTS.pt, TITLES].map(Object.keys)'
    )
    assert english == portuguese
    assert titles == shipped_linkages()
    assert opened.complaints == []


def saved_by(lab: Opened, button: str, folder: Path) -> str:
    with lab.page.expect_download() as download:
        lab.page.locator(button).click()
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path.read_text(encoding='utf-8')


def test_saved_files_are_loaded_by_node_and_page(lab: Opened, tmp_path: Path) -> None:
    lab.drag('C', 25, -30)
    numbers = lab.page.evaluate('[...lab.numbers]')
    lab.page.locator('#name').fill('My leg: "1"')
    text = saved_by(lab, '#save-linkage', tmp_path)
    linkage = linkage_from_text(text, 'file')
    assert linkage.numbers == pytest.approx(numbers, rel=1e-15, abs=1e-18)
    assert linkage.name == 'My leg: "1"'
    (node,) = parse(saved_by(lab, '#save-parameters', tmp_path)).values()
    geometry = KlannGeometry(**node['ros__parameters'])
    assert geometry.l_bc == pytest.approx(numbers[1], rel=1e-14)
    names = ['my_leg_1.yaml', 'my_leg_1_parameters.yaml']
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    lab.page.evaluate("lab.choose('jansen')")
    lab.page.locator('#file').set_input_files(tmp_path / 'my_leg_1.yaml')
    lab.until('lab.name === \'My leg: "1"\'')
    assert lab.page.evaluate('[...lab.numbers]') == pytest.approx(numbers, rel=1e-15, abs=1e-18)
    assert lab.page.locator('#linkage').input_value() == ''


def test_names_from_a_file_are_texts(lab: Opened) -> None:
    lab.load(TEXT.replace('name: Klann leg', f"name: '{HOSTILE}'"))
    assert lab.page.locator('#name').input_value() == HOSTILE
    lab.load(TEXT.replace('crank: alpha', f"crank: '{HOSTILE}'"))
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


@pytest.mark.parametrize('locale', [pytest.param('en-US', marks=pytest.mark.slow), 'pt-BR'])
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


@pytest.mark.slow
def test_axe_finds_no_barrier(visit) -> None:
    opened = visit(color_scheme='light')
    opened.page.evaluate("document.querySelector('details').open = true")
    opened.page.evaluate('lab.setNumber(1, 0.33); lab.turnTo(Math.PI * 11 / 12)')
    opened.page.locator('#number-0').fill('-1')
    # In the dark nothing but colours is other than in the light.
    for scheme, options in (('light', None), ('dark', {'runOnly': ['color-contrast']})):
        opened.page.emulate_media(color_scheme=scheme)
        opened.page.wait_for_timeout(150)
        assert opened.barriers(options) == [], scheme


def draw(lab: Opened, corners: list[tuple[float, float]]) -> None:
    """Draw a path with the pointer, by parts of the panel's width and height."""
    panel = lab.page.locator('#path')
    panel.scroll_into_view_if_needed()
    box = panel.bounding_box()
    places = [(box['x'] + u * box['width'], box['y'] + v * box['height']) for u, v in corners]
    lab.page.mouse.move(*places[0])
    lab.page.mouse.down()
    for place in places[1:]:
        lab.page.mouse.move(*place, steps=4)
    lab.page.mouse.up()


def test_a_drawn_path_is_saved_as_a_wish_that_design_takes(lab: Opened, tmp_path: Path) -> None:
    draw(lab, [(0.3, 0.6), (0.7, 0.6), (0.6, 0.4), (0.4, 0.4)])
    assert lab.page.locator('#path .recorded-path').get_attribute('d').count('L') == 47
    requirements = parse(saved_by(lab, '#save-requirements', tmp_path))
    assert requirements['linkage'] == 'klann'
    points = np.array(requirements['path']['points'])
    assert len(points) == 48
    # As wide as it was drawn, at even steps.
    scale = lab.page.evaluate('pathPanel.drawing.plane.width / pathPanel.drawing.plane.scale')
    assert np.ptp(points[:, 0]) == pytest.approx(0.4e3 * scale, rel=0.02)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.ptp(np.sort(steps)[6:]) < 0.2 * steps.mean()
    # Of a changed linkage it names the file that is saved.
    lab.page.evaluate('scrollTo(0, 0)')
    lab.drag('C', 12, -20)
    lab.page.locator('#name').fill('My leg')
    assert parse(saved_by(lab, '#save-requirements', tmp_path))['linkage'] == 'my_leg.yaml'
    saved_by(lab, '#save-linkage', tmp_path)
    (space,) = requirements_from_file(tmp_path / 'requirements.yaml').spaces
    assert space.linkage.name == 'My leg'


@pytest.mark.slow
def test_a_path_is_typed_and_in_portuguese(lab: Opened, tmp_path: Path) -> None:
    lab.page.locator('#save-requirements').click()
    assert 'there is no path' in lab.text('#refusal')
    lab.page.locator('[data-language=pt]').click()
    lab.page.locator('#path-points').fill('0 0\n50,5 0\n50,5 20')
    lab.page.locator('#path-structure').select_option('new')
    lab.page.locator('#path-turn').click()
    requirements = parse(saved_by(lab, '#save-requirements', tmp_path))
    assert requirements['path']['points'] == [[0, 0], [50.5, 0], [50.5, 20]]
    assert requirements['grow'] == {'dyads': 1}
    assert not requirements['path']['turn']
    lab.page.locator('#path-points').fill('0 0\n50.5 0')
    assert 'use a vírgula decimal' in lab.text('#refusal')
    lab.page.locator('[data-language=en]').click()
    lab.page.locator('#path-turn').click()
    lab.page.locator('#path-structure').select_option('own')
    lab.page.locator('#path-clear').click()
    assert lab.page.locator('#path-points').input_value() == ''


PARALLELOGRAM = change_point_file('parallelogram').read_text(encoding='utf-8')


def rocker_angle(lab: Opened) -> float:
    """Return the rocker's angle less the crank's [deg], as it is drawn."""
    x: list[float] = lab.page.evaluate('lab.pose.x')
    return float(np.degrees(np.angle(np.exp(1j * (x[2] - x[0])))))


@pytest.mark.slow
def test_the_crank_turns_a_parallelogram_through_its_change_points(lab) -> None:
    lab.load(PARALLELOGRAM)
    lab.until('lab.turn && lab.turn.linkage === lab.linkage')
    taken = 'Change point at 180.0°: coupler, rocker in line. It goes on by its inertia'
    assert lab.text('#changes li:first-child').startswith(taken)
    assert 'coupler 0.000, rocker 1.000; the other way: coupler' in lab.text('#changes')
    for angle in [90, 170, 180, 190, 268, 350, 5, 340, 200, 150]:
        lab.page.locator('#alpha').fill(str(angle))
        assert rocker_angle(lab) == pytest.approx(0.0, abs=1e-9)
    for _ in range(40):
        lab.page.evaluate('moveBy(1)')
        assert rocker_angle(lab) == pytest.approx(0.0, abs=1e-9)
    lab.page.evaluate("speak('pt')")
    lab.await_panels()
    assert 'Ponto de mudança em 180,0°: coupler, rocker alinhados.' in lab.text('#changes')


def test_a_clearance_that_is_rounding_is_none(lab) -> None:
    lab.page.locator('#linkage').select_option('four_bar')
    for number, length in enumerate((0.08, 0.18, 0.18, 0.0, 0.0, 0.08)):
        lab.page.evaluate(f'lab.setNumber({number}, {length})')
    lab.until("lab.turn?.linkage === lab.linkage && byId('tiles').textContent.includes('Least')")
    assert 'Least margin0.0 mm' in lab.text('#tiles')


@pytest.mark.slow
def test_beyond_a_change_point_an_edit_keeps_what_is_drawn(lab) -> None:
    lab.load(PARALLELOGRAM)
    lab.page.locator('#alpha').fill('268')
    for length in (0.1001, 0.1):
        n = 'lab.linkage.structure.dimensions.findIndex(({ name }) => name === "B-C")'
        lab.page.evaluate(f'lab.setNumber({n}, {length})')
        assert abs(rocker_angle(lab)) < 1.0
    saved = lab.page.evaluate('textToSave(false)')
    assert linkage_from_text(saved, 'saved').name == 'Parallelogram leg'
    link = lab.page.evaluate('linkOf(lab)')
    lab.page.evaluate(f"lab.choose('klann'); openLink(lab, {json.dumps(link)})")
    assert abs(rocker_angle(lab)) < 1e-9
    lab.page.evaluate('lab.turnTo(1)')
    assert abs(rocker_angle(lab)) < 1e-9


@pytest.mark.slow
def test_a_linkage_of_two_turns_shows_which_one_it_is_in(lab) -> None:
    lab.load(change_point_file('two_turns').read_text(encoding='utf-8'))
    lab.until('lab.turn && lab.turn.linkage === lab.linkage')
    assert 'It is back where it was after 2 turns.' in lab.text('#turn-text')
    assert lab.text('#alpha-text').endswith('turn 1 of 2')
    first = rocker_angle(lab)
    lab.page.evaluate('for (let n = 0; n < 8; n += 1) moveBy(Math.PI / 4)')
    assert lab.text('#alpha-text').endswith('turn 2 of 2')
    assert abs(rocker_angle(lab) - first) > 10.0


def test_the_lectures_task_is_done_in_a_click(lab: Opened) -> None:
    """Draw the angle of bar BC over the angle of AB, of the leg and of the four-bar."""
    for name, across, key, bar in (
        ('klann', 'alpha', 'gamma', 'BC'),
        ('four_bar', 'theta2', 'theta3', 'AB'),
    ):
        lab.page.locator('#linkage').select_option(name)
        lab.until('lab.turn?.linkage === lab.linkage && Boolean(curves.curves)')
        assert lab.text('#curve-legend').startswith(f'{key} ({bar}) = ')
        labels = lab.page.locator('#curves text').all_text_contents()
        assert {f'{across} [°]', f'{key} [°]'} <= {*labels}
        assert labels[labels.index('360') - 4 :][:5] == ['0', '90', '180', '270', '360']
        degrees, angles = lab.page.evaluate('curves.curves.map(({ pieces }) => pieces[0])')
        leg = LinkageLeg(shipped_linkage(name))
        expected = np.degrees(leg.table(np.radians(degrees))[key])
        assert angles == pytest.approx(np.degrees(np.unwrap(np.radians(expected))), abs=1e-9)
    lab.page.locator('#add-curve').select_option('theta4_rate')
    lab.page.locator('#across').select_option('theta3')
    assert 'theta4_rate [rad/s]' in lab.page.locator('#curves text').all_text_contents()
    # The cursor is on the curves wherever the crank is.
    for angle in (10, 200):
        lab.page.locator('#alpha').fill(str(angle))
        row = LinkageLeg(shipped_linkage('four_bar')).table(np.radians([angle]), 1.0)
        x, y, dot = lab.page.evaluate("""() => {
            const { x, y } = curves.plots[1];
            const at = (name) => Number(curves.dots[1].getAttribute(name));
            const shown = [at('cx'), at('cy')];
            return [x.low + (shown[0] - x.from) / (x.to - x.from) * (x.high - x.low),
                    y.low + (shown[1] - y.from) / (y.to - y.from) * (y.high - y.low), shown];
        }""")
        assert x == pytest.approx(np.degrees(row['theta3'])[0], abs=1e-6), dot
        assert y == pytest.approx(row['theta4_rate'][0], abs=1e-9)
    lab.page.locator('#curve-legend button', has_text='theta4_rate').click()
    assert lab.page.evaluate('curves.keys') == ['theta3']
    # A number without a unit.
    lab.page.locator('#add-curve').select_option('theta4_advantage')
    assert re.search(r'advantage \(O4B\) = .?[0-9]+\.[0-9]{4} ×$', lab.text('#curve-legend'))


@pytest.mark.slow
def test_a_curve_jumps_only_through_infinity(lab: Opened) -> None:
    lab.page.locator('#linkage').select_option('galloway')
    lab.until('lab.turn.linkage === lab.linkage && curves.curves?.[1].key === "coupler"')
    (angles,) = lab.page.evaluate('curves.curves[1].pieces')
    assert np.abs(np.diff(angles)).max() < 10.0
    assert angles[-1] - angles[0] == pytest.approx(360.0)
    for alpha in (0.2, 3.0, 6.0):
        lab.page.evaluate(f'lab.turnTo({alpha})')
        dot = lab.page.locator('#curves .curve-dot')
        assert float(dot.get_attribute('r')) > 0
    lab.page.locator('#linkage').select_option('klann')
    lab.until('lab.turn.linkage === lab.linkage && curves.curves?.[1].key === "gamma"')
    lab.page.locator('#add-curve').select_option('gamma_advantage')
    # Gamma turns back twice in a turn.
    lines = lab.page.locator('#curves .chart-line')
    parts = [line.get_attribute('d').count('M') for line in lines.all()[:2]]
    assert parts == [1, 3]
    # An arc through 360 deg begins again at 0.
    lab.page.evaluate('lab.setNumber(1, 0.33)')
    lab.until('lab.turn.linkage === lab.linkage && !lab.turn.isTurn')
    assert lines.first.get_attribute('d').count('M') == 2


@pytest.mark.slow
def test_curves_have_gaps_and_all_turns(lab: Opened) -> None:
    lab.page.locator('#linkage').select_option('chebyshev')
    lab.until('lab.turn?.linkage === lab.linkage && curves.curves?.[0].pieces.length === 2')
    assert lab.page.locator('#curves .chart-line').first.get_attribute('d').count('M') == 2
    widths = lab.page.locator('#curves .chart-dead').evaluate_all(
        '(nodes) => nodes.map((node) => Number(node.getAttribute("width"))).filter(Boolean)'
    )
    span = lab.page.evaluate('curves.plots[0].x.to - curves.plots[0].x.from')
    arcs = LinkageLeg(shipped_linkage('chebyshev')).reachable_arcs()
    reach = sum(end - start for start, end in arcs) / (2.0 * np.pi)
    assert sum(widths) / span == pytest.approx(1.0 - reach, abs=1e-6)
    lab.load(change_point_file('two_turns').read_text(encoding='utf-8'))
    lab.until('lab.turn?.linkage === lab.linkage && curves.span === 720')
    assert '720' in lab.page.locator('#curves text').all_text_contents()
    lab.page.evaluate('lab.turnTo(3 * Math.PI)')
    assert lab.page.locator('#curves').get_attribute('aria-valuenow') == '540.00'
    lab.page.locator('#curves').focus()
    lab.page.keyboard.press('Shift+ArrowLeft')
    assert lab.page.locator('#chart').get_attribute('aria-valuenow') == '530.00'


@pytest.mark.slow
def test_the_values_are_those_of_python_at_the_rate_that_is_typed(lab: Opened) -> None:
    lab.page.evaluate('lab.turnTo(Math.PI / 3)')
    field = lab.page.locator('#rate')
    field.fill('2')
    row = KlannLeg().table([np.pi / 3.0], 2.0)

    def cells(row_name: str) -> list[str]:
        rows = lab.page.locator('.values tbody tr')
        row = rows.filter(has_text=re.compile(f'^{re.escape(row_name)} '))
        texts = row.locator('td').all_text_contents()
        return [text.replace('\N{MINUS SIGN}', '-') for text in texts]

    numbers = [row[f'gamma{end}'][0] for end in ('', '_rate', '_acceleration', '_advantage')]
    numbers[0] = np.degrees(numbers[0])
    assert cells('gamma') == [f'{numbers[0]:.2f}', *(f'{number:.4f}' for number in numbers[1:])]
    names = [f'H.{axis}{end}' for end in ('', '_rate', '_acceleration') for axis in 'xy']
    assert cells('H') == [f'{1e3 * row[name][0]:.2f}' for name in names]
    assert cells('mu_2') == [f'{np.degrees(row.mu_2)[0]:.2f}']
    for typed, rate in (('60 rpm', 2.0 * np.pi), ('-3', -3.0)):
        field.fill(typed)
        assert lab.page.evaluate('lab.rate') == pytest.approx(rate)
    for typed in ('1e9', '3 mm', '3x'):
        field.blur()
        field.fill(typed)
        field.press('Enter')
        assert lab.page.evaluate('lab.rate') == -3.0
        assert field.get_attribute('aria-invalid') == 'true'
    field.fill('1')
    # Where it does not close there are none.
    lab.page.evaluate('lab.setNumber(1, 0.33); lab.turnTo(Math.PI * 11 / 12)')
    assert cells('H') == ['\N{EN DASH}'] * 6


@pytest.mark.slow
@pytest.mark.parametrize('locale', ['en-US', 'pt-BR'])
def test_a_turn_is_saved_and_read_back(visit, tmp_path: Path, locale: str) -> None:
    opened = visit(locale=locale)
    opened.page.evaluate("lab.choose('chebyshev')")
    opened.until('lab.turn?.linkage === lab.linkage')
    opened.page.locator('#table-step').select_option('10')
    opened.page.locator('#table-rates').check()
    text = saved_by(opened, '#table-save', tmp_path)
    (path,) = tmp_path.iterdir()
    assert path.name == 'chebyshev_linkage_turn.csv'
    is_portuguese = locale == 'pt-BR'
    table = LinkageLeg(shipped_linkage('chebyshev')).table(np.radians(np.arange(0, 361, 10)), 1.0)
    expected = table.csv(decimal_comma=is_portuguese).splitlines()
    lines = text.splitlines()
    assert lines[0] == expected[0]
    for line, expected_line in zip(lines[1:], expected[1:], strict=True):
        for cell, expected_cell in zip(
            *(row.split(';' if is_portuguese else ',') for row in (line, expected_line)),
            strict=True,
        ):
            numbers = [float(text.replace(',', '.') or 'nan') for text in (cell, expected_cell)]
            assert numbers[0] == pytest.approx(numbers[1], rel=1e-9, abs=1e-9, nan_ok=True)
    opened.until("document.querySelectorAll('#turn-table tbody tr').length === 37")
    assert (
        opened.text('#turn-table tbody tr:last-child th')
        == ('360,00', '360.00')[locale == 'en-US']
    )


@pytest.mark.slow
def test_the_space_bar_turns_the_crank_but_where_it_writes_or_presses(lab: Opened) -> None:
    page = lab.page
    for selector in ('#alpha', '[data-grip=H]', '#values-title', '.values', '#curves', '#skip'):
        page.locator(selector).focus()
        page.keyboard.press('Space')
        assert page.evaluate('crank.isTurning'), selector
        page.keyboard.press('Space')
        assert not page.evaluate('crank.isTurning'), selector
    for selector in ('#name', '#text', '#rate', '#fit', '#others', '#across', 'summary'):
        page.locator(selector).first.focus()
        page.keyboard.press('Space')
        assert not page.evaluate('crank.isTurning'), selector
        page.keyboard.press('Escape')
    page.evaluate("byId('others').checked = false; lab.undo()")


def test_the_first_tab_skips_to_the_values(visit) -> None:
    opened = visit(locale='en-US')
    opened.page.keyboard.press('Tab')
    assert opened.page.evaluate('document.activeElement.textContent') == 'Skip to the values'
    opened.page.keyboard.press('Enter')
    assert opened.page.evaluate('document.activeElement.id') == 'values-title'
    assert opened.page.evaluate('location.hash') == ''
    opened.page.keyboard.press('Tab')
    assert opened.page.evaluate('document.activeElement.id') == 'rate'


@pytest.mark.slow
def test_cards_leave_no_holes(visit) -> None:
    opened = visit(locale='pt-BR', viewport={'width': 1920, 'height': 1080})
    for name in ('klann', 'four_bar', 'trotbot', 'side_rod'):
        opened.page.evaluate(f"lab.choose('{name}')")
        opened.until('lab.turn?.linkage === lab.linkage')
        opened.page.wait_for_timeout(300)
        gaps = opened.page.evaluate("""() => {
            const cards = [...document.querySelectorAll('main > .card, main > div .card')]
                .map((card) => card.getBoundingClientRect()).filter(({ height }) => height);
            const bottom = Math.max(...cards.map((box) => box.bottom));
            // Below each card there is the next one, or the end of the page.
            return cards.map((box) => Math.min(...cards
                .filter((below) => below.top >= box.bottom && below.left < box.right
                    && below.right > box.left)
                .map((below) => below.top - box.bottom), bottom - box.bottom));
        }""")
        assert max(gaps) <= 15.0, name


@pytest.mark.slow
def test_it_prints_a_report_on_two_pages(visit) -> None:
    opened = visit(locale='pt-BR', color_scheme='dark')
    for setup in (
        "lab.choose('klann')",
        "lab.choose('trotbot'); curves.put('J7.y'); curves.put('J7.x_rate')",
        "lab.choose('klann'); lab.setNumber(1, 0.33); lab.turnTo(Math.PI * 11 / 12)",
    ):
        opened.page.evaluate(setup)
        opened.until('lab.turn?.linkage === lab.linkage')
        opened.page.wait_for_timeout(300)
        opened.page.emulate_media(media='print')
        for part in ('#scene', '#curves', '#chart', '#numbers', '#values-points'):
            assert opened.page.locator(part).bounding_box()['height'] > 80, part
        opened.page.emulate_media(media='null')
        document = opened.page.pdf(prefer_css_page_size=True)
        assert len(re.findall(rb'/Type\s*/Page\b', document)) == 2, setup


@pytest.mark.slow
def test_phi_of_the_leg_is_as_wide_as_a_telephone(visit) -> None:
    size = {'width': 390, 'height': 844}
    opened = visit(locale='pt-BR', viewport=size, has_touch=True, is_mobile=True)
    opened.page.locator('#lecture').click()
    opened.until("document.querySelectorAll('#step .matrix td').length >= 24")
    assert opened.page.evaluate("byId('step').scrollWidth <= byId('step').clientWidth")
    # A larger one scrolls in its own box.
    opened.page.evaluate("lab.choose('jansen')")
    opened.until('lab.turn?.linkage === lab.linkage')
    assert opened.page.evaluate("byId('step').scrollWidth > byId('step').clientWidth")
    assert opened.page.evaluate('document.documentElement.scrollWidth') == 390
