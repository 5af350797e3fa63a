"""What an IMU measures between two readings of the cranks, and which accelerometer is rejected."""

from collections.abc import Callable, Iterator
from itertools import repeat
from math import cos, hypot, inf, nan, pi, sin

from hypothesis import given, settings, strategies as st
from klann_ros.dynamics import GRAVITY
from klann_ros.gait import Feet, Steering
from klann_ros.kinematics.angles import wrap
from klann_ros.walker import (
    DiagnosticLevel,
    imu_reading,
    ImuReading,
    Odometry,
    OdometryNoise,
    Walker,
)
from klann_ros.walker.accelerometer import (
    AccelerometerMonitor,
    AccelerometerState,
    GyroCalibration,
    StandstillDetector,
)
from klann_ros.walker.imu import ImuIncrement, ImuPreintegration
from klann_ros.walker.imu_monitor import ImuState
import numpy as np
import pytest

Triple = tuple[float, float, float]
PERIOD = 0.01
CREEP = 1e-4
NOISE = OdometryNoise(gyro_noise=1e-3, standstill_yaw_rate=CREEP)
AT_REST, LEVEL = (0.0, 0.0, GRAVITY), (0.0, 0.0)


def specific_force(roll: float, pitch: float, level: tuple[float, float]) -> Triple:
    """Return the specific force in base_link at an attitude and a level acceleration."""
    about_x = np.array([[1, 0, 0], [0, cos(roll), -sin(roll)], [0, sin(roll), cos(roll)]])
    about_y = np.array([[cos(pitch), 0, sin(pitch)], [0, 1, 0], [-sin(pitch), 0, cos(pitch)]])
    x, y, z = (about_y @ about_x).T @ (*level, GRAVITY)
    return float(x), float(y), float(z)


class Readings:
    """Readings of an accelerometer one after the other."""

    def __init__(self, *, period: float = PERIOD) -> None:
        self.imu = ImuPreintegration(OdometryNoise())
        self.period = period
        self._time = 0.0
        self.imu.read(ImuReading(None, 0.0, 0.0, LEVEL, force=AT_REST))
        self.imu.take(period)

    def read(
        self, force: Triple | None = AT_REST, attitude: tuple[float, float] | None = LEVEL
    ) -> None:
        self._time += self.period
        self.imu.read(ImuReading(None, 0.0, self._time, attitude, force=force))

    def change(self, seconds: float | None = None) -> Triple | None:
        return self.imu.take(self.period if seconds is None else seconds).delta_velocity


@settings(max_examples=50, deadline=None)
@given(
    attitude=st.tuples(*[st.floats(-0.6, 0.6)] * 2), level=st.tuples(*[st.floats(-5.0, 5.0)] * 2)
)
def test_the_velocity_change_is_that_in_the_level_frame(
    attitude: tuple[float, float], level: tuple[float, float]
) -> None:
    readings = Readings()
    for _ in range(2):
        readings.change()
        readings.read(specific_force(*attitude, level), attitude)
    expected = (level[0] * PERIOD, level[1] * PERIOD, 0.0)
    assert readings.change() == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ('force', 'attitude'),
    [
        (None, LEVEL),
        ((nan, 0.0, 0.0), LEVEL),
        ((0.0, inf, 0.0), LEVEL),
        ((0.0, 0.0, -1e300), LEVEL),
        (AT_REST, None),
    ],
)
def test_without_a_finite_force_and_attitude_an_interval_is_unknown(
    force: Triple | None, attitude: tuple[float, float] | None
) -> None:
    readings = Readings()
    readings.read(force, attitude)
    assert readings.change() is None
    readings.read()
    if attitude is None:
        readings.change()
        readings.read()
    assert readings.change() == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_a_dropped_message_is_not_interpolated_and_a_slow_imu_is_not_used() -> None:
    readings = Readings()
    for _ in range(20):
        readings.read()
    readings.change()
    readings.period = 2.0 * PERIOD
    readings.read()
    assert readings.change() is None
    readings.period = PERIOD
    readings.read()
    assert readings.change() is not None
    slow = Readings(period=0.04)
    slow.read()
    assert slow.change() is None
    assert not slow.imu.velocity.is_available


