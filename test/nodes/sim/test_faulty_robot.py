"""`sim_node` with faults: they act between its topics and the robot."""

from typing import Any

from crank_motors import TWO_MOTORS
from nav_msgs.msg import Odometry
import pytest
from ros_domain import Domain
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool


@pytest.mark.slow
def test_commands_and_readings_pass_the_faults(ros: Domain) -> None:
    cranks: list[JointState] = ros.probe.listen(JointState, 'crank_state')
    imus: list[Imu] = ros.probe.listen(Imu, 'imu')
    switch: list[Bool] = ros.probe.listen(Bool, 'home/right_crank')
    process = start(
        ros,
        faults='left_crank_reversed, right_crank_gear_ratio=-2, imu_missing, driver_repeats@3',
        home_switches=True,
        use_clock=True,
    )
    commands = ros.probe.publisher(JointState, 'crank_command')

    def drive(until: Any) -> None:
        def holds() -> bool:
            message = JointState(name=['left_crank', 'right_crank'], velocity=[1.0, 1.0])
            commands.publish(message)
            return bool(until())

        ros.probe.until(holds)

    drive(lambda: cranks and cranks[-1].position[1] < -1.0)
    assert cranks[-1].position[0] < -0.3
    assert -2.1 < cranks[-1].velocity[1] < -1.9
    # The switch is closed from 0 to 0.2 rad of the crank, wherever its encoder is.
    assert any(state.data for state in switch)
    assert not switch[-1].data
    assert not imus
    drive(lambda: cranks[-1] == cranks[-2] == cranks[-3])
    assert process.popen.poll() is None


def test_only_the_message_of_a_tilted_imu_is_tilted(ros: Domain) -> None:
    imus: list[Imu] = ros.probe.listen(Imu, 'imu')
    truths: list[Odometry] = ros.probe.listen(Odometry, 'ground_truth')
    start(ros, faults='imu_tilted')
    ros.probe.until(lambda: imus and truths)
    assert imus[-1].linear_acceleration.y > 5.0
    assert abs(truths[-1].pose.pose.orientation.x) < 0.1


def start(ros: Domain, **parameters: object) -> Any:
    return ros.start('sim_node', '--ros-args', '--params-file', TWO_MOTORS, **parameters)
