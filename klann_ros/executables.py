# PYTHON_ARGCOMPLETE_OK
"""
The console scripts, which `ros2 run klann_ros NAME` starts.

The signals are handled before any slow import, so that Ctrl-C ends even a starting process without
a traceback; a machine without ROS gets one line, not a traceback.
"""

from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
import errno
from functools import partial
import gc
from importlib import import_module
from io import StringIO, TextIOWrapper
import os
import re
import signal
import sys
from typing import NoReturn
import warnings

from .missing_package import DISTRIBUTIONS, install_command

# The matrices of a linkage are small: threads of BLAS that wait for one another cost a fit five
# times its CPU on a busy machine. NumPy, imported later, reads this; workers inherit it.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

_INTERRUPTED = 130
# A tool's exit code if a required package is not installed: nothing could be read.
_MISSING_PACKAGE = 2


def _run_node(name: str, *, uses_terminal: bool = False) -> int:
    if sys.platform == 'win32':
        print(f'{name}: nodes run on Linux only, on Windows in its WSL', file=sys.stderr)
        return 1
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which waits for StopSignals
    from .stop_signals import StopSignals  # noqa: PLC0415 - Windows has no such signals

    stop = StopSignals(uses_terminal=uses_terminal)
    # Nothing of a start is garbage; `process.run` enables it again.
    gc.disable()
    folder = name.removesuffix('_node')
    try:
        module = import_module(f'klann_ros.nodes.{folder}.node')
        return int(module.main(sys.argv, stop))
    except ModuleNotFoundError as error:
        _report_missing(name, error)
        return 1


def _report_missing(name: str, error: ModuleNotFoundError) -> None:
    """Print the remedy for a package that is not installed; raise the error if it is ours."""
    package = (error.name or '').partition('.')[0]
    if package in ('', 'klann_ros'):
        raise error
    extras = _extras_with(DISTRIBUTIONS.get(package, package))
    extra = name if name in extras else ''.join(extras[:1])
    remedy = install_command(package, extra)
    print(f'{name}: there is no Python module {package} here: {remedy}', file=sys.stderr)


def _extras_with(distribution: str) -> list[str]:
    """Return the extras of this package that install another one."""
    # Only where a package is missing: it takes as long as all else of a start.
    from importlib import metadata  # noqa: PLC0415

    try:
        requirements = metadata.requires('klann_ros') or ()
    except metadata.PackageNotFoundError:
        return []
    pattern = re.compile(rf'{re.escape(distribution)}\b.*extra == .(\w+)', re.IGNORECASE)
    matches = filter(None, map(pattern.match, requirements))
    return [match[1] for match in matches if match[1] not in {'all', 'test'}]


def _run_tool(name: str, module: str, report_failed: int) -> int:
    """
    Run a command, then print its report.

    A reader that ends early (`review RUN | head -1`) is no fault; after a full disk the exit code
    is `report_failed`.
    """
    report = StringIO()
    # Unfinished files are removed as by Ctrl-C; workers end by the default action.
    signal.signal(signal.SIGTERM, _terminate)
    if sys.platform != 'win32':
        os.register_at_fork(after_in_child=partial(signal.signal, signal.SIGTERM, signal.SIG_DFL))
    if isinstance(sys.stdout, TextIOWrapper):
        # Letters that the terminal cannot show become their numbers.
        sys.stdout.reconfigure(errors='backslashreplace')
    try:
        try:
            with redirect_stdout(report):
                code = _run_command(name, module)
        except ModuleNotFoundError as error:
            _report_missing(name, error)
            return _MISSING_PACKAGE
        except Exception:
            # Our own fault: print the report up to it.
            _print_report(name, report.getvalue())
            raise
        return code if _print_report(name, report.getvalue()) else report_failed
    except KeyboardInterrupt:
        # A second one would interrupt the interpreter's shutdown, with a traceback.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        _drop_output()
        return _INTERRUPTED


def _terminate(number: int, _: object) -> NoReturn:
    # A second one ends it at once.
    signal.signal(number, signal.SIG_DFL)
    raise SystemExit(128 + number)


def _run_command(name: str, module: str) -> int:
    """Import the module of a command and run it; return its exit code."""
    try:
        with _uninterrupted():
            command = import_module(module)
            from .sanitize.units import report_unit_warnings  # noqa: PLC0415 - a slow import
        # A report shows what overflows as infinite.
        warnings.simplefilter('ignore', RuntimeWarning)
        report_unit_warnings(lambda text: print(f'{name}: warning: {text}', file=sys.stderr))
        code = int(command.main())
    except SystemExit as request:
        # Of argparse (--help, --version, refusals) or of SIGTERM: a number, or None.
        return int(request.code or 0)
    if code == _INTERRUPTED:
        # The command has ended in order; its caller reacts as to any interrupt.
        raise KeyboardInterrupt
    return code


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Defer Ctrl-C: extension modules turn it into a traceback during their import."""
    if sys.platform == 'win32':  # where it can only be ignored
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
        yield
        signal.signal(signal.SIGINT, handler)
        return
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def _print_report(name: str, report: str) -> bool:
    """Print a report; return False only if it could not be written."""
    try:
        print(report, end='', flush=True)
    except BrokenPipeError:
        _drop_output()
    except OSError as error:
        _drop_output()
        if sys.platform == 'win32' and error.errno == errno.EINVAL:
            return True  # a closed pipe
        print(f'{name}: the report cannot be written: {error.strerror}', file=sys.stderr)
        return False
    return True


def _drop_output() -> None:
    """Discard buffered output, which the interpreter would flush at exit."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)


solver_node = partial(_run_node, 'solver_node')
crank_node = partial(_run_node, 'crank_node')
drive = partial(_run_node, 'drive')
commission_node = partial(_run_node, 'commission_node', uses_terminal=True)
walker_node = partial(_run_node, 'walker_node')
recorder_node = partial(_run_node, 'recorder_node')
player_node = partial(_run_node, 'player_node', uses_terminal=True)
view_node = partial(_run_node, 'view_node')
sim_node = partial(_run_node, 'sim_node')
watchdog_node = partial(_run_node, 'watchdog_node')
review = partial(_run_tool, 'review', 'klann_ros.review.command', report_failed=3)
recover = partial(_run_tool, 'recover', 'klann_ros.log.recover_command', report_failed=1)
export = partial(_run_tool, 'export', 'klann_ros.export.command', report_failed=3)
describe = partial(_run_tool, 'describe', 'klann_ros.datasheet.command', report_failed=3)
calibrate = partial(_run_tool, 'calibrate', 'klann_ros.calibration.command', report_failed=3)
exercise = partial(_run_tool, 'exercise', 'klann_ros.exercises.command', report_failed=3)
design = partial(_run_tool, 'design', 'klann_ros.design.command', report_failed=3)
import_linkage = partial(
    _run_tool, 'import_linkage', 'klann_ros.importing.command', report_failed=3
)
