"""The manual as static files in a real browser: below a path, from a disk, without a network."""

from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
import math
from pathlib import Path
import re
import runpy
import subprocess
import sys
from threading import Thread
from typing import Any

from browser import find
from browser_page import OpenedPage
from klann_ros.kinematics import foot_path, FourBar, KlannGeometry, KlannLeg
import numpy as np
import pytest

pytest.importorskip('playwright')
# To import it here would cost every worker a second.
if find_spec('furo') is None:
    pytest.skip('no furo: pip install furo', allow_module_level=True)
if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)

ROOT = Path(__file__).resolve().parents[2]
LEG = KlannLeg()
# The pages with figures; the check `docs` builds all.
SOURCES = ('index', 'theory', 'teoria', 'examples', 'exemplos', 'lab')
FIGURES = {'theory': 12, 'teoria': 10, 'examples': 5, 'exemplos': 5, '../index': 1}
# L1 to L4 [mm], of each class and kind.
FOUR_BARS = (
    (180, 80, 200, 150),
    (60, 120, 140, 150),
    (200, 180, 120, 70),
    (180, 150, 60, 140),
    (180, 120, 130, 140),
    (200, 100, 250, 150),
    (200, 100, 200, 100),
    (200, 100, 100, 200),
)
SCROLL = """async () => {
    for (const image of document.querySelectorAll('article img')) {
        image.scrollIntoView({ behavior: 'instant' });
        // One without a plan stays.
        for (let k = 0; k < 50 && image.isConnected; k += 1)
            await new Promise((done) => setTimeout(done, 20));
    }
    return document.querySelectorAll('.interactive').length;
}"""
# axe does not read formulas: to it the head of their column is empty.
READABLE = {'rules': {'empty-table-header': {'enabled': False}}}
# Thousands of parts of formulas, all of one kind, would take most of its time.
REPEAT = """document.querySelectorAll('math').forEach((formula, index) => {
    formula.toggleAttribute('data-repeated', index > 40);
})"""
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
        context.set_default_timeout(10_000)
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
        pytest.param('theory', 'light', 1280, marks=pytest.mark.slow),
        pytest.param('teoria', 'dark', 390, marks=pytest.mark.slow),
        pytest.param('examples', 'dark', 1280, marks=pytest.mark.slow),
        pytest.param('exemplos', 'light', 390, marks=pytest.mark.slow),
        ('../index', 'light', 390),
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
    is_portuguese = name in {'teoria', 'exemplos'}
    language = opened.page.evaluate('document.documentElement.lang')
    assert language == ('pt-BR' if is_portuguese else 'en')
    if not name.endswith('index'):
        translation = opened.page.locator('.translation a')
        assert translation.text_content() == ('English' if is_portuguese else 'Português')
    # It takes as long as all others, for the markup of teoria.
    if name != 'theory':
        opened.page.evaluate(REPEAT)
        assert opened.barriers(READABLE, '[data-repeated]') == []


def figure(opened: OpenedPage, name: str) -> Any:
    """Return a figure of a page, when it is drawn."""
    place = opened.page.locator(f'img[src$="/{name}.png"], [data-figure={name}]')
    place.scroll_into_view_if_needed()
    box = opened.page.locator(f'[data-figure={name}]')
    box.wait_for()
    return box


def values(box: Any) -> dict[str, str]:
    """Return the numbers below a figure."""
    names, texts = (box.locator(f'dl {tag}').all_text_contents() for tag in ('dt', 'dd'))
    return dict(zip(names, texts, strict=True))


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r'[-+.\de]+\d', text.replace('\u2212', '-'))]


def move(box: Any, label: str, value: float) -> None:
    """Move a slider as the keyboard and the pointer do."""
    slider = box.get_by_label(label, exact=True)
    slider.fill(str(value))
    slider.dispatch_event('change')


def degrees(*angles: float) -> list[str]:
    return [f'{math.degrees(angle):.2f}°' for angle in angles]


