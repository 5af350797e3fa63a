"""What an IMU measures between two readings of the cranks, and which accelerometer is rejected."""

from collections.abc import Iterator
from math import cos, hypot, inf, nan, pi, sin

from hypothesis import given, settings, strategies as st
from klann_ros.dynamics import GRAVITY
from klann_ros.gait import Feet
from klann_ros.walker import imu_reading, ImuReading, Odometry, OdometryNoise
from klann_ros.walker.imu import (
    AccelerometerState,
    ImuIncrement,
    ImuPreintegration,
    StandstillCalibration,
)
import numpy as np
import pytest

Triple = tuple[float, float, float]
PERIOD = 0.01
CREEP = 1e-4
NOISE = OdometryNoise(gyro_noise=1e-3, standstill_yaw_rate=CREEP)
AT_REST, LEVEL = (0.0, 0.0, GRAVITY), (0.0, 0.0)
STANDS = ((0.0, 0.0), (0.0, 0.0))


def specific_force(roll: float, pitch: float, level: tuple[float, float]) -> Triple:
    """Return the specific force in base_link at an attitude and a level acceleration."""
    about_x = np.array([[1, 0, 0], [0, cos(roll), -sin(roll)], [0, sin(roll), cos(roll)]])
    about_y = np.array([[cos(pitch), 0, sin(pitch)], [0, 1, 0], [-sin(pitch), 0, cos(pitch)]])
    x, y, z = (about_y @ about_x).T @ (*level, GRAVITY)
    return float(x), float(y), float(z)


class Readings:
    """Readings of an accelerometer one after the other."""

    def __init__(self, *, period: float = PERIOD) -> None:
        self.imu, self.period, self._at = ImuPreintegration(OdometryNoise()), period, 0.0
        self.imu.read(ImuReading(None, 0.0, 0.0, LEVEL, force=AT_REST))
        self.imu.take(period)

    def read(
        self, force: Triple | None = AT_REST, attitude: tuple[float, float] | None = LEVEL
    ) -> None:
        self._at += self.period
        self.imu.read(ImuReading(None, 0.0, self._at, attitude, force=force))

    def change(self, seconds: float | None = None) -> Triple | None:
        taken = self.imu.take(self.period if seconds is None else seconds)
        assert taken is not None
        return taken.delta_velocity


@settings(max_examples=50, deadline=None)
@given(lies=st.tuples(*[st.floats(-0.6, 0.6)] * 2), level=st.tuples(*[st.floats(-5.0, 5.0)] * 2))
def test_the_velocity_change_is_that_in_the_level_frame(
    lies: tuple[float, float], level: tuple[float, float]
) -> None:
    readings = Readings()
    for _ in range(2):
        readings.change()
        readings.read(specific_force(*lies, level), lies)
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
    assert not slow.imu.has_accelerometer


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
    one, *others = (readings.change(0.001) for _ in range(40))
    assert one == pytest.approx((0.01, 0.0, 0.0), abs=1e-9)
    assert others[:25] == [(0.0, 0.0, 0.0)] * 25
    assert others[-5:] == [None] * 5


def rest(calibration: StandstillCalibration, seconds: float, force: Triple = AT_REST) -> None:
    x, y, z = force
    change = x * PERIOD, y * PERIOD, (z - GRAVITY) * PERIOD
    for _ in range(round(seconds / PERIOD)):
        calibration.update(ImuIncrement(0.0, None, change, PERIOD, 0.0), *STANDS, PERIOD, 0.0)


def test_an_accelerometer_is_used_after_half_a_second_at_standstill() -> None:
    calibration = StandstillCalibration(NOISE)
    rest(calibration, 0.49)
    assert calibration.state is AccelerometerState.UNKNOWN
    assert not calibration.is_usable
    rest(calibration, 0.02)
    assert calibration.state is AccelerometerState.USED


@pytest.mark.parametrize(
    'force', [(0.0, 0.0, 1.0), (0.0, 0.0, -GRAVITY), (0.0, 0.0, 0.0), (GRAVITY, 0.0, 0.0)]
)
def test_other_units_and_axes_are_rejected(force: Triple) -> None:
    calibration = StandstillCalibration(NOISE)
    rest(calibration, 1.0, force)
    assert calibration.state is AccelerometerState.NOT_BELIEVED


