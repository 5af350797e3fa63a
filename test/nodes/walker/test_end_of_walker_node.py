"""However walker_node ends, the last command that its motors get is to stand."""

from pathlib import Path
import signal

from crank_motors import JOINTS, Motors, TWO_MOTORS
from geometry_msgs.msg import TwistStamped
from klann_ros.nodes.endpoints import LAST_MESSAGES
import pytest
from ros_domain import Domain, Process
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32MultiArray, Float64MultiArray, String

FAILING = str(Path(__file__).with_name('failing_walker.py'))
FILE = ['--ros-args', '--params-file', TWO_MOTORS, '-p', 'diagnostics_period:=0.1']


def started(ros: Domain, *program: str) -> tuple[Process, Motors]:
    """Return a walker and its motors, walking."""
    process = ros.start(*(program or ['walker_node']), *FILE)
    motors = Motors(ros)
    motors.twist = (0.15, 0.05)
    ros.probe.until(lambda: motors.commands and min(motors.commands[-1].velocity) > 0.5)
    return process, motors


def ended(ros: Domain, process: Process) -> int:
    """Wait for the end of a process, and for all that it sent."""
    ros.probe.until(lambda: process.popen.poll() is not None)
    ros.probe.spin(0.3)
    return process.wait()


def assert_stands(motors: Motors) -> None:
    """Check the last command, which is that of the measured angles."""
    last = motors.commands[-LAST_MESSAGES:]
    assert [list(command.velocity) for command in last] == [[0.0, 0.0]] * LAST_MESSAGES
    assert tuple(last[-1].position) in motors.measured


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_stops_the_cranks(ros: Domain, number: signal.Signals) -> None:
    process, motors = started(ros)
    process.popen.send_signal(number)
    assert ended(ros, process) == 0
    assert_stands(motors)


def test_two_signals_and_silent_motors_end_it_standing(ros: Domain) -> None:
    process, motors = started(ros)
    motors.silent = {0, 1}
    for _ in range(2):
        process.popen.send_signal(signal.SIGINT)
    assert ended(ros, process) == 0
    assert_stands(motors)


def test_an_exception_that_ends_it_stops_the_cranks(ros: Domain) -> None:
    process, motors = started(ros, 'python', FAILING)
    ros.probe.publisher(String, 'fail').publish(String(data='exit in a callback'))
    assert ended(ros, process) == 3
    assert_stands(motors)


def test_errors_of_all_steps_stop_the_cranks(ros: Domain) -> None:
    process, motors = started(ros, 'python', FAILING)
    ros.probe.publisher(String, 'fail').publish(String(data='errors of all steps'))
    motors.until_stopped()
    ros.probe.spin(0.5)
    assert not any(motors.commands[-1].velocity)
    assert 'a callback failed, and the node goes on: RuntimeError: on purpose' in process.errors
    assert process.stop() == 0


@pytest.mark.parametrize('is_plain', [False, True])
def test_errors_of_the_executor_leave_no_command_standing(
    ros: Domain, monkeypatch: pytest.MonkeyPatch, is_plain: bool
) -> None:
    monkeypatch.setenv('KLANN_ROS_PLAIN_LOOP', '1' if is_plain else '')
    process, motors = started(ros, 'python', FAILING)
    ros.probe.publisher(String, 'fail').publish(String(data='errors of the executor'))
    ros.probe.until(lambda: 'RuntimeError: on purpose' in process.errors)
    if is_plain:
        # Nothing is received any more.
        motors.until_stopped()
    process.popen.send_signal(signal.SIGTERM)
    assert ended(ros, process) == 0
    assert not any(motors.commands[-1].velocity)


@pytest.mark.parametrize(
    ('command_type', 'kind'),
    [('velocities', Float64MultiArray), ('velocities_float32', Float32MultiArray)],
)
def test_rates_alone_end_with_zero(ros: Domain, command_type: str, kind: type) -> None:
    process = ros.start('walker_node', *FILE, command_type=command_type)
    rates = ros.probe.listen(kind, 'crank_command')
    state = ros.probe.publisher(JointState, 'crank_state')
    cmd_vel = ros.probe.publisher(TwistStamped, 'cmd_vel')
    twist = TwistStamped()
    twist.twist.linear.x = 0.1

    def is_turning() -> bool:
        # Cranks that stay there: positive numbers are rates.
        state.publish(JointState(name=JOINTS, position=[-2.0, -2.0], velocity=[0.4, 0.4]))
        cmd_vel.publish(twist)
        return bool(rates and min(rates[-1].data) > 0.5)

    ros.probe.until(is_turning)
    process.popen.send_signal(signal.SIGINT)
    assert ended(ros, process) == 0
    assert list(rates[-1].data) == [0.0, 0.0]


def test_what_never_commanded_sends_nothing(ros: Domain) -> None:
    process = ros.start('walker_node', *FILE)
    commands = ros.probe.listen(JointState, 'crank_command')
    ros.probe.until(lambda: 'ready: ' in process.errors)
    ros.probe.await_publishers('crank_command')
    process.popen.send_signal(signal.SIGINT)
    assert ended(ros, process) == 0
    assert commands == []
