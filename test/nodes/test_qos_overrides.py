"""`qos_overrides` are honoured, durability and all others, or refused with the reason."""

from typing import Any

from geometry_msgs.msg import PointStamped
from klann_ros.kinematics import KlannLeg
import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from ros_domain import Domain
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def override(topic: str, kind: str, **policies: object) -> dict[str, object]:
    return {f'qos_overrides./{topic}.{kind}.{policy}': v for policy, v in policies.items()}


def profile(ros: Domain, topic: str, *, of_subscription: bool = False) -> QoSProfile:
    """Return what the only endpoint of a topic offers or asks for."""
    node = ros.probe.node
    found = (
        node.get_subscriptions_info_by_topic
        if of_subscription
        else node.get_publishers_info_by_topic
    )
    ros.probe.until(lambda: found(topic))
    (info,) = found(topic)
    return info.qos_profile


def test_a_latched_solver_repeats_its_answers_to_late_subscribers(ros: Domain) -> None:
    given = {
        **override('joint_states', 'publisher', durability='transient_local', depth=2),
        **override('point_h', 'publisher', durability='transient_local'),
    }
    ros.solve(**given)
    crank = ros.probe.publisher(Float64, 'crank_angle')
    early = ros.probe.listen(PointStamped, 'point_h')
    ros.probe.await_publishers('point_h')
    for alpha in (1.0, 2.0, 3.0):
        crank.publish(Float64(data=alpha))
    ros.probe.until(lambda: len(early) == 3)
    poses = ros.probe.listen(JointState, 'joint_states', LATCHED)
    feet = ros.probe.listen(PointStamped, 'point_h', LATCHED)
    ros.probe.until(lambda: len(poses) == 2 and len(feet) == 3)
    assert [pose.position[0] for pose in poses] == [2.0, 3.0]
    expected = [pytest.approx(KlannLeg().closed_form(alpha).h) for alpha in (1.0, 2.0, 3.0)]
    assert [(foot.point.x, foot.point.y) for foot in feet] == expected


def test_an_override_is_of_its_topic_alone(ros: Domain) -> None:
    ros.solve(**override('joint_states', 'publisher', reliability='best_effort'))
    assert profile(ros, 'joint_states').reliability == ReliabilityPolicy.BEST_EFFORT
    for topic in ('point_h', 'velocity_h', '/diagnostics', 'markers'):
        assert profile(ros, topic).reliability == ReliabilityPolicy.RELIABLE
        is_latched = profile(ros, topic).durability == DurabilityPolicy.TRANSIENT_LOCAL
        assert is_latched == (topic == 'markers')


def test_rare_policies_are_honoured_too(ros: Domain) -> None:
    policies: dict[str, Any] = {
        'deadline': 200_000_000,
        'lifespan': 3_000_000_000,
        'liveliness': 'manual_by_topic',
        'liveliness_lease_duration': 5_000_000_000,
    }
    ros.start('crank_node', **override('crank_angle', 'publisher', **policies))
    offered = profile(ros, 'crank_angle')
    assert offered.deadline == Duration(seconds=0.2)
    assert offered.lifespan == Duration(seconds=3.0)
    assert offered.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC
    assert offered.liveliness_lease_duration == Duration(seconds=5.0)


def test_an_input_that_requests_more_reports_incompatible_publishers(
    ros: Domain, capfd: pytest.CaptureFixture[str]
) -> None:
    ros.solve(**override('crank_angle', 'subscription', reliability='reliable'))
    requested = profile(ros, 'crank_angle', of_subscription=True)
    assert requested.reliability == ReliabilityPolicy.RELIABLE
    best_effort = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    ros.probe.node.create_publisher(Float64, 'crank_angle', best_effort)
    ros.probe.until(lambda: 'incompatible QoS' in capfd.readouterr().err)
