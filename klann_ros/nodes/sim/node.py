"""`sim_node`: the simulated robot in real time, and its topics."""

from array import array
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from math import degrees, inf, isfinite
from time import monotonic
from typing import Any

from builtin_interfaces.msg import Time as TimeMessage
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, PointStamped, TwistStamped
from klann_ros.cli import ArgumentParser
from klann_ros.dynamics import MassError
from klann_ros.kinematics import KinematicsError
from klann_ros.kinematics.angles import TURN
from klann_ros.messages import JOINT_STATE
from klann_ros.nodes.encoders import encoder_topics, EncoderPublishers
from klann_ros.nodes.endpoints import (
    create_publisher,
    create_steady_timer,
    create_trigger,
    diagnostic_array,
    diagnostic_status,
    other_publishers,
    publish_last,
    QOS_USAGE,
    subscribe_raw,
    TypeCheck,
)
from klann_ros.nodes.lease import LeaseListener
from klann_ros.nodes.parameters import declare, require, StartError, usage
from klann_ros.nodes.process import arguments, LOG_PERIOD, ProcessNode, run
from klann_ros.nodes.raw_executor import Info, RawCallbackGroup
from klann_ros.nodes.robot_parameters import declared_robot
from klann_ros.robot import Robot, robot_of
from klann_ros.sanitize.text import listed, printable
from klann_ros.stop_signals import StopSignals
from klann_ros.twin import (
    described_faults,
    DivergedError,
    FaultInjector,
    injected_faults,
    Injection,
    NoMujocoError,
    Pace,
    Twin,
    TwinError,
)
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, Header

from .declarations import floor, motors, sensors, SIM_GROUPS, SIM_PARAMETERS, TYPE_REMEDIES

# A warning is published below this part of the requested real-time factor.
MIN_REAL_TIME_FACTOR = 0.97
# With shorter steps the engine would never get anywhere [s].
MIN_TIME_STEP = 1e-5
# Arc, from zero on, over which a crank closes its home switch [rad].
SWITCH_WIDTH = 0.2
# Period of the demo's commands [s].
_COMMAND_PERIOD = 0.1
# The demo stands for this time first, in which a walker learns its accelerometer's bias [s].
_STANDSTILL = 2.0


class SimNode(ProcessNode):
    """Simulate a robot in real time: crank_command in; cranks, IMU and the truth out."""

    def __init__(self, **options: Any) -> None:
        """Declare, validate, and begin; a StartError names a refused parameter, or no engine."""
        super().__init__('sim_node', **options)
        parameters = declare(self, SIM_PARAMETERS)
        time_step = parameters['time_step']
        is_possible = time_step == 0.0 or time_step >= MIN_TIME_STEP
        require(is_possible, 'time_step', time_step, f'0, or {MIN_TIME_STEP:g} .. 0.005')
        robot = declared_robot(self)
        self._twin = _simulated(robot, parameters)
        self._period = 1.0 / parameters['rate']
        faults = _fault_injector(robot, parameters['faults'], self._twin.joints)
        self._commands = CrankCommands(self, self._twin, faults, parameters['command_timeout'])
        self._outputs = RobotOutputs(self, self._twin, faults, parameters)
        # The number of ticks, and the tick of the robot's start.
        self._tick = self._first_tick = 0
        self._resets = 0
        # The last fault since the last report.
        self._fault = ''
        # Time at tick 0 [ns]: simulated time begins with 0, or with now.
        self._origin = 0 if parameters['use_clock'] else self.get_clock().now().nanoseconds
        self._diagnostics = create_publisher(self, DiagnosticArray, '/diagnostics')
        self._types = TypeCheck(self, TYPE_REMEDIES)
        create_trigger(self, 'reset', self._on_reset)
        self._demo: DemoCommandPublisher | None = None
        if parameters['linear']:
            self._demo = DemoCommandPublisher(self, parameters['linear'], lambda: self._twin.time)
        self._factor: float = parameters['real_time_factor']
        is_possible = parameters['use_clock'] or self._factor == 1.0
        require(is_possible, 'real_time_factor', self._factor, '1 without use_clock')
        self._pace = Pace(self._period, self._factor, monotonic())
        timer_period = self._period / max(1.0, self._factor)
        create_steady_timer(self, timer_period, self._on_timer, RawCallbackGroup())
        create_steady_timer(self, parameters['diagnostics_period'], self._report)
        self.get_logger().info(f'ready: {self._twin.summary}, by {self._commands.topic}')

    def close(self) -> int:
        """Command a stop if this node has commanded a motion."""
        if self._demo is not None:
            self._demo.end()
        return 0

    def _on_timer(self) -> None:
        for _ in range(self._pace.due(monotonic())):
            self._commands.drive_motors()
            self._tick += 1
            try:
                self._twin.step((self._tick - self._first_tick) * self._period)
            except DivergedError as error:
                self._fault = f'{error}; the robot is put back to its start'
                self.get_logger().error(self._fault, throttle_duration_sec=LOG_PERIOD)
                self._reset()
            self._outputs.publish(self._stamp(), self._commands.velocities)

    def _stamp(self) -> Any:
        """Return simulated time, or the world's, which stands still for no late tick."""
        seconds = self._tick * self._period + (self._pace.slipped if self._origin else 0.0)
        return Time(nanoseconds=self._origin + round(seconds * 1e9)).to_msg()

    def _reset(self) -> None:
        self._twin.reset()
        self._commands.forget()
        self._first_tick = self._tick
        self._resets += 1

    def _on_reset(self) -> tuple[bool, str]:
        self._reset()
        return True, 'the robot stands where it began, its cranks held'

    def _report(self) -> None:
        factor = self._pace.real_time_factor(monotonic())
        level, message = self._types.add_to(*self._verdict(factor))
        figures = {
            'time': f'{self._tick * self._period:.3f}',
            'real_time_factor': f'{factor:.3f}',
            'given_up': f'{self._pace.slipped:.3f}',
            'tilt': f'{degrees(self._twin.tilt):.2f}',
            'resets': self._resets,
            **self._commands.counts,
        }
        status = diagnostic_status(self, 'simulation', level, message, figures.items())
        self._diagnostics.publish(diagnostic_array(self, [status]))

    def _verdict(self, factor: float) -> tuple[bytes, str]:
        """Return the level and the most important message."""
        if self._fault:
            fault, self._fault = self._fault, ''
            return DiagnosticStatus.ERROR, fault
        if self._twin.state:
            return DiagnosticStatus.ERROR, self._twin.state
        if factor < MIN_REAL_TIME_FACTOR * self._factor:
            rates = f'{factor:.2f} of real time, {self._factor:g} is requested'
            return DiagnosticStatus.WARN, f'it cannot keep up: {rates}'
        silent = self._commands.silent
        if silent:
            joints = ', '.join(map(printable, silent))
            return DiagnosticStatus.OK, f'no command: {joints} held'
        return DiagnosticStatus.OK, 'simulated in real time'


