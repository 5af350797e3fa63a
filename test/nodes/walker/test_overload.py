"""walker_node: an effort in crank_state that is too large for too long stops it."""

from crank_motors import Motors, TWO_MOTORS
import pytest
from ros_domain import Domain

FILE = ['--ros-args', '--params-file', TWO_MOTORS]


@pytest.mark.slow
def test_an_overload_stops_it_until_it_is_reset(ros: Domain) -> None:
    node = ros.start('walker_node', *FILE, diagnostics_period=0.1, max_effort=12.0)
    motors = Motors(ros)
    motors.efforts = [5.0, -11.0]
    motors.twist = (0.15, 0.0)
    motors.until_walking()
    ros.probe.until(lambda: motors.value('right_crank effort') == '-11.000')
    # The torque of describe at 1 rad/s, of the weight on three feet.
    assert 5.0 < float(motors.value('right_crank described_effort')) < 15.0
    motors.efforts = [5.0, -13.0]
    motors.until_message('right_crank has an effort of -13 N m, beyond max_effort (12 N m)')
    motors.until_stopped()
    assert motors.value('fault') == 'OVERLOAD'
    ros.probe.until(lambda: 'fault: right_crank has an effort' in node.errors)
    ros.probe.spin(0.5)
    assert not any(motors.commands[-1].velocity)
    assert node.stop() == 0
