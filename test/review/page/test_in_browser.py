"""The page in a real browser: offline, alive, exact, for keyboards, telephones, nights, paper."""

from browser import find
from browser_page import OpenedPage
from klann_ros.kinematics import KlannLeg, LinkageLeg, shipped_linkage
from leg_runs import LegRun
import numpy as np
import pytest

pytest.importorskip('playwright')
if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)

ALL = (
    *('klann', 'faulty', 'walker', 'garbled', 'hostile'),
    *(
        pytest.param(name, marks=pytest.mark.slow)
        for name in ('jansen', 'quick_return', 'changed', 'feet', 'bare', 'nothing')
    ),
    *(pytest.param(name, marks=pytest.mark.slow) for name in ('two', 'walk', 'run_')),
)
# In which colours barriers are looked for, and what is looked at by telephone.
SCHEMES = {'faulty': ('light', 'dark'), 'walker': ('dark',), 'two': ('light',), 'walk': ('dark',)}
SMALL = ('faulty', 'walker', 'two', 'run_')
NEAR = 1e-6
PAPER = 'getComputedStyle(document.body).backgroundColor'


def pose_time(run: LegRun, number: int) -> float:
    """Return when the n-th pose was logged, from the run's start [s]."""
    return number * run.period + 20e-6 * (number % 7)


def slide(opened: OpenedPage, time: float) -> None:
    opened.page.locator('#time').fill(repr(time))


def shown_time(opened: OpenedPage) -> float:
    return float(opened.page.locator('#time').input_value())


def is_drawn(points: dict[str, np.ndarray], expected: np.ndarray) -> bool:
    drawn = np.array([points[name] for name in sorted(points)])
    return bool(np.abs(drawn - expected).max() <= NEAR)


@pytest.mark.parametrize('name', ALL)
def test_it_is_self_contained_without_errors_and_barriers_and_fits_a_telephone(
    visit, pages, name: str
) -> None:
    # By how it begins: the last one's name is wider than the telephone.
    full = next(key for key in pages if key.startswith(name))
    opened = visit(full)
    opened.page.keyboard.press('End')
    for button in opened.page.locator('.switch button:visible').all():
        button.click()
    assert opened.requests == [pages[full].as_uri()]
    assert opened.complaints == []
    if name in SMALL:
        opened.page.set_viewport_size({'width': 360, 'height': 740})
        opened.until('page.charts.charts[0].plot.width < 360')
        assert opened.page.evaluate('document.documentElement.scrollWidth') == 360
        width = opened.page.locator('#charts canvas').first.bounding_box()['width']
        assert 200 < width < 360
    for scheme in SCHEMES.get(name, ()):
        axe = pytest.importorskip('axe_playwright_python.sync_playwright')
        opened.page.emulate_media(color_scheme=scheme)
        assert axe.Axe().run(opened.page).response['violations'] == []


def test_the_policy_lets_no_other_script_run(visit) -> None:
    opened = visit('klann')
    opened.page.evaluate(
        "document.body.append(Object.assign(document.createElement('script'), {text: 'ran = 1'}))"
    )
    assert opened.page.evaluate('typeof ran') == 'undefined'
    assert 'Content Security Policy' in opened.complaints[0]


@pytest.mark.parametrize('number', [0, 57, 233, 399])
def test_the_slider_moves_the_leg_to_the_pose_of_that_time(klann, runs, number: int) -> None:
    run = runs['klann']
    slide(klann, pose_time(run, number) + 0.3 * run.period)
    expected = KlannLeg().solve(run.alpha(number)).points
    assert is_drawn(klann.points(), expected)
    assert klann.page.locator('#at-foot').text_content() == (
        '{:.1f}, {:.1f} mm'.format(*(1e3 * expected[7]))
    )


