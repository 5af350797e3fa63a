"""What an accelerometer adds to odometry, and which one is not believed."""

from collections.abc import Iterator
from math import cos, inf, nan, sin

from hypothesis import given, settings, strategies as st
from klann_ros.dynamics import GRAVITY
from klann_ros.walker import Feet, ImuReading, Odometry
from klann_ros.walker.accelerometer import Accelerometer
from klann_ros.walker.slope import Slope
import numpy as np
import pytest

Triple = tuple[float, float, float]
PERIOD = 0.01
REST = (0.0, 0.0, GRAVITY)


def felt(roll: float, pitch: float, level: tuple[float, float]) -> Triple:
    """Return what one feels that lies so, while its velocity changes by so much [m/s^2]."""
    about_x = np.array([[1, 0, 0], [0, cos(roll), -sin(roll)], [0, sin(roll), cos(roll)]])
    about_y = np.array([[cos(pitch), 0, sin(pitch)], [0, 1, 0], [-sin(pitch), 0, cos(pitch)]])
    x, y, z = (about_y @ about_x).T @ (*level, GRAVITY)
    return float(x), float(y), float(z)


class Told:
    """An accelerometer, and the readings that it is told one after the other."""

    def __init__(self, *, period: float = PERIOD) -> None:
        self.accelerometer = Accelerometer()
        self._last = ImuReading(None, 0.0, 0.0, 0.0, 0.0, force=REST)
        self.period = period

    def read(
        self, force: Triple | None = REST, roll: float | None = 0.0, pitch: float = 0.0
    ) -> None:
        at = self._last.at + self.period
        reading = ImuReading(None, 0.0, at, roll, pitch, force=force)
        self.accelerometer.read(self._last, reading)
        self._last = reading

    def gained(self, *, rests: bool = False) -> tuple[float, float] | None:
        return self.accelerometer.gained(self.period, rests=rests)

    def rest(self, force: Triple = REST, roll: float = 0.0, pitch: float = 0.0) -> None:
        for k in range(80):
            self.read(force, roll, pitch)
            # As it lay before, the first one lies by half.
            self.gained(rests=k > 0)


@settings(max_examples=50, deadline=None)
@given(
    lies=st.tuples(*[st.floats(-0.6, 0.6)] * 2),
    rested=st.tuples(*[st.floats(-0.6, 0.6)] * 2),
    level=st.tuples(*[st.floats(-5.0, 5.0)] * 2),
    wrong=st.tuples(*[st.floats(-0.9, 0.9)] * 3),
)
def test_however_it_lies_and_is_wrong_it_tells_what_the_velocity_changes_by(
    lies: tuple[float, float],
    rested: tuple[float, float],
    level: tuple[float, float],
    wrong: Triple,
) -> None:
    def reads(roll: float, pitch: float, by: tuple[float, float]) -> Triple:
        x, y, z = (a + b for a, b in zip(felt(roll, pitch, by), wrong, strict=True))
        return x, y, z

    told = Told()
    told.rest(reads(*rested, (0.0, 0.0)), *rested)
    told.read(reads(*lies, level), *lies)
    told.gained()
    told.read(reads(*lies, level), *lies)
    assert told.gained() == pytest.approx((level[0] * PERIOD, level[1] * PERIOD), abs=1e-9)


def test_until_it_has_rested_nothing_is_known() -> None:
    told = Told()
    for _ in range(500):
        told.read()
        assert told.gained() is None
    assert told.accelerometer.state == 'unknown until it rests'
    told.rest()
    assert told.accelerometer.state == 'used'
    told.read()
    assert told.gained() == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    'force', [(0.0, 0.0, 1.0), (0.0, 0.0, -GRAVITY), (0.0, 0.0, 0.0), (GRAVITY, 0.0, 0.0)]
)
def test_what_is_told_in_other_units_or_directions_is_not_believed(force: Triple) -> None:
    told = Told()
    told.rest(force)
    told.read(force)
    assert told.gained() is None
    assert told.accelerometer.state == 'not believed'


@pytest.mark.parametrize('force', [None, (nan, 0.0, 0.0), (0.0, inf, 0.0), (0.0, 0.0, -1e300)])
def test_what_is_no_number_is_left_out_and_said_to_be_unknown(force: Triple | None) -> None:
    told = Told()
    told.rest()
    told.read(force)
    assert told.gained() is None
    told.read()
    assert told.gained() == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_lost_message_is_not_guessed_and_a_slow_imu_is_not_believed() -> None:
    told = Told()
    told.rest()
    told.period = 2.0 * PERIOD
    told.read()
    assert told.gained() is None
    told.period = PERIOD
    told.read()
    assert told.gained() is not None
    slow = Told(period=0.04)
    slow.rest()
    slow.read()
    assert slow.gained() is None
    assert slow.accelerometer.state == 'none'


