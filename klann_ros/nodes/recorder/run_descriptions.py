"""What every file of a run says of who made it: the recorder, and the solvers."""

from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
import os
import platform

from klann_ros import __version__
from klann_ros.log.run_parameters import (
    RECORDER_RECORD,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
)
from klann_ros.log.writing.writer import RunWriter
from rclpy.utilities import get_rmw_implementation_identifier
import yaml


def describe_recorder(run: RunWriter) -> None:
    """Write which versions of what record, and where."""
    run.add_metadata(
        RECORDER_RECORD,
        {
            'version': __version__,
            'host': platform.node(),
            'system': platform.platform(),
            'python': platform.python_version(),
            'ros_distro': os.environ.get('ROS_DISTRO', 'jazzy'),
            'rclpy': _version('rclpy'),
            'rmw': get_rmw_implementation_identifier(),
            'mcap': _version('mcap'),
            'started': datetime.now(timezone.utc).isoformat(),
        },
        in_every_file=True,
    )


def describe_solver(solver: SolverParameters, run: RunWriter) -> None:
    """Write a solver's parameters: as a record, and as the file that starts it so again."""
    name = f'{solver.node.strip("/").replace("/", "_")}.yaml'
    file = yaml.safe_dump({solver.node: {'ros__parameters': solver.parameters}}).encode()
    run.add_metadata(SOLVER_RECORD, solver_record(solver), in_every_file=True)
    run.attach(name, 'text/yaml', file, solver.time, in_every_file=True)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return 'unknown'
