"""The diagnostics of a solver: one status a leg, at a steady rate."""

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticArray
from klann_ros.nodes import qos_overrides
from klann_ros.nodes.qos import OUTPUT
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from . import diagnostics
from .crank_inputs import CrankInputs
from .solved_leg import SolvedLeg


class SolverReports:
    """
    Publisher of a solver's diagnostics.

    Parameters
    ----------
    node : rclpy.node.Node
        Who publishes.
    legs : sequence of SolvedLeg
        The legs.
    inputs : CrankInputs
        What turns them.
    period : float
        Time between diagnostics [s].
    min_transmission_angle : float
        Below this a leg is worth a warning [rad].

    """

    def __init__(
        self,
        node: Node,
        legs: Sequence[SolvedLeg],
        inputs: CrankInputs,
        *,
        period: float,
        min_transmission_angle: float,
    ) -> None:
        """Start the timer."""
        self._node, self._legs, self._inputs = node, legs, inputs
        self._min_transmission_angle = min_transmission_angle
        self._lost_reported = 0
        # Silence is measured on a clock that neither jumps nor stands still.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._last_report = self._steady.now()
        self._last_inputs = [self._last_report] * len(legs)
        profile = qos_overrides.of_publisher(node, '/diagnostics', OUTPUT)
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', profile)
        self.legs_changed()
        node.create_timer(period, self._report, clock=self._steady)

    def legs_changed(self) -> None:
        """Say anew which crank angles the legs cannot take."""
        self._notes = [diagnostics.missing_arcs(leg.leg.reachable_arcs()) for leg in self._legs]

    def _report(self) -> None:
        now = self._steady.now()
        lost, sources = self._inputs.lost, self._inputs.sources()
        array = DiagnosticArray()
        for i, leg in enumerate(self._legs):
            if leg.figures.inputs:
                # Known to a period only, which is far less than what counts as silence.
                self._last_inputs[i] = now
            status = diagnostics.status(
                f'{self._node.get_name()}: {leg.mounting.name or "leg"}',
                leg.figures,
                lost=lost,
                lost_now=lost - self._lost_reported,
                out_of_order=self._inputs.out_of_order,
                period=(now - self._last_report).nanoseconds / 1e9,
                silence=(now - self._last_inputs[i]).nanoseconds / 1e9,
                min_transmission_angle=self._min_transmission_angle,
                assembly=leg.leg.assembly,
                sources=sources,
                note=self._notes[i],
            )
            array.status.append(status)
            leg.figures.reported()
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
        self._lost_reported, self._last_report = lost, now