@pytest.mark.slow
def test_the_numbers_of_the_leg_are_those_of_python(visit: Visit) -> None:
    opened = visit('theory')
    for angle in (0, 100, 251):
        alpha = math.radians(angle)
        pose = LEG.closed_form(alpha)
        box = figure(opened, 'klann_leg')
        move(box, 'Crank angle', angle)
        x, y = 1e3 * np.array(pose.h)
        # Decimal separators are the language's, so a semicolon is between coordinates.
        expected = [*degrees(*pose.x), f'({x:.1f}; {y:.1f}) mm'.replace('-', '\u2212')]
        assert [*values(box).values()] == [text.replace('-', '\u2212') for text in expected]
        box = figure(opened, 'klann_turn')
        move(box, 'Crank angle', angle)
        move(box, 'Direction of the force', 90)
        shown = values(box)
        assert [shown['μ₁'], shown['μ₂']] == degrees(*pose.transmission_angles)
        assert shown['cond Φ'] == f'{pose.condition:.2f}'
        assert numbers(shown['dH/dα']) == np.round(LEG.velocity(pose, 1.0).h, 4).tolist()
        torque = LEG.crank_torque(pose, (0.0, 100.0))
        assert numbers(shown['T for 100 N']) == [round(torque, 2)]


@pytest.mark.slow
def test_the_foot_path_is_that_of_python(visit: Visit) -> None:
    box = figure(visit('theory'), 'klann_foot_path')
    for length in (343, 350, 378):
        move(box, '|B-C|', length)
        path = foot_path(KlannLeg(KlannGeometry(l_bc=length / 1e3)))
        stance = path.stance()
        start, end = np.degrees([stance.start, stance.end])
        assert values(box) == {
            'stride': f'{1e3 * path.stride:.1f} mm',
            'lift': f'{1e3 * path.lift:.1f} mm',
            'stance': f'{start:.2f}° … {end:.2f}°',
            'duty factor': f'{stance.duty_factor:.3f}',
            'crank': 'the whole turn',
        }
    move(box, '|B-C|', 339.5)
    ((start, end),) = KlannLeg(KlannGeometry(l_bc=0.3395)).reachable_arcs()
    arc = f'{math.degrees(start):.1f}° … {math.degrees(end):.1f}°'
    assert values(box)['crank'] == arc


@pytest.mark.slow
def test_newton_raphson_and_the_warm_start_are_those_of_python(visit: Visit) -> None:
    opened = visit('theory')
    alpha = math.radians(60.0)
    iterates = LEG.newton(alpha, np.radians([15.0, 60.0, 45.0, 60.0]))
    box = figure(opened, 'newton_convergence')
    for k, iterate in enumerate(np.degrees(iterates)[:5]):
        shown = values(box)
        assert [*shown.values()][:4] == [f'{angle:.4f}°' for angle in iterate], k
        box.get_by_role('button').click()
    assert (shown['corrections'], shown['assembly']) == (str(len(iterates) - 1), '[+ +]')
    box = figure(opened, 'warm_start')
    pose = LEG.solve(alpha)
    for step in (1, 20, 40):
        move(box, 'Step of the crank', step)
        turn = math.radians(step)
        guesses = (pose.x, pose.x + turn * np.array(pose.coefficients))
        counts = [len(LEG.newton(alpha + turn, guess)) - 1 for guess in guesses]
        assert [*values(box).values()] == [f'{count} corrections' for count in counts]


@pytest.mark.slow
def test_the_class_of_a_four_bar_is_that_of_python(visit: Visit) -> None:
    box = figure(visit('examples'), 'example_four_bar')
    for lengths in FOUR_BARS:
        # The longest first, so that it closes on the way.
        for length, label in sorted(zip(lengths, ('L₁', 'L₂', 'L₃', 'L₄'), strict=True))[::-1]:
            move(box, label, length)
        grashof = FourBar(*lengths).grashof
        motion = grashof.type_.removeprefix(f'{grashof.shape} ')
        assert values(box)['Grashof'] == f'{grashof.class_}, {motion}', lengths