@pytest.mark.parametrize('name', ['jansen', 'quick_return'])
def test_another_linkage_is_drawn_by_its_own_terms(visit, name: str) -> None:
    opened, run = visit(name), LegRun()
    slide(opened, pose_time(run, 140))
    pose = LinkageLeg(shipped_linkage(name)).solve(run.alpha(140))
    points = opened.points()
    for point, position in zip(pose.linkage.structure.points, pose.points, strict=True):
        assert np.abs(points[point] - position).max() <= NEAR


@pytest.mark.parametrize('key', ['', 'Space'], ids=['the button', 'the space bar'])
def test_it_plays_and_pauses(klann, key: str) -> None:
    play = klann.page.locator('#play')
    start = klann.points()['H']
    press = (lambda: klann.page.keyboard.press(key)) if key else play.click
    press()
    assert play.text_content() == 'Pause'
    klann.until("Number(document.getElementById('time').value) > 0.05")
    press()
    assert play.text_content() == 'Play'
    stopped = shown_time(klann)
    assert np.abs(klann.points()['H'] - start).max() > 1e-3
    klann.page.wait_for_timeout(60)
    assert shown_time(klann) == stopped


def test_it_stops_at_the_end_and_plays_again_from_the_start(klann) -> None:
    klann.page.keyboard.press('End')
    assert shown_time(klann) > 1.9
    klann.page.evaluate(
        'page.seen = []; page.player.listen(() => page.seen.push(page.player.time))'
    )
    klann.page.locator('#speed').select_option('20')
    klann.page.locator('#play').click()
    klann.until("document.getElementById('play').textContent === 'Play'")
    assert klann.page.evaluate('page.seen[0]') == 0
    assert shown_time(klann) > 1.9


def test_keys_turn_the_leg_pose_by_pose(klann, runs) -> None:
    run, leg = runs['klann'], KlannLeg()
    for key, number in (
        ('ArrowRight', 1),
        ('ArrowRight', 2),
        ('Shift+ArrowRight', 12),
        ('ArrowLeft', 11),
        ('End', 399),
        ('Home', 0),
    ):
        klann.page.keyboard.press(key)
        assert is_drawn(klann.points(), leg.solve(run.alpha(number)).points)


def test_the_slider_has_keys_and_announces_the_time(klann, runs) -> None:
    slider = klann.page.locator('#time')
    slider.focus()
    klann.page.keyboard.press('ArrowUp')
    assert shown_time(klann) == pytest.approx(pose_time(runs['klann'], 1), abs=2e-6)
    assert slider.get_attribute('aria-valuetext') == '0.005 s'


def test_a_finding_leads_to_its_moment_in_the_picture_and_the_charts(visit, runs) -> None:
    opened = visit('faulty')
    gap = opened.page.locator('button[data-time]', has_text='gap')
    time = float(gap.get_attribute('data-time'))
    gap.click()
    assert shown_time(opened) == pytest.approx(time)
    expected = KlannLeg().solve(runs['faulty'].alpha(299)).points
    # It was solved with the textbook's crank, and another is recorded: its end is elsewhere.
    assert opened.points()['F'] == pytest.approx(expected[5], abs=NEAR)
    opened.until('page.charts.charts[0].plot.scales.x.max < 2.3')
    opened.page.locator('#zoom-all').click()
    opened.until('page.charts.charts[0].plot.scales.x.max > 2.3')


def test_charts_are_zoomed_together(klann) -> None:
    klann.page.locator('#zoom-in').click()
    klann.until('page.charts.charts.every(({plot}) => plot.scales.x.max === page.charts.shown[1])')
    assert klann.page.evaluate('page.charts.shown[1] - page.charts.shown[0]') < 1.1


def test_a_click_at_a_chart_goes_to_its_moment(klann) -> None:
    box = klann.page.locator('#charts .u-over').first
    size = box.bounding_box()
    box.click(position={'x': size['width'] / 2, 'y': 40})
    assert shown_time(klann) == pytest.approx(1.0, abs=0.05)


