"""`solver_node`: crank angles in; the legs' joint angles, feet and diagnostics out."""

from collections.abc import Mapping, Sequence
from math import degrees, tau
from textwrap import fill
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from klann_ros.cli import ArgumentParser
from klann_ros.kinematics import CrankAngleError, GeometryError, KinematicsError
from klann_ros.log import DESCRIPTION_TOPIC
from klann_ros.nodes.endpoints import (
    create_publisher,
    create_steady_timer,
    create_trigger,
    diagnostic_array,
    diagnostic_status,
    LATCHED,
    QOS_USAGE,
    TypeCheck,
)
from klann_ros.nodes.leg_declarations import drive, GEOMETRY, GEOMETRY_NAMES, LEGS, place
from klann_ros.nodes.parameters import declare, usage
from klann_ros.nodes.process import arguments, LIFECYCLE_HELP, LOG_PERIOD, ProcessNode, run
from klann_ros.sanitize.text import printable, verb
from klann_ros.stop_signals import StopSignals
from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from .crank_inputs import CrankInput, CrankInputs, NoFeedbackError, Stamp
from .declarations import INPUT_TYPE_REMEDIES, INPUTS, PUBLISHED, SETTINGS
from .driven_leg import DrivenLeg, SolverStatistics
from .leg_parameters import LegParameters
from .leg_publishers import description_message, LegMarkers, LegMessages

# Inputs are stale after this time without one [s].
STALE_AFTER = 2.0