def _simulated(robot: Robot, parameters: Mapping[str, Any]) -> Twin:
    """Return a robot in the physics engine, as built; a StartError names a refused parameter."""
    try:
        if parameters['built']:
            robot = robot.built_as(robot_of(parameters['built']))
    except ValueError as error:
        raise StartError(f'built: {error}') from error
    try:
        return Twin(
            robot,
            floor=floor(parameters),
            motors=motors(parameters, robot.crank_joints),
            sensors=sensors(parameters),
            time_step=parameters['time_step'],
            seed=parameters['seed'],
            compliance=parameters['compliance'],
        )
    except (MassError, TwinError, NoMujocoError, KinematicsError) as error:
        raise StartError(str(error)) from error


def _fault_injector(robot: Robot, faults: str, joints: Sequence[str]) -> FaultInjector:
    """Return the faults in the robot's file and in a parameter."""
    try:
        return FaultInjector(
            [*described_faults(robot.drives), *injected_faults(faults, joints)], joints
        )
    except TwinError as error:
        raise StartError(f'faults: {error}') from error


class CrankCommands:
    """Subscription to crank_command; without a younger command than the timeout a crank stops."""

    def __init__(self, node: Node, twin: Twin, faults: FaultInjector, timeout: float) -> None:
        self._node = node
        self._twin = twin
        self._faults = faults
        # Maximum age of a command [s].
        self._timeout = timeout
        # The last commands of all joints [rad/s].
        self.velocities = dict.fromkeys(twin.joints, 0.0)
        self._counts: Counter[str] = Counter()
        # Arrival of the last command of each joint [s].
        self._arrivals: dict[str, float] = {}
        self.topic = node.resolve_topic_name('crank_command')
        subscribe_raw(node, JointState, 'crank_command', self._on_command)

    @property
    def silent(self) -> list[str]:
        """Return the joints without a command."""
        return [joint for joint in self._twin.joints if joint not in self._arrivals]

    @property
    def counts(self) -> dict[str, int]:
        """Return the numbers of commands by their outcome, and of cranks held after a timeout."""
        return {name: self._counts[name] for name in ('commands', 'rejected', 'limited', 'held')}

    def drive_motors(self) -> None:
        """Drive the motors by the last commands; hold those whose last command is too old."""
        now = monotonic()
        for joint, arrival in [*self._arrivals.items()]:
            if now - arrival > self._timeout:
                del self._arrivals[joint]
                self.velocities[joint] = 0.0
                self._counts['held'] += 1
        for joint, rate in self._faults.commands(self.velocities, self._twin.time).items():
            self._twin.command(joint, rate)

    def forget(self) -> None:
        """Hold all cranks until the next command."""
        self._arrivals.clear()
        self.velocities = dict.fromkeys(self.velocities, 0.0)

    def _on_command(self, data: bytes, _: Info) -> None:
        self._counts['commands'] += 1
        try:
            velocities = self._velocities(data)
        except ValueError as error:
            self._counts['rejected'] += 1
            text = f'{self.topic} is rejected: {error}'
            self._node.get_logger().warning(text, throttle_duration_sec=LOG_PERIOD)
            return
        for joint, velocity in velocities.items():
            self._arrivals[joint] = monotonic()
            self.velocities[joint] = velocity
            if self._twin.command(joint, velocity) != velocity:
                self._counts['limited'] += 1

    def _velocities(self, data: bytes) -> dict[str, float]:
        """Return the commanded velocities; a ValueError for an invalid message."""
        command = JOINT_STATE.read(data)
        names = command['name']
        # Positions move no motor: `ros2 topic pub` may leave them out.
        numbers = command['velocity']
        if len(numbers) != len(names):
            raise ValueError(f'it has {len(names)} names and {len(numbers)} velocities')
        all_velocities = dict(zip(names, numbers, strict=True))
        velocities = {j: all_velocities[j] for j in self._twin.joints if j in all_velocities}
        if not velocities:
            raise ValueError(f'it has none of the joints {listed(self._twin.joints, 8)}')
        for joint, velocity in velocities.items():
            if not isfinite(velocity):
                raise ValueError(f'velocity of {printable(joint)} is {velocity}')
        return velocities