def test_charts_hold_the_recorded_values(klann, runs) -> None:
    run = runs['klann']
    values = klann.page.evaluate(
        'Object.fromEntries(page.charts.charts.map('
        '({settings, plot}) => [settings.key, plot.data.map((d) => d[57])]))'
    )
    pose = KlannLeg().solve(run.alpha(57))
    assert values['angles'][2:] == pytest.approx(np.degrees(pose.x).tolist(), abs=1e-6)
    rate = np.degrees(run.alpha(1) / run.period)
    assert values['rates'][2:] == pytest.approx([rate * x for x in pose.coefficients], rel=1e-6)
    mu = np.degrees(pose.transmission_angles).tolist()
    assert values['transmission'][1:] == pytest.approx(mu, abs=1e-4)
    assert klann.page.evaluate('page.runs[0].legs[0].iterations.most.length') == 10


def test_over_the_crank_angle_all_turns_coincide(klann) -> None:
    klann.page.locator('#over-crank').click()
    degrees, *bands = klann.page.evaluate('page.charts.charts[0].plot.data')
    assert 0 < degrees[0] < degrees[-1] < 360
    gamma = np.degrees(KlannLeg().solve(np.radians(degrees[31])).gamma)
    low = bands[2][31]
    high = bands[3][31]
    assert low - 0.5 <= gamma <= high + 0.5
    assert high - low < 5


def test_each_leg_of_a_walker_is_drawn_at_its_own_phase(visit, runs) -> None:
    opened, run = visit('walker'), runs['walker']
    slide(opened, pose_time(run, 100))
    for leg in run.legs:
        expected = KlannLeg().solve(run.alpha(100, leg)).points
        assert is_drawn(opened.points(f'#legs button[data-leg={leg}] svg'), expected)
        opened.page.locator(f'#legs button[data-leg={leg}]').click()
        assert is_drawn(opened.points(), expected)


def test_a_robot_that_walks_is_seen_from_above_where_it_was(visit) -> None:
    opened = visit('walk')
    slide(opened, 2.0)
    text = opened.page.locator('#walks figcaption').text_content()
    assert text.startswith('The robot /x\'"><img src=http://a.test/ onerror=bad()></script>')
    assert 'goes 2.0' in text
    # Odometry begins where the truth does, however far it was, and goes a tenth further.
    places = opened.page.eval_on_selector_all(
        '#walks .robot',
        """(marks) => marks.map((mark) => {
            const { left, top, scale } = mark.ownerSVGElement.dataset;
            const { e, f } = mark.transform.baseVal[0].matrix;
            return [Number(left) + e / scale, Number(top) - f / scale];
        })""",
    )
    assert places == [pytest.approx([1.0, 0.0], abs=0.01), pytest.approx([1.1, 0.0], abs=0.01)]
    assert opened.page.locator('#walks .scale-text').text_content() == '0.5 m'
    assert opened.complaints == []


def test_two_runs_lie_over_each_other(visit, runs) -> None:
    opened, run = visit('two'), runs['klann']
    slide(opened, pose_time(run, 77))
    ghost = opened.points(group='ghost')
    assert is_drawn(opened.points(), KlannLeg().solve(run.alpha(77)).points)
    longer = runs['longer'].legs[''].solve(run.alpha(77)).points
    assert is_drawn(ghost, longer)
    assert 'l_ab is 0.12 m in the first run, 0.1212 m in the second' in (
        opened.page.locator('.findings').text_content()
    )
    names = opened.page.locator('#charts .legend').first.locator('button').all_text_contents()
    assert [name[:8] for name in names[1::5]] == ['A: gamma', 'B: gamma']


def test_missing_data_is_named(visit) -> None:
    feet, bare = visit('feet'), visit('bare')
    note = feet.page.locator('#picture-note').text_content()
    assert note == 'Not drawn: the run contains no geometry.'
    assert not feet.page.locator('#curves').is_visible()
    titles = bare.page.locator('#charts h3').all_text_contents()
    assert titles == ['Joint angles']


