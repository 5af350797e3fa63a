"""All together: cmd_vel to walker_node, cranks to sim_node, and the robot is where odom says."""

from pathlib import Path

from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
import pytest
from ros_world import World

WALKER = str(Path(__file__).resolve().parents[3] / 'config' / 'walker6_two_motors.yaml')


def test_what_walks_by_cmd_vel_is_where_its_odometry_says(ros: World) -> None:
    truths: list[Odometry] = ros.probe.listen(Odometry, 'ground_truth')
    odometry: list[Odometry] = ros.probe.listen(Odometry, 'odom')
    given = ('--ros-args', '--params-file', WALKER)
    ros.start_by([], 'sim_node', *given, '-p', 'use_clock:=true', '-p', 'linear:=0.15')
    # Simulated time: however slow the machine is, they see the same.
    ros.start_by([], 'walker_node', *given, '-p', 'use_sim_time:=true')
    ros.probe.until(lambda: bool(odometry) and truths[-1].pose.pose.position.x > 0.15)
    told = {truth.header.stamp.sec * 10**9 + truth.header.stamp.nanosec: truth for truth in truths}
    both = [
        (odom.pose.pose.position, told[stamp].pose.pose.position)
        for odom in odometry
        for stamp in [odom.header.stamp.sec * 10**9 + odom.header.stamp.nanosec]
        if stamp in told
    ]
    odom, truth = both[-1]
    assert truth.x > 0.1
    assert odom.x == pytest.approx(truth.x, abs=0.02)
    assert odom.y == pytest.approx(truth.y, abs=0.02)
    # Once somebody else may steer it nobody else does.
    ros.probe.publisher(TwistStamped, 'cmd_vel')
    ros.probe.until(lambda: abs(odometry[-1].twist.twist.linear.x) < 0.01)
