"""`walker_node`: takes cmd_vel to the cranks of a walker, and gives odom back."""

from collections.abc import Mapping, Sequence
from functools import partial
from math import inf
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist, TwistStamped
from klann_ros.cli import ArgumentParser
from klann_ros.datasheet import peak_efforts
from klann_ros.gait import Feet, NoWalkerError, Steering, walk_figures
from klann_ros.kinematics import KinematicsError
from klann_ros.nodes.cdr_readers import JointReading
from klann_ros.nodes.encoders import subscribe_cranks
from klann_ros.nodes.endpoints import (
    create_publisher,
    create_steady_timer,
    create_trigger,
    diagnostic_array,
    diagnostic_status,
    node_of,
    QOS_USAGE,
    subscribe_raw,
    TypeCheck,
)
from klann_ros.nodes.parameters import declare, on_change, StartError, usage
from klann_ros.nodes.process import arguments, LIFECYCLE_HELP, LOG_PERIOD, ProcessNode, run
from klann_ros.nodes.raw_executor import Info, RawCallbackGroup
from klann_ros.nodes.robot_parameters import declared_robot
from klann_ros.sanitize.text import printable, printable_line
from klann_ros.stop_signals import StopSignals
from klann_ros.walker import (
    DiagnosticLevel,
    Fault,
    imu_reading,
    OdometryScale,
    RefusalKind,
    Walker,
)
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool

from .declarations import (
    CONTROL,
    LIMITS,
    noise,
    ODOMETRY,
    settings,
    TYPE_REMEDIES,
    WALKER_PARAMETERS,
)
from .messages import (
    CrankOutput,
    ImuReader,
    OdomOutput,
    read_pose,
    read_twist,
    twist_message,
)

# Minimum time between two log lines about events [s].
EVENT_PERIOD = 1.0
# Events in one line of the log.
MAX_LOGGED = 5
# Period of the watchdog [s]; where feedback drives this part of all commands, no timer does.
WATCH_PERIOD, DRIVEN_RATIO = 0.1, 0.8
# The command timer restarts when it is off by this number of periods.
BEAT_RESTART = 10
# Steps of a turn of the cranks, for warnings.
WARNING_SAMPLES = 90
# Time without a command after which failing callbacks stop the cranks [s].
MAX_SILENCE = 0.2
OPEN_LOOP = (
    'open loop: begin with all cranks at 0; cranks that drift apart, stall or slip are not seen'
)
# A command may be early by this part of a period: feedback jitters.
EARLY = 0.3