@pytest.mark.parametrize(
    ('period', 'force', 'is_possible'),
    [(1e-3, 500.0, True), (1e-2, 99.0, True), (1e-2, 101.0, False)],
)
def test_an_impact_of_more_than_1_m_s_is_rejected(
    period: float, force: float, *, is_possible: bool
) -> None:
    readings = Readings(period=period)
    readings.read((force, 0.0, GRAVITY))
    expected = (force * period, 0.0, 0.0)
    assert readings.change() == (pytest.approx(expected, abs=1e-9) if is_possible else None)


def test_cranks_may_be_read_more_often_than_the_imu_but_not_for_ever_without_it() -> None:
    readings = Readings()
    readings.read((1.0, 0.0, GRAVITY))
    changes = [readings.change(0.001) for _ in range(40)]
    assert changes[0] == pytest.approx((0.01, 0.0, 0.0), abs=1e-9)
    assert changes[1:26] == [(0.0, 0.0, 0.0)] * 25
    assert changes[-5:] == [None] * 5


def increment(turn: float = 0.0, change: Triple | None = None) -> ImuIncrement:
    return ImuIncrement(turn, None, change, PERIOD if change else 0.0, 0.0)


def rest(monitor: AccelerometerMonitor, seconds: float, force: Triple = AT_REST) -> None:
    x, y, z = force
    change = x * PERIOD, y * PERIOD, (z - GRAVITY) * PERIOD
    for _ in range(round(seconds / PERIOD)):
        monitor.rest(increment(change=change))


def test_an_accelerometer_is_used_after_half_a_second_at_standstill() -> None:
    monitor = AccelerometerMonitor(NOISE)
    rest(monitor, 0.49)
    assert monitor.state is AccelerometerState.UNKNOWN
    rest(monitor, 0.02)
    assert monitor.state is AccelerometerState.USED


@pytest.mark.parametrize(
    'force', [(0.0, 0.0, 1.0), (0.0, 0.0, -GRAVITY), (0.0, 0.0, 0.0), (GRAVITY, 0.0, 0.0)]
)
def test_other_units_and_axes_are_rejected(force: Triple) -> None:
    monitor = AccelerometerMonitor(NOISE)
    rest(monitor, 1.0, force)
    assert monitor.state is AccelerometerState.NOT_BELIEVED


def test_an_accelerometer_rejected_at_standstill_has_to_rest_again() -> None:
    # The body settled on its feet, which was mistaken for a bias.
    monitor = AccelerometerMonitor(NOISE)
    rest(monitor, 0.6)
    monitor.reject(is_at_rest=True)
    rest(monitor, 0.48)
    assert monitor.state is AccelerometerState.UNKNOWN
    rest(monitor, 0.04)
    assert monitor.state is AccelerometerState.USED


def test_an_accelerometer_rejected_on_the_way_is_tried_again_later_each_time() -> None:
    monitor = AccelerometerMonitor(NOISE)
    rest(monitor, 0.6)
    for seconds in (1.0, 2.0, 4.0):
        monitor.reject(is_at_rest=False)
        monitor.elapse(seconds - 0.05)
        assert monitor.state is AccelerometerState.NOT_BELIEVED
        monitor.elapse(0.06)
        assert monitor.state is AccelerometerState.USED
    # What was right for long is tried again soon.
    monitor.elapse(600.0)
    monitor.reject(is_at_rest=False)
    monitor.elapse(1.01)
    assert monitor.state is AccelerometerState.USED


def test_what_friction_has_to_correct_for_long_is_noise_of_the_accelerometer() -> None:
    """It is learned within seconds, forgotten where it is over, and rejected at last."""
    monitor = AccelerometerMonitor(NOISE)
    assert not any(monitor.is_contradicted(0.14, PERIOD) for _ in range(1000))
    assert monitor.noise_factor == 1.0
    assert not any(monitor.is_contradicted(0.21, PERIOD) for _ in range(500))
    assert 5.0 < monitor.noise_factor < 100.0
    assert not any(monitor.is_contradicted(0.02, PERIOD) for _ in range(1000))
    assert monitor.noise_factor == 1.0
    rejected = [monitor.is_contradicted(0.6, PERIOD) for _ in range(500)]
    assert 100 < rejected.index(True) < 400