class SolverNode(ProcessNode):
    """Answer crank angles with the legs' joint angles and feet."""

    def __init__(self, **options: Any) -> None:
        """Declare and validate the parameters; a StartError names a refused one."""
        super().__init__('solver_node', **options)
        self._leg_parameters = LegParameters(self)
        self._legs = self._leg_parameters.legs
        values = declare(self, PUBLISHED)
        self._messages = LegMessages(self, self._legs, values['frame_id'])
        joints = dict.fromkeys(leg.crank_joint for leg in self._legs)
        inputs = declare(self, INPUTS)
        self._inputs = CrankInputs(
            self, list(joints), inputs, self._solve_and_publish, self._reject
        )
        self._diagnostics = SolverDiagnostics(self, self._legs, self._inputs, values)
        self._markers = (
            LegMarkers(self, self._legs, values['frame_id']) if values['publish_markers'] else None
        )
        self._description = create_publisher(self, String, DESCRIPTION_TOPIC, LATCHED)
        self._description.publish(description_message(self))
        create_trigger(self, 'reset', self._on_reset)
        self.add_on_set_parameters_callback(self._validate)
        self.add_post_set_parameters_callback(self._apply)
        self._begin(f'{self._leg_parameters.summary}, turned by {self._inputs.summary}')

    def _begin(self, summary: str) -> None:
        self._inputs.subscribe()
        self.get_logger().info(f'ready: {summary}')

    def _solve_and_publish(self, cranks: Mapping[str, CrankInput], stamp: Stamp) -> None:
        answers = []
        for leg in self._legs:
            crank = cranks.get(leg.crank_joint)
            if crank is None:
                continue
            try:
                answers.append((leg, *leg.answer(*crank)))
            except CrankAngleError as error:
                self._warn(error)
            except KinematicsError as error:
                name = f'{leg.name}: ' if leg.name else ''
                self.get_logger().error(f'{name}{error}', throttle_duration_sec=LOG_PERIOD)
        if answers:
            self._messages.publish(answers, stamp)

    def _reject(self, error: KinematicsError) -> None:
        is_fault = not isinstance(error, NoFeedbackError)
        for leg in self._legs:
            leg.statistics.reject(str(error), is_fault=is_fault)
        if is_fault:
            self._warn(error)

    def _warn(self, error: KinematicsError) -> None:
        self.get_logger().warning(f'input rejected: {error}', throttle_duration_sec=LOG_PERIOD)

    def _validate(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        try:
            self._leg_parameters.changed(parameters)
        except GeometryError as error:
            return SetParametersResult(successful=False, reason=printable(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: Sequence[Parameter]) -> None:
        changed = self._leg_parameters.changed(parameters)
        for leg in self._legs:
            leg.leg = changed.get(leg.name, leg.leg)
        if changed:
            self._diagnostics.legs_changed()
            self._description.publish(description_message(self))
        if changed and self._markers:
            self._markers.legs_changed()

    def _on_reset(self) -> tuple[bool, str]:
        for leg in self._legs:
            leg.leg.reset()
        return True, 'the next pose starts from the closed form'


class ManagedSolverNode(LifecycleNodeMixin, SolverNode):
    """A solver that answers while it is active; its parameters are validated at the start."""

    def __init__(self, **options: Any) -> None:
        SolverNode.__init__(self, **options)
        LifecycleNodeMixin.__init__(self)

    def _begin(self, summary: str) -> None:
        self.get_logger().info(f'ready, unconfigured: {summary}, while it is active')

    def on_configure(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Do nothing: the parameters were validated at the start."""
        return self._log('configured')

    def on_activate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe."""
        self._inputs.subscribe()
        return self._log('activated: it answers')

    def on_deactivate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Unsubscribe."""
        self._inputs.unsubscribe()
        return self._log('deactivated: it does not listen')

    def on_cleanup(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Forget the warm starts."""
        self._on_reset()
        return self._log('cleaned up: unconfigured')

    def on_shutdown(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Unsubscribe."""
        self._inputs.unsubscribe()
        return self._log('shut down: it answers no more')

    def _log(self, text: str) -> TransitionCallbackReturn:
        self.get_logger().info(text)
        return TransitionCallbackReturn.SUCCESS


class SolverDiagnostics:
    """Publisher of a solver's diagnostics, by its parameters."""

    def __init__(
        self,
        node: Node,
        legs: Sequence[DrivenLeg],
        inputs: CrankInputs,
        parameters: Mapping[str, Any],
    ) -> None:
        self._node = node
        self._legs = legs
        self._inputs = inputs
        # A smaller one is a warning [rad].
        self._min_transmission_angle: float = parameters['min_transmission_angle']
        self._lost_reported = 0
        # Times of the last report, and of each leg's last input, on the steady clock [s].
        self._last_report = monotonic()
        self._last_inputs = [self._last_report] * len(legs)
        self._publisher = create_publisher(node, DiagnosticArray, '/diagnostics')
        self._types = TypeCheck(node, INPUT_TYPE_REMEDIES)
        self.legs_changed()
        create_steady_timer(node, parameters['diagnostics_period'], self._report)

    def legs_changed(self) -> None:
        """Let the next report find the arcs that the legs cannot reach."""
        self._missing_arcs: list[str] = []

    def _report(self) -> None:
        """Publish the state of each leg as diagnostics."""
        now = monotonic()
        lost = self._inputs.lost
        input_problem = _input_problem(lost - self._lost_reported, self._inputs.sources())
        # A search of a few milliseconds, so the first answer does not wait for it.
        if not self._missing_arcs:
            self._missing_arcs = [_missing_arcs(leg.leg.reachable_arcs()) for leg in self._legs]
        statuses = []
        for i, leg in enumerate(self._legs):
            if leg.statistics.inputs:
                # To the accuracy of a period, far less than STALE_AFTER.
                self._last_inputs[i] = now
            silence = now - self._last_inputs[i]
            verdict = self._level_and_message(leg.statistics, silence, input_problem)
            level, message = self._types.add_to(*verdict)
            text = '; '.join(filter(None, (message, self._missing_arcs[i])))
            values = _diagnostic_values(leg, self._inputs, now - self._last_report).items()
            name = leg.name or 'leg'
            statuses.append(diagnostic_status(self._node, name, level, text, values))
            leg.statistics.begin_report()
        self._publisher.publish(diagnostic_array(self._node, statuses))
        self._lost_reported = lost
        self._last_report = now

    def _level_and_message(
        self, statistics: SolverStatistics, silence: float, input_problem: str
    ) -> tuple[bytes, str]:
        if silence > STALE_AFTER:
            return DiagnosticStatus.STALE, f'no input for {silence:.1f} s'
        if statistics.failure:
            return DiagnosticStatus.ERROR, statistics.failure
        if statistics.rejection or input_problem:
            return DiagnosticStatus.WARN, statistics.rejection or input_problem
        if statistics.min_transmission_angle < self._min_transmission_angle:
            angle = degrees(statistics.min_transmission_angle)
            message = f'nearly singular: the links of a dyad are {angle:.1f} deg from in line'
            return DiagnosticStatus.WARN, message
        return DiagnosticStatus.OK, 'solving'


def _input_problem(lost: int, sources: str) -> str:
    """Return the inputs lost since the last report, and simultaneous publishers of the crank."""
    problems = []
    if lost:
        problems.append(f'{lost} {verb(lost, "input was", "inputs were")} lost')
    if sources:
        problems.append(f'the crank is turned by more than one: {sources}')
    return '; '.join(problems)


def _diagnostic_values(leg: DrivenLeg, inputs: CrankInputs, period: float) -> dict[str, object]:
    statistics = leg.statistics
    assembly = leg.leg.assembly
    values: dict[str, object] = {
        'solved': statistics.solved,
        'rejected': statistics.rejected,
        'failed': statistics.failed,
        'lost': inputs.lost,
        'out_of_order': inputs.out_of_order,
        'rate': f'{statistics.inputs / period:.3f}',
        'iterations': statistics.iterations,
        'residual': f'{statistics.residual:.3e}',
        'condition': f'{statistics.condition:.4g}',
    }
    for i, mu in enumerate(statistics.transmission_angles(len(assembly)), start=1):
        values[f'transmission_angle_{i}'] = f'{mu:.6f}'
    values['branch'] = ' '.join(f'{sign:+d}' for sign in assembly)
    return values


def _missing_arcs(arcs: Sequence[tuple[float, float]]) -> str:
    """Return the crank angles outside a leg's arcs in words; '' for a full turn."""
    if len(arcs) == 1 and arcs[0][1] - arcs[0][0] >= tau:
        return ''
    gaps = []
    for i, (_, gap_begin) in enumerate(arcs):
        gap_end = arcs[(i + 1) % len(arcs)][0]
        gaps.append(f'{degrees(gap_begin) % 360:.2f} .. {degrees(gap_end) % 360:.2f}')
    return f'the crank does not turn fully, it cannot reach {", ".join(gaps)} deg'


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = ArgumentParser(
        'solver_node',
        'Solve the Klann leg, or any linkage from a file: crank angle in (crank_angle, '
        'crank_state), pose out (joint_states, point_h, velocity_h).',
        _help_on_parameters(),
    )
    parser.add_argument('--lifecycle', action='store_true', help=LIFECYCLE_HELP)
    kind = ManagedSolverNode if arguments(parser, argv).lifecycle else SolverNode
    return run('solver_node', lambda _: kind(), argv, stop, raw=True)


def _help_on_parameters() -> str:
    groups = {
        'the leg, which can be changed while it runs': GEOMETRY,
        'legs and their cranks': [*LEGS, *drive()],
        'inputs': INPUTS,
        'solving': SETTINGS,
        'outputs': PUBLISHED,
        'each of several legs, LEG being its name in legs': [*drive('LEG.'), *place('LEG')],
    }
    geometry = ' '.join(f'LEG.{name}' for name in GEOMETRY_NAMES)
    return (
        f'{usage(groups)}\n{fill(geometry, 97, initial_indent="  ", subsequent_indent="  ")}:\n'
        f'    its own geometry; a missing value is that of all legs\n{QOS_USAGE}\n\n'
        'Service ~/reset (std_srvs/srv/Trigger): the next pose starts from the closed form.\n\n'
        'Presets are in share/klann_ros/config (sem104.yaml, patent.yaml). A linkage is a file,\n'
        'or a shipped name: -p linkage:=jansen.'
    )
