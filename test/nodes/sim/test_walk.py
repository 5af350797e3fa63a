"""All together: cmd_vel to walker_node, cranks to sim_node, odom; recorded, and played back."""

from pathlib import Path

from crank_motors import TWO_MOTORS
from diagnostic_msgs.msg import DiagnosticArray, KeyValue
from geometry_msgs.msg import TwistStamped
from klann_ros.log.reader import open_log
from nav_msgs.msg import Odometry
import pytest
from ros_domain import Domain, RecorderReports
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger


def stamp_of(odometry: Odometry) -> tuple[int, int]:
    return odometry.header.stamp.sec, odometry.header.stamp.nanosec


@pytest.mark.slow
def test_a_walk_by_cmd_vel_agrees_with_its_odometry_and_is_played_back(
    ros: Domain, tmp_path: Path
) -> None:
    truths: list[Odometry] = ros.probe.listen(Odometry, 'ground_truth')
    odometry: list[Odometry] = ros.probe.listen(Odometry, 'odom')
    reports: list[DiagnosticArray] = ros.probe.listen(DiagnosticArray, '/diagnostics')
    recorded = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output=str(tmp_path / 'run'))
    file = ('--ros-args', '--params-file', TWO_MOTORS)
    sim = ros.start('sim_node', *file, use_clock=True, linear=0.15)
    # Simulated time: however slow the machine is, they see the same.
    walker = ros.start('walker_node', *file, use_sim_time=True, use_imu=True)
    ros.probe.until(lambda: bool(odometry and truths) and truths[-1].pose.pose.position.x > 0.15)
    true_positions = {stamp_of(truth): truth.pose.pose.position for truth in truths}
    answered = [estimate for estimate in odometry if stamp_of(estimate) in true_positions]
    odom = answered[-1].pose.pose.position
    truth = true_positions[stamp_of(answered[-1])]
    assert truth.x > 0.1
    # On a busy machine it was off by 2.8 cm once, alone it is by some millimetres.
    assert odom.x == pytest.approx(truth.x, abs=0.04)
    assert odom.y == pytest.approx(truth.y, abs=0.04)
    # It has stood before it walked.
    used = KeyValue(key='accelerometer', value='used')
    ros.probe.until(lambda: any(used in report.status[0].values for report in reports))
    # While another node may steer, sim_node does not.
    ros.probe.publisher(TwistStamped, 'cmd_vel')
    ros.probe.until(lambda: abs(odometry[-1].twist.twist.linear.x) < 0.01)
    recorded.until_received({'/odom': 100, '/crank_command': 100})
    assert [node.stop() for node in (walker, sim, recorder)] == [0, 0, 0]
    # Each message played is one of the run, to the last byte.
    kinds = {'/odom': Odometry, '/crank_command': JointState}
    log = open_log(tmp_path / 'run')
    logged: dict[str, list[bytes]] = {}
    received: dict[str, list[bytes]] = {}
    for name, kind in kinds.items():
        logged[name] = [message.data for message in log.messages([name])]
        received[name] = ros.probe.listen(kind, f'/replay{name}', raw=True)
    options = ('--delay', '0', '--start-paused', '--ros-args', '-r', '__ns:=/replay')
    player = ros.start('player_node', str(tmp_path / 'run'), *options)
    for name in kinds:
        ros.probe.await_publishers(f'/replay{name}')
    resume = '/replay/player_node/resume'
    assert ros.probe.call(Trigger, resume, Trigger.Request()).success
    ros.probe.until(lambda: all(len(messages) > 50 for messages in received.values()))
    assert player.stop() == 0
    for name, messages in received.items():
        assert set(messages) <= set(logged[name])
