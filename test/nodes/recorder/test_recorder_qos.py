"""A recorder with publishers of every quality of service, early and late."""

from pathlib import Path
from typing import Any

from klann_ros.log.qos import qos_from_yaml
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import topic_counts
import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from recorder_runs import numbers
from ros_domain import Domain, RecorderReports
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
# The first and the second publisher of a topic.
PAIRS = {
    '/reliable_first': (RELIABLE, BEST_EFFORT),
    '/best_effort_first': (BEST_EFFORT, RELIABLE),
    '/latched_first': (LATCHED, BEST_EFFORT),
    '/latched_last': (RELIABLE, LATCHED),
}


def publish(publisher: Any, *values: float) -> None:
    for value in values:
        publisher.publish(Float64(data=value))


@pytest.fixture(scope='module')
def recorded(module_ros: Domain) -> tuple[Path, str]:
    """Return a run of all topics, and what its recorder has logged."""
    probe = module_ros.probe
    folder = module_ros.folder / 'run'
    create = probe.node.create_publisher
    reports = RecorderReports(probe)
    create(String, 'robot_description', LATCHED).publish(String(data='<robot/>'))
    recorder = module_ros.start('recorder_node', output=folder, all_topics='true')
    first = {topic: create(Float64, topic, pair[0]) for topic, pair in PAIRS.items()}
    demanding, typed = create(Float64, 'demanding', DEMANDING), create(Float64, 'typed', RELIABLE)
    for publisher in (*first.values(), demanding, typed):
        probe.await_subscribers(publisher)
        publish(publisher, 1.0, 2.0)
    reports.until_received(dict.fromkeys([*PAIRS, '/demanding', '/typed'], 2))
    # One process cannot have both types.
    text_publisher = module_ros.other_node().create_publisher(String, 'typed', 10)
    second = {topic: create(Float64, topic, pair[1]) for topic, pair in PAIRS.items()}
    # A latched message may be older than its subscription.
    publish(second['/latched_last'], 3.0)
    for topic, publisher in second.items():
        probe.await_subscribers(publisher)
        publish(first[topic], 5.0)
        publish(publisher, 4.0)
    reports.until_received(dict.fromkeys(PAIRS, 4) | {'/latched_last': 5})
    probe.until(lambda: 'is not recorded: the topic is recorded as' in recorder.errors)
    text_publisher.publish(String(data='x'))
    publish(typed, 3.0)
    reports.until_received({'/robot_description': 1, '/typed': 3})
    reports.until_reports()
    assert recorder.stop() == 0
    return folder, recorder.errors


@pytest.mark.parametrize('topic', PAIRS)
def test_publishers_of_two_kinds_are_each_recorded_once(
    recorded: tuple[Path, str], topic: str
) -> None:
    early = [3.0] if topic == '/latched_last' else []
    assert sorted(numbers(recorded[0], topic)) == [1.0, 2.0, *early, 4.0, 5.0]


def test_latched_messages_from_before_the_recorder_are_recorded(
    recorded: tuple[Path, str],
) -> None:
    with open_log(recorded[0]) as log:
        (message,) = log.messages(['/robot_description'])
    assert b'<robot/>' in message.data
    assert qos_from_yaml(message.topic.qos)[0].durability == 'transient_local'


def test_deadline_lifespan_and_liveliness_do_not_matter(recorded: tuple[Path, str]) -> None:
    assert numbers(recorded[0], '/demanding') == [1.0, 2.0]


def test_a_topic_of_two_types_is_recorded_as_the_first_with_one_line(
    recorded: tuple[Path, str],
) -> None:
    folder, errors = recorded
    assert numbers(folder, '/typed') == [1.0, 2.0, 3.0]
    assert errors.count('std_msgs/msg/String') == 1
    assert 'Traceback' not in errors


def test_its_own_status_is_not_recorded_but_others_are(recorded: tuple[Path, str]) -> None:
    with open_log(recorded[0]) as log:
        counts = topic_counts(log.metadata['klann_ros.loss'][0])
    assert counts['/demanding'].written == 2
    assert '/diagnostics' not in counts
