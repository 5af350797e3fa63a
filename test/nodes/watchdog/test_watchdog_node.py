"""watchdog_node as a process: alone, and in the chain of ros2_control.launch.py."""

from pathlib import Path
import re
from signal import SIGCONT, SIGSTOP, SIGTERM
from types import SimpleNamespace
from typing import Any

from crank_motors import CONFIG, TWO_MOTORS
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TwistStamped
from klann_ros.nodes.watchdog import node as watchdog
from klann_ros.nodes.watchdog.node import WatchdogNode
import pytest
from ros_domain import Domain, Process
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

CONTROLLERS = Path(__file__).with_name('velocity_controllers.py')
COMMANDS = 'crank_velocity_controller/commands'
REMAPPED = ('-r', f'crank_command:={COMMANDS}')
PARAMETERS = ('--ros-args', '--params-file', str(CONFIG / 'ros2_control.yaml'), *REMAPPED)
# Slower cranks stand [rad/s].
STANDSTILL = 0.02
# Motion in a second at 0.1 m/s [rad]: 1 rad for 0.149 m, at most 1.5 by the feedback of the motion
# and 1.4 by that of the phases.
SECOND = 0.1 / 0.149 * 1.5 * 1.4


class Chain:
    """
    walker_node, the stand-in of the controllers, watchdog_node and sim_node.

    cmd_vel of 0.1 m/s goes on until `is_driven` is false.
    """

    def __init__(self, ros: Domain) -> None:
        self.probe = ros.probe
        self.cranks: list[JointState] = ros.probe.listen(JointState, 'crank_state')
        self.reports: list[DiagnosticArray] = ros.probe.listen(DiagnosticArray, '/diagnostics')
        walker = ('--ros-args', '--params-file', TWO_MOTORS)
        states = ('-r', 'crank_state:=joint_state_broadcaster/joint_states')
        ros.start('sim_node', *walker)
        ros.start('python', str(CONTROLLERS))
        self.watchdog = ros.start('watchdog_node', *PARAMETERS)
        self.walker = ros.start('walker_node', *walker, *PARAMETERS[1:], *states)
        self.cmd_vel = ros.probe.publisher(TwistStamped, 'cmd_vel')
        self.is_driven = True
        ros.probe.node.create_timer(0.05, self._drive)

    def _drive(self) -> None:
        message = TwistStamped()
        message.twist.linear.x = 0.1 if self.is_driven else 0.0
        self.cmd_vel.publish(message)

    @property
    def angles(self) -> list[float]:
        return list(self.cranks[-1].position)

    def turns(self) -> bool:
        return bool(self.cranks) and min(self.cranks[-1].velocity) > 0.5

    def stands(self) -> bool:
        return max(map(abs, self.cranks[-1].velocity)) < STANDSTILL

    def until_walking(self) -> None:
        self.probe.until(self.turns)
        self.probe.spin(0.3)

    def motion_until_standing(self) -> float:
        """Wait until the cranks stand for good; return the largest motion of one [rad]."""
        start_angles = self.angles
        self.probe.until(self.stands)
        self.probe.spin(0.5)
        assert self.stands()
        angles = zip(self.angles, start_angles, strict=True)
        return max(abs(angle - start_angle) for angle, start_angle in angles)


@pytest.fixture
def chain(ros: Domain) -> Chain:
    return Chain(ros)


def test_cranks_stand_while_walker_node_is_stopped(chain: Chain) -> None:
    chain.until_walking()
    chain.walker.popen.send_signal(SIGSTOP)
    assert chain.motion_until_standing() < SECOND
    assert 'crank_velocity_controller/commands: no command for 0.5 s' in chain.watchdog.errors
    chain.walker.popen.send_signal(SIGCONT)
    # cmd_vel has gone on.
    chain.probe.until(chain.turns)
    assert 'publishers' not in chain.walker.errors


def test_cranks_stand_after_walker_node_was_killed(chain: Chain) -> None:
    chain.until_walking()
    chain.walker.kill()
    assert chain.motion_until_standing() < SECOND


def test_a_stopped_watchdog_neither_stops_nor_drives_the_cranks(chain: Chain) -> None:
    chain.until_walking()
    chain.watchdog.popen.send_signal(SIGSTOP)
    # It walks on: without commands it would have stood after the timeout.
    chain.probe.spin(2.0)
    chain.probe.until(chain.turns)
    chain.is_driven = False
    chain.motion_until_standing()
    chain.watchdog.popen.send_signal(SIGCONT)


@pytest.fixture
def commands(ros: Domain) -> list[Float64MultiArray]:
    return ros.probe.listen(Float64MultiArray, COMMANDS)


