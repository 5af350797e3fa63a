# PYTHON_ARGCOMPLETE_OK
"""
The console scripts: what `ros2 run klann_ros NAME` starts.

Nothing heavy is imported before the signals are in hand, so that Ctrl-C ends even a process that
is still starting without a traceback; and a machine without ROS gets one line, not a traceback.
"""

from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from importlib import import_module
from io import StringIO, TextIOWrapper
import os
import signal
import sys

from .sanitize.units import report_unit_warnings
from .stop_signals import StopSignals

INTERRUPTED = 130
# A tool's exit code where a package that it needs is not installed: nothing could be read.
MISSING = 2
# Distributions on PyPI whose name is not that of their module.
DISTRIBUTIONS = {'mcap_ros2': 'mcap-ros2-support', 'yaml': 'PyYAML'}


def solver_node() -> int:
    """Crank angle in, leg pose out."""
    return _node('solver_node')


def crank_node() -> int:
    """Drives the crank."""
    return _node('crank_node')


def walker_node() -> int:
    """Take cmd_vel to the cranks of a walker, and give odom back."""
    return _node('walker_node')


def recorder_node() -> int:
    """Leg topics in, crash-safe MCAP run out."""
    return _node('recorder_node')


def player_node() -> int:
    """Plays an MCAP run back onto topics."""
    return _node('player_node', uses_terminal=True)


def view_node() -> int:
    """Show legs in a browser, live, and let them be driven."""
    return _node('view_node')


def sim_node() -> int:
    """Simulate the robot; no hardware needed."""
    return _node('sim_node')


def review() -> int:
    """Report what happened in a run, and whether it can be trusted."""
    return _tool('review', 'klann_ros.review.command', report_failed=3)


def recover() -> int:
    """Make a readable run out of a damaged one."""
    return _tool('recover', 'klann_ros.log.recover_command', report_failed=1)


def export() -> int:
    """Write a robot as MJCF, URDF, SVG and DXF."""
    return _tool('export', 'klann_ros.export.command', report_failed=3)


def describe() -> int:
    """Write the data sheet of a robot before it is built."""
    return _tool('describe', 'klann_ros.datasheet.command', report_failed=3)


def _node(name: str, *, uses_terminal: bool = False) -> int:
    stop = StopSignals(uses_terminal=uses_terminal)
    room = name.removesuffix('_node')
    try:
        module = import_module(f'klann_ros.nodes.{room}.node')
    except ModuleNotFoundError as error:
        _report_missing(name, error)
        return 1
    return int(module.main(sys.argv, stop))


def _report_missing(name: str, error: ModuleNotFoundError) -> None:
    """Print the remedy for a package that is not installed; raise the error if it is ours."""
    package = (error.name or '').partition('.')[0]
    if package in ('', 'klann_ros'):
        raise error
    remedy = f'pip install {DISTRIBUTIONS.get(package, package)}'
    if package.startswith('rcl') or package.endswith(('_msgs', '_srvs', '_interfaces')):
        remedy = "source ROS 2 (/opt/ros/jazzy/setup.bash), or pip install 'klann_ros[ros]'"
    print(f'{name}: there is no Python module {package} here: {remedy}', file=sys.stderr)


def _tool(name: str, module: str, report_failed: int) -> int:
    """
    Run a command; its exit code is known before anything of its report can fail to arrive.

    A reader that goes away early (`review RUN | head -1`) is no fault, a full disk is one: then
    the exit code is `report_failed`.
    """
    report = StringIO()
    if isinstance(sys.stdout, TextIOWrapper):
        # A terminal without a letter that is in a log shows its number.
        sys.stdout.reconfigure(errors='backslashreplace')
    try:
        try:
            with redirect_stdout(report):
                code = _exit_code(name, module)
        except ModuleNotFoundError as error:
            _report_missing(name, error)
            return MISSING
        except Exception:
            # A fault of ours; the report up to it may still help.
            _print_report(name, report.getvalue())
            raise
        return code if _print_report(name, report.getvalue()) else report_failed
    except KeyboardInterrupt:
        # One is enough: a second would interrupt the interpreter's own end, with noise.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        _drop_output()
        return INTERRUPTED


def _exit_code(name: str, module: str) -> int:
    try:
        with _uninterrupted():
            command = import_module(module)
        report_unit_warnings(lambda text: print(f'{name}: warning: {text}', file=sys.stderr))
        code = int(command.main())
    except SystemExit as end:
        # argparse: --help, --version, and what it refuses.
        return int(end.code or 0)
    if code == INTERRUPTED:
        # It has put things in order by itself; the rest is as for any other interrupt.
        raise KeyboardInterrupt
    return code


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Defer Ctrl-C: extension modules turn it into a traceback during their import."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def _print_report(name: str, report: str) -> bool:
    """Print a report; return whether it arrived, or its reader has gone."""
    try:
        print(report, end='', flush=True)
    except BrokenPipeError:
        _drop_output()
    except OSError as error:
        _drop_output()
        print(f'{name}: the report cannot be written: {error.strerror}', file=sys.stderr)
        return False
    return True


def _drop_output() -> None:
    """Discard buffered output, which the interpreter would flush at exit."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)
