"""The ways in which a linkage can be put together, and how a file states one."""

import math

from four_bars import FOUR_BAR, refusal
from klann_ros.kinematics import (
    assemblies,
    assembly_poses,
    CrankAngleError,
    FourBar,
    GeometryError,
    KlannGeometry,
    KlannLeg,
    linkage_from_text,
    LinkageFileError,
    LinkageLeg,
    shipped_linkage,
    shipped_linkages,
)
import numpy as np
import pytest

DEGREES = ', angle: deg'
START = 'start: {crank: 60, coupler: 15, rocker: 80}'


def test_the_course_prints_both_assemblies_of_its_four_bar() -> None:
    open_, crossed = assembly_poses(FourBar(180, 80, 200, 150, -1), math.radians(60))
    assert (open_.linkage.assembly, crossed.linkage.assembly) == ((1,), (-1,))
    assert math.degrees(open_.x[1]) == pytest.approx(72.14, abs=5e-3)
    assert math.degrees(crossed.x[1]) % 360 == pytest.approx(235.2, abs=5e-3)


def test_each_assembly_of_a_klann_leg_is_that_of_its_signs() -> None:
    for alpha in np.linspace(0.0, 6.0, 25):
        poses = {pose.linkage.assembly: pose for pose in assembly_poses(KlannLeg(), alpha)}
        for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            leg = KlannLeg(KlannGeometry(assembly=signs))
            if signs in poses:
                assert poses[signs].x == leg.closed_form(alpha).x
            else:
                with pytest.raises(Exception, match='cannot be reached'):
                    leg.closed_form(alpha)
        assert {(1, 1), (1, -1)} <= poses.keys()


@pytest.mark.parametrize('name', shipped_linkages())
def test_every_assembly_closes_and_differs_from_the_others(name: str) -> None:
    linkage = shipped_linkage(name)
    poses = assembly_poses(linkage, linkage.start[0])
    assert linkage.assembly in [pose.linkage.assembly for pose in poses]
    for pose in poses:
        assert pose.residual < 1e-12
        # A leg that continues from a pose stays in its assembly.
        again = LinkageLeg(pose.linkage).solve(pose.alpha)
        assert again.x == pytest.approx(pose.x, abs=1e-9)
    angles = np.array([pose.x for pose in poses])
    differences = np.abs(np.exp(1j * angles[:, None]) - np.exp(1j * angles)).max(axis=-1)
    assert (differences + np.eye(len(poses)) > 1e-6).all()


def test_assemblies_are_those_that_close_somewhere() -> None:
    assert assemblies(KlannGeometry()) == [(1, 1), (1, -1), (-1, 1), (-1, -1)]
    assert assemblies(FourBar(2, 1, 2, 1)) == [(1,), (-1,)]
    assert assembly_poses(FourBar(0.3, 0.25, 0.2, 0.24), math.pi) == []
    with pytest.raises(GeometryError, match='its loops are coupled'):
        assemblies(shipped_linkage('stephenson'))
    with pytest.raises(CrankAngleError):
        assembly_poses(KlannLeg(), math.nan)


def test_a_leg_that_does_not_close_names_the_assemblies_that_do() -> None:
    with pytest.raises(GeometryError, match=r'assembly \(-1, 1\), but in \(1, 1\), \(1, -1\)$'):
        KlannGeometry(assembly=(-1, 1), x_e=0.21, y_e=0.22, l_ef=0.14, l_fg=0.27)
    with pytest.raises(GeometryError, match='or in any other'):
        KlannGeometry(y_a=9.0)


@pytest.mark.parametrize('sign', [1, -1])
def test_a_file_may_state_its_assembly_in_place_of_a_start(sign: int) -> None:
    stated = linkage_from_text(FOUR_BAR % ('', f'assembly: [{sign}]'), 'x')
    assert stated.assembly == (sign,)
    pose = LinkageLeg(stated).solve(math.radians(60))
    expected = FourBar(0.18, 0.08, 0.2, 0.15, sign).solve(math.radians(60))
    assert pose.x == pytest.approx(expected.x, abs=1e-14)


def test_a_stated_assembly_is_held_against_the_start() -> None:
    agreed = linkage_from_text(FOUR_BAR % (DEGREES, f'{START}\nassembly: [1]'), 'x')
    assert agreed == linkage_from_text(FOUR_BAR % (DEGREES, START), 'x')
    assert refusal(f'{START}\nassembly: [-1]') == (
        'the start leads to the assembly [1], and [-1] is stated: leave one of them out; at crank '
        '= 60 deg there are the assemblies [1] (coupler 21.56, rocker 72.14 deg); [-1] (coupler '
        '-74.22, rocker -124.8 deg)'
    )


def test_the_possible_assemblies_are_listed() -> None:
    assert refusal('assembly: [1, 1]') == (
        'assembly [1, 1] is refused: possible are [1], [-1], a sign for each of the loops that '
        'are solved one after the other (coupler, rocker)'
    )
    assert 'assembly[0]: 2 must be one of 1, -1' in refusal('assembly: [2]')
    too_long = FOUR_BAR.replace('80', '999')
    assert 'closes at no crank angle' in refusal('assembly: [1]', text=too_long)
    assert 'start is missing: an angle for every body, or in its place assembly' in refusal('')
    long_ground = FOUR_BAR.replace('length: 80', 'length: 250')
    assert refusal('start: {crank: 180, coupler: 15, rocker: 80}', text=long_ground).endswith(
        'in no assembly it closes at crank = 180 deg, in [1] it does at 252.1 .. 467.9 deg'
    )


def test_other_names_are_reported_with_the_nearest() -> None:
    with pytest.raises(LinkageFileError, match=r'janson is shipped: .*; did you mean jansen'):
        shipped_linkage('janson')
    with pytest.raises(GeometryError, match='did you mean l_bc'):
        KlannGeometry().linkage.varied({'L_BC': 0.35})
