"""The documentation's pages: examples that run, numbers that are right, two languages alike."""

from collections import Counter
from collections.abc import Iterator
from decimal import Decimal, localcontext
import doctest
import math
import os
from pathlib import Path
import re

from fork_server import called, PYTHON
import four_bar_equations
import klann_equations as equations
from klann_ros.kinematics import (
    foot_path,
    FourBar,
    klann_poses,
    KlannGeometry,
    KlannLeg,
    length_margins,
    NotConvergedError,
    reachable_arcs,
    shipped_linkage,
    tolerance_study,
    UnreachableError,
)
from klann_ros.kinematics.linkage.dyads import dyad_joint
import numpy as np
import pytest
from yaml_tables import read_table

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / 'docs'
ENGLISH, PORTUGUESE = DOCS / 'theory.md', DOCS / 'teoria.md'
PAGES = (ENGLISH, PORTUGUESE)
TEXT = ' '.join(ENGLISH.read_text(encoding='utf-8').split())
ALPHA = math.radians(60.0)
GUESS = np.radians([15.0, 60.0, 45.0, 60.0])
LEG = KlannLeg()
BARS = FourBar(180.0, 80.0, 200.0, 150.0)
NUMBER = r'(?<![\w.])-?\d+(?:\.\d+)?(?:e-\d+)?'


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf'(?ms)^```{language}\n(.*?)^```', page.read_text(encoding='utf-8'))


def displayed(page: Path) -> list[str]:
    return re.findall(r'(?ms)^\$\$\n(.*?)^\$\$\n', page.read_text(encoding='utf-8'))


def images(page: Path) -> list[str]:
    return re.findall(r'!\[[^\]]+\]\(([^)]+)\)', page.read_text(encoding='utf-8'))


def prose(page: Path) -> str:
    """Return a page without code, displayed formulas, images and references; decimal points."""
    text = re.split('(?m)^## Ref', page.read_text(encoding='utf-8'))[0]
    for skipped in (r'^```.*?^```', r'^\$\$\n.*?^\$\$', r'!\[[^\]]*\]\([^)]*\)'):
        text = re.sub(skipped, '', text, flags=re.DOTALL | re.MULTILINE)
    return re.sub(r'(?<=\d),(?=\d)', '.', text)


def tables(page: Path) -> Iterator[list[list[str]]]:
    for table in re.findall(r'(?:^\|.*\n)+', prose(page), re.MULTILINE):
        yield [[cell.strip() for cell in row.split('|')[1:-1]] for row in table.splitlines()]


def table(first: str, number: int = 0) -> list[list[float]]:
    """Return the numbers in each row of the table whose first row's name contains a text."""
    named_tables = [rows[2:] for rows in tables(ENGLISH) if first in rows[2][0]]
    numbers = []
    for _, *cells in named_tables[number]:
        plain = re.sub(r'\$[^$]*\$', '', ' '.join(cells))
        numbers.append([*map(float, re.findall(NUMBER, plain))])
    return numbers


def says(*texts: str) -> bool:
    """Return whether the English page has each of these texts."""
    return all(text in TEXT for text in texts)


# The pages themselves.


def test_the_examples_of_the_theory_run() -> None:
    source = '\n'.join(blocks(ENGLISH, 'python'))
    test = doctest.DocTestParser().get_doctest(source, {}, ENGLISH.name, str(ENGLISH), 0)
    result = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test)
    assert (result.failed, result.attempted > 25) == (0, True)


def test_the_portuguese_page_has_formulas_examples_and_figures_of_the_english_one() -> None:
    # The numerical methods of the program are in English only.
    extracts = (displayed, 0.7), (images, 0.7), (lambda page: blocks(page, 'python'), 0.2)
    for extract, share in extracts:
        english, portuguese = map(extract, PAGES)
        assert portuguese == [part for part in english if part in portuguese]
        assert len(portuguese) > share * len(english)


