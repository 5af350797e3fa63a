"""The diagnostics of a solver: one status a leg, at a steady rate."""

from collections.abc import Sequence
from math import degrees, tau

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from klann_ros.nodes.endpoints import create_publisher
from klann_ros.sanitize.text import verb
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from .crank_inputs import CrankInputs
from .driven_leg import DrivenLeg, SolverStatistics

# Inputs are stale after this time without one [s].
STALE_AFTER = 2.0


class SolverDiagnostics:
    """Publisher of a solver's diagnostics; a transmission angle below the minimum is a warning."""

    def __init__(
        self,
        node: Node,
        legs: Sequence[DrivenLeg],
        inputs: CrankInputs,
        *,
        period: float,
        min_transmission_angle: float,
    ) -> None:
        self._node, self._legs, self._inputs = node, legs, inputs
        self._min_transmission_angle = min_transmission_angle
        self._lost_reported = 0
        # Silence is measured on a clock that neither jumps nor stands still.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._last_report = self._steady.now()
        self._last_inputs = [self._last_report] * len(legs)
        self._publisher = create_publisher(node, DiagnosticArray, '/diagnostics')
        self.legs_changed()
        node.create_timer(period, self._report, clock=self._steady)

    def legs_changed(self) -> None:
        """Update the arcs that the legs cannot reach."""
        self._missing_arcs = [_missing_arcs(leg.leg.reachable_arcs()) for leg in self._legs]

    def _report(self) -> None:
        now = self._steady.now()
        lost = self._inputs.lost
        input_problem = _input_problem(lost - self._lost_reported, self._inputs.sources())
        period = (now - self._last_report).nanoseconds / 1e9
        array = DiagnosticArray()
        for i, leg in enumerate(self._legs):
            if leg.statistics.inputs:
                # To the accuracy of a period, far less than STALE_AFTER.
                self._last_inputs[i] = now
            silence = (now - self._last_inputs[i]).nanoseconds / 1e9
            level, message = self._level_and_message(leg.statistics, silence, input_problem)
            name = f'{self._node.get_name()}: {leg.name or "leg"}'
            status = DiagnosticStatus(
                level=level,
                name=name,
                message='; '.join(filter(None, (message, self._missing_arcs[i]))),
                hardware_id=name,
                values=[
                    KeyValue(key=key, value=str(value))
                    for key, value in _values(leg, self._inputs, period).items()
                ],
            )
            array.status.append(status)
            leg.statistics.begin_report()
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
        self._lost_reported, self._last_report = lost, now

    def _level_and_message(
        self, statistics: SolverStatistics, silence: float, input_problem: str
    ) -> tuple[bytes, str]:
        """Return the level and the most important message."""
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
    were = verb(lost, 'input was', 'inputs were')
    turned = f'the crank is turned by more than one: {sources}'
    return '; '.join([f'{lost} {were} lost'] * bool(lost) + [turned] * bool(sources))


def _values(leg: DrivenLeg, inputs: CrankInputs, period: float) -> dict[str, object]:
    statistics, assembly = leg.statistics, leg.leg.assembly
    angles = enumerate(statistics.transmission_angles(len(assembly)), start=1)
    return {
        'solved': statistics.solved,
        'rejected': statistics.rejected,
        'failed': statistics.failed,
        'lost': inputs.lost,
        'out_of_order': inputs.out_of_order,
        'rate': f'{statistics.inputs / period:.3f}',
        'iterations': statistics.iterations,
        'residual': f'{statistics.residual:.3e}',
        'condition': f'{statistics.condition:.4g}',
        **{f'transmission_angle_{i}': f'{mu:.6f}' for i, mu in angles},
        'branch': ' '.join(f'{sign:+d}' for sign in assembly),
    }


def _missing_arcs(arcs: Sequence[tuple[float, float]]) -> str:
    """Return the crank angles outside a leg's arcs in words; '' for a full turn."""
    ends = [(end, arcs[(i + 1) % len(arcs)][0]) for i, (_, end) in enumerate(arcs)]
    gaps = [f'{degrees(a) % 360:.2f} .. {degrees(b) % 360:.2f}' for a, b in ends]
    if len(arcs) == 1 and arcs[0][1] - arcs[0][0] >= tau:
        return ''
    return f'the crank does not turn fully, it cannot reach {", ".join(gaps)} deg'
