"""Geometries: invalid ones are refused; others scaled, mirrored, or with a length replaced."""

from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace
import math
from typing import Any

from four_bars import COURSE, NAMES
from klann_ros.kinematics import FourBar, GeometryError, KlannGeometry, LinkageLeg, reachable_arcs
from klann_ros.kinematics.klann import BENDS, COORDINATES, LENGTHS
import numpy as np
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
def test_extreme_lengths_are_refused(make: Make, numbers: dict[str, float], factor: float) -> None:
    with pytest.raises(GeometryError, match=r'must be within 1e-60 \.\. 1e\+60'):
        make(**{name: factor * value for name, value in numbers.items()})


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
def test_an_extremum_near_zero_is_found(
    change: dict[str, float], arc: tuple[float, float]
) -> None:
    # The leg of SEM 104, turned so that |EG| has an extremum just beside a crank angle of 0.
    beside_zero = {'x_d': 0.33793, 'y_a': 0.12808, 'x_e': 0.30368, 'y_e': 0.23522}
    (reachable_arc,) = reachable_arcs(KlannGeometry(**change, **beside_zero))
    assert reachable_arc == pytest.approx(arc, abs=1e-4)


def test_an_arc_through_zero_is_one_arc() -> None:
    ((start, end),) = reachable_arcs(replace(KlannGeometry.patent(), l_fg=0.4842))
    assert start < 2 * math.pi < end


BAR = FourBar(0.18, 0.08, 0.2, 0.15, tolerance=1e-9)
LINKS = ['ground', 'crank', 'coupler', 'rocker']
THINGS = [KlannGeometry(), KlannGeometry.patent(), BAR.geometry, KlannGeometry().linkage]
IDS = ['sem104', 'patent', 'four-bar', 'linkage']


def points(thing: Any, alpha: float) -> np.ndarray:
    return LinkageLeg(getattr(thing, 'linkage', thing)).solve(alpha).points


@pytest.mark.parametrize('thing', THINGS, ids=IDS)
@pytest.mark.parametrize('alpha', [0.3, 2.0, 4.4])
def test_scaling_and_mirroring_apply_to_every_point(thing: Any, alpha: float) -> None:
    original = points(thing, alpha)
    np.testing.assert_allclose(points(thing.scaled(2.5), alpha), 2.5 * original, atol=1e-12)
    np.testing.assert_allclose(points(thing.mirrored(), -alpha), original * [1, -1], atol=1e-12)
    assert type(thing.scaled(2.5)) is type(thing.mirrored()) is type(thing)


@pytest.mark.parametrize('thing', THINGS, ids=IDS)
def test_one_length_is_replaced_and_nothing_else(thing: Any) -> None:
    linkage = getattr(thing, 'linkage', thing)
    name, value = [*linkage.dimensions.items()][1]
    changed = thing.varied({name: 1.01 * value})
    numbers = getattr(changed, 'linkage', changed).dimensions
    assert numbers == {**linkage.dimensions, name: 1.01 * value}
    by_keyword = thing.varied(**{name: 1.01 * value})
    assert getattr(by_keyword, 'linkage', by_keyword).dimensions == numbers
    assert getattr(changed, 'linkage', changed).assembly == linkage.assembly
    with pytest.raises(GeometryError, match=r'no such dimension; there are .*did you mean'):
        thing.varied({name + 'x': value})
    with pytest.raises(GeometryError, match='a length must be > 0'):
        thing.varied({name: -1.0})


@pytest.mark.parametrize('fixed', LINKS)
def test_an_inversion_moves_by_the_law_of_grashof(fixed: str) -> None:
    inversion = BAR.inversion(fixed)
    assert inversion.tolerance == BAR.tolerance
    of_law = BAR.grashof.inversions[fixed]
    assert (inversion.grashof.motion, inversion.grashof.class_) == (of_law.motion, of_law.class_)
    # The same loop: its links around it, the ground and the rocker against their directions.
    for theta2 in (0.4, 2.5, 5.0):
        _, theta3, theta4 = BAR.closed_form(theta2).joints
        around = np.roll([math.pi, theta2, theta3, theta4 + math.pi], -LINKS.index(fixed))
        _, crank, coupler, rocker = around + (math.pi - around[0])
        for assembly in (1, -1):
            f = BAR.inversion(fixed, assembly).f(crank, [coupler, rocker - math.pi])
            assert f == pytest.approx(0.0, abs=1e-15)
