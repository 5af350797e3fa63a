"""One process, one node: from the command line to the exit code."""

import argparse
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from functools import partial
import gc
from importlib import import_module
import inspect
from itertools import chain, islice, pairwise
import sys
from types import FrameType, SimpleNamespace
from typing import Any, Protocol

from klann_ros.sanitize import yaml_text
from klann_ros.sanitize.files import NotRegularFileError, open_regular, read_regular
from klann_ros.sanitize.text import error_with_place, listed, printable, printable_line
from klann_ros.sanitize.units import report_unit_warnings
from klann_ros.stop_signals import StopSignals
import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from .endpoints import flush, LAST_TIMEOUT
from .parameters import MAX_NAME_LENGTH, overrides, prepare_sets, StartError, unknown_parameter
from .raw_executor import RawMessageExecutor

# Arguments for ROS before which users forget --ros-args.
_ROS_FLAGS = ('-p', '--param', '--params-file', '-r', '--remap', '--log-level', '-e', '--enclave')
# Errors of rclpy about a topic or its quality of service.
ROS_ERRORS = (NameValidationException, RCLError, RuntimeError, ValueError)
# Errors about a node, its parameters and its output too, which may be a full disk.
_START_ERRORS = (StartError, ParameterException, OSError, *ROS_ERRORS)
# ROS writes its log files there, and does not start where it cannot.
_LOG_FOLDER_REMEDY = 'set ROS_LOG_DIR (or HOME) to a folder that can be written'
# Help on the option `--lifecycle`.
LIFECYCLE_HELP = 'wait for configure and activate, as a managed node does'
# Period of repeated warnings and errors in the log [s].
LOG_PERIOD = 2.0
# Warnings about unused arguments, and names in one: a file may hold any number.
MAX_LINES = 10
_MAX_NAMES = 5
# A longer file is not checked [bytes]; one of six legs has 3000.
_MAX_FILE_SIZE = 50_000
# The modules of the nodes' parameters, such as PLAYER_PARAMETERS.
_DECLARATIONS = (
    *('player.controls', 'recorder.interface', 'walker.declarations', 'sim.declarations'),
    *('watchdog.node', 'commission.node', 'crank.motion', 'solver.declarations'),
)


class Finish(Protocol):
    """Ends the process, orderly, with an exit code; the first call counts."""

    def __call__(self, code: int = 0) -> None:
        """Request the end."""


class ProcessNode(Node):
    """A node with an orderly shutdown."""

    def close(self) -> int:
        """Shut down before anything is destroyed; return the exit code."""
        return 0

    def on_callback_error(self) -> None:
        """Stop what would go on if callbacks fail again and again."""


def arguments(parser: argparse.ArgumentParser, argv: Sequence[str]) -> argparse.Namespace:
    """Parse the arguments outside --ros-args."""
    program_arguments, _ = split(argv)
    options, unknown = parser.parse_known_args(program_arguments[1:])
    if unknown:
        parser.error(f'unrecognized arguments: {printable(" ".join(unknown))}{_hint(unknown)}')
    return options


