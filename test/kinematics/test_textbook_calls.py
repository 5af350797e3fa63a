"""What a textbook writes down of Newton-Raphson: f, Phi, corrections, and when it stops."""

import math

from klann_ros.kinematics import (
    CrankAngleError,
    FourBar,
    KlannLeg,
    LinkageLeg,
    NotConvergedError,
    shipped_linkage,
    shipped_linkages,
    SingularPoseError,
)
import numpy as np
import pytest

ALPHA = math.radians(60.0)
KLANN = KlannLeg(), np.radians([15.0, 60.0, 45.0, 60.0])
BAR = FourBar(180.0, 80.0, 200.0, 150.0), np.radians([15.0, 80.0])


@pytest.mark.parametrize(('leg', 'guess'), [KLANN, BAR], ids=['klann', 'four-bar'])
def test_a_run_is_its_iterates_f_phi_and_corrections(leg: KlannLeg, guess: np.ndarray) -> None:
    run = leg.iterations(ALPHA, guess)
    assert (run.x == leg.newton(ALPHA, guess)).all()
    assert run.names == leg.joint_names[1:]
    for k, x in enumerate(run.x):
        assert (run.f[k] == leg.f(ALPHA, x)).all()
        assert (run.phi[k] == leg.phi(ALPHA, x)).all()
        assert run.residuals[k] == np.abs(run.f[k]).max()
        if k < len(run.x) - 1:
            np.testing.assert_allclose(run.corrections[k], leg.correction(ALPHA, x), atol=1e-14)
    for array in (run.x, run.f, run.phi):
        with pytest.raises(ValueError, match='read-only'):
            array[0] = 0.0
    lines = str(run).splitlines()
    assert len(lines) == 2 + len(run.x)
    end = 1 + len(guess)
    assert [float(cell) for cell in lines[2].split()[1:end]] == pytest.approx(np.degrees(guess))


def test_a_distance_is_shown_as_one() -> None:
    leg = LinkageLeg(shipped_linkage('slider_crank'))
    run = leg.iterations(0.3, [0.0, 0.2])
    assert run.units == ('rad', 'm')
    lines = str(run).splitlines()
    assert lines[0].startswith('rod, piston [deg, m], f, corrections')
    last = [float(cell) for cell in lines[-1].split()[1:3]]
    assert last == pytest.approx([math.degrees(run.x[-1, 0]), run.x[-1, 1]], abs=1e-5)


def test_it_stops_where_the_course_does() -> None:
    bar, guess = BAR
    for residual in (1e-4, 1e-5, 50.0, 1.5):
        run = bar.iterations(ALPHA, guess, residual=residual)
        below = run.residuals < residual
        assert below.tolist() == [False] * (len(run.x) - 1) + [True]
    # A guess that is good enough is the answer.
    assert len(bar.newton(ALPHA, guess, residual=100.0)) == 1


@pytest.mark.parametrize('tolerance', [1e-1, 1e-3, 1e-5, 1e-9])
def test_it_stops_at_the_first_small_correction(tolerance: float) -> None:
    leg, guess = KLANN
    run = leg.iterations(ALPHA, guess, tolerance=tolerance)
    small = np.abs(run.corrections).max(axis=1) <= tolerance
    assert small.tolist() == [False] * (len(small) - 1) + [True]
    both = leg.iterations(ALPHA, guess, tolerance=tolerance, residual=1e-12)
    assert len(both.x) >= len(run.x)
    assert both.residuals[-1] < 1e-12


@pytest.mark.parametrize('name', ['tolerance', 'residual'])
@pytest.mark.parametrize('value', [0.0, -1.0, math.nan, math.inf, '1e-4'])
def test_an_invalid_stopping_criterion_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf'{name} = .* is refused'):
        BAR[0].newton(ALPHA, BAR[1], **{name: value})


def test_a_stop_that_is_not_reached_is_reported() -> None:
    bar, guess = BAR
    with pytest.raises(NotConvergedError, match=r'\|f\| is not below 1e-05 m after 2') as caught:
        bar.newton(ALPHA, guess, residual=1e-5, max_iterations=2)
    assert caught.value.iterates.shape == (3, 2)


