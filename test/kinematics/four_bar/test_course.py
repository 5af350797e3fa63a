"""The numbers that the four-bar course prints, and its exercises."""

import math
from pathlib import Path

import four_bar_equations as equations
from klann_ros.kinematics import FourBar
import numpy as np
import pytest
import yaml

# L1 to L4 of the examples [mm], as they are computed with in the course.
EXAMPLE = FourBar(180.0, 80.0, 200.0, 150.0)
EXERCISE = FourBar(0.300, 0.100, 0.250, 0.200)
THETA2 = math.radians(60.0)
ROOT = np.radians([21.557634918, 72.137650451])
ITERATIONS = yaml.safe_load(
    Path(__file__).with_name('iterations.yaml').read_text(encoding='utf-8')
)


def test_example_1_prints_z_and_the_transmission_angle() -> None:
    pose = EXAMPLE.solve(THETA2)
    assert round(pose.z, 2) == 156.20
    mu = EXAMPLE.transmission_angle(THETA2)
    assert round(math.degrees(mu), 2) == 50.58
    assert round(360.0 - math.degrees(mu), 2) == 309.42
    assert math.degrees(mu) == pytest.approx(50.580015533, abs=5e-10)
    assert pose.transmission_angle == pytest.approx(mu, abs=1e-15)
    assert pose.transmission_angles == (pose.transmission_angle,)


def test_example_1_prints_alpha_beta_and_both_assemblies() -> None:
    pose = EXAMPLE.closed_form(THETA2)
    z = pose.z
    alpha = math.degrees(math.acos((z**2 + 150.0**2 - 200.0**2) / (2 * z * 150.0)))
    beta = math.degrees(math.acos((z**2 + 180.0**2 - 80.0**2) / (2 * z * 180.0)))
    assert (round(alpha, 2), round(beta, 2)) == (81.53, 26.33)
    assert round(math.degrees(pose.theta4), 2) == 72.14
    assert math.degrees(pose.theta4) == pytest.approx(180.0 - alpha - beta, abs=1e-12)
    other = FourBar(180.0, 80.0, 200.0, 150.0, -1).closed_form(THETA2)
    assert round(math.degrees(other.theta4) % 360.0, 2) == 235.20


@pytest.mark.parametrize('printed', ITERATIONS)
def test_example_2_prints_f_phi_and_the_correction_of_each_estimate(
    printed: dict[str, list[float]],
) -> None:
    estimate, f, phi, correction = printed.values()
    x = np.radians(estimate)
    ours_f, ours_phi = equations.f(EXAMPLE.geometry, THETA2, x), equations.phi(EXAMPLE.geometry, x)
    places = 3 if abs(f[0]) > 1.0 else 6
    assert ours_f.round(places).tolist() == f
    assert ours_phi.round(3).ravel().tolist() == phi
    ours = -np.linalg.solve(ours_phi, ours_f)
    if estimate[0] != 21.5577:
        digits = 4 if places == 3 else 6
        assert ours.round(digits).tolist() == correction
    else:
        # f is printed with three digits here, and the correction made of those.
        np.testing.assert_allclose(ours, correction, rtol=0, atol=1e-8)


def test_example_2_prints_its_iterates_with_rounded_corrections() -> None:
    x, printed = np.array([15.0, 80.0]), []
    for _ in range(2):
        f = equations.f(EXAMPLE.geometry, THETA2, np.radians(x))
        phi = equations.phi(EXAMPLE.geometry, np.radians(x))
        x = (x - np.degrees(np.linalg.solve(phi, f).round(4))).round(3)
        printed.append(x.tolist())
    assert printed == [[21.812, 71.864], [21.560, 72.139]]


def test_newton_makes_the_exact_iterates_of_example_2() -> None:
    iterates = np.degrees(EXAMPLE.newton(THETA2, np.radians([15.0, 80.0])))
    assert iterates[0].tolist() == pytest.approx([15.0, 80.0], abs=1e-13)
    assert iterates[1].round(5).tolist() == [21.81424, 71.86198]
    assert iterates[2].round(5).tolist() == [21.55780, 72.13721]
    assert iterates[3].round(5).tolist() == [21.55763, 72.13765]
    # The third printed row and the result.
    np.testing.assert_allclose(iterates[3], [21.5577, 72.1377], rtol=0, atol=1e-4)
    np.testing.assert_allclose(iterates[-1], [21.5576353, 72.1376951], rtol=0, atol=1e-4)
    np.testing.assert_allclose(np.radians(iterates[-1]), ROOT, rtol=0, atol=1e-11)


def test_the_printed_result_is_off_by_a_misplaced_decimal_point() -> None:
    # 0.00000086 rad are 0.000049 deg; the course subtracts 0.0000049 deg from 72.1377 deg.
    assert math.degrees(0.86e-6) == pytest.approx(0.000049, abs=5e-7)
    printed = 72.1377 - 0.0000049
    assert printed == pytest.approx(72.1376951, abs=1e-9)
    assert math.degrees(ROOT[1]) == pytest.approx(72.1377 - 0.000049, abs=1e-6)


def test_the_check_of_the_solution_prints_these_residuals() -> None:
    f = equations.f(EXAMPLE.geometry, THETA2, np.radians([21.55764, 72.13769]))
    assert f.round(6).tolist() == [-0.000092, 0.000015]


@pytest.mark.parametrize('degrees', [45.0, 60.0])
def test_the_exercises_agree_by_both_methods(degrees: float) -> None:
    theta2 = math.radians(degrees)
    iterates = EXERCISE.newton(theta2, np.radians([30.0, 100.0]))
    expected = EXERCISE.closed_form(theta2)
    np.testing.assert_allclose(iterates[-1], expected.x, rtol=0, atol=1e-12)
    assert np.abs(equations.f(EXERCISE.geometry, theta2, iterates[-1])).max() < 1e-15


def test_exercise_3_has_this_transmission_and_output_angle() -> None:
    # cos mu = (250^2 + 200^2 - 300^2 - 100^2 + 2 300 100 cos 45) / (2 250 200)
    cosine = (62500 + 40000 - 90000 - 10000 + 60000 * math.sqrt(0.5)) / 100000
    theta2 = math.radians(45.0)
    assert EXERCISE.transmission_angle(theta2) == pytest.approx(math.acos(cosine), abs=1e-15)
    pose = EXERCISE.solve(theta2)
    assert math.degrees(pose.transmission_angle) == pytest.approx(63.3035, abs=5e-5)
    assert pose.transmission_angle == pytest.approx(math.acos(cosine), abs=1e-15)
