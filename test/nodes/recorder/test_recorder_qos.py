"""What a recorder hears: publishers of every kind, whenever they come."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from klann_ros.log.qos import qos_from_yaml
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import topic_counts
import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from ros_world import Process, RecorderReports, World
from std_msgs.msg import Float64, String

RELIABLE = QoSProfile(depth=100)
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
DEMANDING = QoSProfile(
    depth=100,
    deadline=Duration(seconds=0.01),
    lifespan=Duration(seconds=1.0),
    liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
    liveliness_lease_duration=Duration(seconds=0.05),
)


def start(ros: World, **parameters: Any) -> tuple[Process, Path]:
    folder = ros.folder / 'run'
    return ros.start('recorder_node', output=folder, **parameters), folder


def numbers(folder: Path, topic: str = '/crank_angle') -> list[float]:
    import struct

    with open_log(folder) as log:
        data = [message.data for message in log.messages([topic])]
    return [float(struct.unpack_from('<d', item, 4)[0]) for item in data]


def heard(ros: World, publisher: Any, count: int = 1) -> None:
    ros.probe.heard(publisher, count)


def publish(publisher: Any, values: list[float]) -> None:
    for value in values:
        publisher.publish(Float64(data=value))


@pytest.mark.parametrize(
    ('first', 'second'),
    [
        (RELIABLE, BEST_EFFORT),
        (BEST_EFFORT, RELIABLE),
        (LATCHED, BEST_EFFORT),
        (RELIABLE, LATCHED),
    ],
    ids=['reliable first', 'best effort first', 'latched first', 'latched last'],
)
def test_publishers_of_two_kinds_are_each_recorded_once(
    ros: World, first: QoSProfile, second: QoSProfile
) -> None:
    reports = RecorderReports(ros.probe)
    recorder, folder = start(ros)
    one = ros.probe.node.create_publisher(Float64, 'crank_angle', first)
    heard(ros, one)
    publish(one, [1.0, 2.0])
    reports.until_heard({'/crank_angle': 2})
    two = ros.probe.node.create_publisher(Float64, 'crank_angle', second)
    # What is latched may come before anybody listens.
    early = [3.0] if second is LATCHED else []
    publish(two, early)
    heard(ros, two)
    publish(one, [5.0])
    publish(two, [4.0])
    reports.until_heard({'/crank_angle': 4 + len(early)})
    assert recorder.stop() == 0
    found = numbers(folder)
    assert sorted(found) == sorted([1.0, 2.0, *early, 4.0, 5.0])


def test_what_was_latched_before_the_recorder_came_is_recorded(ros: World) -> None:
    latched = ros.probe.node.create_publisher(String, 'robot_description', LATCHED)
    latched.publish(String(data='<robot/>'))
    reports = RecorderReports(ros.probe)
    recorder, folder = start(ros)
    reports.until_heard({'/robot_description': 1})
    assert recorder.stop() == 0
    with open_log(folder) as log:
        (message,) = log.messages(['/robot_description'])
        (topic,) = log.topics
    assert b'<robot/>' in message.data
    assert qos_from_yaml(topic.qos)[0].durability == 'transient_local'


def test_what_publishers_promise_does_not_hinder(ros: World) -> None:
    reports = RecorderReports(ros.probe)
    recorder, folder = start(ros)
    publisher = ros.probe.node.create_publisher(Float64, 'crank_angle', DEMANDING)
    heard(ros, publisher)
    publish(publisher, [1.0, 2.0, 3.0])
    reports.until_heard({'/crank_angle': 3})
    assert recorder.stop() == 0
    assert numbers(folder) == [1.0, 2.0, 3.0]


def test_a_topic_of_two_types_is_recorded_as_the_first_with_one_line(
    ros: World, own_context: Callable[[], Any]
) -> None:
    reports = RecorderReports(ros.probe)
    recorder, folder = start(ros)
    publisher = ros.probe.node.create_publisher(Float64, 'crank_angle', RELIABLE)
    heard(ros, publisher)
    # One process cannot have both.
    other = own_context().create_publisher(String, 'crank_angle', 10)
    ros.probe.until(lambda: 'is not recorded: the topic is recorded as' in recorder.errors)
    publish(publisher, [1.0])
    other.publish(String(data='x'))
    reports.until_heard({'/crank_angle': 1})
    assert recorder.stop() == 0
    assert numbers(folder) == [1.0]
    assert recorder.errors.count('std_msgs/msg/String') == 1
    assert 'Traceback' not in recorder.errors


def test_the_own_status_is_not_recorded_but_what_others_say(ros: World) -> None:
    reports = RecorderReports(ros.probe)
    recorder, folder = start(ros, all_topics='true')
    ros.probe.until(lambda: ros.probe.node.count_publishers('/diagnostics') == 1)
    crank = ros.probe.publisher(Float64, 'crank_angle')
    publish(crank, [1.0])
    reports.until_heard({'/crank_angle': 1})
    reports.until_more()
    assert recorder.stop() == 0
    with open_log(folder) as log:
        counts = topic_counts(log.metadata['klann_ros.loss'][0])
    assert counts['/crank_angle'].written == 1
    assert '/diagnostics' not in counts
