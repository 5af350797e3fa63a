"""Faults with real processes: cmd_vel goes on, zero is commanded, and the words name the cause."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import cos, pi, radians, sin
from random import Random

from builtin_interfaces.msg import Time
from crank_motors import CONFIG, JOINTS
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TwistStamped
import pytest
from ros_domain import Domain, Process
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger

LEGS = [f'{end}_{side}' for end in ('front', 'middle', 'rear') for side in ('left', 'right')]
SPEED = 0.15
DT = 0.01
GRAVITY = 9.8  # [m/s^2]
# Commands of zero that show that it stands, and commands that show that it walks.
ZEROS = 20
WALKING = 20


@dataclass
class Wiring:
    """What is wrong with a motor and its driver."""

    motor: float = 1.0
    # Velocity in the feedback, by that of the motor [rad/s].
    velocity: Callable[[float], float] = lambda true_rate: true_rate
    # The driver repeats its last message.
    repeats: bool = False


_random = Random(3)  # noqa: S311 - noise
# One fault of a motor, and one of its driver: test/walker/test_faults.py has all of them.
WIRINGS = {
    'motor runs the wrong way': (Wiring(motor=-1.0), 'WRONG_WAY', 'turns against its command'),
    'driver repeats its last message': (Wiring(repeats=True), '', 'its stamp repeats'),
}


@dataclass
class Body:
    """The motion that an IMU measures."""

    pitch: float = 0.0  # [rad]

    def imu(self, stamp: Time) -> Imu:
        message = Imu()
        message.header.stamp = stamp
        message.orientation.y, message.orientation.w = sin(self.pitch / 2.0), cos(self.pitch / 2.0)
        message.orientation_covariance[0] = 1e-6
        # A gyro without noise is a frozen one.
        message.angular_velocity.x = _random.gauss(0.0, 1e-3)
        message.linear_acceleration.x = -GRAVITY * sin(self.pitch)
        message.linear_acceleration.z = GRAVITY * cos(self.pitch)
        return message


class Cranks:
    """Scripted motors with encoders; `wirings` are changed by tests."""

    def __init__(self, joints: list[str]) -> None:
        self.wirings = dict.fromkeys(joints, Wiring())
        self.angles = dict.fromkeys(joints, 0.0)  # [rad]
        self.readings = dict.fromkeys(joints, 0.0)  # [rad]
        self._message = JointState()

    def turn(self, rates: list[float], stamp: Time) -> JointState:
        """Turn for a tick as commanded [rad/s]; return the feedback."""
        velocities = []
        for (joint, wiring), rate in zip(self.wirings.items(), rates, strict=True):
            true_rate = wiring.motor * rate
            self.angles[joint] += true_rate * DT
            self.readings[joint] += true_rate * DT
            velocities.append(wiring.velocity(true_rate))
        if not any(wiring.repeats for wiring in self.wirings.values()):
            positions = list(self.readings.values())
            names = list(self.wirings)
            self._message = JointState(name=names, position=positions, velocity=velocities)
            self._message.header.stamp = stamp
        return self._message


class Plant:
    """Cranks and a body that answer a walker_node, and a user who goes on to command."""

    def __init__(self, ros: Domain, process: Process, space: str, joints: list[str]) -> None:
        self.probe = ros.probe
        self.process = process
        self.space = space
        self.cranks = Cranks(joints)
        self.body = Body()
        self.linear = SPEED
        self.commands: list[JointState] = self.probe.listen(JointState, f'{space}/crank_command')
        self.reports = self.probe.listen(DiagnosticArray, f'{space}/diagnostics')
        self._state = self.probe.publisher(JointState, f'{space}/crank_state')
        self._imu = self.probe.publisher(Imu, f'{space}/imu')
        self._cmd_vel = self.probe.publisher(TwistStamped, f'{space}/cmd_vel')
        self.timer = self.probe.node.create_timer(DT, self._tick)

    def _tick(self) -> None:
        rates = self.commands[-1].velocity if self.commands else [0.0] * len(self.cranks.angles)
        stamp = self.probe.node.get_clock().now().to_msg()
        self._imu.publish(self.body.imu(stamp))
        self._state.publish(self.cranks.turn(rates, stamp))
        command = TwistStamped()
        command.twist.linear.x = self.linear
        self._cmd_vel.publish(command)

    @property
    def status(self) -> DiagnosticStatus:
        """Return the last status of the walker."""
        return self.reports[-1].status[0]

    @property
    def fault(self) -> str:
        return next(figure.value for figure in self.status.values if figure.key == 'fault')

    @property
    def is_walking(self) -> bool:
        return min(map(abs, self.commands[-1].velocity)) > 0.3

    def until_walking(self) -> None:
        """Reset what was, and wait until all cranks turn for some time."""
        self.cranks.wirings = dict.fromkeys(self.cranks.wirings, Wiring())
        self.body = Body()
        answer = self.probe.call(
            Trigger, f'{self.space}/walker_node/reset_fault', Trigger.Request()
        )
        assert answer.success
        self.until_commanded(WALKING)
        self.probe.until(lambda: self.is_walking)

    def until_commanded(self, command_count: int) -> list[JointState]:
        """Wait for further commands; return them."""
        first = len(self.commands)
        self.probe.until(lambda: len(self.commands) > first + command_count)
        return self.commands[first:]

    def break_down(self, fault: str, words: str) -> None:
        """Wait until it stands for its fault; then it has to stand for good."""
        log_size = len(self.process.errors)
        self.reports.clear()
        self.probe.until(lambda: self.reports and words in self.status.message)
        self.probe.until(lambda: not has_motion(self.commands[-ZEROS:]))
        assert self.fault == fault
        assert self.status.level == DiagnosticStatus.ERROR
        if fault:
            self.probe.until(lambda: 'fault: ' in self.process.errors[log_size:])
            assert words in self.process.errors[log_size:]
        # cmd_vel goes on, and so does the fault.
        self.linear = 0.0
        self.probe.spin(0.1)
        self.linear = SPEED
        assert not has_motion(self.until_commanded(ZEROS))


def has_motion(commands: list[JointState]) -> bool:
    """Return whether any of the commands turns a crank."""
    return any(any(command.velocity) for command in commands)


@pytest.fixture(scope='module')
def start_plant(module_ros: Domain) -> Callable[..., Plant]:
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
def two_motors(start_plant: Callable[..., Plant]) -> Iterator[Plant]:
    plant = start_plant('/two', 'walker6_two_motors.yaml', JOINTS)
    yield plant
    plant.timer.cancel()


@pytest.mark.parametrize('name', WIRINGS)
def test_a_crank_that_does_not_follow_is_not_driven(two_motors: Plant, name: str) -> None:
    wiring, fault, words = WIRINGS[name]
    two_motors.until_walking()
    two_motors.cranks.wirings['right_crank'] = replace(wiring)
    two_motors.break_down(fault, words)
    if fault:
        assert two_motors.status.message.startswith('stopped: right_crank ')


def test_a_body_that_has_fallen_is_not_driven(two_motors: Plant) -> None:
    two_motors.until_walking()
    two_motors.body.pitch = radians(35.0)
    two_motors.break_down('TILTED', 'the body is tilted by 35 deg')


def test_velocities_in_rpm_are_named(two_motors: Plant) -> None:
    two_motors.until_walking()
    two_motors.cranks.wirings['left_crank'] = Wiring(
        velocity=lambda true_rate: true_rate * 30.0 / pi
    )
    words = 'its velocities may be in rpm'
    two_motors.probe.until(lambda: words in two_motors.process.errors)
    two_motors.probe.until(lambda: words in two_motors.status.message)
    assert two_motors.status.level == DiagnosticStatus.WARN


@pytest.mark.slow
def test_an_imu_on_its_head_and_six_motors_of_which_one_is_reversed(
    start_plant: Callable[..., Plant],
) -> None:
    joints = {f'{leg}.crank_joint': f'{leg}_crank' for leg in LEGS}
    plant = start_plant('/six', 'walker6.yaml', list(joints.values()), **joints)
    plant.body.pitch = pi
    plant.break_down('TILTED', 'check its axes')
    assert max(map(abs, plant.cranks.angles.values())) == 0.0
    plant.until_walking()
    plant.cranks.wirings['middle_right_crank'] = Wiring(motor=-1.0)
    plant.break_down('WRONG_WAY', 'middle_right_crank turns against')
    plant.timer.cancel()


def test_with_auto_reset_a_new_command_after_one_of_0_starts_it_again(
    start_plant: Callable[..., Plant],
) -> None:
    plant = start_plant('/auto', 'walker6_two_motors.yaml', JOINTS, auto_reset=True)
    plant.until_walking()
    plant.cranks.wirings['left_crank'] = Wiring(motor=0.0)
    plant.probe.until(lambda: plant.reports and 'a cmd_vel of 0' in plant.status.message)
    plant.cranks.wirings['left_crank'] = Wiring()
    assert not any(plant.until_commanded(ZEROS)[-1].velocity)
    plant.linear = 0.0
    plant.until_commanded(ZEROS)
    assert plant.fault == 'NOT_TURNING'
    plant.linear = SPEED
    plant.probe.until(lambda: plant.is_walking)
    plant.timer.cancel()