class WalkerNode(ProcessNode):
    """Drive the cranks of a walker by cmd_vel, and publish its odometry."""

    def __init__(self, **options: Any) -> None:
        """Declare, validate and connect; a StartError names a refused parameter, or no walker."""
        super().__init__('walker_node', **options)
        values = declare(self, WALKER_PARAMETERS)
        robot = declared_robot(self, described=True)
        try:
            feet = Feet(robot, foot_radius=values['foot_radius'])
            # Simulated time may stand still, and the machine's may be set; cranks need neither.
            self._sim = bool(self.get_parameter('use_sim_time').value)
            self._walker = Walker(
                Steering(feet),
                settings(values),
                noise(values),
                scale=OdometryScale(values['linear_scale'], values['angular_scale']),
                imu_timeout=values['imu_timeout'],
                steady=_steady_time if self._sim else None,
            )
        except (NoWalkerError, KinematicsError) as error:
            raise StartError(str(error)) from error
        self._stamped: bool = values['stamped_cmd_vel']
        # The largest effort of each crank by the masses in its file [N m].
        self._described_efforts = peak_efforts(robot) if values['max_effort'] else {}
        self._connect(values)
        self._values = values
        on_change(self, WALKER_PARAMETERS, self._on_change)
        figures = walk_figures(robot, foot_radius=values['foot_radius'], samples=WARNING_SAMPLES)
        for warning in figures.warnings:
            self.get_logger().warning(printable(warning))
        self.get_logger().info(f'ready: {self._summary(values)}')

    def close(self) -> int:
        """Stop the cranks."""
        self._commands.end(self._walker.controller.standstill, *self._stamp())
        return 0

    def on_callback_error(self) -> None:
        """Stop the cranks where no callback commands them any more."""
        if self._commands.is_turning and _steady_time() - self._commanded > MAX_SILENCE:
            self._commands.publish(self._walker.controller.standstill, *self._stamp())

    def _connect(self, values: dict[str, Any]) -> None:
        joints = self._walker.feet.joints
        self._imu, self._has_imu = ImuReader(), False
        self._commands = CrankOutput(self, self._walker.drives, values['command_type'])
        self._limited: Any = None
        if values['publish_limited_velocity']:
            self._limited = create_publisher(self, TwistStamped, 'cmd_vel_out')
        self._odom = OdomOutput(self, values)
        if self._odom.problem:
            self.get_logger().warning(self._odom.problem)
        self._diagnostics = create_publisher(self, DiagnosticArray, '/diagnostics')
        self._types = TypeCheck(self, TYPE_REMEDIES)
        # Also where simulated time stands still.
        create_steady_timer(self, values['diagnostics_period'], self._report)
        create_trigger(self, 'reset_fault', self._on_reset_fault)
        create_trigger(self, 'set_zero', self._on_set_zero)
        for joint in joints:
            # A joint may have a name that ROS allows to no service.
            if joint.isidentifier() and joint.isascii():
                create_trigger(self, f'{joint}/set_zero', partial(self._on_set_zero, joint))
        create_trigger(self, 'reset_odometry', self._on_reset_odometry)
        create_trigger(self, 'enable', self._on_enable)
        create_trigger(self, 'disable', self._on_disable)
        # Before all other inputs, for which it does not wait.
        subscribe_raw(self, Bool, 'e_stop', self._on_e_stop)
        subscribe_raw(self, PoseWithCovarianceStamped, 'set_pose', self._on_set_pose)
        # Before crank_state, which moves the estimate: in this order waiting messages are taken.
        # An IMU is needed only then, so its messages wake nobody.
        if values['use_imu']:
            subscribe_raw(self, Imu, 'imu', self._on_imu, wakes=False)
        if values['open_loop']:
            self.get_logger().warning(OPEN_LOOP)
        else:
            subscribe_cranks(self, joints, values, self._feed_back)
        cmd_vel = TwistStamped if self._stamped else Twist
        subscribe_raw(self, cmd_vel, 'cmd_vel', self._on_cmd_vel)
        self._period = 1.0 / values['rate']
        # Of the commands, and of the feedback that could drive them.
        self._due, self._fed = Beat(self._period), Beat(self._period)
        # Inputs drive the outputs, which is quicker, and costs half of what a timer does; where
        # too few arrive, the timer helps.
        self._driven = 0
        group = RawCallbackGroup()
        create_timer = self.create_timer if self._sim else partial(create_steady_timer, self)
        self._timer: Any = create_timer(self._period, lambda: self._command(self._now()), group)
        self._reported: set[str] = set()
        self._logged = -EVENT_PERIOD
        self._logged_fault: Fault | None = None
        # Steady time of the last command [s].
        self._commanded = -inf
        create_steady_timer(self, WATCH_PERIOD, self._on_watch, group)

    def _on_change(self, values: Mapping[str, Any]) -> None:
        self._values |= values
        self._walker.controller.configure(settings(self._values))

    def _summary(self, values: dict[str, Any]) -> str:
        feet, steering = self._walker.feet, self._walker.controller.steering
        legs, joints = len(feet.robot.legs), ', '.join(map(printable, feet.joints))
        turns = '' if steering.can_turn else ', straight on only'
        kind = 'TwistStamped' if self._stamped else 'Twist'
        imu = 'an IMU' if values['use_imu'] else 'its feet'
        return (
            f'{legs} legs on {joints}, {steering.speed:.3f} m/s at 1 rad/s{turns}; '
            f'{kind} on {self.resolve_topic_name("cmd_vel")}, yaw from {imu}'
        )

    def _on_reset_fault(self) -> tuple[bool, str]:
        latch = self._walker.controller.latch
        text = f'forgotten: {latch.fault.text}' if latch.fault else 'there is no fault'
        latch.reset()
        # A pressed emergency stop trips it again.
        self._walker.controller.keep_alive(self._now())
        refusal = latch.fault.text if latch.fault else ''
        return not refusal, printable_line(refusal or text)

    def _on_reset_odometry(self) -> tuple[bool, str]:
        self._walker.set_pose()
        return True, self._log('odom begins again here')

    def _on_set_pose(self, data: bytes, _: Info) -> None:
        try:
            pose, covariance = read_pose(data, self._values['odom_frame'])
        except ValueError as error:
            self._warn(f'set_pose is rejected: {error}')
            return
        self._walker.set_pose(pose, covariance)
        x, y, yaw = pose
        self._log(f'odom goes on at x {x:.3f} m, y {y:.3f} m, yaw {yaw:.3f} rad')

    def _on_enable(self) -> tuple[bool, str]:
        refusal = self._walker.controller.interlocks.enable()
        if refusal:
            return False, printable_line(refusal)
        return True, self._log(f'enabled; {self._walker.verdict(self._now())[1]}')

    def _on_disable(self) -> tuple[bool, str]:
        self._walker.controller.interlocks.is_enabled = False
        self._step(self._now())
        return True, self._log('disabled: the cranks are commanded to stand')

    def _log(self, text: str) -> str:
        self.get_logger().info(printable_line(text))
        return text

    def _on_set_zero(self, *joints: str) -> tuple[bool, str]:
        refusal = self._walker.set_zero(joints)
        if refusal:
            return False, f'zero is not set: {refusal}'
        return True, f'for the robot file: {self._walker.drives.zeros}'

    # Time.

    def _now(self) -> float:
        """Return the time of the control clock [s]."""
        return self.get_clock().now().nanoseconds / 1e9 if self._sim else _steady_time()

    def _stamp(self) -> tuple[int, int]:
        seconds, nanoseconds = divmod(self.get_clock().now().nanoseconds, 10**9)
        return seconds, nanoseconds

    def _age(self, sec: int, nanosec: int) -> float:
        """Return the age of a stamp [s]."""
        now = self._now() if self._sim else time.time()
        return now - sec - nanosec / 1e9

    # Inputs.

    def _on_e_stop(self, data: bytes, _: Info) -> None:
        now = self._now()
        controller = self._walker.controller
        controller.interlocks.hear_e_stop(is_pressed=deserialize_message(data, Bool).data, now=now)
        controller.keep_alive(now)
        if controller.latch.fault:
            self._step(now)

    def _sent(self, info: Info) -> float:
        """Return the time of sending [s], which is none of a simulation's: 0 there."""
        return 0.0 if self._sim else float(info['source_timestamp'] / 1e9)

    def _on_cmd_vel(self, data: bytes, info: Info) -> None:
        try:
            linear, angular, *stamp = read_twist(data, stamped=self._stamped)
        except ValueError as error:
            self._warn(f'cmd_vel is rejected: {error}')
            return
        age = 0.0
        if stamp != [0, 0]:
            age = self._age(*stamp)
        refusal = self._walker.controller.command(
            linear, angular, self._now(), age, _transport_age(info)
        )
        if refusal is None:
            return
        if refusal.kind is RefusalKind.CANNOT_TURN:
            # A joystick repeats it.
            self.get_logger().warning(f'angular.z is refused: {refusal.text}', once=True)
        else:
            self._warn(refusal.text)

    def _feed_back(self, joints: Mapping[str, JointReading], info: Info) -> None:
        """Take the readings of cranks of one message; publish odom, and the command if due."""
        encoders = {joint: reading[:2] for joint, reading in joints.items()}
        readings = self._walker.drives.measured(encoders)
        *_, last = joints.values()
        stamp = last.sec, last.nanosec
        when = stamp[0] + stamp[1] / 1e9 if stamp != (0, 0) else self._sent(info)
        now = self._now()
        age = self._age(*stamp) if stamp != (0, 0) else _transport_age(info)
        if age is not None:
            self._walker.controller.lock.take_delay(age)
        efforts = {joint: reading.effort for joint, reading in joints.items()}
        self._walker.take_efforts(efforts, now)
        at_feet = self._walker.feedback(readings, now, when or None, _transport_age(info))
        if at_feet is not None:
            self._odom.publish(at_feet, *(stamp if stamp != (0, 0) else self._stamp()))
            # Also where the timer was first: or it would go on for ever.
            self._driven += self._fed.take(now)
            self._command(now)

    def _on_imu(self, data: bytes, info: Info) -> None:
        try:
            message = self._imu.read(data)
        except ValueError as error:
            self._warn(f'imu is rejected: {error}')
            return
        if not self._has_imu:
            self._has_imu = True
            frame = deserialize_message(data, Imu).header.frame_id
            base = self._values['base_frame']
            if frame not in ('', base):
                text = f'imu is in frame {frame}: its axes are taken as those of {base}'
                self.get_logger().warning(printable_line(text))
        now = self._now()
        # Its own clock has less jitter than the transport; the time of sending less than that of
        # reception, which is one for all that waited.
        at = message.sec + message.nanosec / 1e9 or self._sent(info) or now
        reading = imu_reading(message.orientation, message.angular, at, message.force)
        self._walker.imu(reading, now, message.variance)

    def _warn(self, text: str) -> None:
        self.get_logger().warning(printable(text), throttle_duration_sec=LOG_PERIOD)

    def _warn_once(self, text: str) -> None:
        """Log a warning, unless it is empty or was logged before."""
        if text and text not in self._reported:
            self._reported.add(text)
            self.get_logger().warning(printable_line(text))

    # Outputs.

    def _report(self) -> None:
        now = self._now()
        level, message = self._walker.verdict(now)
        values = self._walker.values(now)
        for joint, effort in self._described_efforts.items():
            values[f'{joint} described_effort'] = f'{effort:.3f}'
        for text in self._rivals():
            self._warn_once(text)
            level = DiagnosticLevel.WARN if level == DiagnosticLevel.OK else level
            message = f'{message}; {text}'
        for crank in self._walker.controller.cranks:
            self._warn_once(crank.units.suspicion)
        verdict = self._types.add_to(bytes([level.value]), message)
        status = diagnostic_status(self, 'walker', *verdict, values.items())
        self._diagnostics.publish(diagnostic_array(self, [status]))

    def _rivals(self) -> list[str]:
        """Return who else commands the cranks or the walker, or its stop."""
        rivals = []
        commanders = self._publishing_nodes('crank_command', 'watchdog_node')
        if len(commanders) > 1:
            count = len(commanders)
            rivals.append(f'crank_command has {count} publishers: only one may drive the cranks')
        # sim_node gives way to others.
        drivers = self._publishing_nodes('cmd_vel', 'sim_node')
        if len(drivers) > 1:
            names = ', '.join(map(printable, drivers))
            rivals.append(f'cmd_vel has {len(drivers)} publishers: {names}')
        switches = self._publishing_nodes('e_stop')
        if len(switches) > 1:
            names = ', '.join(map(printable, switches))
            text = f'e_stop has {len(switches)} publishers, whose silence hides: {names}'
            rivals.append(text)
        return rivals

    def _publishing_nodes(self, name: str, harmless: str = '') -> list[str]:
        """Return the nodes that publish a topic, if there are several, but the harmless ones."""
        topic = self.resolve_topic_name(name)
        if self.count_publishers(topic) < 2:
            return []
        nodes = map(node_of, self.get_publishers_info_by_topic(topic))
        return sorted(node for node in nodes if node.rpartition('/')[2] not in ('', harmless))

    def _on_watch(self) -> None:
        is_enough = self._driven * self._period >= DRIVEN_RATIO * WATCH_PERIOD
        self._driven = 0
        if is_enough and not self._timer.is_canceled():
            self._timer.cancel()
        elif not is_enough and self._timer.is_canceled():
            self._timer.reset()
        now = self._now()
        controller = self._walker.controller
        controller.keep_alive(now)
        # Also where the control clock stands still.
        if controller.stop_reason(now):
            self._step(now)
        self._log_events(_steady_time())

    def _log_events(self, now: float) -> None:
        latch, events = self._walker.controller.latch, self._walker.controller.events
        if latch.fault is not self._logged_fault:
            self._logged_fault = latch.fault
            if latch.fault:
                self.get_logger().error(printable_line(f'fault: {latch.reason}'))
        if not events or now - self._logged < EVENT_PERIOD:
            return
        self._logged = now
        texts = [*events][:MAX_LOGGED]
        more = f'; and {len(events) - len(texts)} more' if len(events) > len(texts) else ''
        events.clear()
        self.get_logger().warning(printable_line('; '.join(texts) + more))

    def _command(self, now: float) -> None:
        """Command the cranks if a command is due."""
        if self._due.take(now):
            self._step(now)

    def _step(self, now: float) -> None:
        command = self._walker.controller.step(now)
        if command is not None and self._walker.controller.interlocks.is_active:
            stamp = self._stamp()
            self._commands.publish(command, *stamp)
            self._commanded = _steady_time()
            if self._limited is not None:
                motion = self._walker.controller.motion
                self._limited.publish(twist_message(motion, self._values['base_frame'], *stamp))
        if self._values['open_loop']:
            estimate = self._walker.follow_command(command, now)
            if estimate is not None:
                self._odom.publish(estimate, *self._stamp())


