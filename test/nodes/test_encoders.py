"""Counts of encoders: what an encoder shows is read as the angle that it had, also over DDS."""

from math import pi, tau
from pathlib import Path
import struct
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from hypothesis import example, given, strategies as st
from klann_ros.nodes.encoders import encoder_count, encoder_topics, TicksReader
from klann_ros.nodes.parameters import StartError
from nav_msgs.msg import Odometry
import pytest
from rclpy.serialization import serialize_message
from ros_domain import Domain
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32, Float32MultiArray, Int32

WALKER = Path(__file__).resolve().parents[2] / 'config' / 'walker6_two_motors.yaml'
INT32 = st.integers(-(2**31), 2**31 - 1)
TICKS: dict[str, Any] = {'crank_state_type': 'ticks', 'counts_per_turn': 600.0}


def message(count: int) -> bytes:
    return bytes(serialize_message(Int32(data=count)))


@given(st.floats(-1e4, 1e4), st.lists(st.floats(-100.0, 100.0), max_size=20), st.floats(1.0, 1e5))
def test_angles_are_read_to_half_a_tick_less_whole_turns(
    first: float, steps: list[float], counts_per_turn: float
) -> None:
    reader = TicksReader(counts_per_turn)
    angle = first
    half = pi / counts_per_turn
    start = reader.read(message(encoder_count(first, counts_per_turn)))
    assert abs(start) <= pi + half
    for step in steps:
        angle += step
        read = reader.read(message(encoder_count(angle, counts_per_turn)))
        turns = (read - angle) / tau
        assert read - angle == pytest.approx(round(turns) * tau, abs=half + 1e-8)
        assert read - start == pytest.approx(angle - first, abs=2.0 * half + 1e-8)


@example(2**31 - 1, [1, -2])
@example(-(2**31), [-1, 5])
@given(INT32, st.lists(st.integers(-(2**30), 2**30), min_size=1, max_size=20))
def test_an_overflow_is_no_jump(first: int, steps: list[int]) -> None:
    reader = TicksReader(4096.0)
    count = first
    last = reader.read(message(first))
    for step in steps:
        count += step
        overflown = struct.unpack('<i', struct.pack('<I', count % 2**32))[0]
        angle = reader.read(message(overflown))
        assert angle - last == pytest.approx(step / 4096.0 * tau, rel=1e-9, abs=1e-6)
        last = angle


def test_the_first_turns_are_left_out_however_long_it_has_counted() -> None:
    assert TicksReader(600.0).read(message(600 * 3_000_000 + 150)) == pytest.approx(pi / 2)
    assert TicksReader(600.0).read(message(-600 * 3_000_000 - 150)) == pytest.approx(-pi / 2)


def test_a_short_message_is_refused() -> None:
    with pytest.raises(ValueError, match='7 bytes are no std_msgs/msg/Int32'):
        TicksReader(600.0).read(b'\0\1\0\0\1\1\1')


def test_each_of_several_cranks_has_a_topic() -> None:
    assert encoder_topics(['crank'], TICKS) == {'crank': 'crank_state'}
    topics = {'left': 'crank_state/left', 'right/crank': 'crank_state/right/crank'}
    assert encoder_topics(['left', 'right/crank'], TICKS) == topics
    assert encoder_topics(['left', 'right'], {'crank_state_type': 'joint_state'}) == {}
    with pytest.raises(StartError, match=r"ticks of joint 'le ft' have no topic: topic name must"):
        encoder_topics(['le ft', 'right'], TICKS)
    with pytest.raises(StartError, match=r'counts_per_turn = 0\.0 is refused: it must be > 0'):
        encoder_topics(['left'], {**TICKS, 'counts_per_turn': 0.0})


