"""No leg is returned twice: not as it is, moved, scaled, mirrored or under other names."""

from collections.abc import Mapping
from itertools import combinations

from hypothesis import given, settings, strategies as st
from klann_ros.design import requirements_from, search
from klann_ros.design.distinct import is_same_leg, leg_shape, SAME_SHAPE, shape_distance
from klann_ros.kinematics import Linkage, linkage_from_text, shipped_linkage, turns_fully
import numpy as np
import pytest

NAMES = st.sampled_from(['klann', 'jansen', 'four_bar', 'strider'])
TENTHS = st.integers(-30, 30)
# The names and the order of the links are other ones.
RENAMED = """
name: The other four-bar
units: {length: mm}
pivots: {Q: [200, 0], P: [0, 0]}
crank: driver
foot: X
bodies:
  driver: {bars: [{from: P, to: R, length: 80}]}
  rocker: {bars: [{from: Q, to: S, length: 150}]}
  coupler: {bars: [{from: R, to: S, length: 180}, {from: R, to: X, length: 90, bend: 0.5}]}
assembly: [-1]
"""


def moved(linkage: Linkage, factor: complex, shift: complex) -> Linkage:
    changes = {}
    for dimension, number in zip(linkage.structure.dimensions, linkage.numbers, strict=True):
        if dimension.kind in {'x', 'y'}:
            pivot = factor * linkage.pivots[dimension.place] + shift
            changes[dimension.name] = pivot.real if dimension.kind == 'x' else pivot.imag
        elif dimension.is_length:
            changes[dimension.name] = abs(factor) * number
    return linkage.varied(changes)


def distance(first: Linkage, second: Linkage, *, can_turn: bool) -> float:
    shapes = [leg_shape(linkage, can_turn=can_turn) for linkage in (first, second)]
    assert shape_distance(*shapes) == pytest.approx(shape_distance(*shapes[::-1]), abs=1e-12)
    return shape_distance(*shapes)


@settings(max_examples=20, deadline=None)
@given(NAMES, st.floats(0.01, 100.0), TENTHS, st.integers(-2, 2), st.booleans())
def test_a_leg_that_is_moved_scaled_or_mirrored_is_the_same(
    name: str, factor: float, tenths: int, shift: int, is_mirrored: bool
) -> None:
    linkage = shipped_linkage(name)
    angle = tenths / 10.0
    image = moved(linkage.mirrored() if is_mirrored else linkage, factor, complex(shift, -shift))
    turned = moved(image, np.exp(1j * angle), 0.0)
    # The sampled centre of a path is exact to 1e-4 at 24 crank angles.
    assert distance(linkage, turned, can_turn=True) < SAME_SHAPE / 10.0
    # A mirror in the vertical is one in the horizontal, and half a turn.
    upright = moved(image, -1.0, 0.0) if is_mirrored else image
    assert distance(linkage, upright, can_turn=False) < 1e-9
    if 0.3 < abs(angle) < 2.8:
        assert distance(linkage, moved(upright, np.exp(1j * angle), 0.0), can_turn=False) > 0.1


@pytest.mark.parametrize('name', ['klann', 'four_bar', 'hoecken'])
def test_a_change_that_shows_makes_another_leg(name: str) -> None:
    linkage = shipped_linkage(name)
    for dimension in linkage.structure.dimensions:
        if dimension.is_length:
            for change, is_same in ((1.001, True), (0.96, False), (1.04, False)):
                varied = linkage.varied(
                    {dimension.name: change * linkage.dimensions[dimension.name]}
                )
                if turns_fully(varied):
                    assert is_same_leg(varied, [linkage], can_turn=True) == is_same


def test_the_names_and_the_order_of_links_do_not_count() -> None:
    renamed = linkage_from_text(RENAMED, 'renamed')
    drawn = RENAMED.replace('P', 'A').replace('X', 'H').replace('driver', 'crank')
    assert distance(renamed, linkage_from_text(drawn, 'drawn'), can_turn=False) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    'content',
    [
        {'linkage': 'four_bar', 'figures': {'transmission_angle': 'maximize'}, 'vary': 10},
        {'linkage': 'slider_crank', 'vary': 3, 'figures': {'stride': {'near': 0.1}}},
        {'linkage': 'hoecken', 'scale': [0.5, 2], 'figures': {'width': 'minimize'}},
        {'linkage': 'klann', 'figures': {'lift': 'maximize', 'stride': 'maximize'}},
    ],
)  # fmt: skip
def test_no_search_returns_a_leg_twice(content: Mapping[str, object]) -> None:
    requirements = requirements_from({**content, 'count': 3})
    search_result = search(requirements, evaluations=480)
    resumed = search(requirements, evaluations=720, state=search_result.state)
    for design in (search_result, resumed):
        legs = design.legs
        assert legs
        for first, second in combinations(legs, 2):
            assert distance(first.linkage, second.linkage, can_turn=False) > 0.99 * SAME_SHAPE
        if len(requirements.aims) == 1:
            # A choice of good ones, the best one first.
            (aim,) = requirements.aims
            losses = [aim.loss(leg.reached[aim.figure]) for leg in legs]
            assert losses == sorted(losses)
            assert losses[-1] - losses[0] < 0.2 * max(abs(losses[0]), 0.1 * aim.value)
            assert len(legs) > 1
