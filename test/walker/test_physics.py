"""A simulated walker, whose controller and odometry know nothing of the simulation."""

from math import degrees, hypot
from pathlib import Path

from klann_ros.gait import Feet, Steering
from klann_ros.kinematics.angles import yaw_of
from klann_ros.robot import robot_of
from klann_ros.twin import Floor, Motors, Sensors, Twin
from klann_ros.walker import imu_reading, Walker
import pytest

pytest.importorskip('mujoco')
CONFIG = Path(__file__).resolve().parents[2] / 'config'
PERIOD = 0.01


class Walked:
    """What became of a walk."""

    def __init__(
        self,
        steering: Steering,
        twist: tuple[float, float],
        seconds: float,
        *,
        imu: bool = False,
        stands: float = 0.0,
        slope: float = 0.0,
        sensors: Sensors | None = None,
        warms: float = 0.0,
    ) -> None:
        feet = steering.feet
        motors, floor = Motors(factors={feet.joints[1]: 0.95}), Floor(slope=slope)
        twin = Twin(feet.robot, floor=floor, motors=motors, sensors=sensors or Sensors())
        walker = Walker(steering)
        self.tilt = self.path = 0.0
        begin = last = twin.truth()
        for k in range(round((stands + seconds) / PERIOD)):
            now = k * PERIOD
            if imu:
                (x, y, z, w), (a, b, c), (u, v, f) = twin.imu()
                force = u + warms * now, v, f
                walker.imu(imu_reading((x, y, z, w), (a, b, c), now, force), now)
            estimate = walker.feedback(dict(twin.cranks()), now)
            (x, y, _), (last_x, last_y, _) = twin.truth().position, last.position
            self.path += hypot(x - last_x, y - last_y)
            last = twin.truth()
            walker.controller.command(*(twist if now >= stands else (0.0, 0.0)), now)
            command = walker.controller.step(now)
            for joint, rate in zip(feet.joints, command.velocity, strict=True):
                twin.command(joint, rate)
            twin.step(now + PERIOD)
            self.tilt = max(self.tilt, degrees(twin.tilt))
            self.values = walker.values(now)
        x, y, z, w = last.orientation
        self.yaw = yaw_of(x, y, z, w)
        self.yaw_error = estimate.yaw - self.yaw
        self.height_error = estimate.z - last.position[2]
        ways = (estimate.x - last.position[0] + begin.position[0], estimate.y - last.position[1])
        self.error = hypot(*ways) / self.path
        left, right = twin.cranks().values()
        self.apart = degrees(abs(left.position - right.position))


@pytest.fixture(scope='module')
def simulated(two_motors: Feet) -> Steering:
    # The simulated feet are balls.
    return Steering(Feet(two_motors.robot, foot_radius=0.004))


def test_straight_walks_agree_with_odometry_and_keep_phase(simulated: Steering) -> None:
    walked = Walked(simulated, (0.15, 0.0), 5.0)
    assert walked.path > 0.6
    assert walked.error < 0.025
    assert abs(walked.height_error) < 0.005
    assert walked.apart < 1.0
    assert walked.tilt < 2.0


@pytest.mark.slow
def test_friction_balances_the_measured_acceleration(simulated: Steering) -> None:
    # Straight on it is off by 0.8 % without, and by 1.4 % with the wrong sign.
    assert Walked(simulated, (0.15, 0.0), 6.0, imu=True, stands=1.0).error < 0.006


@pytest.mark.slow
def test_on_the_spot_yaw_and_position_follow_with_an_imu(simulated: Steering) -> None:
    # On two feet that are dragged against each other it coasts: by friction alone it would be off
    # by a third.
    walked = Walked(simulated, (0.0, 0.1), 6.0, imu=True)
    assert abs(walked.yaw) > 0.3
    assert abs(walked.yaw_error) < 0.01
    assert walked.path < 0.25
    assert walked.error * walked.path < 0.03
    assert walked.tilt < 20.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ('twist', 'slope', 'error'), [((0.1, -0.05), 0.0, 0.04), ((0.05, 0.06), -0.05, 0.018)]
)
def test_in_a_curve_the_accelerometer_resolves_the_slip(
    simulated: Steering, twist: tuple[float, float], slope: float, error: float
) -> None:
    # By its feet and the yaw alone it is off by 7 % and 2.2 %.
    sensors = Sensors(accelerometer_noise=0.03, accelerometer_offset=0.1)
    walked = Walked(simulated, twist, 7.0, imu=True, stands=1.0, slope=slope, sensors=sensors)
    assert walked.values['accelerometer'] == 'used'
    assert walked.path > 0.4
    assert walked.error < error


@pytest.mark.slow
def test_sliding_feet_do_not_displace_the_speed_by_the_noise_of_the_others() -> None:
    # It is off by 3.2 % where noise decides the sign of the slip of feet that stick.
    robot = robot_of(str(CONFIG / 'walker8_two_motors.yaml'))
    sensors = Sensors(
        encoder_noise=0.002, velocity_noise=0.01, gyro_noise=0.005, orientation_noise=0.002
    )
    steering = Steering(Feet(robot, foot_radius=0.004))
    walked = Walked(steering, (0.05, 0.0), 8.0, imu=True, stands=1.0, sensors=sensors)
    assert walked.path > 0.35
    assert walked.error < 0.026


@pytest.mark.slow
def test_a_drifting_accelerometer_bias_is_tracked(simulated: Steering) -> None:
    # It is wrong by 0.055 m/s^2 at the end, which would be found to be more than it may.
    walked = Walked(simulated, (0.15, 0.0), 10.0, imu=True, stands=1.0, warms=0.005)
    assert walked.values['accelerometer'] == 'used'
    assert walked.error < 0.04
