"""Runs of the real nodes in which a second crank or a second solver is found."""

from math import isnan
from pathlib import Path

from domain import own_domain
from findings import checks
from klann_ros.nodes.endpoints import OUTPUT
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.review import Review
from klann_ros.review.reviewing import review_run
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_domain import Domain, open_domain, RecorderReports
from sensor_msgs.msg import JointState
from std_msgs.msg import String

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# This machine may hold anything up for a moment, but for no second.
LIMITS = Limits(gap_time=1.0, latency=1.0)


def two_cranks(ros: Domain) -> Path:
    """Record two cranks at 500 Hz, and what was latched long before."""
    described = ros.probe.node.create_publisher(String, 'robot_description', LATCHED)
    described.publish(String(data='<robot name="none"/>'))
    ros.probe.spin(1.5)
    reports = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output=ros.folder / 'cranks')
    for n in range(2):
        named = ('--ros-args', '-r', f'__node:=crank_{n}')
        # So slow that they are apart whenever each of them begins.
        ros.start('crank_node', *named, start=4.0 * n, speed=0.3, rate=500.0, min_subscribers=1)
    # As soon as it hears both losses are unknown.
    ros.probe.until(lambda: any(s.get('/crank_angle lost') == 'unknown' for s in reports.values()))
    reports.until_received({'/crank_angle': reports.count('/crank_angle received') + 1000})
    reports.until_received({'/robot_description': 1})
    assert recorder.stop() == 0
    return ros.folder / 'cranks'


def two_solvers(ros: Domain) -> Path:
    """Record two solvers that answer the same crank."""
    reports = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output=ros.folder / 'solvers')
    for name in ('first', 'second'):
        ros.solver('--ros-args', '-r', f'__node:={name}')
    ros.probe.listen(JointState, 'joint_states', OUTPUT)
    ros.probe.await_publishers('joint_states', publishers=2)
    # Both answer from the first question on, and the recorder knows both by then.
    ros.start('crank_node', rate=100.0, min_subscribers=3)
    reports.until_received({'/joint_states': 200})
    assert recorder.stop() == 0
    return ros.folder / 'solvers'


@pytest.fixture(scope='module')
def reviews(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Review]:
    """Return the reviews of what the real nodes made."""
    found = {}
    for record in (two_cranks, two_solvers):
        other = tmp_path_factory.mktemp(record.__name__)
        with own_domain() as domain, open_domain(domain, other) as ros:
            found[record.__name__] = review_run(record(ros), limits=LIMITS)
    return found


def test_two_cranks_are_no_clock_set_back_and_named(reviews: dict[str, Review]) -> None:
    review = reviews['two_cranks']
    (topic,) = [topic for topic in review.recording.topics if topic.name == '/crank_angle']
    assert len(topic.times) >= 1000
    assert (topic.lost, topic.shared) == (None, True)
    # There is no solver in this run.
    assert checks(review) == ['poses', 'jump']
    meaning = 'multiple publishers set the crank at once (/crank_angle), each with its own angle'
    assert review.findings[1].meaning == meaning


def test_what_was_latched_before_has_no_latency(reviews: dict[str, Review]) -> None:
    (topic,) = [t for t in reviews['two_cranks'].topics if t.name == '/robot_description']
    assert topic.count == 1
    assert isnan(topic.latency_p50)


def test_two_solvers_are_named(reviews: dict[str, Review]) -> None:
    review = reviews['two_solvers']
    assert checks(review) == ['solvers']
    text = review.findings[0].text
    assert text.startswith('two solvers (/first, /second) answer on /joint_states: ')
    (leg,) = review.legs
    answers, asked = leg.answers.count, leg.answers.asked
    assert text.endswith(f': {answers} answers to {asked} crank angles')
    # The last question may have been answered by one of them only when the recorder stopped.
    assert 2 * asked - 2 <= answers <= 2 * asked