def split(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """
    Return a command line's arguments for the program, and those for ROS: from --ros-args to --.

    ROS's own function would take every OLD:=NEW for a remapping, in an old syntax of its own.
    """
    program_arguments: list[str] = []
    ros_arguments: list[str] = []
    is_for_ros = False
    for argument in argv:
        is_for_ros = is_for_ros or argument == '--ros-args'
        (ros_arguments if is_for_ros else program_arguments).append(argument)
        is_for_ros = is_for_ros and argument != '--'
    return program_arguments, ros_arguments


def _hint(unknown: Sequence[str]) -> str:
    if any(argument in _ROS_FLAGS or ':=' in argument for argument in unknown):
        return '; arguments for ROS go behind --ros-args'
    if any(argument.endswith(('.yaml', '.yml')) for argument in unknown):
        return '; a parameter file is given as --ros-args --params-file FILE'
    return ''


def run(
    name: str,
    make_node: Callable[[Finish], Node],
    argv: Sequence[str],
    stop: StopSignals,
    *,
    raw: bool = False,
    batch_period: float = 0.0,
) -> int:
    """
    Run the node of an executable until a signal stops it, or it requests its end.

    `argv` begins with the program's name. `raw` runs the node by a RawMessageExecutor, for nodes
    driven by messages, with its `batch_period` [s]. The exit code is 0 after a signal, 1 for a
    node that cannot start, else the node's own.
    """
    # Made before the node, so that a signal during start-up is an orderly end as well.
    finished = Future()

    def finish(code: int = 0) -> None:
        if not finished.done():
            finished.set_result(code)

    _, ros_arguments = split(argv)
    _shorten_start()
    try:
        _init_ros(ros_arguments)
        stop.on_stop(finish)
        report_unit_warnings(lambda text: get_logger(name).warning(text))
        node = make_node(finish)
    except _START_ERRORS as error:
        print(f'{name}: {ros_error(error)}', file=sys.stderr)
        stop.limit_end(1)
        rclpy.try_shutdown()
        return 1
    executor = SingleThreadedExecutor()
    code = 1
    try:
        prepare_sets(node, name)
        for warning in unused_arguments(node, name, ros_arguments):
            node.get_logger().warning(warning)
        executor.add_node(node)
        # These objects stay: the garbage collector need not scan them again.
        gc.freeze()
        gc.enable()
        loop = RawMessageExecutor(executor, plain=not raw, batch_period=batch_period)
        spin_through_errors(partial(loop.spin_until_future_complete, finished), node)
        code = int(finished.result() or 0)
    finally:
        code = _close(node, code, stop)
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
        rclpy.try_shutdown()
    return code


def _close(node: Node, code: int, stop: StopSignals) -> int:
    """Shut down what the node does, and limit the rest of the end; return the exit code."""
    exit_code = 1
    try:
        # First: nothing may fail, or block, before a robot is stopped.
        closed = node.close() if isinstance(node, ProcessNode) else 0
        exit_code = code or closed
    finally:
        stop.limit_end(exit_code)
    # Discovery may overtake messages: a subscriber ignores what comes after its publisher's end.
    flush(node.publishers, LAST_TIMEOUT)
    return exit_code


def _shorten_start() -> None:
    """
    Omit work of rclpy that no node needs, and that takes as long as the imports of a node.

    Where rclpy's modules are not as expected, they are left as they are.
    """
    # Messages need one function of this package, which also loads the generator of their code,
    # with its parser and its template engine, if it can.
    generator = 'rosidl_generator_py.generate_py_impl'
    if generator not in sys.modules:
        sys.modules[generator] = None  # type: ignore[assignment]
        with suppress(ImportError):
            import_module('rosidl_generator_py')
        del sys.modules[generator]
    # The first line of a log would read the sources of all modules, for the lines around its call.
    logger_module = sys.modules.get('rclpy.impl.rcutils_logger')
    if getattr(logger_module, 'inspect', None) is inspect:
        names = {**vars(inspect), 'getframeinfo': _frame_without_source}
        logger_module.inspect = SimpleNamespace(**names)  # type: ignore[union-attr]


def _frame_without_source(frame: FrameType, context: int = 0) -> inspect.Traceback:
    return inspect.getframeinfo(frame, context)


def _init_ros(ros_arguments: Sequence[str]) -> None:
    """Initialize ROS; a StartError names a refused argument, or the remedy."""
    _check_params_files(ros_arguments)
    try:
        # StopSignals handles them.
        rclpy.init(args=ros_arguments, signal_handler_options=SignalHandlerOptions.NO)
    except UnknownROSArgsError as error:
        usual = '-p NAME:=VALUE, --params-file FILE, -r OLD:=NEW, --log-level LEVEL'
        raise StartError(f'unknown arguments for ROS {error}; it takes {usual}') from error
    except _START_ERRORS as error:
        if 'initialize logging' not in str(error):
            raise
        raise StartError(f'{ros_error(error)}; {_LOG_FOLDER_REMEDY}') from error


def parameter_files(arguments: Sequence[str]) -> list[str]:
    """Return the parameter files that are named in a command line."""
    return _values_of_flags(arguments, '--params-file')


def _check_params_files(arguments: Sequence[str]) -> None:
    """Refuse special files: for a pipe without a writer ROS blocks and ignores every signal."""
    for file in parameter_files(arguments):
        # A shell's process substitution, as in `--params-file <(...)`, has a writer.
        if file.startswith(('/dev/fd/', '/proc/self/fd/')):
            continue
        try:
            open_regular(file).close()
        except NotRegularFileError as error:
            raise StartError(f'{printable(file)} cannot be read: {error.strerror}') from error
        except (OSError, ValueError):
            continue  # ROS reports it


def ros_error(error: Exception) -> str:
    """Return an error's text on one line, without the places in ROS's C sources."""
    return printable_line(error).partition(', at /')[0]


def spin_through_errors(spin: Callable[[], None], node: Node) -> None:
    """
    Spin until `spin` returns; an error of a callback is logged, and does not end it.

    rclpy itself raises for messages of any sender: a parameter of an unknown type, a clock before
    1970. No message may end a node that turns a leg or records a run.
    """
    while True:
        try:
            spin()
        except ExternalShutdownException:  # noqa: PERF203, RUF100 - an error is rare
            raise
        except Exception as error:
            text = f'a callback failed, and the node goes on: {error_with_place(error)}'
            node.get_logger().error(text, throttle_duration_sec=LOG_PERIOD)
            if isinstance(node, ProcessNode):
                node.on_callback_error()
        else:
            return


def unused_arguments(node: Node, executable: str, arguments: Sequence[str]) -> list[str]:
    """
    Return a line for each argument behind --ros-args that has no effect on a node.

    The node has declared all of its parameters. Nodes may share a parameter file, so a parameter
    of another node of this package is no mistake in a file; behind `-p` it is one.
    """
    rules = _values_of_flags(arguments, '-p', '--param')
    files = parameter_files(arguments)
    unknown_parameters = _unknown_parameters(node, executable, rules)
    unused_rules = chain(_rules_for_others(node, rules), _unused_files(node, files))
    lines = [*islice(chain(unknown_parameters, unused_rules), MAX_LINES + 1)]
    return lines if len(lines) <= MAX_LINES else [*lines[:MAX_LINES], '... and more of the kind']


def _values_of_flags(arguments: Sequence[str], *flags: str) -> list[str]:
    return [argument for flag, argument in pairwise(arguments) if flag in flags]


def _unknown_parameters(node: Node, executable: str, rules: Sequence[str]) -> Iterator[str]:
    """Yield a line for each name, or each leg, that the node does not know."""
    unknown_names = sorted(name for name in overrides(node) if not node.has_parameter(name))
    if not unknown_names:
        return
    declared_names = node.list_parameters([], 0).names
    families = {name.partition('.')[0] for name in declared_names if '.' in name}
    typed_names = {rule.partition(':=')[0].rpartition(':')[2] for rule in rules}
    package = _PackageParameters()
    unknown_families: dict[str, list[str]] = {}
    for name in unknown_names:
        family, dot, _ = name.partition('.')
        if name not in typed_names and package.may_share(name, declared_names):
            continue
        if dot and family not in families:
            unknown_families.setdefault(family, []).append(name)
        elif name in package.owners:
            yield f"parameter {name} is none of {executable}'s; it is {package.owners[name]}'s"
        else:
            yield unknown_parameter(name, executable, declared_names)
    for family, members in unknown_families.items():
        reason = ''
        if 'legs' in declared_names:
            reason = f': {printable(family, MAX_NAME_LENGTH)} is not in legs'
        yield f"{listed(members, _MAX_NAMES)}: none of {executable}'s parameters{reason}"


def _rules_for_others(node: Node, rules: Sequence[str]) -> Iterator[str]:
    """Yield a line for each `-p NODE:NAME:=VALUE` for a node of another name."""
    for rule in rules:
        node_name, _, name = rule.partition(':=')[0].rpartition(':')
        if node_name and name not in overrides(node):
            full_name = node.get_fully_qualified_name()
            yield f'-p {printable(rule, MAX_NAME_LENGTH)} is not for {full_name}'


def _unused_files(node: Node, files: Sequence[str]) -> Iterator[str]:
    """Yield a line for each parameter file for nodes of other names, or without parameters."""
    for file in files:
        try:
            content = yaml_text.load(read_regular(file, _MAX_FILE_SIZE))
        except (OSError, ValueError):
            continue  # ROS has read it all the same
        names = set(_parameter_names(content))
        if not names:
            yield f'{printable(file)} holds no parameters (NODE: ros__parameters: NAME: VALUE)'
        elif names.isdisjoint(overrides(node)):
            full_name = node.get_fully_qualified_name()
            sections = listed(content, _MAX_NAMES)
            yield f'{printable(file)} has nothing for {full_name}; it is for {sections}'


def _parameter_names(content: Any, prefix: str | None = None) -> Iterator[str]:
    """Yield the names of all nodes' parameters in a file; `prefix`: within a node's section."""
    for key, branch in content.items() if isinstance(content, dict) else ():
        if prefix is None:
            yield from _parameter_names(branch, '' if key == 'ros__parameters' else None)
        elif isinstance(branch, dict):
            yield from _parameter_names(branch, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}'


class _PackageParameters:
    """The parameters of all nodes of this package, imported only after a mistake."""

    def __init__(self) -> None:
        from klann_ros.robot import OF_CRANK  # noqa: PLC0415

        from .leg_declarations import FOR_OTHERS, OF_LEG  # noqa: PLC0415
        from .recorder.interface import TOPICS  # noqa: PLC0415

        # The node of each parameter.
        self.owners: dict[str, str] = {}
        for module_name in _DECLARATIONS:
            folder = module_name.partition('.')[0]
            module = import_module(f'{__package__}.{module_name}')
            for declaration in getattr(module, f'{folder.upper()}_PARAMETERS'):
                self.owners[declaration.name] = f'{folder}_node'
        self._of_legs = OF_LEG
        self._for_others = {*FOR_OTHERS, *OF_CRANK}
        self._topics = {topic.rpartition('/')[2] for topic in TOPICS}

    def may_share(self, name: str, declared_names: Collection[str]) -> bool:
        """Return whether a file may hold a name for another node than one with these names."""
        family, _, last = name.rpartition('.')
        if family.startswith('qos_overrides./'):
            is_foreign = not any(n.startswith(f'{family}.') for n in declared_names)
            return is_foreign and family.rpartition('.')[0].rpartition('/')[2] in self._topics
        if family and 'legs' not in declared_names and last in self._of_legs:
            return True
        return name in self.owners or last in self._for_others