def test_the_portuguese_page_has_the_sections_of_the_courses() -> None:
    def sections(page: Path) -> list[str]:
        return re.findall(r'^(## (?:\d+\.|Ref))', page.read_text(encoding='utf-8'), re.MULTILINE)

    english, portuguese = map(sections, PAGES)
    assert english == [*(f'## {k}.' for k in range(1, 10)), '## Ref']
    assert portuguese == [*(f'## {k}.' for k in range(1, 8)), '## Ref']


@pytest.mark.parametrize('pattern', [NUMBER, r'\$[^$]+\$'], ids=['numbers', 'formulas'])
def test_each_number_and_formula_in_a_portuguese_sentence_is_in_an_english_one(
    pattern: str,
) -> None:
    # A sentence is put in another order in another language, and so are its formulas.
    english, portuguese = (Counter(re.findall(pattern, prose(page))) for page in PAGES)
    assert portuguese - english == Counter()
    assert portuguese.total() > 0.6 * english.total()


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_no_formula_is_taken_for_something_else(page: Path) -> None:
    # Markdown would make a list, a heading or an escaped mark of these.
    for line in ''.join(displayed(page)).splitlines():
        assert line
        assert not re.match(r'\s*([-+*>#=]\s|=+$|\d+\.)', line)
    assert re.findall(r'\\[,;!{}_*]', page.read_text(encoding='utf-8')) == []
    for paragraph in prose(page).split('\n\n'):
        assert paragraph.count('$') % 2 == 0, paragraph


def test_every_figure_is_made_and_small(tmp_path: Path) -> None:
    pytest.importorskip('matplotlib')
    done = called(
        PYTHON, DOCS / 'figures.py', tmp_path, environment=os.environ | {'MPLBACKEND': 'Agg'}
    )
    assert (done.returncode, done.stderr) == (0, '')
    names = {path.name for path in tmp_path.iterdir()}
    shown = {*images(ENGLISH), *images(DOCS / 'index.md'), *images(DOCS / 'python.md')}
    assert names <= shown
    # The others stand for interactive figures.
    plans = read_table(DOCS / 'interactive' / 'figures.yaml')
    assert {name.removesuffix('.png') for name in shown - names} <= {*plans}
    for path in [*tmp_path.iterdir(), *(DOCS / name for name in shown)]:
        assert path.stat().st_size <= 120_000, path


# The numbers in them, section by section.


def test_2_the_iterates_and_how_they_are_printed() -> None:
    rows = table(r'$\mathbf{x}_1$', 0)
    iterates = LEG.newton(ALPHA, GUESS)
    for row, exact in zip(rows[1:], iterates[1:], strict=False):
        as_printed = np.degrees(np.round(exact, 4))
        assert row == [*np.degrees(exact).round(4), *as_printed.round(4)]
    assert says('0.0057°', '0.1860 rad')
    assert round(math.degrees(1e-4), 4) == 0.0057
    assert round(iterates[-1][0], 4) == 0.1860


def test_2_errors_are_squared() -> None:
    klann = np.abs(LEG.newton(ALPHA, GUESS) - LEG.closed_form(ALPHA).x)
    four = np.abs(BARS.newton(ALPHA, np.radians([15, 80])) - BARS.closed_form(ALPHA).x)
    for errors in (klann[:, :2], klann[:, 2:], four):
        e = errors.max(axis=1)
        ratios = (e[1:] / np.maximum(e[:-1], 1e-300) ** 2)[e[1:] > 1e-15]
        assert len(ratios) >= 3
        assert all((ratios > 0.1) & (ratios < 1.2))


