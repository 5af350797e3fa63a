"""Encoders and motors of the robot file, as sim, walker and solver have them."""

from math import pi
from pathlib import Path

from crank_motors import TWO_MOTORS
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
import pytest
from ros_domain import Domain
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

CRANKS = '{left_crank: {encoder_ratio: -4.0, motor_ratio: -2.0, zero: 0.3}}'


@pytest.mark.slow
def test_a_robot_with_a_gear_and_wrong_signs_walks_by_its_file(
    ros: Domain, tmp_path: Path
) -> None:
    file = tmp_path / 'robot.yaml'
    text = Path(TWO_MOTORS).read_text()
    file.write_text(f'{text}    cranks: {CRANKS}\n')
    cranks: list[JointState] = ros.probe.listen(JointState, 'crank_state')
    legs: list[JointState] = ros.probe.listen(JointState, 'joint_states')
    truths: list[Odometry] = ros.probe.listen(Odometry, 'ground_truth')
    odometry: list[Odometry] = ros.probe.listen(Odometry, 'odom')
    arguments = ('--ros-args', '--params-file', str(file))
    ros.start('sim_node', *arguments, use_clock=True)
    ros.start('solver_node', *arguments, use_sim_time=True)
    walker = ros.start('walker_node', *arguments, use_sim_time=True)
    ros.probe.until(lambda: odometry and legs and cranks)
    # It stands at zero of its cranks, and an encoder shows its zero.
    assert cranks[-1].position[0] == pytest.approx(-1.2, abs=0.05)
    alphas = dict(zip(legs[-1].name, legs[-1].position, strict=True))
    assert alphas['front_left/alpha'] == pytest.approx(0.0, abs=0.02)
    assert alphas['middle_left/alpha'] == pytest.approx(pi, abs=0.02)
    twists = ros.probe.publisher(TwistStamped, 'cmd_vel')
    message = TwistStamped()
    message.twist.linear.x = 0.15

    def walks() -> bool:
        twists.publish(message)
        return truths[-1].pose.pose.position.x > 0.15

    ros.probe.until(walks)
    # The legs are those of the crank, which turns by a quarter of its encoder.
    assert cranks[-1].position[0] < -4.0
    assert odometry[-1].pose.pose.position.x == pytest.approx(0.15, abs=0.06)
    message.twist.linear.x = 0.0

    def answers() -> bool:
        twists.publish(message)
        answer = ros.probe.call(Trigger, '/walker_node/left_crank/set_zero', Trigger.Request())
        return answer.success and 'cranks: {left_crank: {zero: ' in answer.message

    ros.probe.until(answers)
    assert walker.stop() == 0
    assert 'position offset' not in walker.errors
