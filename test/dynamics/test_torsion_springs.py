"""Torsion springs at joints: a published compliant leg, the engine, and refusals."""

import cmath
from math import pi
from pathlib import Path
from typing import Any

from klann_ros.dynamics import Dynamics, MassError, Masses, masses_from_text, rods, TorsionSpring
from klann_ros.kinematics import deg, FourBar, linkage_from_text, LinkageFileError, LinkageLeg
from klann_ros.robot import robot_from_text
import numpy as np
import pytest

TEXT = Path(__file__).with_name('compliant_klann.yaml').read_text('utf-8')
LEG = linkage_from_text(TEXT, 'compliant_klann')
STEP = 1e-5
# The published leg: its lengths [mm], angles and the crank angle without deflections [rad].
A, B = -94.0, -94.0 + cmath.rect(76.0, 80.5157 * deg)
REST = 18 * deg
STIFFNESS = 1.2386e-3 / deg


def meeting(p: complex, q: complex, r_p: float, r_q: float, side: float) -> complex:
    """Return where two circles meet, to the left of p q for side +1."""
    d = abs(q - p)
    along = (r_p**2 - r_q**2 + d**2) / (2.0 * d)
    return p + (along + 1j * side * (r_p**2 - along**2) ** 0.5) * (q - p) / d


def directions(crank: float) -> list[complex]:
    """Return the links C D, A D, B E and E M of the published leg, on its own equations."""
    c = cmath.rect(28.0, crank)
    d = meeting(c, A, 91.0, 39.6566, -1.0)
    m = c + 2.1 * (d - c) * cmath.exp(-10.6073j * deg)
    e = meeting(m, B, 95.0, 48.441, 1.0)
    return [d - c, d - A, e - B, m - e]


def published_energy(crank: float) -> float:
    """Return the energy of its five joints with linear stiffness [J]."""
    coupler, lower, upper, leg = (
        cmath.phase(link / first)
        for link, first in zip(directions(crank), directions(REST), strict=True)
    )
    deflections = np.array([lower, upper, lower - coupler, leg - upper, coupler - leg])
    return float(STIFFNESS / 2.0 * ((deflections + pi) % (2.0 * pi) - pi) @ deflections)


def dynamics() -> Dynamics:
    masses = masses_from_text(TEXT, LEG, 'compliant_klann')
    assert masses is not None
    return Dynamics(LEG, masses)


def test_the_energy_of_a_compliant_leg_is_that_of_its_published_joints() -> None:
    alphas = np.arange(0.0, 360.0, 15.0) * deg
    expected = [published_energy(alpha) for alpha in alphas]
    energy = dynamics().potential_energy(alphas)
    np.testing.assert_allclose(energy, expected, rtol=1e-7, atol=1e-9)
    assert dynamics().masses.origin.endswith(', with 5 springs')
    assert dynamics().potential_energy(REST)[0] == pytest.approx(0.0, abs=1e-12)
    assert max(expected) == pytest.approx(0.2137, abs=1e-4)


def test_its_torque_stores_and_releases_that_energy() -> None:
    alphas = np.arange(0.0, 360.0, 15.0) * deg
    slopes = []
    for alpha in alphas:
        rise = published_energy(alpha + STEP) - published_energy(alpha - STEP)
        slopes.append(rise / (2.0 * STEP))
    torque = dynamics().crank_torque(alphas)
    np.testing.assert_allclose(torque, slopes, atol=1e-7)
    np.testing.assert_allclose(dynamics().reactions(alphas).torque, torque, atol=1e-12)
    turn = dynamics().turn(1.0)
    assert abs(turn.mean) < 1e-9 * turn.peak
    # It is released while the foot is on the ground, from its least x to its greatest y.
    leg = LinkageLeg(LEG)
    feet = np.array([leg.closed_form(alpha).h for alpha in turn.alphas])
    first, last = feet[:, 0].argmin(), feet[:, 1].argmax()
    stored = dynamics().potential_energy(turn.alphas)
    assert stored[first] > stored[last]


def test_the_engine_turns_a_compliant_leg_with_the_same_torque() -> None:
    twin = pytest.importorskip('klann_ros.twin')
    pytest.importorskip('mujoco')
    robot = robot_from_text(TEXT.replace('density: 0.0', 'density: 0.2'), 'compliant.yaml')
    compared = twin.agreement(robot, pi, samples=60)
    assert compared.foot <= 1e-5
    assert compared.torque_as_moved <= 1e-3
    assert compared.reactions <= 1e-3
    without = robot.legs[0].masses
    assert without is not None
    rigid = Dynamics(LEG, Masses(without.bodies)).turn(pi)
    assert Dynamics(LEG, without).turn(pi).peak > 2.0 * rigid.peak


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        (('between: [ground, lower]', 'between: [ground, leg]'), 'A joins ground, lower; two of'),
        (('joint: A', 'joint: Z'), 'between ground, lower: Z joins nothing'),
        (('stiffness: 0.07', 'stiffness: -0.07'), 'stiffness: -0.0709665525 must be >= 0'),
        (('between: [ground, lower]', 'between: [ground]'), 'torsion_springs[0].between'),
        (('rest_angle: 38', 'rest: 38'), 'rest'),
    ],
)
def test_a_torsion_spring_that_is_none_is_refused(change: tuple[str, str], message: str) -> None:
    with pytest.raises((MassError, LinkageFileError)) as caught:
        text = TEXT.replace(*change)
        masses_from_text(text, linkage_from_text(text, 'x.yaml'), 'x.yaml')
    assert message in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_deflection_is_within_half_a_turn() -> None:
    bar = FourBar(0.18, 0.08, 0.2, 0.15).linkage
    for turns in (-1, 0, 1):
        spring = TorsionSpring('O4', ('ground', 'theta4'), 2.0, 1.0 + turns * 2.0 * pi)
        masses: Any = rods(bar, 0.0)
        energy = Dynamics(bar, Masses(masses.bodies, (), (spring,))).potential_energy(60 * deg)
        assert energy == pytest.approx((72.137650451 * deg - 1.0) ** 2)