class RobotOutputs:
    """Publishers of the robot's readings and of the truth, by the node's parameters."""

    def __init__(
        self, node: Node, twin: Twin, faults: FaultInjector, parameters: Mapping[str, Any]
    ) -> None:
        self._twin = twin
        self._faults = faults
        noise = sensors(parameters)
        self._encoder_offset = noise.encoder_offset
        self._cranks: Any
        topics = encoder_topics(twin.joints, parameters)
        if topics:
            self._cranks = EncoderPublishers(node, topics, parameters['counts_per_turn'])
        else:
            self._cranks = create_publisher(node, JointState, 'crank_state')
        self._imus = create_publisher(node, Imu, 'imu')
        self._truths = create_publisher(node, Odometry, 'ground_truth')
        self._clock = create_publisher(node, Clock, '/clock') if parameters['use_clock'] else None
        self._cameras = {}
        for name in twin.points() if parameters['cameras'] else ():
            self._cameras[name] = create_publisher(node, PointStamped, f'camera/{name}')
        self._switches = {}
        for joint in twin.joints if parameters['home_switches'] else ():
            self._switches[joint] = create_publisher(node, Bool, f'home/{joint}')
        # Messages of which only the stamp and the numbers change.
        self._crank = JointState()
        self._imu = Imu()
        self._imu.header.frame_id = parameters['base_frame']
        self._imu.orientation_covariance = _diagonal(noise.orientation_noise**2)
        self._imu.angular_velocity_covariance = _diagonal(noise.gyro_noise**2)
        self._imu.linear_acceleration_covariance = _diagonal(noise.accelerometer_noise**2)
        self._truth = Odometry(child_frame_id=parameters['base_frame'])
        self._truth.header.frame_id = parameters['world_frame']

    def publish(self, stamp: TimeMessage, commands: Mapping[str, float]) -> None:
        """Publish the current state; `commands` are the commanded rates by joint [rad/s]."""
        if self._clock is not None:
            # First, so that nodes with simulated time have it before the rest arrives.
            self._clock.publish(Clock(clock=stamp))
        # The IMU first: walker_node estimates the motion when it has the cranks.
        self._publish_imu(stamp)
        self._publish_cranks(stamp, commands)
        truth = self._twin.truth()
        self._truth.header.stamp = stamp
        pose, twist = self._truth.pose.pose, self._truth.twist.twist
        _fill(pose.position, 'xyz', truth.position)
        _fill(pose.orientation, 'xyzw', truth.orientation)
        _fill(twist.linear, 'xyz', truth.linear)
        _fill(twist.angular, 'xyz', truth.angular)
        self._truths.publish(self._truth)
        if self._cameras:
            for name, (x, y) in self._twin.points().items():
                message = PointStamped(header=Header(stamp=stamp), point=Point(x=x, y=y))
                message.header.frame_id = f'{name.rpartition("/")[0]}/leg_plane'.lstrip('/')
                self._cameras[name].publish(message)

    def _publish_imu(self, stamp: TimeMessage) -> None:
        imu = self._faults.imu(self._twin.imu(), self._twin.time)
        if self._faults.is_active(Injection.IMU_MISSING, self._twin.time):
            return
        self._imu.header.stamp = stamp
        _fill(self._imu.orientation, 'xyzw', imu.orientation)
        _fill(self._imu.angular_velocity, 'xyz', imu.angular_velocity)
        _fill(self._imu.linear_acceleration, 'xyz', imu.linear_acceleration)
        self._imus.publish(self._imu)

    def _publish_cranks(self, stamp: TimeMessage, commands: Mapping[str, float]) -> None:
        """Publish the home switches and the readings of the encoders, with injected faults."""
        measured = self._twin.cranks()
        for joint, switch in self._switches.items():
            angle = measured[joint].position - self._encoder_offset
            switch.publish(Bool(data=angle % TURN < SWITCH_WIDTH))
        if not self._faults.is_active(Injection.DRIVER_REPEATS, self._twin.time):
            self._crank.header.stamp = stamp
            cranks = self._faults.cranks(measured, commands, self._twin.time)
            self._crank.name = list(cranks)
            self._crank.position = array('d', [crank.position for crank in cranks.values()])
            self._crank.velocity = array('d', [crank.velocity for crank in cranks.values()])
            # A review compares efforts with the masses of the legs alone; a walker's carry its
            # weight.
            if not self._twin.is_free:
                self._crank.effort = array('d', self._twin.efforts())
        self._cranks.publish(self._crank)


