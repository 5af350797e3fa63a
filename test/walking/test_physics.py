"""A simulated walker, whose controller and odometry know nothing of the simulation."""

from math import atan2, degrees, hypot

from klann_ros.twin import Motors, Twin
from klann_ros.walking import Feet, imu_reading, Steering, Walker
import pytest

pytest.importorskip('mujoco')
PERIOD = 0.01


class Walked:
    """What became of a walk."""

    def __init__(
        self, steering: Steering, twist: tuple[float, float], seconds: float, *, imu: bool = False
    ) -> None:
        feet: Feet = steering.feet
        motors = Motors(factors={feet.joints[1]: 0.95})
        twin, walker = Twin(feet.robot, motors=motors), Walker(steering)
        self.tilt = self.path = 0.0
        begin = last = twin.truth()
        for k in range(round(seconds / PERIOD)):
            now = k * PERIOD
            if imu:
                (x, y, z, w), (a, b, c), _ = twin.imu()
                walker.imu(imu_reading((x, y, z, w), (a, b, c), now), now)
            at = walker.feedback(dict(twin.cranks()), now)
            truth = twin.truth()
            self.path += hypot(
                truth.position[0] - last.position[0], truth.position[1] - last.position[1]
            )
            last = truth
            walker.controller.command(*twist, now)
            command = walker.controller.step(now)
            assert command is not None
            for joint, rate in zip(feet.joints, command.velocity, strict=True):
                twin.command(joint, rate)
            twin.step(now + PERIOD)
            self.tilt = max(self.tilt, degrees(twin.tilt))
        assert at is not None
        x, y, z, w = last.orientation
        self.yaw = atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
        self.yaw_error = at.yaw - self.yaw
        self.height_error = at.z - last.position[2]
        ways = (at.x - last.position[0] + begin.position[0], at.y - last.position[1])
        self.error = hypot(*ways) / self.path
        one, other = (crank.position for crank in twin.cranks().values())
        self.apart = degrees(abs(one - other))


@pytest.fixture(scope='module')
def simulated(two_motors: Feet) -> Steering:
    # The simulated feet are balls.
    return Steering(Feet(two_motors.robot, foot_radius=0.004))


def test_straight_on_it_is_where_it_says_with_its_cranks_in_phase(simulated: Steering) -> None:
    walked = Walked(simulated, (0.15, 0.0), 8.0)
    assert walked.path > 1.0
    assert walked.error < 0.02
    assert abs(walked.height_error) < 0.005
    assert walked.apart < 1.0
    assert walked.tilt < 2.0


def test_in_a_curve_an_imu_tells_the_yaw(simulated: Steering) -> None:
    walked = Walked(simulated, (0.1, -0.05), 7.0, imu=True)
    assert abs(walked.yaw) > 0.05
    assert abs(walked.yaw_error) < 0.01
    assert walked.error < 0.06
    assert walked.tilt < 20.0