def test_an_angle_without_any_assembly_is_reported() -> None:
    bar = FourBar(0.3, 0.25, 0.2, 0.24)
    with pytest.raises(NotConvergedError, match=r'at this crank angle it closes in no assembly$'):
        bar.newton(math.pi, [0.1, 0.2])
    # It could have converged here.
    with pytest.raises(NotConvergedError, match=r'after 1 iterations$'):
        bar.newton(1.0, [0.1, 0.2], max_iterations=1)


@pytest.mark.parametrize('call', ['f', 'phi', 'correction', 'newton'])
def test_invalid_angles_are_refused(call: str) -> None:
    for leg in (KLANN[0], BAR[0]):
        with pytest.raises(ValueError, match=r' = .* is refused: .*(two|four) finite numbers'):
            getattr(leg, call)(ALPHA, [1.0])
        with pytest.raises(CrankAngleError):
            getattr(leg, call)(math.nan, [1.0] * (len(leg.joint_names) - 1))


def test_a_singular_estimate_has_no_correction() -> None:
    with pytest.raises(SingularPoseError):
        FourBar(2, 1, 2, 1).correction(0.0, [0.0, 0.0])


def test_the_course_alpha_and_beta_give_theta4_all_round_in_both_assemblies() -> None:
    for sign in (1, -1):
        bar = FourBar(180.0, 80.0, 200.0, 150.0, sign)
        for theta2 in np.radians(np.arange(-180.0, 540.0, 7.0)).tolist():
            pose = bar.solve(theta2)
            theta4 = math.pi - (sign * pose.alpha + pose.beta)
            assert math.remainder(theta4 - pose.theta4, math.tau) == pytest.approx(0.0, abs=1e-12)
            above = 0.0 <= pose.beta <= math.pi
            assert above == (math.sin(theta2) >= 0.0)
            assert 0.0 <= pose.alpha <= math.pi


def test_the_cranks_angle_has_one_name_in_every_linkage() -> None:
    legs = [
        KlannLeg(),
        BAR[0],
        *(LinkageLeg(shipped_linkage(name)) for name in shipped_linkages()),
    ]
    for leg in legs:
        pose = leg.solve(1.25)
        assert pose.crank_angle == pose.joints[0] == 1.25
    pose = BAR[0].solve(ALPHA)
    assert (pose.theta2, round(math.degrees(pose.alpha), 2)) == (ALPHA, 81.53)
    assert repr(pose).startswith(f'FourBarPose(theta2={ALPHA:.7g}, theta3=')
    assert 'alpha' not in repr(pose)


@pytest.mark.parametrize('bar', [BAR[0], FourBar(0.3, 0.25, 0.2, 0.24), FourBar(2, 1, 2, 1, -1)])
def test_the_table_equals_the_single_poses(bar: FourBar) -> None:
    theta2 = np.radians(np.arange(0.0, 360.0, 15.0)).reshape(4, 6)
    table = bar.table(theta2)
    for index, angle in np.ndenumerate(theta2):
        row = [
            float(getattr(table, name)[index])
            for name in ('theta3', 'theta4', 'alpha', 'beta', 'z', 'transmission_angle')
        ]
        if math.isnan(row[0]):
            assert np.isnan([*row, table.mechanical_advantage[index]]).all()
            with pytest.raises(Exception, match='cannot be reached'):
                bar.solve(angle)
            continue
        pose = bar.closed_form(angle)
        own = [pose.theta3, pose.theta4, pose.alpha, pose.beta, pose.z, pose.transmission_angle]
        assert row == pytest.approx(own, abs=1e-7)
        assert float(table.mechanical_advantage[index]) == pytest.approx(
            bar.mechanical_advantage(angle), rel=1e-6, nan_ok=True
        )
    assert not table.theta4.flags.writeable


def test_a_table_is_shown_as_one() -> None:
    lines = str(BAR[0].table([0.0, ALPHA])).splitlines()
    assert lines[0].split() == [
        *('theta2', 'theta3', 'theta4', 'alpha', 'beta', 'Z', 'mu', 'T4/T2')
    ]
    assert lines[3].split()[:5] == ['60.00', '21.56', '72.14', '81.53', '26.33']
    assert str(BAR[0].table(np.zeros(150))).endswith('... and 50 more')
    assert len(str(BAR[0].table(1.0)).splitlines()) == 3
