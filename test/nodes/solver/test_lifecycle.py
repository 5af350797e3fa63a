"""`solver_node --lifecycle`: a managed node, which answers while it is active."""

from geometry_msgs.msg import PointStamped
from klann_ros.kinematics import KlannLeg
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
from ros_world import World
from std_msgs.msg import Float64


def change(ros: World, transition: int) -> bool:
    """Ask for a transition; return whether it was made."""
    request = ChangeState.Request(transition=Transition(id=transition))
    return bool(ros.probe.call(ChangeState, 'solver_node/change_state', request).success)


def test_it_answers_while_it_is_active(ros: World) -> None:
    feet = ros.probe.listen(PointStamped, 'point_h')
    solver = ros.solver('--lifecycle')
    ros.probe.matched('point_h')
    assert change(ros, Transition.TRANSITION_CONFIGURE)
    crank = ros.probe.node.create_publisher(Float64, 'crank_angle', 10)
    ros.probe.spin(0.5)
    assert crank.get_subscription_count() == 0

    assert change(ros, Transition.TRANSITION_ACTIVATE)
    ros.probe.heard(crank)
    crank.publish(Float64(data=1.0))
    ros.probe.until(lambda: feet)
    expected = KlannLeg().closed_form(1.0).h
    assert (feet[0].point.x, feet[0].point.y) == pytest.approx(expected, abs=1e-12)

    assert change(ros, Transition.TRANSITION_DEACTIVATE)
    ros.probe.until(lambda: crank.get_subscription_count() == 0)
    crank.publish(Float64(data=2.0))
    ros.probe.spin(0.5)
    assert len(feet) == 1

    # And once more, all the way round.
    assert change(ros, Transition.TRANSITION_CLEANUP)
    assert change(ros, Transition.TRANSITION_CONFIGURE)
    assert change(ros, Transition.TRANSITION_ACTIVATE)
    ros.probe.heard(crank)
    crank.publish(Float64(data=2.0))
    ros.probe.until(lambda: len(feet) == 2)
    assert solver.stop() == 0
