"""Where a walker is, from the angles of its cranks alone."""

from math import atan, hypot, inf, nan, pi
from operator import attrgetter
from pathlib import Path

from klann_ros.dynamics import GRAVITY
from klann_ros.gait import Feet, Steering
from klann_ros.gait.stance import outside_feet, support
from klann_ros.gait.steering import Twist2D
from klann_ros.robot import robot_of
from klann_ros.walker import (
    DiagnosticLevel,
    ImuReading,
    Odometry,
    OdometryEstimate,
    OdometryNoise,
    Walker,
)
from klann_ros.walker.accelerometer import AccelerometerState
from klann_ros.walker.crank_motion import StanceEstimator
import numpy as np
import pytest

CONFIG = Path(__file__).resolve().parents[2] / 'config'
# No reading of a sensor repeats the last one: its yaw differs by this [rad].
TREMBLE = (0.0, 1e-9)
# Two feet in the middle, and one at each end that is higher.
SEESAW = [(1.0, 0.0, -0.2), (0.0, 0.3, -0.3), (0.0, -0.3, -0.3), (-1.0, 0.0, -0.2)]


def walked(
    feet: Feet, left: float, right: float, *, seconds: float = 10.0, step: float = 0.02
) -> tuple[Odometry, OdometryEstimate]:
    """Return the odometry of a walk at two rates."""
    odometry = Odometry(feet)
    for k in range(round(seconds / step) + 1):
        estimate = odometry.update((left * k * step, right * k * step), (left, right))
    return odometry, estimate


def test_straight_on_it_goes_as_far_as_its_feet_carry_it(two_motors: Feet) -> None:
    _, estimate = walked(two_motors, 0.2, 0.2, seconds=10.0 * pi, step=0.05)
    assert estimate.x == pytest.approx(2.0 * pi * 0.1495, rel=0.01)
    assert abs(estimate.y) < 0.01
    assert abs(estimate.yaw) < 0.01
    assert estimate.z == pytest.approx(0.31, abs=0.02)


def test_back_on_the_same_way_it_is_where_it_was(two_motors: Feet) -> None:
    odometry = Odometry(two_motors)
    angles = [0.004 * k for k in range(500)]
    for angle in (*angles, *reversed(angles)):
        estimate = odometry.update((angle, angle), (0.4, 0.4))
    # But for the feet that slid, and slide back elsewhere.
    assert hypot(estimate.x, estimate.y) < 0.02
    assert odometry.travelled > 0.5


def test_mirrored_rates_are_a_mirrored_walk(two_motors: Feet) -> None:
    # Half a turn of the gait mirrors the legs.
    odometry = Odometry(two_motors)
    mirrored = Odometry(two_motors)
    for k in range(400):
        left = 0.008 * k
        right = 0.014 * k
        pose = odometry.update((left, right), (0.4, 0.7))
        image = mirrored.update((right + pi, left + pi), (0.7, 0.4))
    assert (image.x, image.y, image.yaw) == pytest.approx((pose.x, -pose.y, -pose.yaw), abs=0.02)
    assert pose.yaw > 0.04


def test_it_turns_as_predicted_from_any_phase(two_motors: Feet) -> None:
    rates = Steering(two_motors).rates(Twist2D(0.05, 0.1))
    yaws = []
    for start in (0.0, 1.6, 3.1, 4.7):
        odometry = Odometry(two_motors)
        for k in range(250):
            cranks = [0.04 * k * rates.left, 0.04 * k * rates.right + start]
            estimate = odometry.update(cranks, rates)
        yaws.append(estimate.yaw)
    assert np.mean(yaws) == pytest.approx(1.0, rel=0.15)


@pytest.mark.parametrize('step', [0.005, 0.05, 0.5])
def test_the_pose_depends_little_on_the_update_rate(two_motors: Feet, step: float) -> None:
    _, fine = walked(two_motors, 1.0, 1.0, seconds=3.0, step=0.01)
    _, coarse = walked(two_motors, 1.0, 1.0, seconds=3.0, step=step)
    assert coarse.x == pytest.approx(fine.x, rel=0.02)