@pytest.mark.parametrize('variance', [0.0, 1e-6])
def test_the_drift_of_the_heading_is_measured_by_all_of_the_standstill(variance: float) -> None:
    # The measurements are weighted as independent ones, and together are the mean rate.
    gyro = GyroCalibration(NOISE)
    turns = 3e-5 + 1e-5 * np.random.default_rng(1).standard_normal(200)
    weighted_rate = information = 0.0
    for k, turn in enumerate(turns.tolist()):
        measured = gyro.update(increment(turn), PERIOD, variance, is_confirmed=k >= 50)
        assert (measured is None) == (k < 50)
        if measured:
            rate, rate_variance = measured
            weighted_rate += rate / rate_variance
            information += 1.0 / rate_variance
    assert weighted_rate / information == pytest.approx(turns.mean() / PERIOD, rel=0.02)
    noise = 1e-6 / 2.0 if not variance else 2.0 / 2.0**2 * (1e-6 + 1e-6 / 4.0)
    assert information == pytest.approx(1.0 / (noise + CREEP**2), rel=0.02)


def stood(rate: float, noise: float, *, seconds: float = 5.0, is_commanded: bool = False) -> float:
    """Return the longest standstill of cranks that creep, with noise of their encoders [rad]."""
    detector = StandstillDetector(NOISE)
    rng = np.random.default_rng(4)
    longest = 0.0
    for k in range(round(seconds / PERIOD)):
        angles = (rate * PERIOD * k + noise * rng.standard_normal(2)).tolist()
        detector.update(angles, (rate, rate), 0.0, PERIOD, is_commanded=is_commanded)
        longest = max(longest, detector.time)
    return longest


@pytest.mark.parametrize('noise', [0.0, 0.0005, 0.002, 0.005])
def test_cranks_that_stand_do_so_with_any_noise_of_their_encoders(noise: float) -> None:
    assert stood(0.0, noise, seconds=30.0) > 20.0


def test_cranks_that_give_way_under_the_weight_stand() -> None:
    assert stood(0.006, 0.001, seconds=30.0) > 20.0


@pytest.mark.parametrize('rate', [0.025, -0.03, 0.05])
@pytest.mark.parametrize('noise', [0.0, 0.002])
def test_cranks_that_creep_are_never_confirmed_to_stand(rate: float, noise: float) -> None:
    assert stood(rate, noise) < 2.0 * NOISE.settling_time


def test_a_walker_that_is_commanded_does_not_stand() -> None:
    assert stood(0.0, 0.0, is_commanded=True) == 0.0


@settings(max_examples=50, deadline=None)
@given(roll=st.floats(-1.0, 1.0), pitch=st.floats(-1.0, 1.0), yaw=st.floats(-3.0, 3.0))
def test_an_orientation_is_roll_pitch_and_yaw(roll: float, pitch: float, yaw: float) -> None:
    (a, b), (c, d), (e, f) = ((np.cos(x / 2), np.sin(x / 2)) for x in (roll, pitch, yaw))
    x, y, z, w = (
        b * c * e - a * d * f,
        a * d * e + b * c * f,
        a * c * f - b * d * e,
        a * c * e + b * d * f,
    )
    reading = imu_reading((x, y, z, w), (0.0, 0.0, 1.0), 0.0)
    assert (reading.attitude, reading.yaw) == (pytest.approx((roll, pitch)), pytest.approx(yaw))
    assert reading.yaw_rate == pytest.approx(np.cos(roll) * np.cos(pitch))


def walked(
    feet: Feet, forces: Iterator[Triple], noise: OdometryNoise | None = None
) -> tuple[Odometry, float, float]:
    """Return the odometry of a walker that stands for 1 s and walks for 4, and how far it came."""
    odometry = Odometry(feet, noise)
    for k in range(500):
        angle, rate = (0.01 * (k - 100), 1.0) if k > 100 else (0.0, 0.0)
        yaw = 1e-9 * (k % 2)
        odometry.imu(ImuReading(yaw, 0.0, PERIOD * k, LEVEL, force=next(forces)))
        estimate = odometry.update((angle, angle), (rate, rate), PERIOD if k else 0.0)
    return odometry, estimate.x, estimate.y


@pytest.mark.slow
@pytest.mark.parametrize('spread', [0.0, 2.0, 30.0, 60.0])
def test_an_accelerometer_that_the_feet_contradict_moves_nothing(
    two_motors: Feet, spread: float
) -> None:
    rng = np.random.default_rng(5)
    at_standstill = [AT_REST] * 100

    def forces() -> Iterator[Triple]:
        yield from at_standstill
        while True:
            x, y = rng.uniform(-spread, spread, 2)
            yield float(x) + 0.5, float(y), GRAVITY

    odometry, x, y = walked(two_motors, forces())
    _, alone, _ = walked(two_motors, iter(lambda: (nan, nan, nan), None))
    # Noise that feet could cause counts as noise; what no feet can do is rejected.
    is_impossible = spread > 10.0
    state = odometry.accelerometer_state
    assert (state is AccelerometerState.NOT_BELIEVED) == is_impossible
    assert odometry.accelerometer.noise_factor > 100.0
    assert x == pytest.approx(alone, abs=0.1)
    assert abs(y) < 0.1


