"""A recorder with publishers of every quality of service, early and late."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from klann_ros.log.qos import qos_from_yaml
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import topic_counts
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from recordings import numbers
from ros_domain import Domain, Process, RecorderReports
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


def start(ros: Domain, **parameters: Any) -> tuple[Process, Path]:
    folder = ros.folder / 'run'
    return ros.start('recorder_node', output=folder, **parameters), folder


def publish(publisher: Any, values: list[float]) -> None:
    for value in values:
        publisher.publish(Float64(data=value))


PAIRS = {
    '/reliable_first': (RELIABLE, BEST_EFFORT),
    '/best_effort_first': (BEST_EFFORT, RELIABLE),
    '/latched_first': (LATCHED, BEST_EFFORT),
    '/latched_last': (RELIABLE, LATCHED),
}


def test_publishers_of_two_kinds_are_each_recorded_once(ros: Domain) -> None:
    reports = RecorderReports(ros.probe)
    recorder, folder = start(ros, all_topics='true')
    create = ros.probe.node.create_publisher
    first = {topic: create(Float64, topic, pair[0]) for topic, pair in PAIRS.items()}
    for publisher in first.values():
        ros.probe.await_subscribers(publisher)
        publish(publisher, [1.0, 2.0])
    reports.until_received(dict.fromkeys(PAIRS, 2))
    second = {topic: create(Float64, topic, pair[1]) for topic, pair in PAIRS.items()}
    # A latched message may be older than its subscription.
    publish(second['/latched_last'], [3.0])
    for topic, publisher in second.items():
        ros.probe.await_subscribers(publisher)
        publish(first[topic], [5.0])
        publish(publisher, [4.0])
    reports.until_received(dict.fromkeys(PAIRS, 4) | {'/latched_last': 5})
    assert recorder.stop() == 0
    for topic in PAIRS:
        early = [3.0] if topic == '/latched_last' else []
        assert sorted(numbers(folder, topic)) == sorted([1.0, 2.0, *early, 4.0, 5.0])


def test_latched_messages_from_before_the_recorder_are_recorded(ros: Domain) -> None:
    latched = ros.probe.node.create_publisher(String, 'robot_description', LATCHED)
    latched.publish(String(data='<robot/>'))
    reports = RecorderReports(ros.probe)
    recorder, folder = start(ros)
    reports.until_received({'/robot_description': 1})
    assert recorder.stop() == 0
    with open_log(folder) as log:
        (message,) = log.messages(['/robot_description'])
        (topic,) = log.topics
    assert b'<robot/>' in message.data
    assert qos_from_yaml(topic.qos)[0].durability == 'transient_local'


def test_deadline_lifespan_and_liveliness_do_not_matter(ros: Domain) -> None:
    reports = RecorderReports(ros.probe)
    recorder, folder = start(ros)
    publisher = ros.probe.node.create_publisher(Float64, 'crank_angle', DEMANDING)
    ros.probe.await_subscribers(publisher)
    publish(publisher, [1.0, 2.0, 3.0])
    reports.until_received({'/crank_angle': 3})
    assert recorder.stop() == 0
    assert numbers(folder) == [1.0, 2.0, 3.0]


def test_a_topic_of_two_types_is_recorded_as_the_first_with_one_line(
    ros: Domain, own_context: Callable[[], Any]
) -> None:
    reports = RecorderReports(ros.probe)
    recorder, folder = start(ros)
    publisher = ros.probe.node.create_publisher(Float64, 'crank_angle', RELIABLE)
    ros.probe.await_subscribers(publisher)
    # One process cannot have both.
    other = own_context().create_publisher(String, 'crank_angle', 10)
    ros.probe.until(lambda: 'is not recorded: the topic is recorded as' in recorder.errors)
    publish(publisher, [1.0])
    other.publish(String(data='x'))
    reports.until_received({'/crank_angle': 1})
    assert recorder.stop() == 0
    assert numbers(folder) == [1.0]
    assert recorder.errors.count('std_msgs/msg/String') == 1
    assert 'Traceback' not in recorder.errors


def test_its_own_status_is_not_recorded_but_others_are(ros: Domain) -> None:
    reports = RecorderReports(ros.probe)
    recorder, folder = start(ros, all_topics='true')
    ros.probe.until(lambda: ros.probe.node.count_publishers('/diagnostics') == 1)
    crank = ros.probe.publisher(Float64, 'crank_angle')
    publish(crank, [1.0])
    reports.until_received({'/crank_angle': 1})
    reports.until_reports()
    assert recorder.stop() == 0
    with open_log(folder) as log:
        counts = topic_counts(log.metadata['klann_ros.loss'][0])
    assert counts['/crank_angle'].written == 1
    assert '/diagnostics' not in counts