def test_a_leg_is_not_drawn_in_a_shape_that_it_had_not_yet(visit, runs) -> None:
    opened, run = visit('changed'), runs['changed']
    note = opened.page.locator('#picture-note')
    slide(opened, pose_time(run, 150))
    assert not opened.page.locator('#picture .leg').is_visible()
    assert note.text_content().endswith('it had other dimensions.')
    slide(opened, pose_time(run, 250))
    assert is_drawn(opened.points(), KlannLeg().solve(run.alpha(250)).points)
    assert not note.is_visible()


def test_non_finite_numbers_are_gaps(visit) -> None:
    opened = visit('garbled')
    assert opened.page.locator('#picture-note').text_content() == (
        'Not drawn: an angle of this pose is not a number.'
    )
    opened.page.keyboard.press('ArrowRight')
    assert is_drawn(opened.points(), KlannLeg().solve(LegRun().alpha(1)).points)
    angles = 'page.charts.charts[0].plot.data.slice(1).map((column) => column[100])'
    assert opened.page.evaluate(angles) == [None] * 5


def test_names_from_a_log_are_texts(visit) -> None:
    opened = visit('hostile')
    name = opened.page.locator('tbody th').first.text_content()
    assert '<img src=http://a.test/ onerror=bad()></script><script>bad()</script>&amp;' in name
    assert opened.page.locator('img').count() == 0
    assert opened.page.title() == 'Review of hostile'


def test_at_night_page_and_charts_are_dark(visit) -> None:
    opened = visit('klann', color_scheme='dark')
    ink = 'page.charts.charts[0].plot.axes[0].stroke()'
    assert luminance(opened.page.evaluate(PAPER)) < 40
    assert opened.page.evaluate(ink) == '#a3afbf'
    opened.page.emulate_media(color_scheme='light')
    assert opened.page.evaluate(ink) == '#566173'


def luminance(colour: str) -> float:
    return sum(map(int, colour.removeprefix('rgb(').removesuffix(')').split(','))) / 3


def test_printed_pages_have_figures_and_no_controls(visit) -> None:
    opened = visit('klann', color_scheme='dark')
    opened.page.emulate_media(media='print')
    assert not opened.page.locator('#player').is_visible()
    assert opened.page.locator('#picture .leg').is_visible()
    assert opened.page.locator('#charts canvas').count() == 3
    assert not opened.page.locator('#accuracy canvas').first.is_visible()
    assert luminance(opened.page.evaluate(PAPER)) == 255
    assert opened.page.pdf().startswith(b'%PDF')


def test_every_chart_has_an_accessible_description(klann) -> None:
    labels = klann.page.locator('[role=img]').evaluate_all(
        '(nodes) => nodes.map((node) => node.getAttribute("aria-label"))'
    )
    assert any('gamma from -28.4' in (label or '') for label in labels)
    assert all(len(label or 'by its text') > 5 for label in labels)


def test_reduced_motion_has_no_smooth_scrolling(klann) -> None:
    style = 'getComputedStyle(document.documentElement).scrollBehavior'
    for preference, behaviour in (('reduce', 'auto'), ('no-preference', 'smooth')):
        klann.page.emulate_media(reduced_motion=preference)
        assert klann.page.evaluate(style) == behaviour


def test_the_player_covers_nothing(visit) -> None:
    opened = visit('klann')
    page = opened.page
    page.keyboard.press('PageDown')
    opened.until("document.getElementById('content').scrollTop > 100")
    content = page.locator('#content').bounding_box()
    player = page.locator('#player').bounding_box()
    assert content['y'] + content['height'] <= player['y'] + 1e-6
    assert player['y'] + player['height'] <= page.viewport_size['height']


def test_the_timing_begins_with_a_topic_that_has_one(visit) -> None:
    opened = visit('klann')
    opened.page.evaluate("""
        page.runs[0].topics = [
          { name: '/empty', intervals: { counts: [] }, latencies: { counts: [] } },
          ...page.runs[0].topics,
        ];
        document.getElementById('topic').replaceChildren();
        page.showTopics();
    """)
    assert opened.page.locator('#topic').input_value() != '/empty'