def test_feet_that_creep_alike_make_the_way_less_certain(two_motors: Feet) -> None:
    """By half of the stiction speed over a walk of 4 s; at standstill nothing creeps."""
    variances = []
    for creep in (0.0, 0.5, 1.0):
        noise = OdometryNoise(creep_error=creep)
        odometry, _, _ = walked(two_motors, repeat(AT_REST), noise)
        variances.append(odometry.contact_errors.covariance()[0, 0])
    # It adds to an error of the slip, of any size: so the second difference is twice its square.
    creep_variance = np.diff(variances, 2)[0] / 2.0
    assert np.sqrt(creep_variance) == pytest.approx(0.5 * NOISE.stiction_speed * 4.0, rel=0.1)


def test_a_body_that_rocks_beside_its_feet_moves_as_its_accelerometer(two_motors: Feet) -> None:
    odometry = Odometry(two_motors)
    for k in range(500):
        # It stands for 4 s. Then its cranks turn, but it rocks by 0.3 rad where it is.
        phase = max(0.0, 2.0 * pi * (PERIOD * k - 4.0))
        attitude = 0.15 * (1.0 - cos(phase)), 0.0
        rocking = 0.3 * pi * sin(phase), 0.0
        force = specific_force(*attitude, (0.0, 0.0))
        odometry.imu(ImuReading(0.0, 0.0, PERIOD * k, attitude, rocking, force))
        angle, rate = (phase / 6.0, pi / 3.0) if phase else (0.0, 0.0)
        estimate = odometry.update((angle, angle), (rate, rate), PERIOD if k else 0.0)
    assert odometry.accelerometer_state is AccelerometerState.USED
    # The feet alone went 0.15 m.
    assert hypot(estimate.x, estimate.y) < 0.08


ImuFault = Callable[[float, float, int], tuple[float | None, float]]


def turn_at(time: float) -> tuple[float, float]:
    """Return the angle and the rate of a crank that turns after a second."""
    return (time - 1.0, 1.0) if time > 1.0 else (0.0, 0.0)


@pytest.fixture(scope='module')
def true_yaws(two_motors: Feet) -> list[float]:
    """Return the yaw after each period on the spot, by the feet alone."""
    feet_alone = Odometry(two_motors)
    yaws = []
    for k in range(1500):
        angle, rate = turn_at(PERIOD * k)
        yaws.append(feet_alone.update((-angle, angle), (-rate, rate), PERIOD).yaw)
    return yaws


def turned(
    feet: Feet,
    true_yaws: list[float],
    fault: ImuFault,
    *,
    stamp: float = 1.0,
    until: float = inf,
) -> tuple[set[ImuState], Odometry, float]:
    """
    Return the states of an IMU, its odometry, and its error of the yaw after 14 s on the spot.

    `fault` makes yaw and rate of the true ones and the number of the reading, from 2 s to `until`;
    meanwhile its stamps advance by `stamp` of the time.
    """
    odometry = Odometry(feet)
    states = set()
    yaw = stamp_time = 0.0
    for k, true_yaw in enumerate(true_yaws):
        time = PERIOD * k
        is_faulty = 2.0 < time < until
        angle, rate = turn_at(time)
        change = wrap(true_yaw - yaw)
        yaw += change
        measured = fault(yaw, change / PERIOD, k) if is_faulty else (yaw, change / PERIOD)
        stamp_time += PERIOD * (stamp if is_faulty else 1.0)
        odometry.imu(ImuReading(*measured, stamp_time))
        pose = odometry.update((-angle, angle), (-rate, rate), PERIOD)
        states.add(odometry.imu_input.monitor.state)
    return states, odometry, abs(wrap(pose.yaw - yaw))