def test_an_impact_is_as_long_as_it_is_told() -> None:
    told = Told(period=0.001)
    told.rest()
    assert told.accelerometer.state == 'unknown until it rests'
    for _ in range(10):
        told.rest()
    told.read((500.0, 0.0, GRAVITY))
    assert told.gained() == pytest.approx((0.5, 0.0), abs=1e-9)
    # In 10 ms it would be more than 1 m/s.
    for force, is_possible in ((99.0, True), (101.0, False)):
        slow = Told()
        slow.rest()
        slow.read((force, 0.0, GRAVITY))
        assert (slow.gained() is not None) is is_possible


def test_the_bias_follows_the_correction_by_friction() -> None:
    told = Told()
    told.rest()
    # A tenth of the time constant, in which friction corrects by this.
    told.accelerometer.correct((0.5, -1.0), 1.0)
    told.read()
    assert told.gained() == pytest.approx((0.05 * PERIOD, -0.1 * PERIOD), abs=1e-9)


def test_what_does_not_say_how_it_lies_is_none() -> None:
    told = Told()
    told.rest()
    told.read(roll=None)
    assert told.gained() is None


def test_cranks_may_be_told_oftener_than_it_and_not_for_ever_without_it() -> None:
    told = Told()
    told.rest()
    told.read((1.0, 0.0, GRAVITY))
    one, *others = (told.accelerometer.gained(0.001, rests=False) for _ in range(40))
    assert one == pytest.approx((0.01, 0.0), abs=1e-9)
    assert others[:25] == [(0.0, 0.0)] * 25
    assert others[-5:] == [None] * 5


def test_one_that_was_wrong_has_to_rest_for_twice_as_long() -> None:
    told = Told()
    told.rest()
    for seconds in (1.0, 2.0, 4.0):
        told.accelerometer.reject()
        assert told.accelerometer.state == 'not believed'
        # Twice as long as before, give or take a reading.
        for _ in range(round(seconds / PERIOD) - 2):
            told.read()
            assert told.gained(rests=True) is None
        for _ in range(4):
            told.read()
            told.gained(rests=True)
        assert told.accelerometer.state == 'used'


def walked(feet: Feet, forces: Iterator[Triple]) -> tuple[Odometry, float, float]:
    """Return the odometry of a walker that stands for 1 s and walks for 9, and how far it came."""
    odometry = Odometry(feet)
    for k in range(1000):
        angle, rate = (0.01 * (k - 100), 1.0) if k > 100 else (0.0, 0.0)
        odometry.imu(ImuReading(0.0, 0.0, PERIOD * k, 0.0, 0.0, force=next(forces)))
        at = odometry.update((angle, angle), (rate, rate), PERIOD if k else 0.0)
    return odometry, at.x, at.y


@pytest.mark.parametrize('spread', [0.0, 3.0, 30.0])
def test_what_feels_what_no_feet_do_is_found_out(two_motors: Feet, spread: float) -> None:
    rng = np.random.default_rng(5)
    still = [REST] * 100

    def forces() -> Iterator[Triple]:
        yield from still
        while True:
            x, y = rng.uniform(-spread, spread, 2)
            yield float(x) + 0.5, float(y), GRAVITY

    odometry, x, y = walked(two_motors, forces())
    _, alone, _ = walked(two_motors, iter(lambda: (nan, nan, nan), None))
    assert odometry.accelerometer.state == 'not believed'
    # It takes half a second, in which noise like that is worth 1 m/s.
    assert x == pytest.approx(alone, abs=0.7)
    assert abs(y) < 0.7


@settings(max_examples=30, deadline=None)
@given(slope=st.floats(0.0, 0.3), turned=st.floats(-3.0, 3.0))
def test_a_slope_pulls_downhill_wherever_the_walker_turns(slope: float, turned: float) -> None:
    ground = Slope()
    # Nose down, so it is pulled forwards.
    for _ in range(10):
        ground.learn(0.0, slope, PERIOD)
    pull = GRAVITY * sin(slope)
    assert ground.pull == pytest.approx((pull, 0.0))
    ground.turn(turned)
    assert ground.pull == pytest.approx((pull * cos(turned), -pull * sin(turned)))
    # On its left side.
    other = Slope()
    other.learn(-slope, 0.0, PERIOD)
    assert other.pull == pytest.approx((0.0, pull))
