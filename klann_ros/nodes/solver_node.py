"""`solver_node`: crank angle in, poses of the legs out."""

from collections.abc import Mapping, Sequence
from math import pi
from typing import Any

from klann_ros.kinematics import CrankAngleError, GeometryError, KinematicsError
from klann_ros.stop_signals import StopSignals
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from .crank_inputs import Crank, CrankInputs, Stamp
from .leg_markers import LegMarkers
from .leg_messages import LegMessages
from .leg_parameters import LegParameters
from .parameters import declare, Declared
from .process import arguments, command_line, Finish, run
from .solver_reports import SolverReports

PARAMETERS = (
    Declared('frame_id', 'leg_plane', 'frame of the published point: the plane of the leg'),
    Declared(
        'min_transmission_angle',
        0.349,
        'diagnostics warn when min(mu, pi - mu) of a dyad is below it [rad]',
        limits=(0.0, pi / 2),
    ),
    Declared('publish_markers', True, 'whether the legs are published as markers'),
    Declared('diagnostics_period', 1.0, 'time between diagnostics [s]', limits=(0.01, 3600.0)),
)
# How often a complaint about inputs is logged at most [s].
THROTTLE = 2.0


class SolverNode(Node):
    """
    Answer every crank angle with the joint angles and the feet of the legs.

    Raises
    ------
    StartError
        A parameter is refused; the text says why.

    """

    def __init__(self, **options: Any) -> None:
        """Declare, validate, and listen; `options` are those of Node."""
        super().__init__('solver_node', **options)
        self._leg_parameters = LegParameters(self)
        self._legs = self._leg_parameters.legs
        values = declare(self, PARAMETERS)
        self._messages = LegMessages(self, self._legs, values['frame_id'])
        joints = dict.fromkeys(leg.mounting.crank_joint for leg in self._legs)
        self._inputs = CrankInputs(self, list(joints), self._turn, self._reject)
        self._reports = SolverReports(
            self,
            self._legs,
            self._inputs,
            period=values['diagnostics_period'],
            min_transmission_angle=values['min_transmission_angle'],
        )
        self._markers = (
            LegMarkers(self, self._legs, values['frame_id']) if values['publish_markers'] else None
        )
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.add_on_set_parameters_callback(self._validate)
        self.add_post_set_parameters_callback(self._apply)

    # Inputs: ask the legs, answer.

    def _turn(self, cranks: Mapping[str, Crank], stamp: Stamp) -> None:
        answers = []
        for leg in self._legs:
            crank = cranks.get(leg.mounting.crank_joint)
            if crank is None:
                continue
            try:
                answers.append((leg, *leg.answer(*crank)))
            except CrankAngleError as error:
                self._complain(error)
            except KinematicsError as error:
                name = f'{leg.mounting.name}: ' if leg.mounting.name else ''
                self.get_logger().error(f'{name}{error}', throttle_duration_sec=THROTTLE)
        if answers:
            self._messages.publish(answers, stamp)

    def _reject(self, error: KinematicsError) -> None:
        for leg in self._legs:
            leg.figures.reject(str(error))
        self._complain(error)

    def _complain(self, error: KinematicsError) -> None:
        self.get_logger().warning(f'input rejected: {error}', throttle_duration_sec=THROTTLE)

    # Parameters and services.

    def _validate(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        try:
            self._leg_parameters.changed(parameters)
        except GeometryError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: Sequence[Parameter]) -> None:
        changed = self._leg_parameters.changed(parameters)
        for leg in self._legs:
            leg.leg = changed.get(leg.mounting.name, leg.leg)
        if changed:
            self._reports.legs_changed()
        if changed and self._markers:
            self._markers.legs_changed()

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        for leg in self._legs:
            leg.leg.reset()
        response.success = True
        response.message = 'the next pose starts from the closed form'
        return response


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
    return run('solver_node', _make, argv, stop, lean=True)


def _make(_: Finish) -> SolverNode:
    return SolverNode()