class Newton:
    """The leg's Newton-Raphson for many crank angles at once."""

    linkage = shipped_linkage('klann')
    starts = np.radians(np.arange(360.0))
    poses = tuple(LEG.closed_form(alpha) for alpha in starts)
    x = np.array([pose.x for pose in poses])
    x_1 = np.array([pose.coefficients for pose in poses])

    def corrections(self, step: float, order: int) -> tuple[np.ndarray, bool]:
        """Return how many corrections each start takes, and whether all are right."""
        alphas = self.starts + step
        x, spent = self.solve(alphas, self.x + order * step * self.x_1)
        right = klann_poses(LEG.geometry, alphas, angles=True).angles
        return spent, bool((np.abs(np.sin((x - right) / 2.0)) < 1e-9).all())

    def solve(self, alphas: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x = x.copy()
        spent = np.zeros(len(alphas), dtype=int)
        s = 1j * np.array(self.linkage.structure.senses)
        w, c = self.linkage.equations
        open_ = np.ones(len(alphas), dtype=bool)
        for _ in range(100):
            u = np.exp(s * np.column_stack([alphas, x])[open_])
            f = u @ w.T + c
            phi = (w * (s * u)[:, None, :])[:, :, 1:]
            phi = np.stack([phi.real, phi.imag], axis=2).reshape(-1, 4, 4)
            f = np.stack([f.real, f.imag], axis=2).reshape(-1, 4, 1)
            correction = np.linalg.solve(phi, f)[..., 0]
            x[open_] -= correction
            spent[open_] += 1
            open_[open_] = np.abs(correction).max(axis=1) > 1e-12
            if not open_.any():
                break
        x[open_] = np.nan
        return x, spent


def test_3_corrections_of_a_warm_start() -> None:
    steps = (0.1, 1.0, 5.0, 20.0)
    assert says('After 1° it takes 3.00 corrections in the mean, and the last pose 4.00')
    for order, row in enumerate([[3.28, 4.00, 4.81, 5.26], [2.43, 3.00, 3.69, 4.45]]):
        for step, mean in zip(steps, row, strict=True):
            spent, is_right = Newton().corrections(math.radians(step), order)
            assert is_right
            assert spent.mean() == pytest.approx(mean, abs=0.0101)


@pytest.mark.parametrize(('order', 'first'), [(0, 79), (1, 46)])
def test_3_the_first_step_that_leaves_the_branch(order: int, first: int) -> None:
    assert says(f'step of {first}°' if order == 0 else f'at {first}°')
    right = [Newton().corrections(math.radians(step), order)[1] for step in range(1, first + 1)]
    assert right == [True] * (first - 1) + [False]


def test_3_iterations_return_numbers_at_unreachable_angles() -> None:
    short = KlannLeg(KlannGeometry(l_bc=0.97 * 0.350))
    missing = {}
    for k in range(360):
        try:
            short.closed_form(math.radians(k))
        except UnreachableError as error:
            missing[k] = error.shortfall
    assert list(missing) == list(range(154, 178))
    assert says('the 24 whole degrees from 154 to 177')
    assert says(f'{1e3 * min(missing.values()):.2f} to {1e3 * max(missing.values()):.2f} mm')
    for k, shortfall in missing.items():
        with pytest.raises(NotConvergedError) as caught:
            short.newton(math.radians(k), GUESS, max_iterations=20)
        last = caught.value.iterates[-1]
        assert np.isfinite(last).all()
        f = equations.f(short.geometry, math.radians(k), last)
        assert math.hypot(f[0], f[1]) >= shortfall


def test_4_the_product_form_keeps_its_digits() -> None:
    heights = [14.1, 0.447, 0.0141, 0.000447]  # [mm]
    naive = [7e-14, 5e-11, 6e-9, 3e-5]
    gaps = [10.0**-k for k in (3, 6, 9, 12)]
    for gap, height, naive_error in zip(gaps, heights, naive, strict=True):
        p, q, d = 0.35, 0.14, 0.49 - gap
        with localcontext() as context:
            context.prec = 50
            r, s, e = Decimal(p), Decimal(q), Decimal(d)
            exact = ((r + s - e) * (e - r + s) * (e + r - s) * (e + r + s)).sqrt() / (2 * e)
            _, y = dyad_joint((0.0, 0.0), (d, 0.0), p, q, 1)
            assert abs(Decimal(y) / exact - 1) < Decimal('3e-16')
            a = (d * d + p * p - q * q) / (2 * d)
            error = float(abs(Decimal(math.sqrt(p * p - a * a)) / exact - 1))
        assert float(f'{1e3 * float(exact):.3g}') == height
        assert float(f'{error:.0e}') == naive_error


def test_4_the_four_assemblies() -> None:
    assert reachable_arcs(KlannGeometry(assembly=(1, -1))) == [(0.0, 2 * math.pi)]
    for assembly in ((-1, 1), (-1, -1)):
        arcs = reachable_arcs(KlannGeometry(assembly=assembly))
        share = sum(end - start for start, end in arcs) / math.tau
        assert says(f'{100 * share:.1f} % of the turn')
    guesses = np.random.default_rng(0).uniform(-math.pi, math.pi, (1000, 4))
    x, _ = Newton().solve(np.full(1000, ALPHA), guesses)
    x = x[~np.isnan(x[:, 0])]
    signs = Counter(zip(np.sin(x[:, 0] + x[:, 1]) > 0, np.sin(x[:, 2] + x[:, 3]) > 0, strict=True))
    assert [0.2 < count / len(x) < 0.3 for count in signs.values()] == [True] * 4


def test_4_the_last_digit_near_the_limit() -> None:
    short = KlannLeg(KlannGeometry(l_bc=0.97 * 0.350))
    alpha = short.reachable_arcs()[0][0] + 1e-9
    slope = math.hypot(*short.velocity(short.closed_form(alpha), 1.0).h)
    assert slope == pytest.approx(1930.0, abs=5.0)
    assert slope * math.ulp(alpha) == pytest.approx(9e-13, abs=0.5e-13)


def test_5_the_coefficients_of_the_first_loop() -> None:
    g = LEG.geometry
    for k in range(0, 360, 7):
        pose = LEG.closed_form(math.radians(k))
        across = math.sin(pose.gamma + pose.beta)
        expected = (
            g.l_ab * math.sin(pose.beta - pose.alpha) / (g.l_bc * across),
            g.l_ab * math.sin(pose.gamma + pose.alpha) / (g.l_dc * across),
        )
        assert pose.coefficients[:2] == pytest.approx(expected, abs=1e-13)


def test_5_the_extremes_over_the_turn() -> None:
    poses = [LEG.closed_form(math.radians(k / 10)) for k in range(3600)]
    mu = np.degrees([pose.transmission_angles for pose in poses]).T
    conditions = np.array([pose.condition for pose in poses])
    for row, curve in zip(table(r'$\mu_1$'), (*mu, conditions), strict=True):
        k, m = curve.argmin(), curve.argmax()
        assert row == [round(curve[k], 2), k / 10, round(curve[m], 2), m / 10]
    nearest = min(poses, key=lambda pose: pose.distance_to_singularity)
    assert round(1e3 * nearest.distance_to_singularity, 2) == 8.61
    assert round(math.degrees(nearest.alpha), 1) == 165.6
    _, b, _, d, *_ = nearest.points.tolist()
    assert round(1e3 * math.dist(b, d), 2) == 481.39
    assert says('8.61 mm, at $\\alpha$ = 165.6°, where BD has 481.39 of 490 mm')


def test_6_the_foot_paths() -> None:
    rows = np.array([row for row in table('stride') if len(row) == 2]).T
    crank = next(row for row in table('stride') if len(row) == 4)
    for k, geometry in enumerate((KlannGeometry.sem104(), KlannGeometry.patent())):
        path = foot_path(KlannLeg(geometry))
        stance = path.stance()
        unit, places = (1e3, 2) if k == 0 else (1.0, 4)
        assert rows[k].tolist() == [
            round(unit * path.stride, places),
            round(unit * path.lift, places),
            round(stance.duty_factor, 3),
            round(stance.straightness, 4),
            round(stance.ripple, 3),
        ]
        ends = np.degrees([stance.start, stance.end]).round(2).tolist()
        on_ground = (path.alphas - stance.start) % math.tau <= stance.end - stance.start
        speeds = np.hypot(*path.h_1.T)
        assert speeds[on_ground].mean() < speeds[~on_ground].mean()
        assert np.reshape(crank, (2, 2))[k].tolist() == ends


def test_6_the_margins() -> None:
    margins = length_margins(LEG.geometry)
    # Value, least and greatest [mm], and both margins [%].
    rows = {
        'l_bc': [350, 341.386, 381.386, -2.46, 8.97],
        'x_d': [350, 317.490, 358.887, -9.29, 2.54],
        'l_dc': [140, 131.386, 495.781, -6.15, 254.13],
        'l_ab': [120, 0, 128.614, -100.00, 7.18],
        'l_fg': [360, 280.030, 557.533, -22.21, 54.87],
    }
    for name, row in rows.items():
        margin = margins[name]
        lengths = 1e3 * np.array([margin.value, margin.least, margin.greatest])
        expected = [*lengths.round(3), *100 * np.array(margin.relative)]
        assert row == pytest.approx(expected, abs=5e-3)
    assert says('481.386', '8.614 mm')
    free = ('l_gh', 'angle_bcg', 'angle_fgh')
    assert [margins[name].greatest for name in free] == [math.inf] * 3
    # No other number has less than the dyad BC, DC.
    by_change = sorted(margins, key=lambda name: min(map(abs, margins[name].changes)))
    assert {*by_change[:3]} == {'l_ab', 'l_bc', 'l_dc'}


@pytest.mark.slow
def test_6_the_tolerances() -> None:
    coarse = tolerance_study(LEG.geometry, 0.02, samples=20000, crank_angles=36)
    assert says(f'{100 * coarse.non_turning_fraction:.2f} % of 20000 legs')
    fine = tolerance_study(LEG.geometry, 0.001, samples=2000)
    assert fine.non_turning_fraction == 0.0
    assert says(f'{1e3 * fine.p95.max():.2f} mm')
    ranking = fine.ranking[:2]
    assert [name for name, _ in ranking] == ['l_bc', 'l_cg']
    assert says(*(f'by {1e3 * shift:.2f} mm' for _, shift in ranking))


def test_7_example_1() -> None:
    pose = BARS.closed_form(ALPHA)
    alpha = math.degrees(math.acos((pose.z**2 + 150.0**2 - 200.0**2) / (2 * pose.z * 150.0)))
    beta = math.degrees(math.acos((pose.z**2 + 180.0**2 - 80.0**2) / (2 * pose.z * 180.0)))
    assert says(f'$Z$ = {pose.z:.2f}', f'$\\mu$ = {math.degrees(pose.transmission_angle):.2f}°')
    assert says(f'$\\alpha$ = {alpha:.2f}°', f'$\\beta$ = {beta:.2f}°')
    assert says(f'$\\theta_4$ = {math.degrees(pose.theta4):.2f}° or 235.20°')


def test_7_example_2() -> None:
    iterates = np.degrees(BARS.newton(ALPHA, np.radians([15.0, 80.0])))
    exact = [
        [21.81424, 71.86198],
        [21.55780, 72.13721],
        [21.55763, 72.13765],
        [21.55763, 72.13765],
    ]
    assert iterates[1:5].round(5).tolist() == exact
    # The first two rows come out with corrections of 4 decimals, each printed to 3 decimals.
    x = np.array([15.0, 80.0])
    for printed in ([21.812, 71.864], [21.560, 72.139]):
        f = four_bar_equations.f(BARS.geometry, ALPHA, np.radians(x))
        correction = np.linalg.solve(four_bar_equations.phi(BARS.geometry, np.radians(x)), f)
        x = (x - np.degrees(correction.round(4)).round(3)).round(3)
        assert printed == x.tolist()


def test_7_the_last_digits_of_example_2() -> None:
    printed, exact = np.array([21.5576353, 72.1376951]), np.degrees(BARS.closed_form(ALPHA).x)
    off = printed - exact
    assert (f'{off[0]:.7f}', f'{off[1]:.7f}') == ('0.0000004', '0.0000446')
    assert says('0.0000446°')
    # The slip: 0.00000086 rad are 0.0000493 deg, and a tenth of that has been subtracted.
    assert f'{math.degrees(0.00000086):.7f}' == '0.0000493'
    assert round(72.1377 - 0.0000049, 7) == printed[1]
    full = four_bar_equations.f(BARS.geometry, ALPHA, np.radians(printed))
    cut = four_bar_equations.f(BARS.geometry, ALPHA, np.radians([21.55764, 72.13769]))
    assert [round(full[0], 6), *cut.round(6)] == [-0.000111, -0.000092, 0.000015]


def test_7_dead_points_and_limits() -> None:
    limits = BARS.rocker_limits
    assert BARS.dead_points('crank') == []
    assert says(f'$\\theta_4$ = {math.degrees(limits.stretched.angle):.2f}° (stretched out)')
    assert says(f'{math.degrees(limits.folded.angle):.2f}° (folded)')
    assert says(f'a swing of {math.degrees(limits.swing):.2f}°')
    triple = FourBar(180.0, 120.0, 130.0, 140.0)
    crank = [round(math.degrees(point.angle), 2) for point in triple.dead_points()]
    assert (triple.grashof.class_, crank) == ('II', [-127.17, 127.17])
    (rocker,) = triple.dead_points('rocker')
    (mirrored,) = FourBar(180.0, 120.0, 130.0, 140.0, -1).dead_points('rocker')
    angles = [round(math.degrees(point.angle), 2) for point in (mirrored, rocker)]
    assert angles == [-77.98, 77.98]
    assert says("one of each assembly; `dead_points('rocker')` returns that of its own")
    assert says('±127.17°', '±77.98°', f'it is {BARS.mechanical_advantage(ALPHA):.2f} at 60°')


def test_7_exercises() -> None:
    lengths = (300.0, 100.0, 250.0, 200.0)
    rows = (
        [239.945, 63.3035, 30.9915, 94.2950, 294.7300, 231.4265],
        [264.575, 71.0344, 26.5278, 97.5622, 295.2590, 224.2246],
    )
    for degrees, row in zip((45, 60), rows, strict=True):
        pose = FourBar(*lengths).closed_form(math.radians(degrees))
        mirrored = FourBar(*lengths, -1).closed_form(math.radians(degrees))
        angles = np.degrees([pose.transmission_angle, *pose.x, *mirrored.x]) % 360.0
        assert row == [round(pose.z, 3), *angles.round(4)]


def test_7_the_two_discs() -> None:
    discs = FourBar(500.0, 100.0, 500.0, 120.0)
    limits = discs.rocker_limits
    assert says(f'swings by {math.degrees(limits.swing):.2f}°')
    ends = [math.degrees(end.angle) for end in (limits.stretched, limits.folded)]
    assert says('from {:.2f}° to {:.2f}°'.format(*ends))
    for alpha in np.radians(range(360)).tolist():
        differences = np.subtract(discs.solve(alpha).x, discs.closed_form(alpha).x)
        assert max(abs(math.remainder(angle, math.tau)) for angle in differences) < 1e-14


def test_8_the_loop_equations_of_the_klann_leg() -> None:
    g, (w, c) = LEG.geometry, Newton.linkage.equations
    bend = np.exp(1j * g.angle_bcg)
    expected = [[g.l_ab, g.l_bc, -g.l_dc, 0, 0], [0, -g.l_cg * bend, -g.l_dc, g.l_ef, g.l_fg]]
    np.testing.assert_allclose(w, expected, rtol=0, atol=1e-15)
    constants = [-g.x_d + 1j * g.y_a, g.x_e - g.x_d + 1j * g.y_e]
    np.testing.assert_allclose(c, constants, rtol=0, atol=1e-15)
