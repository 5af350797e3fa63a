"""Faults with real processes: cmd_vel goes on, zero is commanded, and the words name the cause."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import cos, pi, radians, sin
import os
from pathlib import Path
from random import Random
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TwistStamped
import pytest
from ros_domain import Domain, Process
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger

CONFIG = Path(__file__).resolve().parents[3] / 'config'
LEGS = [f'{end}_{side}' for end in ('front', 'middle', 'rear') for side in ('left', 'right')]
SPEED = 0.15
DT = 0.01
# Zeros that show that it stands, and the time for which a driver repeats its message [s].
ZEROS, REPEATED = 60, 1.0


@dataclass
class Wiring:
    """What is wrong with a motor, its encoder and its driver."""

    motor: float = 1.0
    encoder: float = 1.0
    is_frozen: bool = False
    # Velocity in the feedback, by the velocities of motor and command [rad/s].
    velocity: Callable[[float, float], float] = lambda true, _: true
    # The driver repeats its last message.
    repeats: bool = False


_random = Random(3)  # noqa: S311 - noise
WIRINGS = {
    'motor runs the wrong way': (Wiring(motor=-1.0), 'WRONG_WAY', 'turns against its command'),
    'encoder counts backwards': (Wiring(encoder=-1.0), 'WRONG_WAY', 'turns against its command'),
    'encoder frozen, true velocity': (Wiring(is_frozen=True), 'FROZEN', 'repeats one angle'),
    'encoder frozen, velocity echoed': (
        Wiring(is_frozen=True, velocity=lambda _, command: command), 'FROZEN', 'repeats one angle',
    ),
    'dead motor, noisy velocity': (
        Wiring(motor=0.0, velocity=lambda *_: _random.uniform(-0.1, 0.1)),
        'NOT_TURNING', 'does not turn',
    ),
    'coupling slips': (Wiring(motor=0.15), 'SLIPPING', 'not as it is commanded'),
    'driver repeats its last message': (Wiring(repeats=True), '', 'its stamp repeats'),
}  # fmt: skip
TILTS = {
    'fallen on its side': (90.0, 'TILTED', 'it has fallen'),
    'fallen on its head': (180.0, 'TILTED', 'it has fallen'),
    'tilted by 35 deg': (35.0, 'TILTED', 'the body is tilted by 35 deg'),
}


class Plant:
    """Scripted motors and an IMU that answer a walker_node, and a user who goes on to command."""

    def __init__(self, ros: Domain, process: Process, space: str, joints: list[str]) -> None:
        self.probe, self.process, self.space, self.joints = ros.probe, process, space, joints
        self.wirings = dict.fromkeys(joints, Wiring())
        self.angles = dict.fromkeys(joints, 0.0)
        self.readings = dict(self.angles)
        self.pitch, self.gravity = 0.0, 9.8
        self.ticks = 0
        self.linear = SPEED
        # Steady times and rates of all commands.
        self.commands: list[tuple[float, list[float]]] = []
        self.reports: list[DiagnosticArray] = []
        node = self.probe.node
        node.create_subscription(JointState, f'{space}/crank_command', self._on_command, 100)
        node.create_subscription(DiagnosticArray, f'{space}/diagnostics', self.reports.append, 100)
        self.state = self.probe.publisher(JointState, f'{space}/crank_state')
        self.imu = self.probe.publisher(Imu, f'{space}/imu')
        self.cmd_vel = self.probe.publisher(TwistStamped, f'{space}/cmd_vel')
        self.message = JointState()
        self.timer = node.create_timer(DT, self._tick)

    def _on_command(self, message: JointState) -> None:
        self.commands.append((monotonic(), list(message.velocity)))

    def _tick(self) -> None:
        self.ticks += 1
        rates = self.commands[-1][1] if self.commands else [0.0] * len(self.joints)
        stamp = self.probe.node.get_clock().now().to_msg()
        velocities = []
        for joint, rate in zip(self.joints, rates, strict=True):
            wiring = self.wirings[joint]
            self.angles[joint] += wiring.motor * rate * DT
            if not wiring.is_frozen:
                self.readings[joint] += wiring.encoder * wiring.motor * rate * DT
            velocities.append(wiring.velocity(wiring.encoder * wiring.motor * rate, rate))
        if not any(wiring.repeats for wiring in self.wirings.values()):
            positions = list(self.readings.values())
            self.message = JointState(name=self.joints, position=positions, velocity=velocities)
            self.message.header.stamp = stamp
        imu = Imu()
        imu.header.stamp = stamp
        imu.orientation.y, imu.orientation.w = sin(self.pitch / 2.0), cos(self.pitch / 2.0)
        imu.orientation_covariance[0] = 1e-6
        # A gyro without noise is a frozen one.
        imu.angular_velocity.x = _random.gauss(0.0, 1e-3)
        imu.linear_acceleration.x = -self.gravity * sin(self.pitch)
        imu.linear_acceleration.z = self.gravity * cos(self.pitch)
        self.imu.publish(imu)
        self.state.publish(self.message)
        command = TwistStamped()
        command.twist.linear.x = self.linear
        self.cmd_vel.publish(command)

    @property
    def status(self) -> DiagnosticStatus:
        """Return the last status of the walker."""
        return self.reports[-1].status[0]

    @property
    def fault(self) -> str:
        return next(figure.value for figure in self.status.values if figure.key == 'fault')

    def until_walking(self) -> None:
        """Reset what was, and wait until all cranks turn for some time."""
        self.wirings = dict.fromkeys(self.joints, Wiring())
        self.pitch, self.gravity = 0.0, 9.8
        answer = self.probe.call(
            Trigger, f'{self.space}/walker_node/reset_fault', Trigger.Request()
        )
        assert answer.success
        first = self.ticks
        self.probe.until(
            lambda: self.ticks > first + 60 and min(map(abs, self.commands[-1][1])) > 0.3
        )

    def break_down(self, name: str, fault: str, words: str) -> None:
        """Wait until it stands for its fault; then it has to stand for good."""
        begin = monotonic()
        command_count = len(self.commands)
        logged = len(self.process.errors)
        start_angles = dict(self.angles)
        self.reports.clear()
        self.probe.until(lambda: self.reports and words in self.status.message)
        self.probe.until(lambda: self._is_standing)
        assert self.fault == fault
        assert self.status.level == DiagnosticStatus.ERROR
        later_commands = self.commands[command_count:]
        zero_time = next(time for time, rates in later_commands if not any(rates))
        if fault:
            self.probe.until(lambda: 'fault: ' in self.process.errors[logged:])
            assert words in self.process.errors[logged:]
        # cmd_vel goes on, and so does the fault.
        self.linear = 0.0
        self.probe.spin(0.1)
        self.linear = SPEED
        reset_count = len(self.commands)
        self.probe.until(lambda: len(self.commands) > reset_count + ZEROS)
        assert not any(any(rates) for _, rates in self.commands[reset_count:])
        turns = [abs(self.angles[joint] - start_angles[joint]) for joint in self.joints]
        self._write_row(name, fault, zero_time - begin, max(turns))

    @property
    def _is_standing(self) -> bool:
        return len(self.commands) > ZEROS and not any(
            any(rates) for _, rates in self.commands[-ZEROS:]
        )

    def _write_row(self, name: str, fault: str, seconds: float, turn: float) -> None:
        """Add a row to the table of the acceptance, where one is asked for."""
        if path := os.environ.get('KLANN_ROS_FAULT_TABLE'):
            figures = f'{seconds:.2f} s | {turn:.2f} rad | 0'
            with Path(path).open('a', encoding='utf-8') as table:
                table.write(f'| {name} | {fault} | {figures} | {self.status.message} |\n')


@pytest.fixture(scope='module')
def start(module_ros: Domain) -> Callable[..., Plant]:
    """Return a function that starts a walker_node in a namespace, and its motors."""

    def make(space: str, file: str, joints: list[str], **parameters: object) -> Plant:
        words = ['--ros-args', '--params-file', str(CONFIG / file), '-r', f'__ns:={space}']
        words += ['-r', f'/diagnostics:={space}/diagnostics']
        process = module_ros.start(
            'walker_node', *words, use_imu=True, diagnostics_period=0.1, publish_tf=False,
            **parameters,
        )  # fmt: skip
        return Plant(module_ros, process, space, joints)

    return make


@pytest.fixture(scope='module')
def two_motors(start: Callable[..., Plant]) -> Iterator[Plant]:
    plant = start('/two', 'walker6_two_motors.yaml', ['left_crank', 'right_crank'])
    yield plant
    plant.timer.cancel()


@pytest.mark.parametrize('name', WIRINGS)
def test_a_crank_that_does_not_follow_is_not_driven(two_motors: Plant, name: str) -> None:
    wiring, fault, words = WIRINGS[name]
    two_motors.until_walking()
    two_motors.wirings['right_crank'] = replace(wiring)
    two_motors.break_down(name, fault, words)
    if fault:
        assert two_motors.status.message.startswith('stopped: right_crank ')


@pytest.mark.parametrize('name', TILTS)
def test_a_body_that_has_fallen_is_not_driven(two_motors: Plant, name: str) -> None:
    degrees, fault, words = TILTS[name]
    two_motors.until_walking()
    two_motors.pitch = radians(degrees)
    two_motors.break_down(name, fault, words)


def test_velocities_in_rpm_are_named(two_motors: Plant) -> None:
    two_motors.until_walking()
    two_motors.wirings['left_crank'] = Wiring(velocity=lambda true, _: true * 30.0 / pi)
    words = 'its velocities may be in rpm'
    two_motors.probe.until(lambda: words in two_motors.process.errors)
    two_motors.probe.until(lambda: words in two_motors.status.message)
    assert two_motors.status.level == DiagnosticStatus.WARN


def test_a_body_that_falls_is_not_driven(two_motors: Plant) -> None:
    two_motors.until_walking()
    two_motors.gravity = 0.2
    two_motors.break_down('falls freely', 'FREE_FALL', 'the body falls')


def test_an_imu_on_its_head_and_six_motors_of_which_one_is_reversed(
    start: Callable[..., Plant],
) -> None:
    joints = {f'{leg}.crank_joint': f'{leg}_crank' for leg in LEGS}
    plant = start('/six', 'walker6.yaml', list(joints.values()), **joints)
    plant.pitch = pi
    plant.break_down('IMU on its head from the start', 'TILTED', 'check its axes')
    assert max(map(abs, plant.angles.values())) == 0.0
    plant.until_walking()
    plant.wirings['middle_right_crank'] = Wiring(motor=-1.0)
    plant.break_down('six motors, one backwards', 'WRONG_WAY', 'middle_right_crank turns against')
    plant.timer.cancel()


def test_with_auto_reset_a_new_command_after_one_of_0_starts_it_again(
    start: Callable[..., Plant],
) -> None:
    plant = start(
        '/auto', 'walker6_two_motors.yaml', ['left_crank', 'right_crank'], auto_reset=True
    )
    plant.until_walking()
    plant.wirings['left_crank'] = Wiring(motor=0.0)
    plant.probe.until(lambda: plant.reports and 'a cmd_vel of 0' in plant.status.message)
    plant.wirings['left_crank'] = Wiring()
    first = len(plant.commands)
    plant.probe.until(lambda: len(plant.commands) > first + ZEROS)
    assert not any(plant.commands[-1][1])
    plant.linear = 0.0
    plant.probe.until(lambda: len(plant.commands) > first + 2 * ZEROS)
    assert plant.fault == 'NOT_TURNING'
    plant.linear = SPEED
    plant.probe.until(lambda: min(map(abs, plant.commands[-1][1])) > 0.3)
    plant.timer.cancel()
