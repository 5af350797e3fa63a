"""`solver_node`: a node that answers at once, or one that is managed (`--lifecycle`)."""

from collections.abc import Sequence
from typing import Any

from klann_ros.stop_signals import StopSignals
from rclpy.node import Node

from .process import arguments, command_line, Finish, run
from .solver import Solver


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
        Solver(self).listen()


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
    parser.add_argument(
        '--lifecycle',
        action='store_true',
        help='wait for configure and activate, as a managed node does',
    )
    make = _make_managed if arguments(parser, argv).lifecycle else _make
    return run('solver_node', make, argv, stop, lean=True)


def _make(_: Finish) -> SolverNode:
    return SolverNode()


def _make_managed(_: Finish) -> Node:
    # It takes a tenth of a second to load, which others need not wait for.
    from .managed_solver_node import ManagedSolverNode  # noqa: PLC0415

    return ManagedSolverNode()