def test_velocity_is_that_of_the_way(two_motors: Feet) -> None:
    odometry = Odometry(two_motors)
    speeds = []
    xs = []
    for k in range(315):
        estimate = odometry.update((0.02 * k, 0.02 * k), (1.0, 1.0))
        speeds.append(estimate.linear[0])
        xs.append(estimate.x)
    assert np.sum(speeds) * 0.02 == pytest.approx(xs[-1], rel=2e-3)
    # But for the body, which tips on until it lies still.
    assert hypot(*odometry.update((6.28, 6.28), (0.0, 0.0)).linear) < 0.02


def test_doubt_grows_with_the_way_and_stays_while_it_stands(two_motors: Feet) -> None:
    odometry, estimate = walked(two_motors, 1.0, 1.0, seconds=5.0)
    estimate = odometry.update((5.0, 5.0), (0.0, 0.0))
    for _ in range(100):
        standing = odometry.update((5.0, 5.0), (0.0, 0.0))
    assert np.array(standing.covariance) == pytest.approx(np.array(estimate.covariance), abs=1e-6)
    _, further = walked(two_motors, 1.0, 1.0, seconds=20.0)
    assert np.all(np.diag(further.covariance) > np.diag(estimate.covariance))
    assert np.all(np.linalg.eigvalsh(further.covariance) >= 0.0)
    # On the spot the feet are trusted less.
    _, spot = walked(two_motors, -1.0, 1.0, seconds=5.0)
    assert spot.covariance[2][2] > 2.0 * estimate.covariance[2][2]


def test_the_covariance_turns_with_the_heading(two_motors: Feet) -> None:
    """The same walk, begun to the north instead of to the east."""
    estimates = []
    for heading in (0.0, pi / 2.0):
        odometry = Odometry(two_motors)
        odometry.state.mean[2] = heading
        for k in range(200):
            estimate = odometry.update((0.02 * k, 0.03 * k), (1.0, 1.5))
        estimates.append(estimate)
    east, north = estimates
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert (north.x, north.y) == pytest.approx((-east.y, east.x))
    expected = turn @ np.array(east.covariance) @ turn.T
    assert abs(expected[0, 2]) > 1e-5
    assert np.array(north.covariance) == pytest.approx(expected, rel=1e-6, abs=1e-12)


def test_slip_makes_the_way_as_uncertain_ahead_as_aside(two_motors: Feet) -> None:
    covariances = []
    for error in (0.0, 0.2):
        odometry = Odometry(two_motors, OdometryNoise(slip_error=error))
        for k in range(200):
            estimate = odometry.update((0.02 * k, 0.02 * k), (1.0, 1.0))
        covariances.append(np.array(estimate.covariance))
    ahead, aside, yaw = np.diag(covariances[1] - covariances[0])
    assert ahead > 1e-6
    assert (aside, yaw) == pytest.approx((ahead, 0.0), rel=0.05)


@pytest.mark.slow
def test_a_heading_that_is_unknown_by_a_radian_leaves_a_circle_of_poses() -> None:
    odometry = Odometry(
        Feet(robot_of(str(CONFIG / 'walker_jansen.yaml'))), OdometryNoise(slip_yaw_error=0.3)
    )
    path = []
    for k in range(900):
        estimate = odometry.update((0.015 * k, 0.075 * k), (0.3, 1.5))
        path.append((estimate.x, estimate.y))
    diameter = np.ptp(path, axis=0).mean()
    assert estimate.covariance[2][2] > 1.0
    min_deviation, max_deviation = np.sqrt(
        np.linalg.eigvalsh(np.array(estimate.covariance)[:2, :2])
    )
    assert 0.25 * diameter < min_deviation < max_deviation < diameter


def test_a_crank_that_disagrees_with_its_rate_is_not_filtered(two_motors: Feet) -> None:
    odometry = Odometry(two_motors)
    odometry.update((0.0, 0.0), (1.0, 1.0), 0.01)
    odometry.update((0.01, 0.51), (1.0, 1.0), 0.01)
    # Its feet are dragged at once.
    assert odometry.slid > 0.01