def start(ros: Domain, **parameters: object) -> Process:
    process = ros.start('watchdog_node', *PARAMETERS, **parameters)
    ros.probe.await_publishers(COMMANDS)
    return process


@pytest.fixture
def reports(ros: Domain) -> list[DiagnosticArray]:
    return ros.probe.listen(DiagnosticArray, '/diagnostics')


def is_report(reports: list[DiagnosticArray], pattern: str, timeouts: str) -> bool:
    """Return whether the last report has these words and this number of timeouts."""
    if not reports:
        return False
    (status,) = reports[-1].status
    assert status.name == 'watchdog_node: commands'
    assert status.level == DiagnosticStatus.OK
    (figure,) = status.values
    is_count = (figure.key, figure.value) == ('timeouts', timeouts)
    return is_count and bool(re.fullmatch(pattern, status.message))


def test_zero_is_repeated_until_a_command_arrives(
    ros: Domain, commands: list[Float64MultiArray], reports: list[DiagnosticArray]
) -> None:
    process = start(ros, command_timeout=0.2, diagnostics_period=0.05)
    ros.probe.until(lambda: len(commands) >= 3)
    ros.probe.until(lambda: is_report(reports, r'no command for \d+\.\d s: zero is sent', '1'))
    assert {tuple(command.data) for command in commands} == {(0.0, 0.0)}
    # Its own zeros are no commands: the silence is one.
    assert process.errors.count('no command for 0.2 s') == 1
    publisher = ros.probe.publisher(Float64MultiArray, COMMANDS)
    publisher.publish(Float64MultiArray(data=[1.0, -1.0]))
    ros.probe.until(lambda: [1.0, -1.0] in [list(command.data) for command in commands])
    ros.probe.until(lambda: list(commands[-1].data) == [0.0, 0.0])
    ros.probe.until(lambda: process.errors.count('no command for 0.2 s') == 2)
    ros.probe.until(lambda: is_report(reports, 'no command .*', '2'))
    assert process.stop() == 0


def test_its_end_sends_zero(
    ros: Domain, commands: list[Float64MultiArray], reports: list[DiagnosticArray]
) -> None:
    process = start(ros, command_timeout=60.0, diagnostics_period=0.05)
    ros.probe.until(lambda: is_report(reports, 'commanded', '0'))
    publisher = ros.probe.publisher(Float64MultiArray, COMMANDS)
    publisher.publish(Float64MultiArray(data=[1.0, 1.0]))
    ros.probe.until(lambda: commands)
    assert process.stop(SIGTERM) == 0
    ros.probe.until(lambda: list(commands[-1].data) == [0.0, 0.0])


class Silence:
    """The timer and the subscription of a watchdog of 0.5 s, by a clock of their own."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        # Times of the zeros that were sent.
        self.zeros: list[float] = []
        monkeypatch.setattr(watchdog, 'monotonic', lambda: self.now)
        publisher = SimpleNamespace(topic_name='/c', publish=lambda _: self.zeros.append(self.now))
        self.node: Any = SimpleNamespace(
            _timeout=0.5,
            _zero=b'zero',
            _publisher=publisher,
            _command_time=0.0,
            _zero_time=0.0,
            _expected_echoes=0,
            _is_silent=False,
            _timeouts=0,
            get_logger=lambda: SimpleNamespace(warning=lambda _: None),
        )

    def at(self, time: float, *commands: bytes) -> None:
        """Let the commands arrive at a time [s], and then the timer."""
        self.now = time
        for command in commands:
            WatchdogNode._on_command(self.node, command, {})
        WatchdogNode._on_timer(self.node)


def test_zero_is_due_after_the_timeout_and_again_after_its_period(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    silence = Silence(monkeypatch)
    for time in (0.25, 0.5, 0.5625, 0.625, 0.75, 1.0):
        silence.at(time)
    assert silence.zeros == [0.5625, 0.75, 1.0]
    assert silence.node._timeouts == 1


def test_only_its_own_zeros_are_no_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    silence = Silence(monkeypatch)
    # Another node's zeros, as it expects none of its own.
    silence.at(0.5, b'zero')
    silence.at(1.0)
    assert silence.zeros == []
    silence.at(1.25)
    # The echo, then another node's zero.
    silence.at(1.5, b'zero')
    silence.at(1.5, b'zero', b'zero')
    silence.at(2.0)
    assert silence.zeros == [1.25, 1.5]
    # A command that comes while an echo is under way or lost; then another node's zero.
    silence.at(2.25)
    silence.at(2.5, b'one')
    silence.at(2.75, b'zero')
    silence.at(3.25)
    assert silence.zeros == [1.25, 1.5, 2.25]
    assert silence.node._timeouts == 2