@pytest.mark.slow
def test_a_length_that_is_still_dragged_draws_and_one_that_closes_nowhere_says_so(
    visit: Visit,
) -> None:
    opened = visit('examples')
    box = figure(opened, 'example_four_bar')
    move(box, 'Crank angle', 144)
    move(box, 'L₄', 40)
    assert values(box)[''] == 'It does not close here.'
    # Only the end of a drag is a change.
    box.get_by_label('L₃', exact=True).fill('250')
    assert 'μ' in values(box)
    assert 'NaN' not in box.evaluate('(node) => node.outerHTML')
    move(box, 'L₁', 400)
    move(box, 'L₂', 40)
    assert [*values(box)] == ['', 'Grashof', 'crank']
    assert opened.complaints == []


@pytest.mark.slow
def test_the_ratio_of_a_quick_return_is_that_of_its_geometry(visit: Visit) -> None:
    box = figure(visit('examples'), 'example_quick_return')
    for crank in (50, 62, 100):
        move(box, 'Crank', crank)
        lag = 2.0 * math.asin(crank / 200.0)
        ratio = (math.pi + lag) / (math.pi - lag)
        assert numbers(values(box)['time ratio']) == [pytest.approx(ratio, abs=6e-4)]


@pytest.mark.slow
def test_a_figure_moves_when_it_is_started_and_seen(visit: Visit) -> None:
    opened = visit('examples', reduced_motion='no-preference')
    box = figure(opened, 'example_walker')
    angle = box.locator('output').first
    opened.page.wait_for_timeout(300)
    assert angle.text_content() == '60.0°'
    box.get_by_role('button').press('Enter')
    opened.until("document.querySelector('.interactive output').textContent !== '60.0°'")
    opened.page.evaluate("scrollTo({ top: 1e6, behavior: 'instant' })")
    opened.page.wait_for_timeout(200)
    before = angle.text_content()
    opened.page.wait_for_timeout(300)
    assert angle.text_content() == before
    box.get_by_role('button').click()
    assert box.get_by_role('button').text_content() == 'Turn'


@pytest.mark.slow
def test_a_figure_steps_for_who_wants_no_motion_and_is_turned_by_keys_and_pointer(
    visit: Visit,
) -> None:
    opened = visit('exemplos', reduced_motion='reduce')
    box = figure(opened, 'example_change_point')
    angle = box.locator('output').first
    box.get_by_role('button').click()
    opened.page.wait_for_timeout(200)
    assert angle.text_content() == '75,0°'
    box.get_by_label('Ângulo da manivela', exact=True).press('ArrowRight')
    assert angle.text_content() == '76,0°'
    box.locator('.interactive-grip').hover()
    axle = box.locator('.leg rect[data-point=A]').bounding_box()
    opened.page.mouse.down()
    opened.page.mouse.move(axle['x'] - 60, axle['y'] + axle['height'] / 2)
    opened.page.mouse.up()
    assert numbers(angle.text_content().replace(',', '.')) == [pytest.approx(180.0, abs=1.0)]
    chart = box.locator('.interactive-chart svg')
    width = chart.bounding_box()['width']
    chart.click(position={'x': width * (46 + 334 / 4) / 400, 'y': 60})
    assert numbers(angle.text_content().replace(',', '.')) == [pytest.approx(90.0, abs=1.0)]
    assert opened.complaints == []