def test_the_filter_of_the_encoders_does_not_lag_while_cranks_accelerate(two_motors: Feet) -> None:
    odometry = Odometry(two_motors)
    for k in range(100):
        time = 0.01 * k
        odometry.update((time**2, time**2), (2.0 * time, 2.0 * time), 0.01)
    assert odometry.cranks.angles == pytest.approx([0.99**2] * 2, abs=1e-9)


@pytest.mark.parametrize(
    ('start', 'drift', 'rate', 'yaw'),
    [
        (0.5, 0.001, 0.1, 0.999),
        # A gyro that is off by 0.02 rad/s: the orientation holds in the long run.
        (0.0, 0.0, 0.02, 0.01),
        # A gyro alone is summed up.
        (None, 0.0, 0.1, 0.999),
    ],
)
def test_yaw_is_the_imus_where_there_is_one(
    two_motors: Feet, start: float | None, drift: float, rate: float, yaw: float
) -> None:
    odometry = Odometry(two_motors)
    for k in range(1000):
        angle = None if start is None else start + drift * k
        odometry.imu(ImuReading(angle, rate + TREMBLE[k % 2], 0.01 * k))
        estimate = odometry.update((0.01 * k, 0.01 * k), (1.0, 1.0))
    assert estimate.yaw == pytest.approx(yaw, abs=0.002)
    assert estimate.angular == pytest.approx(rate, abs=1e-4)
    assert estimate.covariance[2][2] >= odometry.noise.heading_error**2


def test_slip_of_the_feet_in_a_curve_changes_no_measured_yaw(two_motors: Feet) -> None:
    """Unequal sides, and an IMU that measures another yaw rate than they make."""
    odometry = Odometry(two_motors)
    for k in range(1700):
        walk_time = max(0.0, 0.01 * k - 2.0)
        odometry.imu(
            ImuReading(0.05 * walk_time, 0.05 if walk_time else 0.0, 0.01 * k, (0.0, 0.0))
        )
        rates = (0.7, 1.4) if walk_time else (0.0, 0.0)
        estimate = odometry.update((0.7 * walk_time, 1.4 * walk_time), rates, 0.01)
    assert estimate.yaw == pytest.approx(0.05 * walk_time, abs=1e-4)
    assert abs(odometry.gyro_bias) < 1e-6


def test_an_orientation_that_trembles_drags_no_feet(two_motors: Feet) -> None:
    rng = np.random.default_rng(3)
    odometry = Odometry(two_motors)
    feet_alone = Odometry(two_motors)
    for k in range(400):
        odometry.imu(ImuReading(0.002 * rng.standard_normal(), 0.0, 0.01 * k))
        estimate = odometry.update((0.01 * k, 0.01 * k), (1.0, 1.0))
        alone = feet_alone.update((0.01 * k, 0.01 * k), (1.0, 1.0))
    assert (estimate.x, estimate.y) == pytest.approx((alone.x, alone.y), abs=0.02)
    assert odometry.slid < 1.3 * feet_alone.slid


def test_a_yaw_rate_is_as_uncertain_as_one_reading_of_the_gyro(two_motors: Feet) -> None:
    odometry = Odometry(two_motors)
    rng = np.random.default_rng(2)
    period = 0.01
    # A density is the deviation of one reading by the root of its rate.
    noise = odometry.noise.gyro_noise / period**0.5
    errors = []
    for k in range(1500):
        odometry.imu(ImuReading(0.0, noise * rng.standard_normal(), period * k))
        estimate = odometry.update((period * k, period * k), (1.0, 1.0))
        if k >= 500:
            errors.append(estimate.angular**2 / estimate.rate_variances[2])
    assert np.mean(errors) < 1.2
    assert estimate.rate_variances[2] > 0.99 * noise**2


def test_an_imu_that_falls_silent_leaves_the_yaw_to_the_feet(steering: Steering) -> None:
    walker = Walker(steering, imu_timeout=0.2)
    for k in range(300):
        now = 0.01 * k
        if k < 100:
            walker.imu(ImuReading(1.0 + TREMBLE[k % 2], 0.0, now), now)
        estimate = walker.feedback(
            {'left_crank': (now, 1.0), 'right_crank': (2.0 * now, 2.0)}, now
        )
        if k == 100:
            assert abs(estimate.yaw) < 1e-4
            assert walker.values(now)['imu'] == 'used'
    assert estimate.yaw > 0.02
    assert walker.values(3.0)['imu'] == 'none'