def test_a_solver_takes_a_float32_and_ticks(ros: Domain) -> None:
    ros.solve(crank_angle_type='float32', crank_state_type='ticks', counts_per_turn=600)
    poses = ros.probe.listen(JointState, 'joint_states')
    ros.probe.await_publishers('joint_states')
    ros.probe.publisher(Float32, 'crank_angle').publish(Float32(data=0.1))
    ros.probe.until(lambda: len(poses) == 1)
    # The nearest of 24 bits.
    assert poses[0].position[0] == struct.unpack('f', struct.pack('f', 0.1))[0] != 0.1
    assert poses[0].header.stamp.sec > 0
    ros.probe.publisher(Int32, 'crank_state').publish(Int32(data=150))
    ros.probe.until(lambda: len(poses) == 2)
    assert poses[1].position[0] == pytest.approx(pi / 2)
    assert not poses[1].velocity
    assert poses[1].header.stamp.sec > 0


def test_ticks_of_several_cranks_turn_the_legs_on_them(ros: Domain) -> None:
    joints = {'left.crank_joint': 'left_crank', 'right.crank_joint': 'right_crank'}
    ros.solve(legs='[left, right]', diagnostics_period=0.1, **joints, **TICKS)
    poses = ros.probe.listen(JointState, 'joint_states')
    reports: list[DiagnosticArray] = ros.probe.listen(DiagnosticArray, '/diagnostics')
    ros.probe.await_publishers('joint_states')
    counts = {'left_crank': 60, 'right_crank': -60}
    encoders = {joint: ros.probe.publisher(Int32, f'crank_state/{joint}') for joint in counts}
    reports.clear()
    for _ in range(20):
        for joint, count in counts.items():
            encoders[joint].publish(Int32(data=count))
        ros.probe.spin(0.02)
    ros.probe.until(lambda: len(poses) == 40)
    angles = {name: p for pose in poses for name, p in zip(pose.name, pose.position, strict=True)}
    assert angles['left/alpha'] == pytest.approx(tau / 10.0)
    assert angles['right/alpha'] == pytest.approx(-tau / 10.0)
    assert all(len(pose.name) == 5 for pose in poses)
    # Each has an encoder of its own: no two turn one crank.
    messages = {status.message for report in reports for status in report.status}
    assert messages <= {'solving', 'no input for 0.0 s'}
    assert 'solving' in messages


@pytest.mark.slow
def test_a_simulated_walker_walks_by_ticks(ros: Domain) -> None:
    truths: list[Odometry] = ros.probe.listen(Odometry, 'ground_truth')
    odometry: list[Odometry] = ros.probe.listen(Odometry, 'odom')
    counts: list[Int32] = ros.probe.listen(Int32, 'crank_state/right_crank')
    words = ('--ros-args', '--params-file', str(WALKER))
    ros.start('sim_node', *words, **TICKS, use_clock=True, linear=0.15)
    ros.start('walker_node', *words, **TICKS, use_sim_time=True, use_imu=True)
    ros.probe.until(lambda: odometry and truths and truths[-1].pose.pose.position.x > 0.15)
    ros.probe.until(lambda: odometry[-1].pose.pose.position.x > 0.1)
    assert 0 < abs(counts[-1].data) < 600
    # One message behind the other, each is of the last moment.
    odom, truth = odometry[-1].pose.pose.position, truths[-1].pose.pose.position
    assert odom.x == pytest.approx(truth.x, abs=0.05)


def test_float32_commands_answer_ticks(ros: Domain) -> None:
    words = ('--ros-args', '--params-file', str(WALKER.with_name('walker6.yaml')))
    types = {'stamped_cmd_vel': False, 'command_type': 'velocities_float32'}
    ros.start('walker_node', *words, **TICKS, **types)
    commands: list[Float32MultiArray] = ros.probe.listen(Float32MultiArray, 'crank_command')
    ticks = ros.probe.publisher(Int32, 'crank_state')
    cmd_vel = ros.probe.publisher(Twist, 'cmd_vel')
    twist = Twist()
    twist.linear.x = 0.1
    motor = {'angle': 0.0, 'time': monotonic()}

    def turn() -> None:
        now = monotonic()
        rate = commands[-1].data[0] if commands else 0.0
        motor['angle'] += rate * (now - motor['time'])
        motor['time'] = now
        ticks.publish(Int32(data=encoder_count(motor['angle'], 600.0)))
        cmd_vel.publish(twist)

    ros.probe.node.create_timer(0.01, turn)
    ros.probe.until(lambda: commands and commands[-1].data[0] > 0.5)
    assert len(commands[-1].data) == 1
