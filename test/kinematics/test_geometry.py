"""Geometries of the Klann leg and the four-bar: invalid ones are refused, with the reason."""

from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace
import math
from typing import Any

from four_bars import COURSE, NAMES
from klann_ros.kinematics import FourBar, GeometryError, KlannGeometry, reachable_arcs
from klann_ros.kinematics.klann import BENDS, COORDINATES, LENGTHS
import pytest

Make = Callable[..., Any]


def four_bar(**changes: Any) -> FourBar:
    """Return the course's four-bar with changes."""
    return FourBar(**dict(zip(NAMES, COURSE, strict=True)) | changes)


ALL_LENGTHS = [*((KlannGeometry, name) for name in LENGTHS), *((four_bar, name) for name in NAMES)]
ALL_NUMBERS = [*ALL_LENGTHS, *((KlannGeometry, name) for name in COORDINATES + BENDS)]


@pytest.mark.parametrize(('make', 'name'), ALL_NUMBERS)
@pytest.mark.parametrize('value', [math.nan, math.inf, 'long', '0.12', b'0.12', None, 10**400])
def test_a_value_that_is_not_finite_is_refused(make: Make, name: str, value: object) -> None:
    with pytest.raises(GeometryError, match=f'{name} = .* must be a finite number'):
        make(**{name: value})


@pytest.mark.parametrize(('make', 'name'), ALL_LENGTHS)
@pytest.mark.parametrize('value', [0.0, -0.1])
def test_a_length_must_be_positive(make: Make, name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f'{name} = .* a length must be > 0'):
        make(**{name: value})


@pytest.mark.parametrize('factor', [1e-81, 1e160])
@pytest.mark.parametrize(
    ('make', 'numbers'),
    [
        (KlannGeometry, {n: getattr(KlannGeometry(), n) for n in LENGTHS + COORDINATES}),
        (four_bar, dict(zip(NAMES, COURSE, strict=True))),
    ],
)
def test_lengths_beyond_all_measure_are_refused(
    make: Make, numbers: dict[str, float], factor: float
) -> None:
    with pytest.raises(GeometryError, match=r'must be within 1e-60 \.\. 1e\+60 m'):
        make(**{name: factor * value for name, value in numbers.items()})


@pytest.mark.parametrize(
    ('make', 'assembly', 'text'),
    [
        *(
            (KlannGeometry, signs, 'two signs')
            for signs in ((0, 1), (1,), (1, 1, 1), (2, -1), 1, None, ('+', '-'), {1, -1}, {})
        ),
        *(
            (four_bar, sign, r'assembly = .* must be one sign, \+1 or -1')
            for sign in (0, 2, None, '+', (1,), [1, -1], math.nan)
        ),
    ],
)
def test_an_invalid_assembly_is_refused(make: Make, assembly: object, text: str) -> None:
    with pytest.raises(GeometryError, match=text):
        make(assembly=assembly)


def test_geometries_are_frozen_and_compare_by_value() -> None:
    bar = four_bar().geometry
    for geometry, name in ((KlannGeometry(), 'l_ab'), (bar, 'crank')):
        with pytest.raises(FrozenInstanceError):
            setattr(geometry, name, 1.0)
    assert KlannGeometry() == KlannGeometry.sem104()
    assert hash(KlannGeometry()) == hash(KlannGeometry.sem104())
    assert bar == four_bar().geometry != four_bar(assembly=-1).geometry
    assert hash(bar) == hash(four_bar(assembly=True).geometry)
    assert KlannGeometry(assembly=[1, -1]).assembly == (1, -1)
    patent = KlannGeometry.patent()
    assert KlannGeometry(**patent.as_dict()) == patent
    assert replace(patent, **patent.as_dict()) == patent


# The four-bar.


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('length', [3.0, 3.1])
def test_a_link_as_long_as_the_others_together_is_refused(name: str, length: float) -> None:
    lengths = dict.fromkeys(NAMES, 1.0) | {name: length}
    with pytest.raises(GeometryError, match=f'at no crank angle .* {name} = .* not shorter than'):
        FourBar(**lengths)


def test_a_link_that_is_a_little_shorter_is_taken() -> None:
    (start, end), *_ = FourBar(2.999, 1.0, 1.0, 1.0).reachable_arcs()
    assert 0.0 < end - start < 0.2


# The Klann leg.


@pytest.mark.parametrize(
    'change',
    [
        {'l_bc': 0.01},
        {'l_ef': 0.001, 'l_fg': 0.002},
        {'x_e': 9.0},
        # It seems to close where B is D.
        {'l_ab': 0.1, 'x_d': 0.1, 'y_a': 0.0, 'l_bc': 0.35, 'l_dc': 0.35, 'x_e': 100.0},
    ],
)
def test_lengths_that_never_close_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(GeometryError, match='at no crank angle do both dyads close'):
        KlannGeometry(**change)


@pytest.mark.parametrize(
    ('change', 'arc'),
    [
        # A gap beside zero, and a leg that closes there only.
        ({'l_fg': 0.280028}, (0.00916, 2 * math.pi + 0.00104)),
        ({'l_ef': 0.3, 'l_fg': 0.850028}, (0.00104, 0.00916)),
    ],
)
def test_an_extremum_beside_zero_is_not_missed(
    change: dict[str, float], arc: tuple[float, float]
) -> None:
    # The leg of SEM 104, turned so that |EG| has an extremum just beside a crank angle of 0.
    beside_zero = {'x_d': 0.33793, 'y_a': 0.12808, 'x_e': 0.30368, 'y_e': 0.23522}
    (found,) = reachable_arcs(KlannGeometry(**change, **beside_zero))
    assert found == pytest.approx(arc, abs=1e-4)


def test_an_arc_through_zero_is_one_arc() -> None:
    ((start, end),) = reachable_arcs(replace(KlannGeometry.patent(), l_fg=0.4842))
    assert start < 2 * math.pi < end
