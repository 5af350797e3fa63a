"""The feedback of the measured motion, where the body moves as in the map of its phases."""

from collections import deque
from functools import cache
from math import pi
from pathlib import Path

from klann_ros.gait import Feet, Rates, Steering, Twist2D
from klann_ros.gait.steering import phase_map
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.robot import robot_of
from klann_ros.walker import ControllerSettings
from klann_ros.walker.control_laws import MotionFeedback
import numpy as np
import pytest

CONFIG = Path(__file__).resolve().parents[2] / 'config'
WALKERS = ('walker6_two_motors', 'walker8_two_motors', 'walker_jansen')
STANDS = Twist2D(0.0, 0.0)
# Points of the map in a turn, and the time of a step [s].
POINTS = 64
DT = 0.02


@cache
def mapped(name: str) -> tuple[Steering, FloatArray]:
    """Return a walker's steering, and its map: twists for rates of mean and half difference."""
    steering = Steering(Feet(robot_of(str(CONFIG / f'{name}.yaml')), foot_radius=0.004))
    sides = np.array([steering.crank_rates(Rates(*rates)) for rates in np.eye(2)])
    return steering, np.array(phase_map(steering.feet, sides, POINTS))


class MapWalk:
    """
    A walker by plan and feedback whose body moves as in the map, times `gains`.

    `path` holds the distance [m] and the yaw [rad] after each step. The motion is measured after
    `delay` [s].
    """

    def __init__(
        self, name: str, gains: tuple[float, float] = (1.0, 1.0), delay: float = 0.0
    ) -> None:
        self.steering, self._map = mapped(name)
        self.feedback = MotionFeedback(ControllerSettings(), self.steering.unit_motion)
        self._gains = np.array(gains)
        self._phases = np.zeros(2)
        self._late = deque([STANDS] * round(delay / DT))
        self.path = [np.zeros(2)]

    def run(self, wanted: Twist2D, seconds: float) -> 'MapWalk':
        on_spot = not wanted.linear
        for _ in range(round(seconds / DT)):
            mean, difference = self._phases
            cranks = self.steering.crank_rates(Rates(mean - difference, mean + difference))
            corrected = self.feedback.corrected(wanted)
            left, right = self.steering.planned_rates(corrected, cranks, on_spot=on_spot)
            rates = np.array([left + right, right - left]) / 2.0
            i, j = (self._phases / (2.0 * pi) * POINTS).astype(int) % POINTS
            motion = rates @ self._map[:, i, j] * self._gains
            self._late.append(Twist2D(*motion.tolist()))
            self.feedback.measure(wanted, self._late.popleft(), DT)
            self._phases += rates * DT
            self.path.append(self.path[-1] + motion * DT)
        return self

    def errors(self, wanted: Twist2D) -> FloatArray:
        """Return measured minus commanded distance [m] and yaw [rad] after each step."""
        times = DT * np.arange(len(self.path))
        return np.array(self.path) - times[:, None] * wanted


def part_of(name: str, linear: float, angular: float) -> Twist2D:
    """Return parts of the speed straight on and of the yaw rate on the spot, at 1 rad/s."""
    unit = mapped(name)[0].unit_motion
    return Twist2D(linear * unit.linear, angular * unit.angular)


