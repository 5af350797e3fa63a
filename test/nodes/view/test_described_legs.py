"""The live page shows the legs of a foreign player by the recorded leg_description."""

import json
from typing import Any

from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.live.legs import drawn_shape
from klann_ros.log.run_parameters import leg_description, SolverParameters
from klann_ros.nodes.endpoints import LATCHED
from klann_ros.nodes.view.live_state import LiveState
import pytest
from ros_domain import Domain
from sensor_msgs.msg import JointState
from std_msgs.msg import String

LONG = KlannGeometry(l_gh=0.61)


@pytest.mark.parametrize(('text', 'length'), [(None, 0.61), ('[', 0.43)])
def test_the_description_beside_joint_states_is_the_leg(
    ros: Domain, text: str | None, length: float
) -> None:
    parameters = {**LONG.as_dict(), 'assembly': [1, 1]}
    own = leg_description(SolverParameters('/solver_node', 0, parameters))
    state = LiveState(ros.probe.add_node('page'), read_only=True)
    player = ros.probe.add_node('foreign_player')
    described = player.create_publisher(String, '/again/leg_description', LATCHED)
    poses = player.create_publisher(JointState, '/again/joint_states', 10)
    described.publish(String(data=own if text is None else text))
    leg = KlannLeg(LONG)
    message = JointState(name=[*leg.joint_names], position=[*leg.solve(1.0).joints])

    def legs() -> Any:
        poses.publish(message)
        found = [solver['legs'] for solver in json.loads(state.parts().get('legs', (0, '[]'))[1])]
        return found and found[0] and found[0][0]['shape'] == shape

    expected = KlannLeg(KlannGeometry(l_gh=length)).linkage
    shape = json.loads(json.dumps(drawn_shape(expected)))
    ros.probe.until(legs)
    state.close()