def test_an_accelerometer_rejected_at_standstill_has_to_rest_again() -> None:
    # The body settled on its feet, which was mistaken for a bias.
    calibration = StandstillCalibration(NOISE)
    rest(calibration, 0.6)
    calibration.reject()
    rest(calibration, 0.48)
    assert not calibration.is_usable
    rest(calibration, 0.04)
    assert calibration.is_usable


def test_an_accelerometer_rejected_on_the_way_has_to_rest_for_twice_as_long() -> None:
    calibration = StandstillCalibration(NOISE)
    rest(calibration, 0.6)
    for seconds in (1.0, 2.0, 4.0):
        calibration.restart()
        calibration.reject()
        assert calibration.state is AccelerometerState.NOT_BELIEVED
        rest(calibration, seconds - 0.02)
        assert not calibration.is_usable
        rest(calibration, 0.04)
        assert calibration.is_usable


@pytest.mark.parametrize('variance', [0.0, 1e-6])
def test_the_drift_of_the_heading_is_measured_by_all_of_the_standstill(variance: float) -> None:
    # The measurements are weighted as independent ones, and together are the mean rate.
    calibration, rng = StandstillCalibration(NOISE), np.random.default_rng(1)
    turns = 3e-5 + 1e-5 * rng.standard_normal(200)
    whole = information = 0.0
    for turn in turns:
        taken = ImuIncrement(float(turn), None, None, 0.0, 0.0)
        measured = calibration.update(taken, *STANDS, PERIOD, variance)
        assert measured is not None
        if measured[1]:
            whole, information = whole + measured[0] / measured[1], information + 1 / measured[1]
    assert whole / information == pytest.approx(turns[50:].mean() / PERIOD, rel=0.02)
    noise = 1e-6 / 1.5 if not variance else 2.0 / 1.5**2 * (1e-6 + 1e-6 / 4.0)
    assert information == pytest.approx(1.0 / (noise + CREEP**2), rel=0.02)


def test_cranks_that_creep_do_not_stand_still() -> None:
    calibration = StandstillCalibration(NOISE)
    taken = ImuIncrement(0.0, None, None, 0.0, 0.0)
    found = [
        calibration.update(taken, (5e-4 * k, 0.0), (0.05, 0.0), PERIOD, 0.0) for k in range(200)
    ]
    assert all(measured is None or not measured[1] for measured in found)


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


def walked(feet: Feet, forces: Iterator[Triple]) -> tuple[Odometry, float, float]:
    """Return the odometry of a walker that stands for 1 s and walks for 4, and how far it came."""
    odometry = Odometry(feet)
    for k in range(500):
        angle, rate = (0.01 * (k - 100), 1.0) if k > 100 else (0.0, 0.0)
        odometry.imu(ImuReading(0.0, 0.0, PERIOD * k, LEVEL, force=next(forces)))
        at = odometry.update((angle, angle), (rate, rate), PERIOD if k else 0.0)
    return odometry, at.x, at.y


@pytest.mark.parametrize('spread', [0.0, 3.0, 30.0, 60.0])
def test_an_accelerometer_that_the_feet_contradict_is_rejected(
    two_motors: Feet, spread: float
) -> None:
    rng = np.random.default_rng(5)
    still = [AT_REST] * 100

    def forces() -> Iterator[Triple]:
        yield from still
        while True:
            x, y = rng.uniform(-spread, spread, 2)
            yield float(x) + 0.5, float(y), GRAVITY

    odometry, x, y = walked(two_motors, forces())
    _, alone, _ = walked(two_motors, iter(lambda: (nan, nan, nan), None))
    assert odometry.accelerometer_state is AccelerometerState.NOT_BELIEVED
    # It takes half a second, in which noise like that is worth 1 m/s.
    assert x == pytest.approx(alone, abs=0.7)
    assert abs(y) < 0.7


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
        at = odometry.update((angle, angle), (rate, rate), PERIOD if k else 0.0)
    assert odometry.accelerometer_state is AccelerometerState.USED
    # The feet alone went 0.15 m.
    assert hypot(at.x, at.y) < 0.08
