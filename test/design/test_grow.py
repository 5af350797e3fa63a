"""Growing structures: each one once, candidates that close, and legs that every program takes."""

from collections.abc import Sequence
from itertools import combinations, permutations, product
from pathlib import Path
import sys

from klann_ros.design import refine, requirements_from, search
from klann_ros.design.grow import shapes
from klann_ros.design.leg_file import leg_text
from klann_ros.kinematics import linkage_poses
from klann_ros.robot import robot_from_file
import numpy as np
import pytest

# Joined bodies of a structure, each pair with the kind of its joint.
Joints = Sequence[tuple[int, int, str]]
Named = tuple[frozenset[tuple[int, int, str]], int]
GROUND, CRANK = 0, 1


def brute_force(dyads: int, *, sliders: bool = False) -> set[Named]:
    """Return all structures with so many dyads, by comparing them under all renamings."""
    count = 2 * (dyads + 1)
    graphs: list[Joints] = [[(GROUND, CRANK, 'pin')]]
    for link in range(2, count + 1, 2):
        ends = [(*pair, 'pin') for pair in combinations(range(link), 2)]
        ends += [(*pair, 'slide') for pair in permutations(range(link), 2) if sliders]
        graphs = [
            [*graph, (link, base, 'pin'), (link + 1, link, 'pin'), (link + 1, end, kind)]
            for graph, (base, end, kind) in product(graphs, ends)
        ]
    structures: set[Named] = set()
    for graph, foot in product(graphs, (count, count + 1)):
        renamings = ((GROUND, CRANK, *p) for p in permutations(range(2, count + 2)))
        renamed = (named(graph, foot, names) for names in renamings)
        if is_wanted(graph, foot) and structures.isdisjoint(renamed):
            structures.add(named(graph, foot, range(count + 2)))
    return structures


def named(graph: Joints, foot: int, names: Sequence[int]) -> Named:
    low_high = ((*sorted((names[a], names[b])), kind) for a, b, kind in graph)
    return frozenset(low_high), names[foot]  # type: ignore[arg-type]  # three in each


def is_wanted(graph: Joints, foot: int) -> bool:
    """Return whether the foot is on no circle or line, and no dyad can be taken away from it."""
    if any({GROUND, foot} == {*joint[:2]} for joint in graph):
        return False
    degrees = [sum(body in joint[:2] for joint in graph) for body in range(2 + foot)]
    loose = [link for link in range(2, foot + 1, 2) if degrees[link] == degrees[link + 1] == 2]
    return loose == [foot - foot % 2]


@pytest.mark.parametrize(('dyads', 'sliders'), [(0, False), (1, False), (2, False), (1, True)])
def test_every_structure_is_grown_once(dyads: int, *, sliders: bool) -> None:
    grown = shapes(dyads, sliders=sliders)
    count = sum(len(brute_force(n, sliders=sliders)) for n in range(dyads + 1))
    assert len(set(grown)) == len(grown) == count
    assert count == {(0, False): 1, (1, False): 9, (2, False): 93, (1, True): 75}[dyads, sliders]


def test_the_six_bars_are_watts_and_stephensons() -> None:
    # Which bodies have three joints, and whether these two are joined: all there is to a six-bar.
    kinds = set()
    for dyads, _ in shapes(1):
        joints = [(GROUND, CRANK)]
        for k, (base, end, _) in enumerate(dyads, start=1):
            joints += [(2 * k, base), (2 * k, 2 * k + 1), (2 * k + 1, end)]
        if len(dyads) == 2:
            ternary = {b for b in range(6) if sum(b in joint for joint in joints) == 3}
            kinds.add(any(ternary == {*joint} for joint in joints))
    assert kinds == {True, False}


@pytest.mark.slow
def test_candidates_close_where_they_are_drawn() -> None:
    grown = {'dyads': 1, 'sliders': True, 'crank': [0.02, 0.03]}
    requirements = requirements_from({'grow': grown})
    # Every third structure: with pins only, and with sliders.
    for space in requirements.spaces[::3]:
        x = space.sample(np.random.default_rng(0), 150)
        variants = space.variants(x)
        assert not variants.refused.any()
        alphas = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
        reached = linkage_poses(variants, alphas, kernel='numpy').reason == 0
        assert reached.any(axis=1).mean() > 0.95
        assert reached.all(axis=1).mean() > 0.05
        # In both modes of each dyad.
        assert all(len(np.unique(signs)) == 2 for signs in variants.signs)


# A figure of eight, 120 by 60 mm.
EIGHT = [[60.0 * np.cos(t), 30.0 * np.sin(2.0 * t)] for t in np.arange(0.0, 6.28, 0.1)]


@pytest.mark.slow
def test_a_grown_leg_follows_a_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refine, 'MAX_STEPS', 40)
    monkeypatch.setattr(sys.modules[search.__module__], 'REFINED_CANDIDATES', 4)
    path = {'units': {'length': 'mm'}, 'path': {'points': EIGHT}}
    requirements = requirements_from({'grow': {'dyads': 1}, **path, 'count': 1})
    search_result = search(requirements, evaluations=8000)
    (leg,) = search_result.legs
    assert leg.linkage.name.startswith('Grown six-bar')
    assert leg.reached['path_error'] < 2e-3
    # Half of the structures after each round, but four.
    assert sum(x is not None and len(x) > 0 for x in search_result.state.populations) == 4
    file = tmp_path / 'leg.yaml'
    file.write_text(leg_text(leg.leg))
    assert robot_from_file(file).legs[0].linkage == leg.linkage


@pytest.mark.slow
def test_grown_legs_with_sliders_have_the_crank_wished_for() -> None:
    requirements = requirements_from(
        {
            'grow': {'dyads': 0, 'sliders': True, 'crank': [20, 30]},
            'units': {'length': 'mm', 'angle': 'deg'},
            'figures': {'lift': 'maximize', 'transmission_angle': {'at_least': 30}},
            'count': 3,
        }
    )
    search_result = search(requirements, evaluations=2000)
    assert search_result.legs
    for leg in search_result.legs:
        assert 0.02 <= leg.linkage.dimensions['A-C'] <= 0.03
