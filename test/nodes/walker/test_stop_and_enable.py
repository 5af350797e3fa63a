"""Services and the emergency stop of walker_node, with cmd_vel going on."""

from signal import SIGCONT, SIGSTOP

from crank_motors import Motors, TWO_MOTORS
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from ros_domain import Domain, Process
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

FILE = ['--ros-args', '--params-file', TWO_MOTORS, '-p', 'diagnostics_period:=0.1']


def call(ros: Domain, service: str) -> tuple[bool, str]:
    answer = ros.probe.call(Trigger, f'walker_node/{service}', Trigger.Request())
    return answer.success, answer.message


def walks(ros: Domain, motors: Motors) -> None:
    ros.probe.until(lambda: motors.commands and min(motors.commands[-1].velocity) > 0.5)


def stands(ros: Domain, motors: Motors) -> None:
    """Check that it stands, and goes on to command that."""
    motors.until_stopped()
    begin = len(motors.commands)
    ros.probe.until(lambda: len(motors.commands) >= begin + 30)
    assert not any(any(command.velocity) for command in motors.commands[begin:])


@pytest.fixture(scope='module')
def ros(module_ros: Domain) -> Domain:
    return module_ros


@pytest.fixture(scope='module')
def walker(ros: Domain) -> Process:
    return ros.start('walker_node', *FILE)


@pytest.fixture(scope='module')
def motors(ros: Domain, walker: Process) -> Motors:  # noqa: ARG001 - it is there first
    motors = Motors(ros)
    motors.twist = (0.15, 0.0)
    return motors


def test_a_disabled_walker_commands_zero_at_its_rate_until_it_is_enabled(
    ros: Domain, motors: Motors
) -> None:
    walks(ros, motors)
    assert call(ros, 'disable') == (True, 'disabled: the cranks are commanded to stand')
    stands(ros, motors)
    motors.until_message('disabled: ~/enable permits motion')
    assert call(ros, 'enable')[0]
    walks(ros, motors)


@pytest.mark.parametrize(
    ('durability', 'reliability'), [('VOLATILE', 'RELIABLE'), ('TRANSIENT_LOCAL', 'BEST_EFFORT')]
)
def test_an_emergency_stop_of_any_quality_of_service_latches(
    ros: Domain, motors: Motors, durability: str, reliability: str
) -> None:
    assert ros.probe.set_parameters('walker_node', {'e_stop_timeout': 0.0}).successful
    walks(ros, motors)
    qos = QoSProfile(
        depth=1,
        durability=DurabilityPolicy[durability],
        reliability=ReliabilityPolicy[reliability],
    )
    e_stop = ros.probe.node.create_publisher(Bool, 'e_stop', qos)
    ros.probe.await_subscribers(e_stop)
    e_stop.publish(Bool(data=True))
    stands(ros, motors)
    motors.until_message('e_stop is pressed')
    assert call(ros, 'reset_fault') == (False, 'e_stop is pressed')
    e_stop.publish(Bool(data=False))
    stands(ros, motors)
    assert call(ros, 'enable') == (False, 'e_stop is pressed; call ~/reset_fault')
    assert call(ros, 'reset_fault') == (True, 'forgotten: e_stop is pressed')
    walks(ros, motors)
    ros.probe.node.destroy_publisher(e_stop)


def test_a_pause_of_the_process_is_no_silence(
    ros: Domain, walker: Process, motors: Motors
) -> None:
    e_stop = ros.probe.publisher(Bool, 'e_stop')
    timer = ros.probe.node.create_timer(0.05, lambda: e_stop.publish(Bool(data=False)))
    ros.probe.spin(0.3)
    assert ros.probe.set_parameters('walker_node', {'e_stop_timeout': 1.0}).successful
    walks(ros, motors)
    pauses = walker.errors.count('was paused for')
    walker.popen.send_signal(SIGSTOP)
    ros.probe.spin(1.8)
    walker.popen.send_signal(SIGCONT)
    ros.probe.until(lambda: walker.errors.count('was paused for') > pauses)
    walks(ros, motors)
    assert 'e_stop has been silent' not in walker.errors
    assert ros.probe.set_parameters('walker_node', {'e_stop_timeout': 0.0}).successful
    timer.destroy()


def test_the_silence_of_an_emergency_stop_stops(ros: Domain, motors: Motors) -> None:
    walks(ros, motors)
    e_stop = ros.probe.publisher(Bool, 'e_stop')
    timer = ros.probe.node.create_timer(0.05, lambda: e_stop.publish(Bool(data=False)))
    ros.probe.spin(0.3)
    assert ros.probe.set_parameters('walker_node', {'e_stop_timeout': 1.0}).successful
    walks(ros, motors)
    timer.cancel()
    stands(ros, motors)
    motors.until_message('e_stop has been silent for 1.')
    assert not call(ros, 'reset_fault')[0]
    timer.reset()
    ros.probe.until(lambda: call(ros, 'reset_fault')[0])
    walks(ros, motors)
    timer.cancel()