def test_an_encoder_jump_adds_no_distance(steering: Steering) -> None:
    walker = Walker(steering)
    for k in range(300):
        now = 0.01 * k
        jump = 2.0 if k > 150 else 0.0
        walker.feedback({'left_crank': (now, 1.0), 'right_crank': (now + jump, 1.0)}, now)
    assert walker.odometry.travelled < 0.7
    assert walker.values(3.0)['right_crank jumps'] == '1'


def test_cranks_without_valid_angles_stand(steering: Steering) -> None:
    """As all are stopped then, whatever rates their drivers go on to send."""
    walker = Walker(steering)
    joints = 'left_crank', 'right_crank'
    for k in range(600):
        now = 0.01 * k
        estimate = walker.feedback(dict.fromkeys(joints, (now if k < 100 else nan, 1.0)), now)
    assert estimate
    assert 0.1 < walker.odometry.travelled < 0.2
    assert hypot(*estimate.linear) < 0.001


@pytest.mark.parametrize('bad', [nan, inf, -inf, 1e300, 1e7])
def test_no_angle_makes_the_pose_no_number(steering: Steering, bad: float) -> None:
    walker = Walker(steering)
    walker.feedback({'left_crank': (0.0, 0.0), 'right_crank': (0.0, 0.0)}, 0.0)
    estimate = walker.feedback({'left_crank': (bad, bad), 'right_crank': (0.01, nan)}, 0.01)
    assert np.isfinite(
        [estimate.x, estimate.y, estimate.z, estimate.yaw, *estimate.linear, estimate.angular]
    ).all()
    assert walker.values(0.01)['left_crank rejected'] == '1'


def test_a_returning_imu_turns_by_its_orientation(two_motors: Feet) -> None:
    odometry = Odometry(two_motors)
    for yaw, time in ((0.0, 0.0), (0.0, 0.01), (0.3, 3600.0)):
        odometry.imu(ImuReading(yaw, 0.2, time))
        pose = odometry.update((0.0, 0.0), (0.0, 0.0))
    assert pose.yaw == pytest.approx(0.3, abs=0.01)


def test_a_gyro_bias_learned_at_standstill_turns_no_walk(two_motors: Feet) -> None:
    odometry = Odometry(two_motors)
    bias = 0.004
    for k in range(800):
        angle = max(0.0, 0.01 * (k - 300))
        odometry.imu(ImuReading(None, bias + TREMBLE[k % 2], 0.01 * k))
        estimate = odometry.update((angle, angle), (1.0, 1.0) if angle else (0.0, 0.0), 0.01)
    assert odometry.gyro_bias == pytest.approx(bias, rel=0.1)
    assert abs(estimate.yaw) < 0.2 * bias * 5.0


def test_the_noise_of_the_first_heading_is_no_bias(two_motors: Feet) -> None:
    biases = []
    for seed in range(10):
        odometry = Odometry(two_motors)
        rng = np.random.default_rng(seed)
        for k in range(200):
            yaw, rate = rng.standard_normal(2) * (0.002, 0.005)
            odometry.imu(ImuReading(yaw, rate, 0.01 * k), 4e-6)
            odometry.update((0.0, 0.0), (0.0, 0.0), 0.01)
        biases.append(odometry.gyro_bias)
    assert np.std(biases) < 5e-4


