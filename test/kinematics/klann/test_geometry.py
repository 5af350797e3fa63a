"""`KlannGeometry`: what is no leg is refused, with the reason."""

from dataclasses import FrozenInstanceError, replace
import math

from hypothesis import given, settings, strategies as st
from klann_ros.kinematics import (
    GeometryError,
    KlannGeometry,
    KlannLeg,
    reachable_arcs,
    UnreachableError,
)
from klann_ros.kinematics.klann import BENDS, COORDINATES, LENGTHS
import pytest
from strategies import legs


@pytest.mark.parametrize('name', [*LENGTHS, *COORDINATES, *BENDS])
@pytest.mark.parametrize('value', [math.nan, math.inf, 'long', '0.12', b'0.12', None, 10**400])
def test_a_value_that_is_not_finite_is_refused(name: str, value: object) -> None:
    with pytest.raises(GeometryError, match=f'{name} = .* must be a finite number'):
        KlannGeometry(**{name: value})


@pytest.mark.parametrize('name', LENGTHS)
@pytest.mark.parametrize('value', [0.0, -0.1])
def test_a_length_must_be_positive(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f'{name} = .* a length must be > 0'):
        KlannGeometry(**{name: value})


@pytest.mark.parametrize(
    'assembly', [(0, 1), (1,), (1, 1, 1), (2, -1), 1, None, ('+', '-'), {1, -1}, {}]
)
def test_an_assembly_is_two_signs(assembly: object) -> None:
    with pytest.raises(GeometryError, match='two signs'):
        KlannGeometry(assembly=assembly)


@pytest.mark.parametrize('change', [{'l_bc': 0.01}, {'l_ef': 0.001, 'l_fg': 0.002}, {'x_e': 9.0}])
def test_lengths_that_never_close_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(GeometryError, match='at no crank angle do both dyads close'):
        KlannGeometry(**change)


def test_an_assembly_list_is_taken_as_a_tuple() -> None:
    assert KlannGeometry(assembly=[1, -1]).assembly == (1, -1)


def test_a_geometry_is_frozen_and_compares_by_value() -> None:
    with pytest.raises(FrozenInstanceError):
        KlannGeometry().l_ab = 1.0
    assert KlannGeometry() == KlannGeometry.sem104()
    assert hash(KlannGeometry()) == hash(KlannGeometry.sem104())


@pytest.mark.parametrize('geometry', [KlannGeometry.sem104(), KlannGeometry.patent()])
def test_both_known_legs_turn_fully(geometry: KlannGeometry) -> None:
    assert reachable_arcs(geometry) == [(0.0, 2 * math.pi)]


def test_the_limit_of_the_full_turn_is_where_the_textbook_leg_has_it() -> None:
    # BD reaches 481.39 of BC + DC = 490 mm.
    farthest = 0.12 + math.hypot(0.35, 0.09)
    limit = farthest - 0.14
    assert limit / 0.35 == pytest.approx(1 - 0.0246, abs=1e-4)
    assert reachable_arcs(KlannGeometry(l_bc=limit + 1e-9)) == [(0.0, 2 * math.pi)]
    assert reachable_arcs(KlannGeometry(l_bc=limit - 1e-6)) != [(0.0, 2 * math.pi)]


# The leg of SEM 104, turned so that |EG| has an extremum just beside a crank angle of 0.
BESIDE_ZERO = {'x_d': 0.33793, 'y_a': 0.12808, 'x_e': 0.30368, 'y_e': 0.23522}


def test_a_gap_beside_zero_is_not_missed() -> None:
    ((start, end),) = reachable_arcs(KlannGeometry(l_fg=0.280028, **BESIDE_ZERO))
    assert start == pytest.approx(0.00916, abs=1e-4)
    assert end == pytest.approx(2 * math.pi + 0.00104, abs=1e-4)


def test_a_leg_that_closes_only_beside_zero_is_accepted() -> None:
    ((start, end),) = reachable_arcs(KlannGeometry(l_ef=0.3, l_fg=0.850028, **BESIDE_ZERO))
    assert (start, end) == pytest.approx((0.00104, 0.00916), abs=1e-4)


def test_an_arc_through_zero_is_one_arc() -> None:
    arcs = reachable_arcs(replace(KlannGeometry.patent(), l_fg=0.4842))
    assert len(arcs) == 1
    assert arcs[0][0] < 2 * math.pi < arcs[0][1]


def test_a_leg_that_only_seems_to_close_where_b_is_d_is_refused() -> None:
    with pytest.raises(GeometryError, match='at no crank angle'):
        KlannGeometry(l_ab=0.1, x_d=0.1, y_a=0.0, l_bc=0.35, l_dc=0.35, x_e=100.0)


@pytest.mark.parametrize('factor', [1e-81, 1e160])
def test_lengths_beyond_all_measure_are_refused(factor: float) -> None:
    numbers = {name: factor * getattr(KlannGeometry(), name) for name in LENGTHS + COORDINATES}
    with pytest.raises(GeometryError, match=r'must be within 1e-60 \.\. 1e\+60 m'):
        KlannGeometry(**numbers)


def closes(geometry: KlannGeometry, alpha: float, leg: KlannLeg | None = None) -> bool:
    try:
        (leg or KlannLeg(geometry)).closed_form(alpha)
    except UnreachableError:
        return False
    return True


@settings(max_examples=60)
@given(geometry=legs(change=0.5), offset=st.floats(0.0, 0.03))
def test_the_arcs_are_where_the_closed_form_closes(geometry: KlannGeometry, offset: float) -> None:
    arcs, leg = reachable_arcs(geometry), KlannLeg(geometry)
    assert arcs
    for k in range(209):
        alpha = offset + 3 * k / 100
        from_an_end = min(
            abs(math.remainder(alpha - end, 2 * math.pi)) for arc in arcs for end in arc
        )
        inside = any(
            start <= angle <= end for start, end in arcs for angle in (alpha, alpha + 2 * math.pi)
        )
        if from_an_end > 1e-9:
            assert closes(geometry, alpha, leg) is inside


@pytest.mark.parametrize('arc', reachable_arcs(KlannGeometry(l_bc=0.33)))
def test_the_ends_of_an_arc_are_sharp(arc: tuple[float, float]) -> None:
    geometry = KlannGeometry(l_bc=0.33)
    start, end = arc
    assert closes(geometry, start + 1e-9)
    assert closes(geometry, end - 1e-9)
    assert not closes(geometry, start - 1e-9)
    assert not closes(geometry, end + 1e-9)


def test_as_dict_makes_the_same_geometry() -> None:
    geometry = KlannGeometry.patent()
    assert KlannGeometry(**geometry.as_dict()) == geometry
    assert replace(geometry, **geometry.as_dict()) == geometry
