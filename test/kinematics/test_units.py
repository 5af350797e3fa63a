"""Degrees and millimetres: what is meant is said, and what is likely wrong is warned of."""

from collections.abc import Callable
import math
from threading import Thread
from typing import Any
import warnings

from klann_ros.dynamics import Dynamics, rods
from klann_ros.kinematics import (
    deg,
    foot_path,
    FourBar,
    GeometryError,
    KlannGeometry,
    KlannLeg,
    linkage_poses,
    LinkageLeg,
    shipped_linkage,
    UnreachableError,
)
from klann_ros.sanitize import units
from klann_ros.sanitize.units import UnitWarning
from klann_ros.synthesis import function_task
import numpy as np
import pytest

LEG = KlannLeg()
BAR = FourBar(180, 80, 200, 150)
# Of a crank that does not turn fully.
STUCK = FourBar(300, 200, 180, 150)


@pytest.mark.parametrize(
    'call',
    [
        lambda: LEG.solve(60),
        lambda: KlannLeg().solve(60.0),
        lambda: LEG.closed_form(-90),
        lambda: LEG.phi(1.0, [15, 60, 45, 60]),
        lambda: BAR.solve(60),
        lambda: BAR.newton(60, [0.2, 1.4]),
        lambda: BAR.transmission_angle(60),
        lambda: BAR.mechanical_advantage(60),
        lambda: BAR.table([0, 60, 120]),
        lambda: linkage_poses(LEG, np.arange(0, 360)),
        lambda: linkage_poses(LEG, np.arange(0.0, 3600.0)),
        lambda: Dynamics(LEG, rods(LEG, 1.0)).crank_torque([0, 60]),
        lambda: LinkageLeg(shipped_linkage('jansen')).solve(30),
        lambda: function_task(lambda x: 1.0 / x, (1.0, 2.0), (90, 90)),
    ],
)
def test_whole_numbers_beyond_a_turn_are_warned_of(call: Callable[[], Any]) -> None:
    with pytest.warns(UnitWarning, match=r'is read in rad: .* 60 degrees are 60 \* deg') as warned:
        call()
    assert len(warned) == 1


def test_a_loop_in_degrees_is_warned_of_once() -> None:
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter('default')
        for k in range(0, 360, 10):
            LEG.solve(k)
    assert [warning.category for warning in warned] == [UnitWarning]


def test_a_program_reports_once_in_its_own_words(monkeypatch: pytest.MonkeyPatch) -> None:
    reports: list[str] = []
    monkeypatch.setattr(units, '_reports', [])
    with warnings.catch_warnings():
        # As by python -W error, which must not stop a node.
        warnings.simplefilter('error')
        units.report_unit_warnings(reports.append)
        token = units.omits_degrees.set(True)
        KlannLeg().solve(30)
        units.omits_degrees.reset(token)
        assert not reports
        KlannLeg().solve(60)
        KlannLeg().solve(120)
        thread = Thread(target=KlannGeometry, kwargs={'l_gh': 430.0})
        thread.start()
        thread.join()
    assert reports[0].endswith(': if it is in degrees, convert it (60 deg are 1.0472 rad)')
    assert [text.partition(' ')[0] for text in reports] == ['a', 'l_gh']


def test_radians_are_not_warned_of() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        for alpha in (0, 1, 6, -6.0, 7.5, 100.25, 60 * deg, 720 * deg):
            LEG.solve(alpha)
        linkage_poses(LEG, np.linspace(0.0, 100.0, 1001))
        linkage_poses(LEG, [0, 1, 2, 6])
        linkage_poses(LEG, [])
        BAR.newton(1.0, [0.0, 1.0])


def test_degrees_are_said_by_a_factor() -> None:
    assert 180 * deg == pytest.approx(math.pi, rel=1e-15)
    x = LEG.newton(60 * deg, [a * deg for a in (15, 60, 45, 60)])[-1] / deg
    np.testing.assert_allclose(x, [10.659455, 67.329484, 34.463973, 45.722936], atol=1e-6)
    assert BAR.transmission_angle(60 * deg) / deg == pytest.approx(50.580015533)


def test_the_texts_of_a_four_bar_name_no_unit() -> None:
    with pytest.raises(UnreachableError, match=r'are [\d.]+ further apart than AB \+ O4B'):
        STUCK.solve(170 * deg)
    with pytest.raises(GeometryError, match=r'rocker = 500 is not shorter .* \(460\)'):
        FourBar(180, 80, 200, 500)
    with pytest.raises(GeometryError, match='crank = -80 is refused'):
        FourBar(180, -80, 200, 150)
    assert 'stride 177.8, lift 50.78<' in foot_path(BAR)._repr_svg_()
    with pytest.raises(ValueError, match=r'must be finite and at least \S+$'):
        foot_path(BAR).stance(-1.0)


def test_the_texts_of_a_leg_are_in_metres() -> None:
    leg = KlannLeg(LEG.geometry.varied(l_bc=0.33))
    with pytest.raises(UnreachableError, match=r'are [\d.]+ m further apart than BC \+ DC'):
        leg.solve(165.6 * deg)
    assert 'stride 0.491 m, lift 0.3001 m' in foot_path(LEG)._repr_svg_()