class DemoCommandPublisher:
    """Repeat one cmd_vel [m/s]; pause while another node publishes it, or holds its lease."""

    def __init__(self, node: Node, linear: float, now: Callable[[], float]) -> None:
        self._node = node
        # Returns the robot's time [s].
        self._now = now
        # Robot's time since which a walker has been there; infinite without a walker [s].
        self._walker_time = inf
        self._cranks = node.resolve_topic_name('crank_command')
        self._publisher: Any = create_publisher(node, TwistStamped, 'cmd_vel')
        self._lease = LeaseListener(node, self._publisher.topic_name, self._on_lease)
        # Without a stamp it is as old as its arrival.
        self._command = TwistStamped()
        self._command.twist.linear.x = linear
        # Whether this node commanded the motion last.
        self._is_driving = False
        create_steady_timer(node, _COMMAND_PERIOD, self._send)

    def end(self) -> None:
        """Command a stop, unless another node drives."""
        if self._is_driving:
            publish_last(self._publisher, TwistStamped())

    def _send(self) -> None:
        if not self._node.count_publishers(self._cranks):
            self._walker_time = inf
            return
        # The robot's time starts again at a reset.
        self._walker_time = min(self._walker_time, self._now())
        has_stood = self._now() >= self._walker_time + _STANDSTILL
        self._is_driving = has_stood and not self._lease.holder and not self._has_rivals()
        if self._is_driving:
            self._publisher.publish(self._command)

    def _has_rivals(self) -> bool:
        """Return whether another node publishes cmd_vel, except a driver that has left."""
        # A driver that was killed is known to the middleware for 20 s more.
        publishers = other_publishers(self._node, self._publisher.topic_name)
        return bool(publishers - {self._lease.last_holder})

    def _on_lease(self, driver: str) -> None:
        text = f'yields to {driver}, which drives it' if driver else 'resumes: the driver has left'
        self._node.get_logger().info(f'{self._publisher.topic_name}: {text}')


def _fill(message: object, names: str, numbers: Sequence[float]) -> None:
    for name, number in zip(names, numbers, strict=True):
        setattr(message, name, number)


def _diagonal(variance: float) -> list[float]:
    # All zero: by the message's definition unknown, and also without error.
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    kinds = '\n'.join(f'  {kind.label} ({kind.size:g}): {kind.description}' for kind in Injection)
    parser = ArgumentParser(
        'sim_node',
        'Simulate a robot in MuJoCo, in real time: speeds of its cranks in (crank_command), its '
        'cranks (crank_state), its IMU (imu) and its true pose (ground_truth) out.',
        f'{usage(SIM_GROUPS)}\n'
        f' faults by name (size), of a crank as JOINT_NAME or for all:\n{kinds}\n'
        ' its legs and masses: those of solver_node, in the same file\n'
        f'{QOS_USAGE}\n\n'
        'Service ~/reset (std_srvs/srv/Trigger): the robot stands where it began.',
    )
    arguments(parser, argv)
    return run('sim_node', lambda _: SimNode(), argv, stop, raw=True)
