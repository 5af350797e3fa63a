"""Grashof's law: what it says is what the linkage does."""

from itertools import permutations, product
import math
from pathlib import Path
from typing import Any

from four_bars import four_bars, NAMES, turning_links, ULP, untimed
from hypothesis import assume, example, given, settings, strategies as st
from klann_ros.kinematics import FourBar
import numpy as np
import pytest
from yaml_tables import read_table

TURN = 2 * math.pi
KINDS = read_table(Path(__file__).with_name('kinds.yaml'))


@pytest.mark.parametrize('kind', KINDS, ids=lambda kind: kind['types'][0])
def test_each_kind_has_its_name(kind: dict[str, Any]) -> None:
    grashof = FourBar(*kind['lengths']).grashof
    assert (grashof.class_, grashof.type_) == (kind['class_'], kind['types'][0])
    assert list(grashof.inversions) == list(NAMES)
    assert [inversion.type_ for inversion in grashof.inversions.values()] == kind['types']
    assert grashof.inversions['ground'] == grashof


def is_decided(bar: FourBar) -> bool:
    return abs(bar.grashof.margin) > 1e-9


@pytest.mark.slow
@settings(max_examples=30)
@given(bar=four_bars())
@example(FourBar(2, 6, 3, 5))
@example(FourBar(3, 1, 3, 1))
@example(FourBar(1, 3, 1, 3))
@example(FourBar(1, 1, 3, 3))
@example(FourBar(3, 3, 1, 1))
@example(FourBar(1, 3, 3, 1))
@example(FourBar(3, 1, 1, 3))
@example(FourBar(2, 2, 2, 2))
@example(FourBar(7, 1, 5, 3))
@example(FourBar(1, 7, 3, 5))
@example(FourBar(5, 3, 1, 7))
@example(FourBar(5, 7, 3, 1))
def test_the_roles_in_every_inversion_match_the_motion(bar: FourBar) -> None:
    longest = max(bar.geometry.lengths)
    margin = abs(bar.grashof.margin) / longest
    assume(margin == 0.0 or margin > 0.01)
    # A nearly locked linkage hardly moves.
    assume(longest < 0.99 * (sum(bar.geometry.lengths) - longest))
    # A motion through a change point is that of a linkage nearby, with the same shortest link.
    changes = product((-1e-3, 1e-3), repeat=4) if margin == 0.0 else [(0.0,) * 4]
    lengths = np.array(bar.geometry.lengths)
    gaps = np.diff(np.sort(lengths)) / longest
    assume(margin > 0.0 or ((gaps == 0.0) | (gaps > 0.01)).all())
    nearby = (FourBar(*(lengths * (1.0 + np.array(change))).tolist()) for change in changes)
    # Some changes leave it at a change point, where rounding decides how a table goes on.
    turning = set().union(*(turning_links(other) for other in nearby if is_decided(other)))
    for fixed, kind in bar.grashof.inversions.items():
        for name in NAMES:
            role = 'rotates' if (fixed, name) in turning else 'oscillates'
            assert getattr(kind.roles, name) == ('fixed' if name == fixed else role)


@untimed
@given(bar=four_bars())
def test_a_crank_rotates_where_every_angle_is_reached(bar: FourBar) -> None:
    full = bar.reachable_arcs() == [(0.0, TURN)]
    assert (bar.grashof.roles.crank == 'rotates') is full
    ground, crank, coupler, rocker = bar.geometry.lengths
    full = FourBar(ground, rocker, coupler, crank).reachable_arcs() == [(0.0, TURN)]
    assert (bar.grashof.roles.rocker == 'rotates') is full


@pytest.mark.parametrize('order', list(permutations((0.1, 0.2, 0.3, 0.4))))
@pytest.mark.parametrize('unit', [1.0, 1e-3, 25.4, 1e20, 1 / 3])
def test_rounding_leaves_a_change_point_one(order: tuple[float, ...], unit: float) -> None:
    bar = FourBar(*(unit * length for length in order))
    assert bar.grashof.class_ == 'III'
    assert bar.grashof.shape == 'change-point'
    full = bar.reachable_arcs() == [(0.0, TURN)]
    assert full is (bar.grashof.roles.crank == 'rotates')


@untimed
@given(a=st.floats(0.1, 10.0), b=st.floats(0.1, 10.0), ulps=st.tuples(*[st.integers(-1, 1)] * 4))
def test_two_pairs_are_a_change_point(a: float, b: float, ulps: tuple[int, ...]) -> None:
    assume(abs(a - b) > 1e-6)
    changed = [1.0 + k * ULP for k in ulps]
    shapes = {'parallelogram': (a, b, a, b), 'kite': (a, a, b, b)}
    for shape, lengths in shapes.items():
        bar = FourBar(*(n * k for n, k in zip(lengths, changed, strict=True)))
        assert (bar.grashof.class_, bar.grashof.shape) == ('III', shape)


@untimed
@given(bar=four_bars())
def test_the_class_is_that_of_the_sums(bar: FourBar) -> None:
    s, p, q, longest = sorted(bar.geometry.lengths)
    margin = p + q - s - longest
    assume(abs(margin) > 1e-12)
    assert bar.grashof.class_ == ('I' if margin > 0 else 'II')
    assert bar.grashof.margin == pytest.approx(margin, abs=1e-14)
    assert bar.grashof.shape == ''


def test_it_is_shown_in_a_line() -> None:
    assert str(FourBar(180.0, 80.0, 200.0, 150.0).grashof) == (
        'class I, crank-rocker: ground fixed, crank rotates, coupler oscillates, rocker oscillates'
    )
