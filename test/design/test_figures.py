"""The figures in bulk are those of the data sheet, and candidates differ in the solver."""

from klann_ros.datasheet import data_sheet
from klann_ros.design.evolve import scores
from klann_ros.design.figures import FIGURES, judge, sheet_figures
from klann_ros.design.requirements import requirements_from
from klann_ros.kinematics import LinkageLeg, shipped_linkage, turns_fully, Variants
from klann_ros.robot import Robot, RobotLeg
import numpy as np
import pytest

LOAD = 5.0


@pytest.mark.parametrize('name', ['klann', 'jansen', 'strider', 'trotbot', 'chebyshev_lambda'])
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
