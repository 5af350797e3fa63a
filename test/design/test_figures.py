"""The figures in bulk are those of the data sheet, and candidates differ in the solver."""

from itertools import combinations

from hypothesis import given, Phase, settings, strategies as st
from klann_ros.datasheet import data_sheet, Motor
from klann_ros.design.evolve import scores
from klann_ros.design.figures import FIGURES, judge, sheet_figures
from klann_ros.design.requirements import requirements_from
from klann_ros.kinematics import Linkage, LinkageLeg, shipped_linkage, turns_fully, Variants
from klann_ros.kinematics.foot.stance import narrowest_strips
from klann_ros.robot import Robot, RobotLeg
import numpy as np
import pytest

LOAD = 5.0
OF_TASKS = {name for name, kind in FIGURES.items() if kind.needs not in {'', 'load', 'motor'}}


@pytest.mark.slow
@pytest.mark.parametrize('name', ['klann', 'jansen', 'chebyshev_lambda'])
def test_figures_in_bulk_are_those_of_the_data_sheet(name: str) -> None:
    legs = variants(name, 0.03, 12)
    judged = judge(legs, frozenset(FIGURES), LOAD)
    assert len(judged.figures) > 15
    turning_legs = np.flatnonzero(judged.turns).tolist()
    assert len(turning_legs) > 5
    i = turning_legs[0]
    sheet = data_sheet(Robot('leg', (RobotLeg('', legs[i]),)), load=LOAD, samples=360)
    reported = sheet_figures(sheet, legs[i])
    for figure, of_legs in judged.figures.items():
        assert of_legs[i] == pytest.approx(reported[figure], rel=2e-3), figure


def test_a_candidate_turns_where_its_leg_does() -> None:
    legs = variants('klann', 0.2, 60)
    turns = judge(legs, frozenset()).turns
    assert 5 < np.count_nonzero(turns) < 55
    for i in range(60):
        assert bool(turns[i]) == turns_fully(legs[i])


def test_different_candidates_are_different_geometries_in_the_solver() -> None:
    requirements = requirements_from(
        {'linkage': 'klann', 'vary': 1, 'figures': {'lift': 'maximize'}}
    )
    (space,) = requirements.spaces
    x = np.random.default_rng(1).uniform(size=(8, len(space.names)))
    lifts = scores(requirements, space, x).figures['lift']
    assert len(set(lifts.tolist())) == 8
    alphas = np.linspace(0.0, 6.0, 200)
    for i in range(8):
        leg = LinkageLeg(space.variants(x)[i])
        y = [leg.closed_form(alpha).h[1] for alpha in alphas.tolist()]
        assert np.ptp(y) == pytest.approx(lifts[i], rel=1e-2)


def variants(name: str, spread: float, count: int) -> Variants:
    linkage = shipped_linkage(name)
    random = np.random.default_rng(3)
    changes = {
        dimension: value * random.uniform(1.0 - spread, 1.0 + spread, count)
        for dimension, value in linkage.dimensions.items()
    }
    return Variants(linkage, changes)


# What a rotation of the linkage changes: the ground, and with it the stance, stays level.
LEVEL = {
    *('stride', 'lift', 'duty_factor', 'ground_covered', 'deviation', 'minimax_deviation'),
    *('straightness', 'ripple', 'advance', 'step_height', 'ground_clearance', 'width', 'height'),
    *('torque_peak', 'torque_range', 'motor_margin'),
}
MOTOR = Motor(stall_torque=2.0, no_load_speed=100.0, gear_ratio=1.0, efficiency=1.0)


def figures_of(linkage: Linkage, speed: float = 6.0) -> dict[str, float]:
    """Return the figures of a leg by its data sheet, then in bulk."""
    robot = Robot('leg', (RobotLeg('', linkage),))
    sheet = data_sheet(robot, speed=speed, load=LOAD, motor=MOTOR, margins=True, samples=360)
    bulk = judge(Variants(linkage, {}), frozenset(FIGURES), LOAD).figures
    figures = {f'{name} in bulk': float(column[0]) for name, column in bulk.items()}
    return {**sheet_figures(sheet, linkage), **figures}


