"""The legs and drives of the live page: solvers, foreign players, walkers."""

import json
from typing import Any

from geometry_msgs.msg import TwistStamped
from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.live.legs import drawn_shape
from klann_ros.log.run_parameters import leg_description, SolverParameters
from klann_ros.nodes.endpoints import LATCHED
from klann_ros.nodes.raw_executor import RawCallbackGroup
from klann_ros.nodes.view.connections import ODOMETRY_TYPE, RosGraph, SubscribedTopic
from klann_ros.nodes.view.live_state import LiveState
from nav_msgs.msg import Odometry
import pytest
from rclpy.serialization import serialize_message
from ros_domain import Domain
from sensor_msgs.msg import JointState
from std_msgs.msg import String

LONG = KlannGeometry(l_gh=0.61)


@pytest.mark.parametrize(('text', 'length'), [(None, 0.61), ('[', 0.43)])
def test_the_description_beside_joint_states_is_the_leg(
    ros: Domain, text: str | None, length: float
) -> None:
    parameters = {**LONG.as_dict(), 'assembly': [1, 1]}
    description = leg_description(SolverParameters('/solver_node', 0, parameters))
    state = LiveState(ros.probe.add_node('page'), read_only=True)
    player = ros.probe.add_node('foreign_player')
    described = player.create_publisher(String, '/again/leg_description', LATCHED)
    poses = player.create_publisher(JointState, '/again/joint_states', 10)
    described.publish(String(data=description if text is None else text))
    leg = KlannLeg(LONG)
    message = JointState(name=[*leg.joint_names], position=[*leg.solve(1.0).joints])

    def legs() -> Any:
        poses.publish(message)
        legs_of_solvers = [
            solver['legs'] for solver in json.loads(state.parts.get('legs', (0, '[]'))[1])
        ]
        return legs_of_solvers and legs_of_solvers[0] and legs_of_solvers[0][0]['shape'] == shape

    expected = KlannLeg(KlannGeometry(l_gh=length)).linkage
    shape = json.loads(json.dumps(drawn_shape(expected)))
    ros.probe.until(legs)
    state.close()


def test_a_simulation_publishing_only_its_crank_is_not_a_solver(ros: Domain) -> None:
    state = LiveState(ros.probe.add_node('page'), read_only=True)
    leg = KlannLeg(LONG)
    publishers = {}
    for name, topic in (('sim', '/crank_state'), ('solver', '/joint_states')):
        node = ros.probe.add_node(name)
        for parameter, value in LONG.as_dict().items():
            node.declare_parameter(parameter, value)
        publishers[name] = node.create_publisher(JointState, topic, 10)
    poses = {
        'sim': JointState(name=['crank'], position=[1.0]),
        'solver': JointState(name=[*leg.joint_names], position=[*leg.solve(1.0).joints]),
    }

    def only_the_solver() -> bool:
        for name, publisher in publishers.items():
            publisher.publish(poses[name])
        legs = json.loads(state.parts.get('legs', (0, '[]'))[1])
        return [solver['node'] for solver in legs if solver['legs']] == ['/solver']

    ros.probe.until(lambda: {'/sim', '/solver'} <= state._solvers.keys())
    ros.probe.until(only_the_solver)
    ros.probe.spin(0.5)
    assert only_the_solver()
    state.close()


def test_a_walk_is_offered_while_a_node_subscribes_to_cmd_vel(ros: Domain) -> None:
    graph = RosGraph(ros.probe.add_node('page'))
    ros.probe.node.create_publisher(TwistStamped, 'cmd_vel', 10)
    ros.probe.until(lambda: '/cmd_vel' in dict(graph.topics()))
    assert graph.walker_topics(graph.topics()) == []
    ros.probe.listen(TwistStamped, 'cmd_vel')
    ros.probe.until(lambda: graph.walker_topics(graph.topics()) == ['/cmd_vel'])


def test_the_newest_odometry_alone_is_stored(ros: Domain) -> None:
    node = ros.probe.add_node('page')
    topic = SubscribedTopic(node, RawCallbackGroup(), 'odom', ODOMETRY_TYPE, lambda: None)
    for x in range(40):
        message = Odometry()
        message.pose.pose.position.x = float(x)
        topic._on_message(serialize_message(message), {'publication_sequence_number': x})
    assert [message.pose.pose.position.x for _, message in topic.newest()] == [39.0]
