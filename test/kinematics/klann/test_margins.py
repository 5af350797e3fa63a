"""Margins: each is where the full turn is lost, and the way there is free of gaps."""

import math
import pickle

from hypothesis import assume, given, HealthCheck, settings, strategies as st
from klann_ros.kinematics import (
    GeometryError,
    KlannGeometry,
    length_margins,
    Linkage,
    PartialTurnError,
    reachable_arcs,
    shipped_linkage,
    turns_fully,
)
from klann_ros.kinematics.klann import BENDS, COORDINATES, LENGTHS
import pytest
from strategies import legs

NUMBERS = LENGTHS + COORDINATES + BENDS
PRESETS = [KlannGeometry.sem104(), KlannGeometry.patent()]
shares = st.floats(1e-6, 1.0 - 1e-6)


def still_turns(linkage: KlannGeometry | Linkage, name: str, number: float) -> bool:
    """Return it by the arcs alone: by a search that shares nothing with that for margins."""
    try:
        return reachable_arcs(linkage.varied({name: number})) == [(0.0, 2.0 * math.pi)]
    except GeometryError:
        return False


def check_the_ends(
    geometry: KlannGeometry | Linkage, name: str, ends: tuple[float, float]
) -> None:
    low, high = ends
    for end, outward in ((low, -1.0), (high, 1.0)):
        step = outward * 1e-9 * max(abs(end), 0.01)
        if math.isfinite(end) and not (name in LENGTHS and end == 0.0):
            assert still_turns(geometry, name, end - step), (name, end)
            assert not still_turns(geometry, name, end + step), (name, end)


@settings(max_examples=30)
@given(geometry=legs(change=0.15))
def test_a_leg_turns_fully_where_its_arcs_are_a_turn(geometry: KlannGeometry) -> None:
    assert turns_fully(geometry) == (reachable_arcs(geometry) == [(0.0, 2.0 * math.pi)])


@pytest.mark.slow
@pytest.mark.parametrize(
    'linkage',
    [*PRESETS, *map(shipped_linkage, ('chebyshev_lambda', 'four_bar', 'jansen'))],
    ids=['sem104', 'patent', 'chebyshev_lambda', 'four_bar', 'jansen'],
)
def test_just_beyond_a_margin_the_full_turn_is_lost(linkage: KlannGeometry | Linkage) -> None:
    dimensions = getattr(linkage, 'linkage', linkage).dimensions
    for number, margin in length_margins(linkage).items():
        assert margin.least < margin.value == dimensions[number] < margin.greatest
        low = -math.inf if margin.least == 0.0 else margin.least
        check_the_ends(linkage, number, (low, margin.greatest))


def test_a_braced_bar_may_shrink_until_its_triangle_is_flat() -> None:
    linkage = shipped_linkage('jansen')
    numbers = linkage.dimensions
    flat = numbers['W-V'] - numbers['Y-W']
    assert length_margins(linkage)['Y-V'].least == pytest.approx(flat, rel=1e-14)


def test_the_textbook_legs_bc_may_lose_2_46_percent() -> None:
    margins = length_margins(KlannGeometry.sem104())
    assert margins['l_bc'].relative[0] == pytest.approx(-0.0246, abs=5e-5)
    # Dyad 1 stretched and folded, in closed form.
    ad = math.hypot(0.35, 0.09)
    assert margins['l_bc'].least == pytest.approx(0.12 + ad - 0.14, rel=1e-12)
    assert margins['l_bc'].greatest == pytest.approx(ad - 0.12 + 0.14, rel=1e-12)
    assert margins['l_ab'].greatest == pytest.approx(0.35 + 0.14 - ad, rel=1e-12)
    assert margins['y_a'].greatest == pytest.approx(math.sqrt(0.37**2 - 0.35**2), rel=1e-12)


def test_the_foot_has_no_limits() -> None:
    margins = length_margins(KlannGeometry.sem104())
    assert list(margins) == list(NUMBERS)
    assert margins['l_gh'][1:] == (0.0, math.inf)
    assert margins['angle_fgh'][1:] == (-math.inf, math.inf)
    assert margins['l_gh'].changes == (-0.43, math.inf)
    assert margins['l_ab'].least == 0.0


@pytest.mark.slow
def test_a_bend_without_limit_turns_all_round() -> None:
    geometry = KlannGeometry.sem104()
    assert length_margins(geometry)['angle_bcg'][1:] == (-math.inf, math.inf)
    assert all(still_turns(geometry, 'angle_bcg', math.radians(k)) for k in range(-180, 180, 5))


def test_a_number_that_is_0_has_no_relative_change() -> None:
    geometry = KlannGeometry(y_a=0.0)
    margin = length_margins(geometry)['y_a']
    assert margin.least == pytest.approx(-margin.greatest, rel=1e-9)
    assert margin.relative == (-math.inf, math.inf)


# Most random legs do not turn fully.
@pytest.mark.slow
@settings(max_examples=6, suppress_health_check=[HealthCheck.filter_too_much])
@given(geometry=legs(change=0.15), name=st.sampled_from(NUMBERS), share=shares)
def test_between_margins_it_turns_fully(geometry: KlannGeometry, name: str, share: float) -> None:
    assume(turns_fully(geometry))
    margins = length_margins(geometry)
    _, min_number, max_number = margins[name]
    low = max(min_number, -4.0)
    high = min(max_number, 4.0)
    number = low + share * (high - low)
    assume(name not in LENGTHS or number > 0.0)
    assert still_turns(geometry, name, number)
    check_the_ends(geometry, name, (min_number, max_number))


@pytest.mark.slow
@settings(max_examples=3)
@given(geometry=legs(change=0.1), factor=st.sampled_from([0.001, 1000.0]))
def test_scaled_lengths_scale_the_margins(geometry: KlannGeometry, factor: float) -> None:
    assume(turns_fully(geometry))
    scaled = length_margins(geometry.scaled(factor))
    for name, margin in length_margins(geometry).items():
        expected = [(1.0 if name in BENDS else factor) * value for value in margin]
        assert list(scaled[name]) == pytest.approx(expected, rel=1e-8, abs=1e-9 * factor)


@pytest.mark.parametrize('difference', [0.01, 0.0001])
def test_the_range_ends_at_the_first_loss(difference: float) -> None:
    # Where E crosses the path of G, EG becomes shorter than |EF - FG|, over no more than that.
    geometry = KlannGeometry(l_ef=0.36, l_fg=0.36 + difference)
    greatest = length_margins(geometry)['x_e'].greatest
    check_the_ends(geometry, 'x_e', (-math.inf, greatest))
    assert 0.56 < greatest < 0.58
    assert still_turns(geometry, 'x_e', 0.60)


def test_a_leg_that_does_not_turn_fully_has_no_margins() -> None:
    geometry = KlannGeometry(l_bc=0.33)
    assert not turns_fully(geometry)
    with pytest.raises(PartialTurnError, match=r'it reaches 194.5.* \.\. 496.6.* deg') as caught:
        length_margins(geometry)
    assert caught.value.arcs == reachable_arcs(geometry)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)  # noqa: S301
