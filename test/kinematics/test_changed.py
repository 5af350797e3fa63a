"""A leg, a four-bar or a linkage made larger, mirrored, or with one length replaced."""

import math
from typing import Any

from klann_ros.kinematics import FourBar, GeometryError, KlannGeometry, LinkageLeg
import numpy as np
import pytest

PATENT = KlannGeometry.patent()
BAR = FourBar(0.18, 0.08, 0.2, 0.15, tolerance=1e-9)
LINKS = ['ground', 'crank', 'coupler', 'rocker']
THINGS = [KlannGeometry(), PATENT, BAR.geometry, KlannGeometry().linkage]
IDS = ['sem104', 'patent', 'four-bar', 'linkage']


def points(thing: Any, alpha: float) -> np.ndarray:
    return LinkageLeg(getattr(thing, 'linkage', thing)).solve(alpha).points


@pytest.mark.parametrize('thing', THINGS, ids=IDS)
@pytest.mark.parametrize('alpha', [0.3, 2.0, 4.4])
def test_scaling_and_mirroring_apply_to_every_point(thing: Any, alpha: float) -> None:
    own = points(thing, alpha)
    np.testing.assert_allclose(points(thing.scaled(2.5), alpha), 2.5 * own, atol=1e-12)
    np.testing.assert_allclose(points(thing.mirrored(), -alpha), own * [1, -1], atol=1e-12)
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


@pytest.mark.parametrize('thing', THINGS, ids=IDS)
@pytest.mark.parametrize('factor', [0.0, -1.0, math.nan, math.inf, '2', None])
def test_an_invalid_factor_is_refused(thing: Any, factor: Any) -> None:
    with pytest.raises(GeometryError, match=r'factor = .* is refused'):
        thing.scaled(factor)


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
        _, driven, across, other = around + (math.pi - around[0])
        for assembly in (1, -1):
            f = BAR.inversion(fixed, assembly).f(driven, [across, other - math.pi])
            assert f == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize('fixed', ['coupler bar', '', None, 2])
def test_an_unknown_link_is_refused(fixed: Any) -> None:
    with pytest.raises(GeometryError, match='must be one of ground, crank, coupler, rocker'):
        BAR.inversion(fixed)
