"""`walker_node --lifecycle`: a managed node, which commands its cranks while it is active."""

from crank_motors import Motors, TWO_MOTORS
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from ros_domain import Domain

FILE = ['--ros-args', '--params-file', TWO_MOTORS]


def test_a_managed_walker_commands_while_it_is_active(ros: Domain) -> None:
    node = ros.start('walker_node', '--lifecycle', *FILE)
    motors = Motors(ros)
    motors.twist = (0.15, 0.0)

    def change(name: str) -> None:
        number = getattr(Transition, f'TRANSITION_{name}')
        request = ChangeState.Request(transition=Transition(id=number))
        assert ros.probe.call(ChangeState, 'walker_node/change_state', request).success

    def until_walking() -> None:
        ros.probe.until(lambda: motors.commands and min(motors.commands[-1].velocity) > 0.5)

    change('CONFIGURE')
    ros.probe.spin(0.5)
    assert motors.commands == []
    change('ACTIVATE')
    until_walking()
    change('DEACTIVATE')
    motors.until_stopped()
    ros.probe.spin(0.2)
    count = len(motors.commands)
    ros.probe.spin(0.5)
    assert len(motors.commands) == count
    assert not any(motors.commands[-1].velocity)
    change('ACTIVATE')
    until_walking()
    change('ACTIVE_SHUTDOWN')
    motors.until_stopped()
    assert node.stop() == 0
    assert not any(motors.commands[-1].velocity)
