"""`solver_node`: crank angle in, pose of the leg out."""

from collections.abc import Sequence
from math import pi
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, TwistStamped
from klann_ros.kinematics import (
    CrankAngleError,
    GeometryError,
    KinematicsError,
    SingularPoseError,
)
from klann_ros.log.loss import LossCounter
from klann_ros.log.run_parameters import LINKAGE_PARAMETER
from klann_ros.stop_signals import StopSignals
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from . import diagnostics, leg_parameters
from .crank_input import BadMessageError, Crank, from_joint_state
from .leg_messages import LegMessages
from .leg_parameters import Leg, LegParameters, LegPose, LegVelocity
from .parameters import declare, declare_constant, Declared
from .process import arguments, command_line, Finish, run, StartError
from .qos import INPUT, OUTPUT
from .solver_figures import SolverFigures
from .taking import drain, forgetful, Info

PARAMETERS = (
    Declared('frame_id', 'leg_plane', 'frame of the published point: the plane of the leg'),
    Declared('crank_joint', 'crank', 'the joint in crank_state that turns the crank'),
    Declared(
        'min_transmission_angle',
        0.349,
        'diagnostics warn when min(mu, pi - mu) of a dyad is below it [rad]',
        limits=(0.0, pi / 2),
    ),
    Declared('diagnostics_period', 1.0, 'time between diagnostics [s]', limits=(0.01, 3600.0)),
)
# How often a complaint about inputs is logged at most [s].
THROTTLE = 2.0


