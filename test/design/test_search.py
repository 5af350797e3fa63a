"""A search: what it returns is proven, repeatable, and resumed where it ended."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
import re
import sys

from klann_ros.datasheet import data_sheet
from klann_ros.design import refine, requirements_from, search, SearchResult, State
from klann_ros.design.evolve import evolve, pareto_front, Scores, scores as evaluated
from klann_ros.design.figures import FIGURES, judge, Judgement, sheet_figures
from klann_ros.design.leg_file import leg_text, parameter_text, with_numbers
from klann_ros.design.search import failing_figures, IslandScores
from klann_ros.gait import walk_figures
from klann_ros.kinematics import linkage_poses, shipped_linkage, turns_fully, Variants
from klann_ros.robot import robot_from_file
import numpy as np
import pytest

TOY = {
    'linkage': ['klann', 'jansen'],
    'units': {'length': 'mm', 'angle': 'deg'},
    'figures': {
        'stride': 'maximize',
        'deviation': 'minimize',
        'transmission_angle': {'at_least': 20},
        'duty_factor': {'at_least': 0.3},
    },
    'walker': {'legs': 8},
    'count': 3,
}


@pytest.fixture(scope='module')
def design() -> SearchResult:
    return search(requirements_from(TOY), evaluations=960)


def test_every_leg_closes_all_round_in_one_assembly_mode(design: SearchResult) -> None:
    alphas = np.linspace(0.0, 2.0 * np.pi, 20_000)
    assert len(design.legs) >= 2
    for leg in design.legs:
        poses = linkage_poses(leg.linkage, alphas, transmission_angles=True)
        assert not poses.reason.any()
        assert poses.transmission_angles is not None
        assert np.sin(poses.transmission_angles).min() > np.sin(np.radians(19.9))
        # A change of branch would be a jump.
        step = np.linalg.norm(np.diff(poses.h, axis=0), axis=1)
        assert step.max() < 1e-2 * leg.reached['stride']
        assert 0.0 <= leg.non_turning_fraction <= 1.0
        assert leg.margins


@pytest.mark.slow
def test_the_figures_are_those_of_describe(design: SearchResult, tmp_path: Path) -> None:
    for leg in design.legs[:2]:
        file = tmp_path / 'leg.yaml'
        file.write_text(leg_text(leg.leg))
        robot = robot_from_file(file)
        sheet = data_sheet(robot, samples=360)
        reported = sheet_figures(sheet, robot.legs[0].linkage)
        for name in ('stride', 'lift', 'deviation', 'duty_factor', 'transmission_angle'):
            assert leg.reached[name] == pytest.approx(reported[name], rel=1e-9)
        for name, value in leg.expected.items():
            assert leg.reached[name] == pytest.approx(value, rel=2e-3)


def test_no_leg_dominates_another(design: SearchResult) -> None:
    table = [(-leg.reached['stride'], leg.reached['deviation']) for leg in design.legs]
    assert table == sorted(table)
    assert len(pareto_front(np.array(table))) == len(table)


def test_a_walker_of_a_leg_walks_forward(design: SearchResult, tmp_path: Path) -> None:
    leg = design.legs[0]
    assert leg.walker is not None
    file = tmp_path / 'walker.yaml'
    file.write_text(parameter_text(leg.walker))
    walk = walk_figures(robot_from_file(file))
    assert walk.speed > 0.0
    assert walk.stable_fraction > 0.9
    assert leg.reached['speed'] == pytest.approx(walk.speed * 2.0 * np.pi)


def test_another_seed_gives_other_legs_and_is_not_resumed() -> None:
    requirements = requirements_from({'linkage': 'four_bar', 'count': 1})
    first = search(requirements, evaluations=480, seed=0)
    second = search(requirements, evaluations=480, seed=1)
    assert first.legs[0].linkage != second.legs[0].linkage
    with pytest.raises(ValueError, match='other requirements or another seed'):
        search(replace(requirements, text='other'), state=first.state)


@pytest.mark.parametrize(
    ('damage', 'reason'),
    [
        ({'populations': (None, None, None, np.full((3, 2), 0.5))}, 'population 3'),
        ({'populations': (np.full((3, 14), np.nan), None, None, None)}, 'population 0'),
        ({'populations': (np.full((1, 14), 1.5), None, None, None)}, 'population 0'),
        ({'populations': (np.empty((0, 0)),) * 4}, 'a count or a population'),
        ({'evaluations': -1}, 'a count'),
        ({'rounds': -1}, 'a count'),
        ({'frame': ((0.0, 0.0),)}, 'its frame'),
        ({'hypervolumes': (np.inf,)}, 'a hypervolume'),
    ],
)
def test_a_damaged_state_is_refused(damage: Mapping[str, object], reason: str) -> None:
    requirements = requirements_from({'linkage': 'klann'})
    state = State('key', 0, 0, (None,) * 4)
    state.check(requirements, 'key')
    with pytest.raises(ValueError, match=f'{reason}.* is damaged'):
        state._replace(**damage).check(requirements, 'key')


def searched(content: Mapping[str, object]) -> SearchResult:
    return search(requirements_from(content), evaluations=480)


@pytest.mark.parametrize('aims', [1, 2])
@pytest.mark.parametrize('evaluations', [10, 500])
def test_as_many_candidates_are_judged_as_are_allowed_and_reported(
    aims: int, evaluations: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = sys.modules[evolve.__module__]
    counts = []

    def count_and_judge(variants: Variants, *arguments: object) -> Judgement:
        # Proven legs are judged alone.
        counts.append(len(variants) if len(variants) > 1 else 0)
        return judge(variants, *arguments)

    monkeypatch.setattr(module, 'judge', count_and_judge)
    figures = dict([('stride', 'maximize'), ('lift', 'maximize')][:aims])
    requirements = requirements_from({'linkage': 'four_bar', 'figures': figures, 'count': 1})
    search_result = search(requirements, evaluations=evaluations)
    assert sum(counts) == search_result.state.evaluations
    assert sum(counts) <= max(evaluations, 80)
    assert sum(counts) > 0.9 * evaluations
    assert search_result.proven >= len(search_result.legs)


@pytest.mark.slow
def test_requirements_that_no_leg_fulfils_name_the_figure_and_by_how_much() -> None:
    figures = {'stride': {'at_least': 900}, 'lift': {'at_least': 100}}
    units = {'length': 'mm'}
    without_legs = searched({'linkage': 'klann', 'units': units, 'vary': 5, 'figures': figures})
    assert without_legs.legs == ()
    (reason,) = without_legs.reasons
    best = re.fullmatch(r'stride at least 900 mm: best ([\d.]+) mm', reason)
    assert best is not None
    assert 550.0 < float(best[1]) < 900.0


def test_limits_that_hold_alone_but_not_together_are_named_with_both_figures() -> None:
    requirements = requirements_from(
        {'linkage': 'klann', 'figures': {'lift': {'at_least': 3}, 'stride': {'at_most': 4}}}
    )
    columns = {'lift': np.array([3.5, 2.9, np.nan]), 'stride': np.array([6.0, 4.1, 3.0])}
    scores = Scores(np.zeros((3, 1)), np.array([[0.0, 0.5, 0.5]] * 3), columns)
    reasons = failing_figures(requirements, [IslandScores(0, np.zeros((3, 1)), scores)])
    assert reasons == [
        'lift at least 3 m: best 2.9 m beside the other limits, 3.5 m alone',
        'stride at most 4 m: best 4.1 m beside the other limits, 3 m alone',
    ]


def test_a_candidate_that_jams_never_beats_one_that_turns() -> None:
    path = {'points': [[0, 0], [1e-3, 0], [0, 1e-3]]}
    limits = {
        'stride': {'at_least': 1e4},
        'duty_factor': {'at_most': 0},
        'lift': {'at_most': 1e-9},
    }
    figures = {**limits, 'path_error': {'at_most': 1e-9}, 'height': 'minimize'}
    requirements = requirements_from(
        {'linkage': 'klann', 'units': {'length': 'm'}, 'path': path, 'figures': figures}
    )
    (space,) = requirements.spaces
    x = space.sample(np.random.default_rng(0), 60)
    turns = judge(space.variants(x), frozenset()).turns
    assert 5 < np.count_nonzero(turns) < 55
    order = evaluated(requirements, space, x).order
    assert turns[order].tolist() == sorted(turns, reverse=True)


@pytest.mark.slow
@pytest.mark.parametrize('timing', ['free', 'prescribed'])
def test_a_limit_of_the_path_is_judged_after_refinement(
    timing: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(refine, 'MAX_STEPS', 15)
    monkeypatch.setattr(sys.modules[search.__module__], 'REFINED_CANDIDATES', 2)
    alphas = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    drawn = shipped_linkage('four_bar')
    points = 1e3 * linkage_poses(drawn, alphas).h
    points += np.random.default_rng(1).normal(size=points.shape)
    content: dict[str, object] = {'linkage': 'four_bar', 'units': {'length': 'mm'}, 'count': 1}
    content['path'] = {'points': points.tolist(), 'timing': timing}
    (leg,) = searched(content).legs
    attainable = 1e3 * leg.reached['path_error']
    reached = searched({**content, 'figures': {'path_error': {'at_most': 2.0 * attainable}}})
    assert len(reached.legs) == 1
    limit = 0.1 * attainable
    missed = searched({**content, 'figures': {'path_error': {'at_most': limit}}})
    (reason,) = missed.reasons
    assert reason.startswith(f'path_error at most {limit:.4g} mm: best ')
    assert float(reason.split()[-2]) < 2.0 * attainable


@pytest.mark.slow
@pytest.mark.parametrize('path', [{}, {'path': {'file': 'jansen_path.csv'}}])
def test_a_candidate_outside_of_its_limits_is_refined_into_them(
    path: Mapping[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(refine, 'MAX_STEPS', 30)
    figures = {'transmission_angle': {'at_least': 28}, 'bar_ratio': {'at_most': 3.3}}
    units = {'length': 'mm', 'angle': 'deg'}
    folder = Path(__file__).parents[2] / 'examples' / 'requirements'
    content = {'linkage': 'klann', 'units': units, 'vary': 30, 'figures': figures, **path}
    requirements = requirements_from(content, folder)
    (space,) = requirements.spaces
    (x,) = space.sample(np.random.default_rng(0), 1)
    drawn = evaluated(requirements, space, x[None])
    assert drawn.total[0] > 0.0
    reached = refine.leg_figures(requirements, refine.refined(requirements, space, x))
    assert reached['transmission_angle'] > np.radians(28)
    assert reached['bar_ratio'] < 3.3
    if path:
        assert reached['path_error'] < drawn.figures['path_error'][0]


def test_a_search_without_turning_legs_is_reported() -> None:
    none = searched({'linkage': 'klann', 'vary': {'B-C': [0.2, 0.22]}})
    assert none.legs == ()
    assert none.reasons[0].startswith('no candidate turns fully')


@pytest.mark.slow
@pytest.mark.parametrize('linkage', ['klann', 'slider_crank'])
def test_every_figure_that_no_leg_has_is_named_with_its_shortfall(linkage: str) -> None:
    names = []
    for name, kind in FIGURES.items():
        if not kind.is_costly and kind.needs in {'', 'load'}:
            names.append(name)
    limits = {name: {'at_least': min(1e4, 0.999 * FIGURES[name].max_value)} for name in names}
    units = {'length': 'm'}
    none = searched({'linkage': linkage, 'units': units, 'vary': 5, 'load': 1, 'figures': limits})
    assert not none.legs
    assert [reason.split()[0] for reason in none.reasons] == names
    assert 'nan' not in ' '.join(none.reasons)


@pytest.mark.slow
@pytest.mark.parametrize(
    'content',
    [
        # Two pivots on one another.
        {'linkage': 'four_bar', 'vary': 30, 'tie': {'O4.x': 'O2.x', 'O4.y': 'O2.y'}},
        # A crank that vanishes, and lengths of nearly nothing.
        {'linkage': 'klann', 'vary': {'A-B': [1e-9, 0.12]}},
        {'linkage': 'klann', 'scale': [1e-9, 1e-8]},
        # No lift, and a foot on a line.
        {'linkage': 'scotch_yoke'},
        {'linkage': 'peaucellier'},
    ],
)
def test_degenerate_linkages_give_legs_or_reasons(content: Mapping[str, object]) -> None:
    search_result = searched({**content, 'count': 1})
    assert search_result.legs or search_result.reasons
    for leg in search_result.legs:
        alphas = np.linspace(0.0, 2.0 * np.pi, 2000)
        assert not linkage_poses(leg.linkage, alphas).reason.any()


def test_a_hidden_leg_is_recovered_from_its_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refine, 'MAX_STEPS', 20)
    monkeypatch.setattr(sys.modules[search.__module__], 'REFINED_CANDIDATES', 4)
    drawn = shipped_linkage('klann')
    random = np.random.default_rng(2)
    changes = {n: v * random.uniform(0.95, 1.05, 1) for n, v in drawn.dimensions.items()}
    h = linkage_poses(Variants(drawn, changes), np.linspace(0.0, 6.28, 300)).h[0]
    turned = h @ (1.0, 1j) * 2.0 * np.exp(0.5j) + 1.0
    points = [[z.real, z.imag] for z in turned.tolist()]
    requirements = requirements_from(
        {
            'linkage': 'klann',
            'vary': 10,
            'path': {'points': points},
            'figures': {'lift': {'at_least': 0.1}, 'transmission_angle': {'at_least': 0.1}},
            'count': 1,
        }
    )
    (leg,) = search(requirements, evaluations=1440).legs
    assert requirements.target is not None
    assert leg.reached['path_error'] < 1e-3 * requirements.target.size
    # The search judges the leg that is written, twice as large as the candidate.
    for name in ('lift', 'transmission_angle'):
        assert leg.expected[name] == pytest.approx(leg.reached[name], rel=2e-3)
    foot = linkage_poses(leg.linkage, np.linspace(0.0, 6.28, 300)).h @ (1.0, 1j)
    nearest = np.abs(foot[:, None] - turned).min(axis=0)
    assert nearest.max() < 2e-2 * requirements.target.size


def test_a_leg_that_slides_is_found_and_read_back(tmp_path: Path) -> None:
    (leg,) = searched({'linkage': 'slider_crank', 'vary': 3, 'count': 1}).legs
    file = tmp_path / 'leg.yaml'
    file.write_text(leg_text(leg.leg))
    assert robot_from_file(file).legs[0].linkage == leg.linkage


def test_a_candidate_with_coupled_loops_turns_and_is_read_back(tmp_path: Path) -> None:
    # Not proven: its margins take 15 s.
    (space,) = requirements_from({'linkage': 'stephenson', 'vary': 3}).spaces
    variants = space.variants(space.sample(np.random.default_rng(0), 20))
    turning = np.flatnonzero(judge(variants, frozenset()).turns)
    leg = with_numbers(space.leg, variants[int(turning[-1])])
    file = tmp_path / 'leg.yaml'
    file.write_text(leg_text(leg))
    assert robot_from_file(file).legs[0].linkage == leg.linkage
    assert turns_fully(leg.linkage)


def test_the_front_is_that_of_all_pairs() -> None:
    losses = np.random.default_rng(0).uniform(size=(60, 3)).round(1)
    front = pareto_front(losses).tolist()
    for i, loss in enumerate(losses):
        is_dominated = ((losses <= loss).all(axis=1) & (losses < loss).any(axis=1)).any()
        has_equal_in_front = (losses[front] == loss).all(axis=1).any()
        assert has_equal_in_front != is_dominated
        assert not (i in front and is_dominated)


@pytest.mark.parametrize('lifts', [[], [0.3]])
def test_a_figure_without_a_value_is_a_reason_in_words(lifts: list[float]) -> None:
    requirements = requirements_from({'linkage': 'klann', 'figures': {'lift': {'at_least': 0.5}}})
    violations = np.array([[0.0, 1.0]] * (2 + len(lifts)))
    losses = np.zeros((len(violations), 1))
    scores = Scores(losses, violations, {'lift': np.array([np.nan, np.nan, *lifts])})
    (reason,) = failing_figures(requirements, [IslandScores(0, losses, scores)])
    best = 'best 0.3 m' if lifts else 'no value'
    assert reason == f'lift at least 0.5 m: {best}'


@pytest.mark.slow
def test_a_parallelogram_by_construction_is_found() -> None:
    search_result = searched(
        {
            'linkage': 'four_bar',
            'units': {'length': 'mm'},
            'vary': {'O2-A': [60, 90], 'A-B': [150, 200]},
            'tie': {'O4.x': 'A-B', 'O4-B': 'O2-A'},
            'figures': {'stride': {'near': 140}},
            'count': 1,
        }
    )
    (leg,) = search_result.legs
    assert leg.reached['stride'] == pytest.approx(0.14, rel=0.02)
    assert leg.linkage.change_points.period == 1
