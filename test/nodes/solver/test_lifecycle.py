"""`solver_node --lifecycle`: a managed node, which answers while it is active."""

from geometry_msgs.msg import PointStamped
from klann_ros.kinematics import KlannLeg
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
from rclpy.qos import DurabilityPolicy
from ros_domain import Domain
from std_msgs.msg import Float64

LINES = {
    'CONFIGURE': 'configured',
    'ACTIVATE': 'activated: it answers',
    'DEACTIVATE': 'deactivated: it does not listen',
    'CLEANUP': 'cleaned up: unconfigured',
    'UNCONFIGURED_SHUTDOWN': 'shut down: it answers no more',
}


def change(ros: Domain, *names: str) -> None:
    for name in names:
        number = getattr(Transition, f'TRANSITION_{name}')
        request = ChangeState.Request(transition=Transition(id=number))
        assert ros.probe.call(ChangeState, 'solver_node/change_state', request).success


def test_it_answers_while_it_is_active(ros: Domain) -> None:
    feet = ros.probe.listen(PointStamped, 'point_h')
    solver = ros.solver('--lifecycle')
    ros.probe.await_publishers('point_h')
    change(ros, 'CONFIGURE')
    crank = ros.probe.node.create_publisher(Float64, 'crank_angle', 10)
    ros.probe.spin(0.5)
    assert crank.get_subscription_count() == 0

    change(ros, 'ACTIVATE')
    ros.probe.await_subscribers(crank)
    crank.publish(Float64(data=1.0))
    ros.probe.until(lambda: feet)
    expected = KlannLeg().closed_form(1.0).h
    assert (feet[0].point.x, feet[0].point.y) == pytest.approx(expected, abs=1e-12)

    change(ros, 'DEACTIVATE')
    ros.probe.until(lambda: crank.get_subscription_count() == 0)
    crank.publish(Float64(data=2.0))
    ros.probe.spin(0.5)
    assert len(feet) == 1

    change(ros, 'CLEANUP', 'CONFIGURE', 'ACTIVATE')
    ros.probe.await_subscribers(crank)
    crank.publish(Float64(data=2.0))
    ros.probe.until(lambda: len(feet) == 2)
    assert solver.stop() == 0


def test_each_transition_is_logged(ros: Domain, capfd: pytest.CaptureFixture[str]) -> None:
    ros.solve(managed=True)
    change(ros, *LINES)
    lines = [line.partition(']: ')[2] for line in capfd.readouterr().err.splitlines()]
    assert lines[0].startswith('ready, unconfigured: Klann leg sem104, turned by /crank_angle')
    assert lines[0].endswith('(joint crank), while it is active')
    assert lines[1:] == list(LINES.values())


def test_overrides_of_its_inputs_are_declared_before_it_subscribes(
    ros: Domain, capfd: pytest.CaptureFixture[str]
) -> None:
    name = 'qos_overrides./crank_angle.subscription.durability'
    ros.solve(managed=True, **{name: 'transient_local'})
    change(ros, 'CONFIGURE', 'ACTIVATE')
    (info,) = ros.probe.node.get_subscriptions_info_by_topic('/crank_angle')
    assert info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert '[WARN]' not in capfd.readouterr().err