class SolverNode(Node):
    """
    Answer every crank angle with the joint angles and the foot of a leg.

    Raises
    ------
    StartError
        A parameter is refused; the text says why.

    """

    def __init__(self, **options: Any) -> None:
        """Declare, validate, and listen; `options` are those of Node."""
        super().__init__('solver_node', **options)
        self._declare()
        self._figures = SolverFigures()
        self._losses = (LossCounter(), LossCounter())
        self._lost_reported = 0
        self._last_stamp = (0, 0)
        # Silence is measured on a clock that neither jumps nor stands still.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._last_input = self._last_report = self._steady.now()
        self._connect()

    def _declare(self) -> None:
        values = declare(self, [*leg_parameters.DECLARED, *PARAMETERS])
        self._min_transmission_angle = values['min_transmission_angle']
        self._crank_joint = values['crank_joint']
        self._period = values['diagnostics_period']
        try:
            self._leg_parameters = LegParameters(values)
        except ValueError as error:
            # A GeometryError, or what a leg says of tolerance and max_crank_step.
            raise StartError(str(error)) from error
        self._set_leg(self._leg_parameters.leg)
        self._messages = LegMessages(values['frame_id'], self._leg.joint_names)
        declare_constant(
            self,
            LINKAGE_PARAMETER,
            self._leg_parameters.description,
            "content of the linkage's file; empty for a Klann leg",
        )
        self.add_on_set_parameters_callback(self._validate)
        self.add_post_set_parameters_callback(self._apply)

    def _connect(self) -> None:
        overridable = QoSOverridingOptions.with_default_policies()

        def publisher(kind: type, topic: str) -> Any:
            return self.create_publisher(kind, topic, OUTPUT, qos_overriding_options=overridable)

        def subscription(kind: type, topic: str, callback: Any, loss: LossCounter) -> Subscription:
            return self.create_subscription(
                kind,
                topic,
                callback,
                INPUT,
                qos_overriding_options=overridable,
                event_callbacks=forgetful(loss),
            )

        self._joint_states = publisher(JointState, 'joint_states')
        self._point_h = publisher(PointStamped, 'point_h')
        self._velocity_h = publisher(TwistStamped, 'velocity_h')
        self._diagnostics = publisher(DiagnosticArray, '/diagnostics')
        loss_1, loss_2 = self._losses
        self._crank_angle = subscription(Float64, 'crank_angle', self._on_crank_angle, loss_1)
        self._crank_state = subscription(JointState, 'crank_state', self._on_crank_state, loss_2)
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_timer(self._period, self._report, clock=self._steady)

    # Inputs: take, ask the leg, answer.

    def _on_crank_angle(self, message: Float64, info: Info) -> None:
        loss = self._losses[0]
        publishers = self._crank_angle.get_publisher_count()
        for taken, about in drain(self._crank_angle, message, info):
            loss.count(about['publication_sequence_number'], publishers)
            self._answer(Crank(taken.data, None, None), about)

    def _on_crank_state(self, message: JointState, info: Info) -> None:
        loss = self._losses[1]
        publishers = self._crank_state.get_publisher_count()
        for taken, about in drain(self._crank_state, message, info):
            loss.count(about['publication_sequence_number'], publishers)
            try:
                crank = from_joint_state(taken, self._crank_joint)
            except BadMessageError as error:
                self._reject(error)
            else:
                self._answer(crank, about)

    def _answer(self, crank: Crank, info: Info) -> None:
        self._last_input = self._steady.now()
        stamp = crank.stamp or self._stamp(info)
        self._check_order(stamp)
        try:
            pose = self._leg.solve(crank.alpha)
        except CrankAngleError as error:
            self._reject(error)
        except KinematicsError as error:
            self._figures.fail(str(error))
            self.get_logger().error(str(error), throttle_duration_sec=THROTTLE)
        else:
            self._figures.solve(pose)
            self._publish(pose, self._velocity(pose, crank.rate), stamp)

    def _reject(self, error: KinematicsError) -> None:
        self._last_input = self._steady.now()
        self._figures.reject(str(error))
        self.get_logger().warning(f'input rejected: {error}', throttle_duration_sec=THROTTLE)

    def _stamp(self, info: Info) -> Time:
        """Return the source's time for a message without a stamp, or simulated time."""
        clock = self.get_clock()
        if clock.ros_time_is_active:
            return clock.now().to_msg()
        seconds, nanoseconds = divmod(info['source_timestamp'], 10**9)
        return Time(sec=seconds, nanosec=nanoseconds)

    def _check_order(self, stamp: Time) -> None:
        moment = (stamp.sec, stamp.nanosec)
        if moment < self._last_stamp:
            self._figures.out_of_order += 1
        self._last_stamp = moment

    def _velocity(self, pose: LegPose, rate: float | None) -> LegVelocity | None:
        if rate is None:
            return None
        try:
            return self._leg.velocity(pose, rate)  # type: ignore[arg-type]  # its own pose
        except SingularPoseError:
            return None

    def _publish(self, pose: LegPose, velocity: LegVelocity | None, stamp: Time) -> None:
        self._joint_states.publish(self._messages.joint_state(pose, velocity, stamp))
        self._point_h.publish(self._messages.point_h(pose, stamp))
        if velocity is not None:
            self._velocity_h.publish(self._messages.velocity_h(velocity, stamp))

    # Parameters and services.

    def _validate(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        try:
            self._leg_parameters.changed(parameters)
        except GeometryError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: Sequence[Parameter]) -> None:
        leg = self._leg_parameters.changed(parameters)
        if leg is not self._leg:
            self._set_leg(leg)

    def _set_leg(self, leg: Leg) -> None:
        self._leg_parameters.leg = self._leg = leg
        self._note = diagnostics.missing_arcs(leg.reachable_arcs())

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._leg.reset()
        response.success = True
        response.message = 'the next pose starts from the closed form'
        return response

    # Diagnostics.

    def _report(self) -> None:
        now = self._steady.now()
        lost = sum(loss.lost for loss in self._losses)
        status = diagnostics.status(
            f'{self.get_name()}: leg',
            self._figures,
            lost=lost,
            lost_now=lost - self._lost_reported,
            period=(now - self._last_report).nanoseconds / 1e9,
            silence=(now - self._last_input).nanoseconds / 1e9,
            min_transmission_angle=self._min_transmission_angle,
            assembly=self._leg.assembly,
            note=self._note,
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)
        self._figures.reported()
        self._lost_reported, self._last_report = lost, now


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = command_line(
        'solver_node',
        'Solve the Klann leg, or any linkage from a file: crank angle in (crank_angle, '
        'crank_state), pose out (joint_states, point_h, velocity_h).',
        'Parameters are given as --ros-args -p NAME:=VALUE or --ros-args --params-file FILE;\n'
        'presets are in share/klann_ros/config (sem104.yaml, patent.yaml), linkages in\n'
        'share/klann_ros/linkages (jansen.yaml, ...): -p linkage:=FILE.',
    )
    arguments(parser, argv)
    return run('solver_node', _make, argv, stop)


def _make(_: Finish) -> SolverNode:
    return SolverNode()