@pytest.mark.slow
@pytest.mark.parametrize('is_commanded', [True, False])
def test_a_slow_turn_is_no_bias_of_the_gyro(two_motors: Feet, *, is_commanded: bool) -> None:
    """By the command, and by the cranks where others command them."""
    odometry = Odometry(two_motors)
    rng = np.random.default_rng(1)
    for k in range(3000):
        time = max(0.0, 0.01 * k - 2.0)
        yaw_rate = 0.0094 if time else 0.0
        odometry.imu(ImuReading(yaw_rate * time, yaw_rate + 1e-5 * (k % 2), 0.01 * k))
        angle = 0.06 * time * (0.0 if is_commanded else 1.0)
        left, right = 0.001 * rng.standard_normal(2)
        cranks = left - angle, right + angle
        pose = odometry.update(cranks, (0.0, 0.0), 0.01, is_commanded=is_commanded and time > 0.0)
    # By the cranks it takes a fifth of a second.
    assert abs(odometry.gyro_bias) < (2e-4 if is_commanded else 2e-3)
    assert pose.yaw == pytest.approx(0.0094 * time, abs=0.01 if is_commanded else 0.06)


def test_a_walker_tells_its_odometry_what_is_commanded(steering: Steering) -> None:
    walker = Walker(steering)
    for k in range(1500):
        now = 0.01 * k
        yaw = 0.0094 * max(0.0, now - 2.0)
        if yaw:
            walker.controller.command(0.0, 0.0094, now)
            walker.controller.step(now)
        walker.imu(ImuReading(yaw, 0.0094 if yaw else 0.0, now), now)
        walker.feedback(dict.fromkeys(('left_crank', 'right_crank'), (0.0, 0.0)), now)
    assert abs(walker.odometry.gyro_bias) < 2e-4