@pytest.mark.slow
def test_every_figure_opens_in_the_lab_as_it_is(visit: Visit) -> None:
    opened = visit('theory')
    opened.page.evaluate(SCROLL)
    links = {}
    for box in opened.page.locator('.interactive').all():
        options = box.locator('option').count()
        for k in {0, max(options, 1) - 1}:
            if options:
                box.locator('select').select_option(index=k)
            link = box.get_by_role('link').evaluate('(node) => node.href')
            links[link] = box.locator('output').first.text_content()
    assert len(links) >= 8
    page = opened.page.context.new_page()
    for link, angle in links.items():
        page.goto('about:blank')
        lab = OpenedPage(page, link)
        lab.until('Boolean(lab.turn)')
        assert page.locator('#refusal').is_hidden(), link
        assert f'{math.degrees(page.evaluate("lab.alpha")):.1f}°' == angle
        assert lab.complaints == []


def test_the_site_opens_from_a_disk(visit: Visit, site: Path) -> None:
    opened = visit('exemplos', base=f'{site.as_uri()}/')
    assert opened.page.evaluate(SCROLL) == FIGURES['exemplos']
    assert opened.complaints == []


def test_without_scripts_images_and_formulas_stay(visit: Visit) -> None:
    opened = visit('theory', java_script_enabled=False)
    assert opened.page.locator('img[src$="/dyad.png"]').is_visible()
    assert opened.page.locator('math').count() > 100


@pytest.mark.parametrize(
    ('content', 'fault'),
    [
        ('<a href="b.html#there">', None),
        ('<a href="#here"><i id="here">', None),
        ('<a href="lab.html#crank=60">', None),
        ('<a href="https://a.test/">', None),
        ('<link rel="canonical" href="https://a.test/">', None),
        ('<a href="none.html">', 'page.html: broken link none.html'),
        ('<a href="b.html#nowhere">', 'page.html: broken link b.html#nowhere'),
        ('<a href="../b.html">', 'page.html: broken link ../b.html'),
        ('<img src="none.png">', 'page.html: broken link none.png'),
        ('<script src="https://a.test/x.js">', 'page.html loads https://a.test/x.js'),
        ('<script src="//a.test/x.js">', 'page.html loads //a.test/x.js'),
        ('<link rel="stylesheet" href="http://a.test/">', 'page.html loads http://a.test/'),
    ],
)
def test_a_build_names_broken_links_and_what_is_loaded_from_outside(
    tmp_path: Path, content: str, fault: str | None
) -> None:
    folder = tmp_path / 'site'
    folder.mkdir()
    for page, text in (('page', content), ('b', '<i id="there">'), ('lab', '')):
        (folder / f'{page}.html').write_text(text)
    (tmp_path / 'b.html').touch()
    site = runpy.run_path(str(ROOT / 'docs' / 'links.py'))['Site']
    assert [*site(folder).broken_links()] == ([fault] if fault else [])
    (folder / 'x.css').write_text('a { background: url("https://a.test/x.png") }')
    assert 'x.css loads https://a.test/x.png' in site(folder).broken_links()


@pytest.mark.parametrize(
    ('formula', 'markup'),
    [
        (r'd = |PQ|', 'd = <|> P Q </|>'),
        (r'L_3 \cos\theta_4', 'L 3 _ cos \u2061 _ θ 4'),
        (r'-(\pm\alpha + \beta)', '\u2212 ( <±> α + β )'),
        (r'\sin(\gamma - 10^\circ)', 'sin \u2061 ( γ \u2212 10 ∘ )'),
    ],
)
def test_formulas_have_the_spaces_of_tex(formula: str, markup: str) -> None:
    made = runpy.run_path(str(ROOT / 'docs' / 'static_site.py'))['formula_markup'](formula)
    made = made.replace('&ApplyFunction;', '\u2061').replace('<mspace width="0.17em">', ' _ ')
    made = re.sub(r'<mo form="prefix"[^>]*>(.)</mo>', r' <\1> ', made)
    made = re.sub(r'<mo form="postfix"[^>]*>(.)</mo>', r' </\1> ', made)
    assert re.sub(r'</?m[^>]*>', ' ', made).split() == markup.split()
