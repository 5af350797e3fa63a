"""`sim_node` as a process: commands, outputs, and refusals."""

from itertools import pairwise
import math
from typing import Any

from crank_motors import JOINTS, TWO_MOTORS
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from klann_ros.nodes.endpoints import LAST_MESSAGES
from nav_msgs.msg import Odometry
import pytest
from ros_domain import Domain
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger


class Robot:
    """A simulated walker, and its messages so far."""

    def __init__(self, ros: Domain) -> None:
        self.probe = ros.probe
        self.cranks: list[JointState] = ros.probe.listen(JointState, 'crank_state')
        self.imus: list[Imu] = ros.probe.listen(Imu, 'imu')
        self.truths: list[Odometry] = ros.probe.listen(Odometry, 'ground_truth')
        self.clocks: list[Clock] = ros.probe.listen(Clock, '/clock')
        self._reports: list[DiagnosticArray] = ros.probe.listen(DiagnosticArray, '/diagnostics')
        self.process = ros.start(
            'sim_node',
            *('--ros-args', '--params-file', TWO_MOTORS),
            use_clock=True,
            motor_speed_factor=[1.0, 0.9],
            diagnostics_period=0.2,
            command_timeout=0.3,
            gyro_noise=0.01,
        )
        self._commands = ros.probe.publisher(JointState, 'crank_command')
        self.probe.until(lambda: self.truths and self._reports)

    def command(self, names: list[str], velocities: list[float], positions: Any = None) -> None:
        self._commands.publish(
            JointState(name=names, position=positions or [0.0] * len(names), velocity=velocities)
        )

    def driven(self, until: Any, *velocities: float) -> None:
        """Command again and again until something holds."""

        def holds() -> bool:
            self.command(JOINTS, [*velocities])
            return bool(until())

        self.probe.until(holds)

    def value(self, key: str) -> str:
        (status,) = self._reports[-1].status
        return next(figure.value for figure in status.values if figure.key == key)

    def message(self) -> str:
        return self._reports[-1].status[0].message


@pytest.fixture(scope='module')
def robot(module_ros: Domain) -> Robot:
    return Robot(module_ros)


def test_it_follows_commands_and_publishes_every_topic(robot: Robot) -> None:
    start = robot.truths[-1].pose.pose.position.x
    robot.driven(lambda: robot.truths[-1].pose.pose.position.x - start > 0.05, 2.0, 2.0)
    state, truth, imu = robot.cranks[-1], robot.truths[-1], robot.imus[-1]
    assert list(state.name) == JOINTS
    assert list(state.effort) == []
    # The right motor has its speed factor.
    assert state.velocity[1] / state.velocity[0] == pytest.approx(0.9, abs=0.05)
    assert (truth.header.frame_id, truth.child_frame_id) == ('odom', 'base_link')
    assert imu.header.frame_id == 'base_link'
    assert imu.angular_velocity_covariance[0] == pytest.approx(1e-4)
    # Each foot that comes down is felt; in the mean it is the weight.
    forces = [reading.linear_acceleration.z for reading in robot.imus]
    assert sum(forces) / len(forces) == pytest.approx(9.81, abs=1.5)


def test_its_stamps_are_its_clock(robot: Robot) -> None:
    stamps = [state.header.stamp for state in robot.cranks]
    times = [stamp.sec + stamp.nanosec / 1e9 for stamp in stamps]
    steps = [later - earlier for earlier, later in pairwise(times)]
    # Whatever the machine has else to do: simulated time goes by even steps.
    assert steps == pytest.approx([0.01] * len(steps), abs=1e-6)
    last = stamps[-1].sec, stamps[-1].nanosec
    robot.probe.until(lambda: last in {(c.clock.sec, c.clock.nanosec) for c in robot.clocks})


def test_without_commands_its_cranks_are_held(robot: Robot) -> None:
    robot.driven(lambda: robot.cranks[-1].velocity[0] > 0.9, 1.0, 1.0)
    held_count = int(robot.value('held'))
    robot.probe.until(lambda: int(robot.value('held')) >= held_count + 2)
    robot.probe.until(lambda: abs(robot.cranks[-1].velocity[0]) < 0.1)
    robot.probe.until(lambda: 'held' in robot.message() or 'keep up' in robot.message())


@pytest.mark.parametrize(
    ('names', 'velocities'),
    [
        (JOINTS, [math.nan, 1.0]),
        (JOINTS, [1.0, math.inf]),
        (JOINTS, []),
        (['wheel'], [1.0]),
        ([], []),
        (JOINTS, [1.0]),
    ],
)
def test_invalid_commands_move_nothing_and_are_counted(
    robot: Robot, names: list[str], velocities: list[float]
) -> None:
    rejected = int(robot.value('rejected'))
    robot.command(names, velocities)
    robot.probe.until(lambda: int(robot.value('rejected')) == rejected + 1)
    assert robot.process.popen.poll() is None
    assert math.isfinite(robot.cranks[-1].position[0])


def test_commands_above_the_limit_are_limited_and_counted(robot: Robot) -> None:
    limited = int(robot.value('limited'))
    robot.command(['left_crank'], [1e300])
    robot.command(['left_crank'], [0.0])
    robot.probe.until(lambda: int(robot.value('limited')) == limited + 1)


def test_a_reset_puts_it_back(robot: Robot) -> None:
    answer = robot.probe.call(Trigger, '/sim_node/reset', Trigger.Request())
    assert answer.success
    # What was under way still comes first.
    robot.probe.until(lambda: abs(robot.truths[-1].pose.pose.position.x) <= 0.02)
    robot.probe.until(lambda: int(robot.value('resets')) == 1)


def test_ctrl_c_ends_it_silently(robot: Robot) -> None:
    assert robot.process.stop() == 0
    assert 'Traceback' not in robot.process.errors


def test_its_own_drive_ends_with_a_command_to_stand(ros: Domain) -> None:
    words = ('--ros-args', '--params-file', TWO_MOTORS)
    sim = ros.start('sim_node', *words, linear=0.1)
    # It drives what has a publisher of crank_command.
    ros.probe.node.create_publisher(JointState, 'crank_command', 1)
    commands = ros.probe.listen(TwistStamped, 'cmd_vel')
    ros.probe.until(lambda: commands)
    assert commands[-1].twist.linear.x == 0.1
    assert sim.stop() == 0
    ros.probe.spin(0.3)
    last = [command.twist.linear.x for command in commands[-LAST_MESSAGES:]]
    assert last == [0.0] * LAST_MESSAGES