@pytest.mark.parametrize(
    ('fault', 'stamp', 'state'),
    [
        pytest.param(
            lambda _yaw, _rate, _k: (0.1, 0.02), 1.0, ImuState.FROZEN, marks=pytest.mark.slow
        ),
        # A driver that repeats its last message, and one that stamps no more.
        (lambda _yaw, _rate, _k: (0.1, 0.02), 0.0, ImuState.FROZEN),
        (lambda yaw, rate, _k: (yaw, rate), 0.0, ImuState.FROZEN),
        (lambda yaw, rate, _k: (-yaw, -rate), 1.0, ImuState.CONTRADICTED),
        pytest.param(
            lambda _yaw, rate, _k: (None, -rate),
            1.0,
            ImuState.CONTRADICTED,
            marks=pytest.mark.slow,
        ),
        (lambda _yaw, rate, _k: (None, 57.3 * rate), 1.0, ImuState.CONTRADICTED),
    ],
)
def test_an_imu_that_is_wrong_about_a_turn_is_named_and_not_used(
    two_motors: Feet, true_yaws: list[float], fault: ImuFault, stamp: float, state: ImuState
) -> None:
    states, odometry, error = turned(two_motors, true_yaws, fault, stamp=stamp)
    assert states == {ImuState.USED, state}
    assert odometry.imu_input.monitor.state is state
    # The feet are wrong by 10 %, in units of degrees the gyro is by half a turn in a second.
    assert error < 0.8
    states, odometry, _ = turned(two_motors, true_yaws, fault, stamp=stamp, until=4.0)
    assert state in states
    assert odometry.imu_input.monitor.state is ImuState.USED


def test_an_imu_that_is_right_is_used_all_the_time(
    two_motors: Feet, true_yaws: list[float]
) -> None:
    states, _, error = turned(two_motors, true_yaws, lambda yaw, rate, _: (yaw, rate))
    assert states == {ImuState.USED}
    assert error < 0.01
    # One of few bits repeats some readings.
    states, _, _ = turned(
        two_motors, true_yaws, lambda yaw, rate, _: (yaw - yaw % 1e-3, rate - rate % 0.02)
    )
    assert states == {ImuState.USED}


def test_readings_without_noise_repeat_at_standstill(steering: Steering) -> None:
    walker = Walker(steering)
    for k in range(300):
        now = PERIOD * k
        walker.imu(ImuReading(0.0, 0.0, now, LEVEL, force=AT_REST), now)
        walker.feedback(dict.fromkeys(('left_crank', 'right_crank'), (0.0, 0.0)), now)
    assert walker.values(now)['imu'] == 'used'
    for k in range(300, 400):
        now = PERIOD * k
        walker.imu(ImuReading(0.0, 0.0, now, LEVEL, force=AT_REST), now)
        turning = {'left_crank': (3.0 - now, -1.0), 'right_crank': (now - 3.0, 1.0)}
        walker.feedback(turning, now)
    assert walker.values(now)['imu'] == 'frozen'
    level, text = walker.verdict(now)
    assert level == DiagnosticLevel.WARN
    assert 'its IMU repeats the same reading; odom goes on without the IMU' in text


def test_queues_that_are_drained_one_after_the_other_repeat_no_reading(steering: Steering) -> None:
    walker = Walker(steering)
    for first in range(0, 400, 40):
        times = [PERIOD * k for k in range(first, first + 40)]
        for time in times:
            reading = ImuReading(0.0, 0.001 * (time % 0.03), time, LEVEL, force=AT_REST)
            walker.imu(reading, times[-1])
        for time in times:
            turning = {'left_crank': (-time, -1.0), 'right_crank': (-time, -1.0)}
            walker.feedback(turning, times[-1], at=time)
            assert walker.values(times[-1])['imu'] == 'used'


def test_a_body_that_is_turned_by_hand_turns_as_its_gyro(two_motors: Feet) -> None:
    """Its feet tell nothing while it is lifted, nor of an obstacle that turns it a little."""
    odometry = Odometry(two_motors)
    for k in range(1600):
        time = PERIOD * k
        yaw, rate = (0.3 * time, 0.3) if time < 8.0 else (2.4 + 0.1 * (time - 8.0), 0.1)
        odometry.imu(ImuReading(yaw, rate + 1e-9 * (k % 2), time))
        angle, speed = (time - 8.0, 1.0) if time > 8.0 else (0.0, 0.0)
        pose = odometry.update((angle, angle), (speed, speed), PERIOD)
        assert odometry.imu_input.monitor.state is ImuState.USED
    assert wrap(pose.yaw - yaw) == pytest.approx(0.0, abs=0.01)