def test_a_heading_that_jumps_at_rest_is_no_bias_and_is_reported(steering: Steering) -> None:
    walker = Walker(steering)
    for k in range(2000):
        now = 0.01 * k
        heading = float(k // 200)
        walker.imu(ImuReading(heading, 1e-5 * (k % 2), now), now, variance=1e-4)
        walker.feedback(dict.fromkeys(('left_crank', 'right_crank'), (0.0, 0.0)), now)
        if k == 190:
            assert walker.verdict(now)[0] == DiagnosticLevel.OK
    assert abs(walker.odometry.gyro_bias) < 0.01
    level, text = walker.verdict(now)
    assert level == DiagnosticLevel.WARN
    assert 'the heading of its IMU turns while it stands' in text


@pytest.mark.parametrize(
    ('acceleration', 'slope', 'facet'),
    [(2.0, 0.0, (1, 2, 3)), (-2.0, 0.0, (0, 1, 2)), (0.0, 2.0, (0, 1, 2)), (0.0, -2.0, (1, 2, 3))],
)
def test_an_accelerated_body_rests_on_the_feet_around_its_zero_moment_point(
    two_motors: Feet, acceleration: float, slope: float, facet: tuple[int, int, int]
) -> None:
    # Forwards it leans back, and downhill forwards.
    stance = StanceEstimator(two_motors, OdometryNoise())
    stance.centre.height = 0.3
    stance.centre.acceleration = acceleration + 0j
    stance.slope.acceleration = slope + 0j
    load_point = stance._zero_moment_point((0.0, 0.0, 0.0), is_accelerated=True)
    body_support = support(SEESAW, load_point)
    assert body_support.facet == facet


@pytest.mark.parametrize('pitch', [0.3, -0.3])
def test_it_stands_on_the_feet_that_its_measured_attitude_shows(
    two_motors: Feet, pitch: float
) -> None:
    # Half a turn apart it lies on its middle feet, and tips forwards or back.
    odometry = Odometry(two_motors)
    for k in range(600):
        angle = 3.9 + max(0.0, 0.003 * (k - 300))
        feet, _, centre = two_motors.at((angle, angle + pi)).tolist()
        body_support = support(feet, centre, None, (0.0, pitch))
        odometry.imu(
            ImuReading(TREMBLE[k % 2], 0.0, 0.01 * k, (body_support.roll, body_support.pitch))
        )
        odometry.update((angle, angle + pi), (0.0, 0.0), 0.01)
    assert body_support.pitch == pytest.approx(pitch, abs=0.04)
    assert odometry.support.pitch == pytest.approx(body_support.pitch, abs=0.01)


def test_feet_that_slide_against_each_other_inform_little_along_their_slip() -> None:
    eight = Feet(robot_of(str(CONFIG / 'walker8_two_motors.yaml')))
    odometry = Odometry(eight)
    for k in range(600):
        angle = max(0.0, 0.01 * (k - 200))
        still = ImuReading(TREMBLE[k % 2], 0.0, 0.01 * k, (0.0, 0.0), force=(0.0, 0.0, GRAVITY))
        odometry.imu(still)
        estimate = odometry.update((-angle, angle), (-1.0, 1.0) if angle else (0.0, 0.0), 0.01)
    assert odometry.accelerometer_state is AccelerometerState.USED
    along, across, _ = estimate.rate_variances
    assert along > 4.0 * across


@pytest.mark.parametrize(
    ('part', 'contradicted', 'usual'),
    [
        ('stance.slope', 'roughness', 'usual_tilt'),
        ('accelerometer', 'innovation_square', 'usual_innovation'),
    ],
)
def test_the_way_is_less_certain_where_attitude_or_accelerometer_contradict(
    two_motors: Feet, part: str, contradicted: str, usual: str
) -> None:
    def deviation(times: float) -> float:
        odometry = Odometry(two_motors)
        gravity = 0.0, 0.0, GRAVITY
        square = getattr(odometry.noise, usual) ** 2
        for k in range(330):
            angle = max(0.0, 0.01 * (k - 300))
            odometry.imu(ImuReading(TREMBLE[k % 2], 0.0, 0.01 * k, (0.0, 0.0), force=gravity))
            if k >= 300:
                setattr(attrgetter(part)(odometry), contradicted, times * square)
            estimate = odometry.update((angle, angle), (1.0, 1.0) if angle else (0.0, 0.0), 0.01)
        assert odometry.accelerometer_state is AccelerometerState.USED
        return float(np.sqrt(estimate.covariance[0][0]))

    assert deviation(60.0) > 2.0 * deviation(0.0)


@pytest.mark.parametrize(('x', 'distance'), [(-0.05, 0.05), (0.0, 0.0), (0.05, 0.0)])
def test_a_body_that_lies_on_feet_that_cannot_carry_it_is_reported(
    steering: Steering, x: float, distance: float
) -> None:
    """It leans forwards, where the file has its centre of mass behind the feet in the middle."""
    attitude = 0.0, atan(0.1)
    centre = x, 0.0, -0.3
    assert outside_feet(SEESAW, centre, attitude) == pytest.approx(distance, abs=1e-9)
    walker = Walker(steering)
    walker.feedback({'left_crank': (0.0, 0.0), 'right_crank': (0.0, 0.0)}, 0.0)
    check = walker.odometry.stance.support_check
    for _ in range(400):
        check.update(SEESAW, centre, (1, 2, 3), attitude, 0.01)
    level, text = walker.verdict(0.0)
    assert ('check body_centre' in text) == bool(distance)
    assert (level == DiagnosticLevel.WARN) == bool(distance)
    check.violation = 0.0
    walker.odometry.stance.slope._innovation_square = 7.1**2
    assert 'attitude is not that of a body on its feet' in walker.verdict(0.0)[1]
    # An attitude of no feet is that of a body that tips.
    assert outside_feet(SEESAW, centre, (0.3, 0.0)) == 0.0


@pytest.mark.parametrize(
    ('set_by', 'now_offset'), [(1.8e9, 0.0), (1000.0, 0.0), (-1000.0, 0.0), (-50.0, -50.0)]
)
def test_a_clock_that_is_set_moves_nothing(
    steering: Steering, set_by: float, now_offset: float
) -> None:
    """As that of a computer without a battery, which gets its time later, or of a simulation."""
    estimates = []
    for is_set in (0, 1):
        walker = Walker(steering)
        for k in range(400):
            time = 0.01 * k
            late = is_set * (k > 200)
            now = time + now_offset * late
            walker.imu(
                ImuReading(TREMBLE[k % 2], 0.0, time, (0.0, 0.0), force=(0.0, 0.0, 9.81)), now
            )
            readings = dict.fromkeys(('left_crank', 'right_crank'), (0.3 * time, 0.3))
            pose = walker.feedback(readings, now, time + set_by * late)
        assert pose
        estimates.append(pose)
    plain, with_set_clock = estimates
    assert (with_set_clock.x, with_set_clock.y, with_set_clock.yaw) == pytest.approx(
        (plain.x, plain.y, plain.yaw), abs=1e-3
    )
    assert np.array(with_set_clock.covariance) == pytest.approx(
        np.array(plain.covariance), abs=1e-6
    )


@pytest.mark.parametrize('late', [(0.0, 0.0099), (0.0, 0.012), (0.04, 0.03, 0.02, 0.01, 0.0)])
@pytest.mark.parametrize('has_imu', [False, True])
def test_readings_in_bunches_are_no_leaps(
    steering: Steering, late: tuple[float, ...], has_imu: bool
) -> None:
    """As from a driver on a serial line, which stamps them as they arrive."""
    walker = Walker(steering)
    for k in range(400):
        time = 0.01 * k
        if has_imu:
            walker.imu(
                ImuReading(TREMBLE[k % 2], 0.0, time, (0.0, 0.0), force=(0.0, 0.0, 9.81)), time
            )
        reading = max(0.0, time - 1.0), float(time > 1.0)
        readings = dict.fromkeys(('left_crank', 'right_crank'), reading)
        pose = walker.feedback(readings, time + late[k % len(late)] + 1e-5 * k)
    assert pose
    assert pose.x == pytest.approx(0.467, abs=0.03)


@pytest.mark.parametrize('late', [0.0, 0.0099])
def test_noise_of_encoders_without_rates_is_no_motion(steering: Steering, late: float) -> None:
    """Nor where readings come in pairs: at rest the bias of the gyro is learned all the same."""
    walker = Walker(steering)
    rng = np.random.default_rng(1)
    for k in range(300):
        time = 0.01 * k
        walker.imu(ImuReading(0.003 * time, 0.003, time, (0.0, 0.0)), time)
        left, right = rng.normal(0.0, 0.001, 2)
        readings = {'left_crank': (left, None), 'right_crank': (right, None)}
        walker.feedback(readings, time + late * (k % 2))
    assert walker.odometry.gyro_bias == pytest.approx(0.003, abs=0.0005)


def test_half_an_hour_without_feedback_leaves_a_covariance(two_motors: Feet) -> None:
    odometry = Odometry(two_motors)
    last_time = 0.0
    for k in range(300):
        time = 0.01 * k + 1800.0 * (k > 150)
        pitch = 0.05 * (k % 2)
        odometry.imu(ImuReading(TREMBLE[k % 2], 0.0, time, (0.0, pitch), force=(0.0, 0.0, 9.81)))
        pose = odometry.update((0.01 * k, 0.01 * k), (1.0, 1.0), time - last_time)
        last_time = time
        assert np.linalg.eigvalsh(pose.covariance)[0] >= 0.0
        assert odometry.stance.slope.innovation < 3.0
    assert hypot(pose.x, pose.y) < 0.6


def test_a_gyro_in_degrees_leaves_a_covariance(two_motors: Feet) -> None:
    """It is far too fast, by up to a radian a step, and right again later."""
    odometry = Odometry(two_motors)
    for k in range(400):
        time = 0.01 * k
        rate = 99.0 if 100 < k < 300 else 0.0
        odometry.imu(ImuReading(TREMBLE[k % 2], rate, time, (0.0, 0.0), force=(0.0, 0.0, 9.81)))
        pose = odometry.update((time, time), (1.0, 1.0), 0.01)
    assert np.linalg.eigvalsh(pose.covariance)[0] > 0.0
    assert np.trace(pose.covariance) < 1.0
    assert hypot(*pose.linear) < 0.4


def test_an_accelerometer_in_g_is_reported(steering: Steering) -> None:
    walker = Walker(steering)
    for k in range(100):
        time = 0.01 * k
        walker.imu(ImuReading(0.0, 0.0, time, (0.0, 0.0), force=(0.0, 0.0, 1.0)), time)
        walker.feedback(dict.fromkeys(('left_crank', 'right_crank'), (0.0, 0.0)), time)
    level, text = walker.verdict(time)
    assert level == DiagnosticLevel.WARN
    assert 'accelerometer is not believed: check its units' in text
