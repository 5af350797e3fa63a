"""
The console scripts: what `ros2 run klann_ros NAME` starts.

Nothing heavy is imported before the signals are in hand, so that Ctrl-C ends even a process that
is still starting without a traceback; and a machine without ROS gets one line, not a traceback.
"""

from importlib import import_module
import sys

from .stop_signals import StopSignals


def solver_node() -> int:
    """Crank angle in, leg pose out."""
    return _node('solver_node')


def crank_node() -> int:
    """Drives the crank."""
    return _node('crank_node')


def recorder_node() -> int:
    """Leg topics in, crash-safe MCAP run out."""
    return _node('recorder_node')


def player_node() -> int:
    """Plays an MCAP run back onto topics."""
    return _node('player_node')


def review() -> int:
    """Tell what happened in a run, and whether it can be trusted."""
    return _tool('klann_ros.review.command')


def recover() -> int:
    """Make a readable run out of a damaged one."""
    return _tool('klann_ros.log.recover_command')


def _node(name: str) -> int:
    stop = StopSignals()
    try:
        module = import_module(f'klann_ros.nodes.{name}')
    except ModuleNotFoundError as error:
        if (error.name or '').startswith('klann_ros'):
            raise
        print(
            f'{name}: there is no Python module {error.name} here: source ROS 2 '
            f"(/opt/ros/jazzy/setup.bash), or pip install 'klann_ros[ros]'",
            file=sys.stderr,
        )
        return 1
    return int(module.main(sys.argv, stop))


def _tool(module: str) -> int:
    try:
        return int(import_module(module).main())
    except KeyboardInterrupt:
        return 130