def test_a_lag_is_made_up_within_bounds() -> None:
    feedback = MotionFeedback(ControllerSettings(), Twist2D(-0.15, 0.1))
    curve, line, spot = Twist2D(0.1, 0.02), Twist2D(0.1, 0.0), Twist2D(0.0, 0.1)
    assert feedback.corrected(curve) == curve
    for _ in range(100):
        feedback.measure(curve, Twist2D(0.09, 0.0), 0.01)
    assert feedback.lag == pytest.approx((0.01, 0.02))
    assert feedback.corrected(curve) == pytest.approx((0.105, 0.03))
    # Half a turn of the cranks, and twice the command with half of the motion at 1 rad/s; the
    # speed is halved, the yaw rate may change its sign.
    for measured, sign, bound in (
        (STANDS, 1.0, (0.275, 0.09)),
        (Twist2D(0.3, 0.3), -1.0, (0.05, -0.05)),
    ):
        for _ in range(10_000):
            feedback.measure(curve, measured, 0.01)
        assert feedback.lag == pytest.approx((sign * 0.15 * pi, sign * 0.1 * pi))
        assert feedback.corrected(curve) == pytest.approx(bound)
        assert feedback.corrected(line).angular == 0.0
        assert feedback.corrected(STANDS) == STANDS
    feedback.measure(STANDS, STANDS, 0.01)
    assert feedback.corrected(curve) == curve
    # A long gap says little about the motion within it.
    feedback.measure(curve, STANDS, 0.11)
    assert feedback.lag == STANDS
    # Straight on no lag turns it; on the spot the drift of the body is made up for.
    feedback.measure(line, Twist2D(0.05, 0.1), 0.1)
    assert feedback.corrected(line) == pytest.approx((0.1025, 0.0))
    feedback.measure(spot, Twist2D(0.105, 0.08), 0.1)
    assert feedback.corrected(spot) == pytest.approx((-0.00275, 0.103))
    for measured_rate, yaw_rate in ((0.0, 0.2), (0.3, 0.05)):
        for _ in range(10_000):
            feedback.measure(spot, Twist2D(0.0, measured_rate), 0.01)
        assert feedback.corrected(spot).angular == pytest.approx(yaw_rate)


def test_a_mirrored_lag_is_corrected_in_mirror_image() -> None:
    for linear in (0.1, -0.1):
        corrected = []
        for side in (1.0, -1.0):
            feedback = MotionFeedback(ControllerSettings(), Twist2D(0.15, 0.1))
            wanted = Twist2D(linear, side * 0.01)
            for _ in range(300):
                feedback.measure(wanted, Twist2D(1.3 * linear, side * 0.09), 0.01)
            corrected.append(feedback.corrected(wanted))
        assert corrected[0] == (corrected[1].linear, -corrected[1].angular)
        assert corrected[0].linear == pytest.approx(0.55 * linear)
        assert corrected[0].angular == pytest.approx(0.01 - 0.06)


@pytest.mark.slow
@pytest.mark.parametrize('name', WALKERS)
def test_on_the_spot_the_yaw_rate_holds_over_any_3_s(name: str) -> None:
    """By plan and feedback: within a fourth."""
    window = round(3.0 / DT)
    for part in (0.5, -1.0):
        wanted = part_of(name, 0.0, part)
        yaws = np.array(MapWalk(name).run(wanted, 40.0).path)[window:, 1]
        means = (yaws[window:] - yaws[:-window]) / (window * DT)
        assert means == pytest.approx(wanted.angular, rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('gains', 'delay'), [((1.0, 1.0), 0.0), ((0.75, 1.3), 0.0), ((1.2, 0.7), 0.3)]
)
@pytest.mark.parametrize('name', WALKERS)
def test_in_a_curve_an_error_that_is_measured_is_removed(
    name: str, gains: tuple[float, float], delay: float
) -> None:
    """
    Heading and distance stay within about the motion of half a turn of the cranks.

    So the error of the mean yaw rate decreases with time, at 5 % of the largest one as well.
    """
    bound = 1.2 * pi * np.array(mapped(name)[0].unit_motion)
    for linear, angular in ((0.7, 0.1), (-0.7, -0.1), (-0.73, 0.05), (0.5, -0.4), (0.56, 0.74)):
        wanted = part_of(name, linear, angular)
        errors = np.abs(MapWalk(name, gains, delay).run(wanted, 100.0).errors(wanted))
        assert (errors.max(axis=0) < bound).all()


@pytest.mark.parametrize('angular', [0.0, 0.05, -0.4])
def test_a_walker_that_was_held_does_not_hurry_for_long(angular: float) -> None:
    """What half a minute of standing leaves is made up within the largest lag, and decays."""
    feedback = MotionFeedback(ControllerSettings(), Twist2D(0.15, 0.1))
    wanted = Twist2D(0.05, angular * 0.1)
    for _ in range(3000):
        feedback.measure(wanted, STANDS, 0.01)
    extra = np.zeros(2)
    for _ in range(3000):
        corrected = feedback.corrected(wanted)
        feedback.measure(wanted, corrected, 0.01)
        extra += 0.01 * (np.array(corrected) - wanted)
    assert feedback.corrected(wanted) == pytest.approx(wanted, abs=1e-3)
    bound = np.array([0.15 * pi, 0.1 * pi if angular else 0.0])
    assert (np.abs(extra) <= bound + 1e-9).all()
