"""`walker_node`: takes cmd_vel to the cranks of a walker, and gives odom back."""

from collections.abc import Mapping, Sequence
from functools import partial
from math import inf
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped, Twist, TwistStamped
from klann_ros.cli import ArgumentParser
from klann_ros.gait import Feet, NoWalkerError, Steering, walk_figures
from klann_ros.kinematics import KinematicsError
from klann_ros.messages import JointReading
from klann_ros.nodes.clocks import ControlClock, steady_time, transport_age
from klann_ros.nodes.crank_output import CrankOutput
from klann_ros.nodes.encoders import subscribe_cranks
from klann_ros.nodes.endpoints import (
    create_publisher,
    create_steady_timer,
    create_trigger,
    QOS_USAGE,
    subscribe_raw,
)
from klann_ros.nodes.parameters import declare, on_change, StartError, usage
from klann_ros.nodes.process import arguments, LIFECYCLE_HELP, LOG_PERIOD, ProcessNode, run
from klann_ros.nodes.raw_executor import Info, RawCallbackGroup
from klann_ros.nodes.robot_parameters import declared_robot
from klann_ros.sanitize.text import printable, printable_line
from klann_ros.stop_signals import StopSignals
from klann_ros.walker import imu_reading, OdometryScale, RefusalKind, Walker
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool

from .declarations import CONTROL, LIMITS, noise, ODOMETRY, settings, WALKER_PARAMETERS
from .messages import ImuReader, OdomOutput, read_pose, read_twist, twist_message, WalkerReports
from .timing import CommandPacer, WATCH_PERIOD

# Steps of a turn of the cranks, for warnings.
WARNING_SAMPLES = 90
# Time without a command after which failing callbacks stop the cranks [s].
MAX_SILENCE = 0.2
OPEN_LOOP = (
    'open loop: begin with all cranks at 0; cranks that drift apart, stall or slip are not seen'
)