class ManagedWalkerNode(LifecycleNodeMixin, WalkerNode):
    """A walker_node that commands its cranks while it is active, and only listens otherwise."""

    def __init__(self, **options: Any) -> None:
        WalkerNode.__init__(self, **options)
        self._walker.controller.interlocks.is_active = False
        LifecycleNodeMixin.__init__(self)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Command the cranks, which begin to stand."""
        self._walker.controller.interlocks.is_active = True
        self._log('activated: it commands the cranks')
        return super().on_activate(state)

    def on_deactivate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Stop the cranks, and command nothing."""
        self._walker.controller.interlocks.is_active = False
        self.close()
        self._log('not active: it commands nothing')
        return TransitionCallbackReturn.SUCCESS

    # Also after a transition that failed.
    on_shutdown = on_error = on_deactivate


def _steady_time() -> float:
    """Return the time of a clock that runs while the machine is suspended as well [s]."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def _transport_age(info: Info) -> float | None:
    """Return the age of a message since it was sent [s]; None if unknown."""
    sent: int = info['source_timestamp']
    return (time.time_ns() - sent) / 1e9 if sent else None


class Beat:
    """A mean period [s], kept by events that are frequent enough."""

    def __init__(self, period: float) -> None:
        self._period, self._due = period, 0.0

    def take(self, now: float) -> bool:
        """Return whether the next beat is due at a time [s]; if so, count it."""
        if abs(now - self._due) > BEAT_RESTART * self._period:
            self._due = now
        if now < self._due - EARLY * self._period:
            return False
        self._due += self._period
        return True


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    groups = {'limits': LIMITS, 'control': CONTROL, 'odometry': ODOMETRY}
    parser = ArgumentParser(
        'walker_node',
        'Walk: convert cmd_vel to rates of the cranks of a walker (crank_command), whose legs '
        'keep their phases; estimate its pose (odom) from the angles of its cranks (crank_state).',
        f'{usage(groups)}\n its legs: those of solver_node, in the same file or by its '
        f'leg_description\n{QOS_USAGE}\n\n'
        'Services (std_srvs/srv/Trigger): ~/reset_fault forgets the fault that stopped\n'
        'it; ~/disable commands the cranks to stand, ~/enable permits motion again;\n'
        '~/set_zero and ~/JOINT/set_zero: all cranks, or that of a joint, are at zero\n'
        'now; ~/reset_odometry: odom begins again at 0.',
    )
    parser.add_argument('--lifecycle', action='store_true', help=LIFECYCLE_HELP)
    kind = ManagedWalkerNode if arguments(parser, argv).lifecycle else WalkerNode
    return run('walker_node', lambda _: kind(), argv, stop, raw=True)
