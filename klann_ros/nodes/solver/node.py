"""`solver_node`: a node that answers crank angles at once; `--lifecycle`: see `managed_node`."""

from collections.abc import Sequence
from textwrap import fill
from typing import Any

from klann_ros.cli import ArgumentParser
from klann_ros.nodes.endpoints import QOS_USAGE
from klann_ros.nodes.leg_declarations import drive, GEOMETRY, GEOMETRY_NAMES, LEGS, place
from klann_ros.nodes.parameters import usage
from klann_ros.nodes.process import arguments, LIFECYCLE_HELP, run
from klann_ros.stop_signals import StopSignals
from rclpy.node import Node

from .declarations import INPUTS, PUBLISHED, SETTINGS
from .solver import Solver


class SolverNode(Node):
    """A solver that answers at once."""

    def __init__(self, **options: Any) -> None:
        super().__init__('solver_node', **options)
        solver = Solver(self)
        solver.inputs.subscribe()
        self.get_logger().info(f'ready: {solver.summary}')


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = ArgumentParser(
        'solver_node',
        'Solve the Klann leg, or any linkage from a file: crank angle in (crank_angle, '
        'crank_state), pose out (joint_states, point_h, velocity_h).',
        _help_on_parameters(),
    )
    parser.add_argument('--lifecycle', action='store_true', help=LIFECYCLE_HELP)
    kind: type[Node] = SolverNode
    if arguments(parser, argv).lifecycle:
        from .managed_node import ManagedSolverNode as kind  # noqa: N813, PLC0415 - it is rare
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