class WalkerNode(ProcessNode):
    """Drive the cranks of a walker by cmd_vel, and publish its odometry."""

    def __init__(self, **options: Any) -> None:
        """Declare, validate and connect; a StartError names a refused parameter, or no walker."""
        super().__init__('walker_node', **options)
        self._parameter_values = parameters = declare(self, WALKER_PARAMETERS)
        robot = declared_robot(self, described=True)
        self._control_clock = ControlClock(self)
        try:
            feet = Feet(robot, foot_radius=parameters['foot_radius'])
            self._walker = Walker(
                Steering(feet),
                settings(parameters),
                noise(parameters),
                scale=OdometryScale(parameters['linear_scale'], parameters['angular_scale']),
                imu_timeout=parameters['imu_timeout'],
                steady=steady_time if self._control_clock.is_simulated else None,
            )
        except (NoWalkerError, KinematicsError) as error:
            raise StartError(str(error)) from error
        self._commands = CrankOutput(self, self._walker.drives, parameters['command_type'])
        # Steady time of the last command [s].
        self._command_time = -inf
        self._limited_motion: Any = None
        if parameters['publish_limited_velocity']:
            self._limited_motion = create_publisher(self, TwistStamped, 'cmd_vel_out')
        self._odom = OdomOutput(self, parameters)
        self._reports = WalkerReports(self, self._walker, self._control_clock, parameters)
        self._offer_services()
        self._imu = ImuReader()
        self._has_imu = False
        self._subscribe()
        self._pacer = CommandPacer(self, self._control_clock, 1.0 / parameters['rate'], self._step)
        create_steady_timer(self, WATCH_PERIOD, self._on_watch, RawCallbackGroup())
        on_change(self, WALKER_PARAMETERS, self._on_change)
        figures = walk_figures(
            robot, foot_radius=parameters['foot_radius'], samples=WARNING_SAMPLES
        )
        for warning in figures.warnings:
            self.get_logger().warning(printable(warning))
        self.get_logger().info(f'ready: {self._summary()}')

    def close(self) -> int:
        """Stop the cranks."""
        self._commands.end(self._walker.controller.standstill, *self._control_clock.stamp())
        return 0

    def on_callback_error(self) -> None:
        """Stop the cranks where no callback commands them any more."""
        if self._commands.is_turning and steady_time() - self._command_time > MAX_SILENCE:
            self._commands.publish(
                self._walker.controller.standstill, *self._control_clock.stamp()
            )

    def _offer_services(self) -> None:
        create_trigger(self, 'reset_fault', self._on_reset_fault)
        create_trigger(self, 'set_zero', self._on_set_zero)
        for joint in self._walker.feet.joints:
            # A joint may have a name that ROS allows to no service.
            if joint.isidentifier() and joint.isascii():
                create_trigger(self, f'{joint}/set_zero', partial(self._on_set_zero, joint))
        create_trigger(self, 'reset_odometry', self._on_reset_odometry)
        create_trigger(self, 'enable', self._on_enable)
        create_trigger(self, 'disable', self._on_disable)

    def _subscribe(self) -> None:
        # Waiting messages are taken in this order: e_stop before all inputs that move anything.
        subscribe_raw(self, Bool, 'e_stop', self._on_e_stop)
        subscribe_raw(self, PoseWithCovarianceStamped, 'set_pose', self._on_set_pose)
        # Before crank_state, which moves the estimate. An IMU is needed only then, so its messages
        # do not wake the node.
        if self._parameter_values['use_imu']:
            subscribe_raw(self, Imu, 'imu', self._on_imu, wakes=False)
        if self._parameter_values['open_loop']:
            self.get_logger().warning(OPEN_LOOP)
        else:
            joints = self._walker.feet.joints
            subscribe_cranks(self, joints, self._parameter_values, self._on_crank_state)
        cmd_vel_type = TwistStamped if self._parameter_values['stamped_cmd_vel'] else Twist
        subscribe_raw(self, cmd_vel_type, 'cmd_vel', self._on_cmd_vel)

    def _on_change(self, changed: Mapping[str, Any]) -> None:
        self._parameter_values |= changed
        self._walker.controller.configure(settings(self._parameter_values))

    def _summary(self) -> str:
        feet = self._walker.feet
        steering = self._walker.controller.steering
        joints = ', '.join(map(printable, feet.joints))
        straight_on = '' if steering.can_turn else ', straight on only'
        cmd_vel_type = 'TwistStamped' if self._parameter_values['stamped_cmd_vel'] else 'Twist'
        yaw_source = 'an IMU' if self._parameter_values['use_imu'] else 'its feet'
        return (
            f'{len(feet.robot.legs)} legs on {joints}, {steering.speed:.3f} m/s at 1 rad/s'
            f'{straight_on}; {cmd_vel_type} on {self.resolve_topic_name("cmd_vel")}, '
            f'yaw from {yaw_source}'
        )

    # Services.

    def _on_reset_fault(self) -> tuple[bool, str]:
        latch = self._walker.controller.latch
        text = f'forgotten: {latch.fault.text}' if latch.fault else 'there is no fault'
        latch.reset()
        # A pressed emergency stop trips it again.
        self._walker.controller.keep_alive(self._control_clock.now())
        refusal = latch.fault.text if latch.fault else ''
        return not refusal, printable_line(refusal or text)

    def _on_reset_odometry(self) -> tuple[bool, str]:
        self._walker.set_pose()
        return True, self._log('odom begins again here')

    def _on_enable(self) -> tuple[bool, str]:
        refusal = self._walker.controller.interlocks.enable()
        if refusal:
            return False, printable_line(refusal)
        return True, self._log(f'enabled; {self._walker.verdict(self._control_clock.now())[1]}')

    def _on_disable(self) -> tuple[bool, str]:
        self._walker.controller.interlocks.is_enabled = False
        self._step(self._control_clock.now())
        return True, self._log('disabled: the cranks are commanded to stand')

    def _on_set_zero(self, *joints: str) -> tuple[bool, str]:
        refusal = self._walker.set_zero(joints)
        if refusal:
            return False, f'zero is not set: {refusal}'
        return True, f'for the robot file: {self._walker.drives.zeros}'

    # Inputs.

    def _on_e_stop(self, message: bytes, _: Info) -> None:
        now = self._control_clock.now()
        is_pressed = deserialize_message(message, Bool).data
        controller = self._walker.controller
        controller.interlocks.take_e_stop(is_pressed=is_pressed, now=now)
        controller.keep_alive(now)
        if controller.latch.fault:
            self._step(now)

    def _on_set_pose(self, message: bytes, _: Info) -> None:
        try:
            pose, covariance = read_pose(message, self._parameter_values['odom_frame'])
        except ValueError as error:
            self._warn(f'set_pose is rejected: {error}')
            return
        self._walker.set_pose(pose, covariance)
        x, y, yaw = pose
        self._log(f'odom goes on at x {x:.3f} m, y {y:.3f} m, yaw {yaw:.3f} rad')

    def _on_cmd_vel(self, message: bytes, info: Info) -> None:
        """Give a commanded velocity to the controller, and log the reason of a refusal."""
        try:
            twist = read_twist(message, stamped=self._parameter_values['stamped_cmd_vel'])
        except ValueError as error:
            self._warn(f'cmd_vel is rejected: {error}')
            return
        age = (
            self._control_clock.age(twist.sec, twist.nanosec)
            if twist.sec or twist.nanosec
            else 0.0
        )
        refusal = self._walker.controller.command(
            twist.linear, twist.angular, self._control_clock.now(), age, transport_age(info)
        )
        if refusal is None:
            return
        if refusal.kind is RefusalKind.CANNOT_TURN:
            # A joystick repeats it.
            self.get_logger().warning(f'angular.z is refused: {refusal.text}', once=True)
        else:
            self._warn(refusal.text)

    def _on_crank_state(self, readings: Mapping[str, JointReading], info: Info) -> None:
        """Take the readings of cranks of one message; publish odom, and the command if due."""
        walker = self._walker
        now = self._control_clock.now()
        encoders = {joint: (r.position, r.velocity) for joint, r in readings.items()}
        # All readings of a message have its stamp, and either all an effort or none.
        reading = next(iter(readings.values()))
        if reading.effort is not None:
            efforts = {joint: r.effort for joint, r in readings.items()}
            walker.take_efforts(efforts, now)
        age_since_sending = transport_age(info)
        stamp = reading.sec, reading.nanosec
        if stamp == (0, 0):
            stamp = self._control_clock.stamp()
            reading_time = self._control_clock.sending_time(info)
            age = age_since_sending
        else:
            reading_time = reading.sec + reading.nanosec / 1e9
            age = self._control_clock.age(*stamp)
        if age is not None:
            walker.controller.lock.take_delay(age)
        estimate = walker.feedback(
            walker.drives.measured(encoders), now, reading_time or None, age_since_sending
        )
        if estimate is not None:
            self._odom.publish(estimate, *stamp)
            self._pacer.on_feedback(now)

    def _on_imu(self, message: bytes, info: Info) -> None:
        """Give a reading of the IMU to the odometry."""
        try:
            imu = self._imu.read(message)
        except ValueError as error:
            self._warn(f'imu is rejected: {error}')
            return
        if not self._has_imu:
            self._has_imu = True
            frame = deserialize_message(message, Imu).header.frame_id
            base = self._parameter_values['base_frame']
            if frame not in ('', base):
                text = f'imu is in frame {frame}: its axes are taken as those of {base}'
                self.get_logger().warning(printable_line(text))
        now = self._control_clock.now()
        # Its own clock has less jitter than the transport; the time of sending less than that of
        # reception, which is one for all that waited.
        reading_time = imu.sec + imu.nanosec / 1e9 or self._control_clock.sending_time(info) or now
        reading = imu_reading(imu.orientation, imu.angular, reading_time, imu.force)
        self._walker.imu(reading, now, imu.variance)

    def _warn(self, text: str) -> None:
        self.get_logger().warning(printable(text), throttle_duration_sec=LOG_PERIOD)

    def _log(self, text: str) -> str:
        self.get_logger().info(printable_line(text))
        return text

    # Outputs.

    def _on_watch(self) -> None:
        self._pacer.check_timer()
        now = self._control_clock.now()
        controller = self._walker.controller
        controller.keep_alive(now)
        # Also where the control clock stands still.
        if controller.stop_reason(now):
            self._step(now)
        self._reports.log_events()

    def _step(self, now: float) -> None:
        """Command the cranks."""
        controller = self._walker.controller
        command = controller.step(now)
        if command is not None and controller.interlocks.is_active:
            stamp = self._control_clock.stamp()
            self._commands.publish(command, *stamp)
            self._command_time = steady_time()
            if self._limited_motion is not None:
                motion = twist_message(
                    controller.motion, self._parameter_values['base_frame'], *stamp
                )
                self._limited_motion.publish(motion)
        if self._parameter_values['open_loop']:
            estimate = self._walker.follow_command(command, now)
            if estimate is not None:
                self._odom.publish(estimate, *self._control_clock.stamp())


class ManagedWalkerNode(LifecycleNodeMixin, WalkerNode):
    """A walker_node that commands its cranks while it is active, and only listens otherwise."""

    def __init__(self, **options: Any) -> None:
        WalkerNode.__init__(self, **options)
        self._walker.controller.interlocks.is_active = False
        LifecycleNodeMixin.__init__(self)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to command the cranks, from standstill."""
        self._walker.controller.interlocks.is_active = True
        self._log('activated: it commands the cranks')
        return super().on_activate(state)

    def on_deactivate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Stop the cranks, and command nothing more."""
        self._walker.controller.interlocks.is_active = False
        self.close()
        self._log('not active: it commands nothing')
        return TransitionCallbackReturn.SUCCESS

    # Also after a transition that failed.
    on_shutdown = on_error = on_deactivate


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
