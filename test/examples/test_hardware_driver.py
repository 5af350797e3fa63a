"""examples/hardware_driver as a process, with simulated motors and with a board on a port."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import nan, pi
import os
from pathlib import Path
from signal import SIGCONT, SIGKILL, SIGSTOP, SIGTERM
import subprocess
import sys
from time import monotonic
import tty

from crank_motors import JOINTS, TWO_MOTORS
from domain import own_domain
from driver_modules import DRIVER
from geometry_msgs.msg import TwistStamped
from motor_board import ROOT, TIMEOUT
import pytest
from rclpy.duration import Duration
from ros_domain import Domain, open_domain, Process
from sensor_msgs.msg import JointState

# Slower shafts stand [rad/s].
STANDSTILL = 0.02
# Motion in a second at 0.1 m/s [rad]: 1 rad for 0.149 m, at most 1.5 by the feedback of the motion
# and 1.4 by that of the phases.
SECOND = 0.1 / 0.149 * 1.5 * 1.4


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[Domain]:
    with own_domain() as domain, open_domain(domain, tmp_path) as ros:
        yield ros


def start_driver(ros: Domain, **parameters: object) -> Process:
    return ros.start('python', str(DRIVER / 'hardware_driver.py'), **parameters)


class Walk:
    """A driver and walker_node; cmd_vel of 0.1 m/s goes on."""

    def __init__(self, ros: Domain, **parameters: object) -> None:
        self.probe = ros.probe
        self.states: list[JointState] = ros.probe.listen(JointState, 'crank_state')
        self.driver = start_driver(ros, **parameters)
        self.walker = ros.start('walker_node', '--ros-args', '--params-file', TWO_MOTORS)
        self.cmd_vel = ros.probe.publisher(TwistStamped, 'cmd_vel')
        ros.probe.node.create_timer(0.05, self._drive)

    def _drive(self) -> None:
        message = TwistStamped()
        message.twist.linear.x = 0.1
        self.cmd_vel.publish(message)

    def until_walking(self) -> None:
        self.probe.until(lambda: self.states)
        start = self.states[-1].position[0]
        self.probe.until(lambda: self.states[-1].position[0] - start > 1.0)

    def turned_in(self, seconds: float) -> float:
        """Return the largest motion of a crank in a time [rad]."""
        start_angles = self.states[-1].position
        self.probe.spin(seconds)
        return largest_step(start_angles, self.states[-1].position)

    def motion_until_standing(self) -> float:
        """Wait until the cranks stand; return the largest motion of one [rad]."""
        start_angles = self.states[-1].position
        self.probe.until(lambda: self.turned_in(0.3) < 0.3 * STANDSTILL)
        return largest_step(start_angles, self.states[-1].position)


def largest_step(start: Sequence[float], end: Sequence[float]) -> float:
    return max(
        abs(end_angle - start_angle) for start_angle, end_angle in zip(start, end, strict=True)
    )


@pytest.mark.parametrize('number', [SIGKILL, SIGSTOP])
def test_cranks_stand_without_walker_node(ros: Domain, number: int) -> None:
    walk = Walk(ros)
    walk.until_walking()
    walk.walker.popen.send_signal(number)
    # The timeout, the lag of the motor, and a busy machine.
    assert walk.motion_until_standing() < SECOND
    walk.walker.popen.send_signal(SIGCONT)


def test_a_stopped_driver_takes_no_old_command_when_it_goes_on(ros: Domain) -> None:
    walk = Walk(ros)
    walk.until_walking()
    walk.driver.popen.send_signal(SIGSTOP)
    # Commands until here wait in its queue, for longer than its timeout.
    walk.probe.spin(0.2)
    walk.walker.kill()
    walk.probe.spin(0.8)
    walk.driver.popen.send_signal(SIGCONT)
    count = len(walk.states)
    walk.probe.until(lambda: len(walk.states) > count + 5)
    assert walk.turned_in(0.5) < 0.5 * STANDSTILL


class Board:
    """A board with two motors on a serial port, as a process of its own."""

    def __init__(self, folder: Path, library: Path, timeout: float) -> None:
        self._log = folder / 'board.log'
        # The port stays where nobody has it open: this process holds both ends.
        self._ends: tuple[int, ...] = os.openpty()
        tty.setraw(self._ends[1])
        self.port = os.ttyname(self._ends[1])
        script = str(ROOT / 'test' / 'support' / 'motor_board.py')
        arguments = [script, str(library), str(self._ends[0]), str(self._log), str(timeout)]
        self.process = subprocess.Popen([sys.executable, *arguments], pass_fds=self._ends[:1])

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        for end in self._ends:
            os.close(end)
        self._ends = ()

    def rows(self) -> list[list[float]]:
        """Return the log: times, rates of the shafts, duties."""
        lines = self._log.read_text().splitlines()[:-1] if self._log.exists() else []
        return [[float(word) for word in line.split()] for line in lines]

    @property
    def stands(self) -> bool:
        """Return whether the shafts stand, and their bridges are off."""
        return max(map(abs, self.rows()[-1][1:])) < STANDSTILL

    def turned_since(self, start_time: float) -> float:
        """Return the largest motion of a shaft since a time [rad]."""
        turns = [0.0, 0.0]
        for last_row, row in pairwise(row for row in self.rows() if row[0] >= start_time):
            for index, rate in enumerate(last_row[1:3]):
                turns[index] += abs(rate) * (row[0] - last_row[0])
        return max(turns)


@pytest.fixture
def board(request: pytest.FixtureRequest, tmp_path: Path, library: Path) -> Iterator[Board]:
    """Start a board; its timeout [s] may be a parameter."""
    pytest.importorskip('serial')
    board = Board(tmp_path, library, getattr(request, 'param', TIMEOUT))
    yield board
    board.close()


@pytest.mark.parametrize('number', [SIGKILL, SIGSTOP])
def test_the_motors_stand_without_their_driver(ros: Domain, board: Board, number: int) -> None:
    walk = Walk(ros, port=board.port)
    walk.until_walking()
    stopped = monotonic()
    walk.driver.popen.send_signal(number)
    walk.probe.until(lambda: board.stands)
    assert board.turned_since(stopped) < SECOND
    walk.probe.spin(0.3)
    assert board.stands
    walk.driver.popen.send_signal(SIGCONT)


def test_a_board_turns_as_commanded(ros: Domain, board: Board) -> None:
    states = ros.probe.listen(JointState, 'crank_state')
    driver = start_driver(ros, port=board.port, rate=50.0)
    commands = ros.probe.publisher(JointState, 'crank_command')
    command = JointState(name=JOINTS, velocity=[0.5, -0.5])
    ros.probe.node.create_timer(0.05, lambda: commands.publish(command))
    ros.probe.until(lambda: states and states[-1].position[0] > 1.0)
    first, last = states[len(states) // 2], states[-1]
    turns = [b - a for a, b in zip(first.position, last.position, strict=True)]
    seconds = stamp(last) - stamp(first)
    assert turns == pytest.approx([0.5 * seconds, -0.5 * seconds], abs=0.03)
    # A port that is gone is one line, and the end: crank_state ends with it.
    board.close()
    assert driver.wait() == 1
    assert driver.errors.splitlines()[-1].startswith('hardware_driver: ')
    assert 'Traceback' not in driver.errors


def stamp(state: JointState) -> float:
    return float(state.header.stamp.sec) + 1e-9 * state.header.stamp.nanosec


def test_sign_gear_ratio_and_zero_hold_for_commands_and_angles(ros: Domain) -> None:
    states = ros.probe.listen(JointState, 'crank_state')
    start_driver(
        ros, joints='[left_crank, right_crank]', gear_ratios=[-30.0, 2.0], zeros=[0.5, pi]
    )
    ros.probe.until(lambda: states)
    assert list(states[0].name) == JOINTS
    assert list(states[0].position) == pytest.approx([0.5, pi])
    commands = ros.probe.publisher(JointState, 'crank_command')
    command = JointState(name=['stranger', *JOINTS], velocity=[9.0, 1.0, -1.0])
    ros.probe.node.create_timer(0.05, lambda: commands.publish(command))
    ros.probe.until(lambda: states[-1].position[0] > 1.5)
    assert states[-1].position[1] < pi - 0.5


@pytest.mark.parametrize(
    ('names', 'velocities', 'age', 'reason'),
    [
        (JOINTS, [1.0, nan], 0.0, 'it has no finite'),
        (['left_crank', 'stranger'], [1.0, 1.0], 0.0, 'it has no finite'),
        (JOINTS, [1.0], 0.0, 'it has no finite'),
        (JOINTS, [1.0, 1.0], 5.0, 'it is 5.'),
        (JOINTS, [1.0, 1.0], -5.0, 'it is -5.'),
    ],
)
def test_what_is_no_command_turns_no_motor(
    ros: Domain, names: list[str], velocities: list[float], age: float, reason: str
) -> None:
    states = ros.probe.listen(JointState, 'crank_state')
    driver = start_driver(ros)
    commands = ros.probe.publisher(JointState, 'crank_command')

    def send() -> None:
        command = JointState(name=names, velocity=velocities)
        sent = ros.probe.node.get_clock().now() - Duration(seconds=age)
        command.header.stamp = sent.to_msg()
        commands.publish(command)

    ros.probe.node.create_timer(0.05, send)
    ros.probe.until(lambda: f'crank_command is refused: {reason}' in driver.errors)
    ros.probe.spin(0.2)
    assert list(states[-1].position) == [0.0, 0.0]


@pytest.mark.parametrize('board', [60.0], indirect=True)
def test_its_end_stops_the_motors(ros: Domain, board: Board) -> None:
    driver = start_driver(ros, port=board.port, command_timeout=60.0)
    commands = ros.probe.publisher(JointState, 'crank_command')
    commands.publish(JointState(name=JOINTS, velocity=[1.0, 1.0]))
    ros.probe.until(lambda: board.rows() and min(board.rows()[-1][1:3]) > 0.5)
    assert driver.stop(SIGTERM) == 0
    # The timeout of the board is a minute.
    ros.probe.until(lambda: board.stands, 10.0)


def test_a_measurement_is_published_once_with_its_own_time(ros: Domain) -> None:
    pytest.importorskip('serial')
    from driver_modules import serial_motors

    ours, theirs = os.openpty()
    tty.setraw(theirs)
    states = ros.probe.listen(JointState, 'crank_state')
    driver = start_driver(ros, port=os.ttyname(theirs), rate=20.0)
    ros.probe.await_publishers('crank_state')
    # The counter of the board wraps. Later lines arrive later and later.
    counters = [2**32 - 15_000 + 10_000 * k for k in range(4)]
    for index, counter in enumerate(counters):
        line = serial_motors.line_of(['S', str(counter % 2**32), f'{index}.0', '0.0'])
        os.write(ours, line)
        ros.probe.until(lambda count=index: len(states) > count)
        ros.probe.spin(0.3)
    assert [state.position[0] for state in states] == [0.0, 1.0, 2.0, 3.0]
    steps = [stamp(state) - stamp(last_state) for last_state, state in pairwise(states)]
    # A busy machine may pause the driver between its two clocks.
    assert steps == pytest.approx([0.01] * 3, abs=0.1)
    # What is no line of this protocol is no measurement.
    os.write(ours, b'S 1 2.0 3.0*00\nnoise\n' + serial_motors.line_of(['S', 'x', '2.0', '3.0']))
    ros.probe.spin(0.3)
    assert len(states) == 4
    assert driver.stop() == 0
    os.close(ours)
    os.close(theirs)


def test_a_port_that_is_not_there_is_one_line(ros: Domain) -> None:
    pytest.importorskip('serial')
    driver = start_driver(ros, port='/dev/no_port')
    assert driver.wait() == 1
    (line,) = driver.errors.splitlines()
    assert line.startswith('hardware_driver: ')


@pytest.mark.parametrize(
    ('parameters', 'words'),
    [
        ({'rate': 100}, "parameter 'rate' to '100' of type 'INTEGER', expecting type 'DOUBLE'"),
        ({'rate': 0.0}, 'a rate above 0'),
        ({'gear_ratios': [1.0]}, 'a gear ratio other than 0 and a zero'),
        ({'gear_ratios': [0.0, 1.0]}, 'a gear ratio other than 0 and a zero'),
    ],
)
def test_a_wrong_parameter_is_one_line(
    ros: Domain, parameters: dict[str, object], words: str
) -> None:
    driver = start_driver(ros, **parameters)
    assert driver.wait() == 1
    assert words in driver.errors
    assert len(driver.errors.splitlines()) == 1
