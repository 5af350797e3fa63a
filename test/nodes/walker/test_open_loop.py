"""walker_node without encoders: the commanded path is taken as the measured one."""

from crank_motors import TWO_MOTORS
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
import pytest
from ros_domain import Domain
from sensor_msgs.msg import JointState


@pytest.mark.slow
def test_it_walks_stands_and_starts_again_without_encoders(ros: Domain) -> None:
    words = ['--ros-args', '--params-file', TWO_MOTORS]
    node = ros.start('walker_node', *words, open_loop=True, diagnostics_period=0.1)
    probe = ros.probe
    commands = probe.listen(JointState, 'crank_command')
    odom = probe.listen(Odometry, 'odom')
    reports = probe.listen(DiagnosticArray, '/diagnostics')
    cmd_vel = probe.publisher(TwistStamped, 'cmd_vel')
    twist = TwistStamped()
    timer = probe.node.create_timer(0.05, lambda: cmd_vel.publish(twist))
    twist.twist.linear.x = 0.15
    for distance in (0.3, 0.6):
        timer.reset()
        probe.until(lambda distance=distance: odom and odom[-1].pose.pose.position.x > distance)
        # A silent cmd_vel stops it as ever.
        timer.cancel()
        probe.until(lambda: not any(commands[-1].velocity))
    assert not probe.node.get_subscriptions_info_by_topic('/crank_state')
    # 0.149 m a radian of the cranks, by the commanded path.
    assert odom[-1].pose.pose.position.x == pytest.approx(
        0.149 * commands[-1].position[0], rel=0.1
    )
    assert commands[-1].position[0] == pytest.approx(commands[-1].position[1])
    probe.until(lambda: any('standing' in status.message for status in reports[-1].status))
    assert 'open loop: begin with all cranks at 0' in node.errors
    assert node.stop() == 0
    assert 'fault' not in node.errors
