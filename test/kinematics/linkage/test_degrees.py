"""Degrees where radians are meant are refused, wherever a bend or a start is given."""

import math

from four_bars import FOUR_BAR, refusal
from klann_ros.kinematics import (
    GeometryError,
    KlannGeometry,
    length_margins,
    Linkage,
    linkage_from_text,
    linkage_poses,
    LinkageFileError,
    LinkageLeg,
    Reason,
    tolerance_study,
    Variants,
)
import numpy as np
import pytest

LEG = KlannGeometry.sem104().linkage


def four_bar(end: str, angle: str = '') -> Linkage:
    return linkage_from_text(FOUR_BAR % (angle, end), 'four_bar.yaml')


@pytest.mark.parametrize('name', ['angle_bcg', 'angle_fgh'])
@pytest.mark.parametrize('degrees', [10.0, -40.0, 7, 1e300])
def test_a_bend_beyond_a_turn_is_refused(name: str, degrees: float) -> None:
    text = f'{name} = {degrees:g} rad is refused: a bend must be within'
    for make in (lambda: KlannGeometry(**{name: degrees}), lambda: LEG.varied({name: degrees})):
        with pytest.raises(GeometryError) as caught:
            make()
        assert str(caught.value).startswith(text)
        assert f'if {degrees:g} deg are meant, give {math.radians(degrees):.6g}' in str(
            caught.value
        )
    variants = Variants(LEG, {name: [0.1, degrees]})
    assert 'deg are meant' in variants.reason(1)
    assert linkage_poses(variants, 1.0).reason.tolist() == [0, Reason.REFUSED]


def test_a_bend_of_a_whole_turn_is_none() -> None:
    turned = KlannGeometry(angle_bcg=math.radians(10.0) - 2 * math.pi)
    assert LinkageLeg(turned.linkage).solve(1.0).h == pytest.approx(
        LinkageLeg(LEG).solve(1.0).h, abs=1e-14
    )
    KlannGeometry(angle_fgh=math.radians(360.0))


def test_margins_of_a_bend_are_searched_for_a_whole_turn() -> None:
    turned = KlannGeometry(angle_bcg=math.radians(10.0) - 2 * math.pi).linkage
    own, other = length_margins(LEG)['angle_bcg'], length_margins(turned)['angle_bcg']
    assert other.changes == pytest.approx(own.changes, abs=1e-9)


def test_a_tolerance_of_degrees_is_refused() -> None:
    with pytest.raises(ValueError, match=r'tolerance of angle_bcg = 10 .*2 pi rad \(degrees\?\)'):
        tolerance_study(LEG, {'angle_bcg': 10}, samples=2, crank_angles=4)


@pytest.mark.parametrize(
    'start',
    [
        # Newton-Raphson would go from these to either assembly.
        '{crank: 180, coupler: 60, rocker: 104}',
        '{crank: 60, coupler: 15, rocker: 80}',
        '{crank: 60, coupler: -74, rocker: 235}',
        # In degrees not near either, but no radians all the same.
        '{crank: 180, coupler: 260, rocker: 90}',
    ],
)
def test_a_start_that_can_only_be_degrees_is_refused(start: str) -> None:
    text = refusal(f'start: {start}', '')
    assert 'is in radians near no pose in which it closes' in text
    assert 'for degrees write units: {angle: deg}' in text
    assert 'there are the assemblies [1] (coupler' in text
    assert '; [-1] (coupler' in text


def test_small_degrees_are_refused_where_an_assembly_is_near() -> None:
    flat = FOUR_BAR.replace('[180, 0]', '[345, 0]').replace('length: 80', 'length: 10')
    flat = flat.replace('from: O4, to: B', 'from: B, to: O4')
    start = 'start: {crank: 3, coupler: 5, rocker: -6}'
    with pytest.raises(LinkageFileError, match=r'write units: \{angle: deg\}'):
        linkage_from_text(flat % ('', start), 'flat.yaml')
    pose = LinkageLeg(linkage_from_text(flat % (', angle: deg', start), 'flat.yaml')).solve(0.05)
    assert np.abs(pose.x).max() < 0.4


@pytest.mark.parametrize(
    'start',
    [
        '{crank: 1.05, coupler: 0.3, rocker: 1.4}',
        '{crank: 1.0472, coupler: -1.2, rocker: -2.2}',
        # More than a turn, but near a pose.
        '{crank: 7.3304, coupler: 0.4, rocker: 7.5}',
        # A drawing that is 25 degrees off.
        '{crank: 1.05, coupler: 0.8, rocker: 1.7}',
    ],
)
def test_a_start_in_radians_is_taken(start: str) -> None:
    assert four_bar(f'start: {start}').assembly in {(1,), (-1,)}


def test_a_bend_in_degrees_is_refused_in_a_file() -> None:
    bent = FOUR_BAR.replace('length: 200}', 'length: 200}, {from: B, to: P, length: 9, bend: 30}')
    start = 'start: {crank: 60, coupler: 15, rocker: 80}'
    with pytest.raises(LinkageFileError) as caught:
        linkage_from_text(bent % ('', start), 'bent.yaml')
    assert 'bodies.coupler.bars[1].bend: 30 must be within +-2 pi rad; for degrees' in str(
        caught.value
    )
    assert linkage_from_text(bent % (', angle: deg', start), 'bent.yaml')
    far = bent.replace('bend: 30', 'bend: 400')
    with pytest.raises(LinkageFileError, match=r'bend: 400 must be within \+-360 deg$'):
        linkage_from_text(far % (', angle: deg', start), 'bent.yaml')
