"""The raw message executor answers as its oracle does, rclpy's plain executor."""

import math

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped, TwistStamped
from klann_ros.nodes.raw_executor import PLAIN
import pytest
from ros_world import World
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

OUTPUTS = {'joint_states': JointState, 'point_h': PointStamped, 'velocity_h': TwistStamped}
# Of the five states one is no crank angle, and two have a velocity.
COUNTS = {'joint_states': 4, 'point_h': 4, 'velocity_h': 2}
STATES = [
    JointState(name=['crank'], position=[1.0], velocity=[2.0]),
    JointState(name=['other', 'crank'], position=[0.0, -7.5]),
    JointState(name=['crank'], position=[math.nan]),
    JointState(name=['crank'], position=[3.0], velocity=[math.nan], effort=[1.0]),
    JointState(name=['crank'], position=[400.0], velocity=[-1e-3]),
]


def answers(ros: World) -> dict[str, list[bytes]]:
    """Start a solver, ask, and return what it says as bytes, by topic."""
    received = {topic: ros.probe.listen(kind, topic, raw=True) for topic, kind in OUTPUTS.items()}
    solver = ros.solver()
    for topic in OUTPUTS:
        ros.probe.matched(topic)
    crank = ros.probe.publisher(JointState, 'crank_state')
    for number, state in enumerate(STATES, start=1):
        state.header.stamp = Time(sec=number, nanosec=number)
        crank.publish(state)
    for topic, count in COUNTS.items():
        ros.probe.until(lambda: len(received[topic]) >= count)  # noqa: B023 - called at once
    assert solver.stop() == 0
    return {topic: list(messages) for topic, messages in received.items()}


def test_what_is_published_is_equal_byte_for_byte(
    ros: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    lean = answers(ros)
    monkeypatch.setenv(PLAIN, '1')
    plain = answers(ros)
    assert lean == plain
    assert {topic: len(messages) for topic, messages in lean.items()} == COUNTS


def test_the_plain_path_answers_a_burst_too(ros: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PLAIN, '1')
    feet = ros.probe.listen(PointStamped, 'point_h')
    ros.solver()
    ros.probe.matched('point_h')
    crank = ros.probe.publisher(Float64, 'crank_angle')
    for n in range(300):
        crank.publish(Float64(data=0.01 * n))
    ros.probe.until(lambda: len(feet) >= 300)
