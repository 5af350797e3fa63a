"""`solver_node`: a node that answers at once, or one that is managed (`--lifecycle`)."""

from collections.abc import Sequence
from textwrap import fill
from typing import Any

from klann_ros.nodes.endpoints import QOS_USAGE
from klann_ros.nodes.parameters import usage
from klann_ros.nodes.process import arguments, command_line, Finish, run
from klann_ros.stop_signals import StopSignals
from rclpy.node import Node

from .declarations import drive, GEOMETRY, GEOMETRY_NAMES, LEGS, place, PUBLISHED, SETTINGS
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
        solver = Solver(self)
        solver.listen()
        self.get_logger().info(f'ready: {solver.summary}')


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = command_line(
        'solver_node',
        'Solve the Klann leg, or any linkage from a file: crank angle in (crank_angle, '
        'crank_state), pose out (joint_states, point_h, velocity_h).',
        help_on_parameters(),
    )
    parser.add_argument(
        '--lifecycle',
        action='store_true',
        help='wait for configure and activate, as a managed node does',
    )
    make = _make_managed if arguments(parser, argv).lifecycle else _make
    return run('solver_node', make, argv, stop, lean=True)


def help_on_parameters() -> str:
    """Return the part of the help that tells the parameters."""
    groups = {
        'the leg, which can be changed while it runs': GEOMETRY,
        'which legs, and what turns them': [*LEGS, *drive()],
        'solving': SETTINGS,
        'what is published': PUBLISHED,
        'each of several legs, LEG being its name in legs': [*drive('LEG.'), *place('LEG')],
    }
    geometry = ' '.join(f'LEG.{name}' for name in GEOMETRY_NAMES)
    return (
        f'{usage(groups)}\n{fill(geometry, 97, initial_indent="  ", subsequent_indent="  ")}:\n'
        f'    its own geometry; what is not given is that of all legs\n{QOS_USAGE}\n\n'
        'Service ~/reset (std_srvs/srv/Trigger): the next pose starts from the closed form.\n\n'
        'Presets are in share/klann_ros/config (sem104.yaml, patent.yaml), linkages in\n'
        'share/klann_ros/linkages (jansen.yaml, ...): -p linkage:=FILE.'
    )


def _make(_: Finish) -> SolverNode:
    return SolverNode()


def _make_managed(_: Finish) -> Node:
    # It takes a tenth of a second to load, which others need not wait for.
    from .managed_node import ManagedSolverNode  # noqa: PLC0415

    return ManagedSolverNode()