@pytest.fixture(scope='module', params=['klann', 'hoecken'])
def reference(request: pytest.FixtureRequest) -> tuple[Linkage, dict[str, float]]:
    linkage = shipped_linkage(request.param)
    figures = figures_of(linkage)
    names = {name.removesuffix(' in bulk') for name in figures}
    assert names == FIGURES.keys() - OF_TASKS
    return linkage, figures


@pytest.mark.slow
@settings(max_examples=3, phases=[Phase.explicit, Phase.generate])
@given(st.sampled_from([0.01, 1.0, 30.0]), st.integers(-3, 3), st.integers(-3, 3), st.booleans())
def test_a_figure_depends_on_no_origin_unit_or_side(
    reference: tuple[Linkage, dict[str, float]], scale: float, x: int, y: int, is_mirrored: bool
) -> None:
    linkage, figures = reference
    # A mirror in the vertical: in the horizontal, and half a turn.
    image = linkage.mirrored().moved(-scale) if is_mirrored else linkage.moved(scale)
    # The crank of a mirror image turns the other way.
    speed = -6.0 if is_mirrored else 6.0
    moved_figures = figures_of(image.moved(1.0, complex(x, y)), speed)
    assert moved_figures.keys() == figures.keys()
    for name, figure in figures.items():
        unit = FIGURES[name.removesuffix(' in bulk')].unit
        exponent = {'m': 1, 'N m': 1}.get(unit, -1 if name == 'motor_margin' else 0)
        # Crank angles of samples differ in a mirror image.
        tolerance = 2e-3 if 'bulk' in name or 'torque' in name or 'motor' in name else 1e-6
        wanted = scale**exponent * figure
        assert moved_figures[name] == pytest.approx(wanted, rel=tolerance, abs=1e-6 * scale), name


@pytest.mark.slow
@pytest.mark.parametrize('angle', [0.4, -2.0])
def test_a_figure_of_the_mechanism_alone_does_not_depend_on_its_attitude(
    reference: tuple[Linkage, dict[str, float]], angle: float
) -> None:
    linkage, figures = reference
    turned_figures = figures_of(linkage.moved(np.exp(1j * angle), 2.0 - 1.0j))
    for name in figures.keys() - {*LEVEL, *(f'{name} in bulk' for name in LEVEL)}:
        # The worst angle is sampled.
        tolerance = 2e-3 if 'bulk' in name else 1e-5
        assert turned_figures[name] == pytest.approx(figures[name], rel=tolerance), name


def test_the_margin_of_sem_104_is_that_of_bar_bc_in_its_longest_link() -> None:
    # The note to the course: shortening BC = 350 mm by more than 2.46 % loses the full turn.
    linkage = shipped_linkage('klann')
    assert figures_of(linkage)['margin'] == pytest.approx(0.0246 * 0.350 / linkage.size, rel=2e-3)


def test_the_minimax_line_is_no_farther_than_the_least_squares_line() -> None:
    legs = variants('strider', 0.03, 8)
    judged = judge(legs, frozenset(FIGURES))
    turning_legs = np.flatnonzero(judged.turns)
    minimax = judged.figures['minimax_deviation'][turning_legs]
    least_squares = judged.figures['deviation'][turning_legs]
    assert (minimax < least_squares).all()
    assert (minimax > 0.4 * least_squares).all()


@pytest.mark.parametrize('count', [3, 4, 9, 40])
def test_the_narrowest_strip_is_the_width_of_the_convex_hull(count: int) -> None:
    points = np.random.default_rng(count).normal(size=(5, count, 2)) * [1.0, 0.1]
    half_widths, angles = narrowest_strips(points[..., 0], points[..., 1])
    for row, half_width, angle in zip(points, half_widths, angles, strict=True):
        # A side of the narrowest strip is an edge of the hull: a line through two points.
        normals = [(q - p) @ [[0.0, -1.0], [1.0, 0.0]] for p, q in combinations(row, 2)]
        widths = [np.ptp(row @ normal) / np.hypot(*normal) for normal in normals]
        assert half_width == pytest.approx(min(widths) / 2.0, rel=1e-8)
        assert np.ptp(row @ [-np.sin(angle), np.cos(angle)]) == pytest.approx(2.0 * half_width)
