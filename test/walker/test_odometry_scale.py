"""Factors of a calibration correct the path of the odometry, and its covariance with it."""

from cmath import rect
from pathlib import Path

from hypothesis import given, strategies as st
from klann_ros.gait import Feet, Steering
from klann_ros.robot import robot_of
from klann_ros.walker import Odometry, OdometryEstimate, OdometryScale, Walker
import numpy as np
import pytest

WALKER = Path(__file__).resolve().parents[2] / 'config' / 'walker6_two_motors.yaml'
factors = st.floats(0.8, 1.25)
speeds = st.floats(-0.3, 0.3)
COVARIANCE = ((0.04, 0.01, 0.002), (0.01, 0.09, 0.003), (0.002, 0.003, 0.01))


def estimate(place: complex, yaw: float, speed: float = 0.1) -> OdometryEstimate:
    return OdometryEstimate(
        place.real, place.imag, 0.3, 0.01, 0.02, yaw, (speed, 0.0), 0.2, COVARIANCE,
        (0.01, 0.02, 0.03),
    )  # fmt: skip


@given(factors, factors, st.lists(st.tuples(speeds, speeds), min_size=1, max_size=30))
def test_the_scaled_path_of_wrong_estimates_is_the_true_one(
    linear: float, angular: float, motions: list[tuple[float, float]]
) -> None:
    scale = OdometryScale(linear, angular)
    true_place = place = 0j
    true_yaw = yaw = 0.0
    for speed, turn in motions:
        true_place += speed * rect(1.0, true_yaw + turn / 2.0)
        true_yaw += turn
        place += speed / linear * rect(1.0, yaw + turn / angular / 2.0)
        yaw += turn / angular
        scaled = scale.scaled(estimate(place, yaw))
    assert complex(scaled.x, scaled.y) == pytest.approx(true_place, abs=1e-9)
    assert rect(1.0, scaled.yaw) == pytest.approx(rect(1.0, true_yaw), abs=1e-9)
    # Height and attitude have no scale.
    assert (scaled.z, scaled.roll, scaled.pitch) == (0.3, 0.01, 0.02)


def test_the_covariance_is_that_of_the_scaled_errors() -> None:
    scaled = OdometryScale(2.0, 3.0).scaled(estimate(1.0 + 0j, 0.5))
    # It has turned by three times 0.5 rad, where the estimate turned by 0.5 rad.
    turn = rect(2.0, 1.0)
    jacobian = np.array([[turn.real, -turn.imag, 0], [turn.imag, turn.real, 0], [0, 0, 3.0]])
    expected = jacobian @ np.array(COVARIANCE) @ jacobian.T
    assert np.array(scaled.covariance) == pytest.approx(expected)
    assert scaled.rate_variances == pytest.approx((0.04, 0.08, 0.27))
    assert (*scaled.linear, scaled.angular) == pytest.approx((0.2, 0.0, 0.6))


def test_without_factors_an_estimate_stays_itself() -> None:
    unscaled = estimate(1.0 + 2.0j, 3.0)
    assert OdometryScale().scaled(unscaled) is unscaled


@pytest.fixture(scope='module')
def feet() -> Feet:
    return Feet(robot_of(str(WALKER)))


def walked(odometry: Odometry, first: int, last: int) -> OdometryEstimate:
    """Walk in a curve between two readings, at 100 Hz."""
    for k in range(first, last):
        latest = odometry.update([0.008 * k, 0.012 * k], [0.8, 1.2], 0.01)
    return latest


def test_a_walk_from_a_set_pose_is_the_same_walk_from_there(feet: Feet) -> None:
    plain = Odometry(feet)
    start = walked(plain, 0, 300)
    set_odometry = Odometry(feet)
    walked(set_odometry, 0, 300)
    set_odometry.set_pose((1.0, 2.0, 0.7), np.zeros((3, 3)))
    end = walked(plain, 300, 600)
    set_end = walked(set_odometry, 300, 600)
    step = complex(end.x - start.x, end.y - start.y) * rect(1.0, 0.7 - start.yaw)
    # What is learned later of the velocity before changes the whole walk only.
    assert complex(set_end.x, set_end.y) == pytest.approx(1.0 + 2.0j + step, abs=1e-3)
    assert set_end.yaw - 0.7 == pytest.approx(end.yaw - start.yaw, abs=1e-3)
    # A shorter walk is known better, and from its own covariance on.
    assert np.trace(set_end.covariance) < np.trace(end.covariance)
    set_odometry.set_pose((0.0, 0.0, 0.0), np.array(COVARIANCE))
    assert np.array(walked(set_odometry, 600, 601).covariance) == pytest.approx(
        np.array(COVARIANCE), rel=0.05
    )


def test_a_set_pose_is_independent_of_what_else_is_known(feet: Feet) -> None:
    odometry = Odometry(feet)
    walked(odometry, 0, 300)
    covariance = odometry.state.covariance.copy()
    assert np.abs(covariance[:3, 3:]).max() > 0.0
    odometry.set_pose((1.0, 2.0, 3.0), np.array(COVARIANCE))
    set_covariance = odometry.state.covariance
    assert not set_covariance[:3, 3:].any()
    assert not set_covariance[3:, :3].any()
    assert (set_covariance[3:, 3:] == covariance[3:, 3:]).all()
    assert (set_covariance[:3, :3] == COVARIANCE).all()


@pytest.mark.parametrize('factor', [1.0, 1.1])
def test_a_walker_goes_on_at_a_set_pose(feet: Feet, factor: float) -> None:
    walker = Walker(Steering(feet), scale=OdometryScale(factor, factor))

    def walk(first: int, last: int) -> OdometryEstimate | None:
        for k in range(first, last):
            readings = {'left_crank': (0.01 * k, 1.0), 'right_crank': (0.01 * k, 1.0)}
            walker.controller.command(0.15, 0.0, 0.01 * k)
            latest = walker.feedback(readings, 0.01 * k)
            walker.controller.step(0.01 * k)
        return latest

    walk_end = walk(0, 200)
    lag = walker.controller.motion_feedback.lag
    walker.set_pose((5.0, -3.0, 1.0), COVARIANCE)
    continued = walk(200, 201)
    assert walk_end.x > 0.1
    assert (continued.x, continued.y, continued.yaw) == pytest.approx((5.0, -3.0, 1.0), abs=0.01)
    # A covariance that users give is in their scale.
    assert np.array(continued.covariance) == pytest.approx(
        np.array(COVARIANCE), rel=0.05, abs=1e-3
    )
    # No motion was measured on the way there.
    assert walker.controller.motion_feedback.lag == pytest.approx(lag, abs=0.01)
    walker.set_pose()
    reset_estimate = walk(201, 202)
    assert (reset_estimate.x, reset_estimate.y, reset_estimate.yaw) == pytest.approx(
        (0.0, 0.0, 0.0), abs=0.01
    )
