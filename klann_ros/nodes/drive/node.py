"""`drive`: moves cranks and walkers by hand, sends messages, triggers services, shows topics."""

from argparse import ArgumentTypeError, Namespace
from collections.abc import Callable, Generator, Mapping, Sequence
from functools import partial
from inspect import signature
from math import isfinite
import os
import struct
import sys
from time import monotonic
from typing import Any

from klann_ros.cli import ArgumentParser, NOT_READ, number_type, print_error, SECONDS
from klann_ros.log import definition
from klann_ros.messages import ANGLE_TYPES, MessageType, parse_definition, TWIST, TWIST_STAMPED
from klann_ros.nodes import endpoints
from klann_ros.nodes.crank_output import standstill
from klann_ros.nodes.process import arguments, Finish, ProcessNode, ros_error, run
from klann_ros.sanitize import yaml_text
from klann_ros.sanitize.quantity import read_quantity
from klann_ros.sanitize.text import listed, printable
from klann_ros.stop_signals import StopSignals
from rclpy._rclpy_pybind11 import RCLError
from rclpy.exceptions import NameValidationException
from rclpy.qos import qos_profile_best_available
from std_srvs.srv import Trigger

# Period of steps and messages, time of discovery, timeout of a wait, time without --for [s].
PERIOD = 0.05
DISCOVERY_TIME = 0.7
TIMEOUT = 5.0
DURATION = 5.0
JOINT_STATE = 'sensor_msgs/msg/JointState'
EXAMPLES = """\
examples:
  drive list                               topics, types, nodes; list odom: some
  drive echo joint_states --once           the next message; a latched one too
  drive hz crank_state                     messages a second
  drive crank 60deg                        an angle, to a solver
  drive crank left_crank=0.5rad/s --for 3  a rate, to the driver of a motor
  drive walk 0.05 --turn 10deg/s --for 5   a velocity, to a walker
  drive pub crank_state '{data: 408}'      any message, in the type that the listening node takes
  drive call walker_node/reset_fault       a service without arguments
in a namespace: drive list --ros-args -r __ns:=/left"""
Steps = Generator[None, None, Any]
# Errors of an argument; all others are those of the nodes that run.
_REFUSALS = (ArgumentTypeError, NameValidationException, yaml_text.YamlError)


class DriveNode(ProcessNode):
    """Take the steps of a command one by one; their `finally` stops what they have moved."""

    def __init__(self, options: Namespace, finish: Finish, **node_options: Any) -> None:
        """Begin."""
        super().__init__(f'drive_{os.getpid()}', enable_rosout=False, **node_options)
        self.options = options
        self._finish = finish
        self._steps = COMMANDS[options.command](self, *options.words)
        endpoints.create_steady_timer(self, PERIOD, self._step)

    def close(self) -> int:
        """Stop what was moved."""
        self._steps.close()
        return 0

    def _step(self) -> None:
        try:
            next(self._steps)
        except StopIteration as end:
            self._finish(end.value or 0)
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            self._finish()
        except Exception as error:
            print_error('drive', ros_error(error))
            self._finish(NOT_READ if isinstance(error, _REFUSALS) else 1)


def _pause(duration: float) -> Steps:
    end_time = monotonic() + duration
    while monotonic() < end_time:
        yield


def _await(condition: Callable[[], Any], problem: str) -> Steps:
    """Wait until a condition holds; raise a ValueError with the problem after TIMEOUT."""
    end_time = monotonic() + TIMEOUT
    while not condition():
        if monotonic() > end_time:
            raise ValueError(f'{problem}; drive list shows what this ROS_DOMAIN_ID has')
        yield


def _find(node: DriveNode, topic: str, role: str) -> Steps:
    """Wait for 'publishers' or 'subscriptions'; return their full topic, class and fields."""
    try:
        topic = node.resolve_topic_name(topic)
    except RCLError as error:
        raise ArgumentTypeError(ros_error(error)) from error
    find = getattr(node, f'get_{role}_info_by_topic')
    yield from _await(partial(find, topic), f'{topic} has no {role}')
    yield from _pause(DISCOVERY_TIME)
    type_names = sorted({endpoint.topic_type for endpoint in find(topic)})
    if len(type_names) != 1:
        raise ValueError(f'{topic} has several types: {listed(type_names)}')
    (type_name,) = type_names
    kind = endpoints.message_class(type_name)
    definitions = parse_definition(definition(type_name), 'ros2msg')
    return topic, kind, MessageType(type_name.replace('/msg/', '/'), definitions)


def _send(node: DriveNode, topic: str, contents: Mapping[str, Any]) -> Steps:
    """Publish fields, by the type that is taken ('': any), for a time, or once; then zero."""
    topic, kind, message_type = yield from _find(node, topic, 'subscriptions')
    fields = contents.get(message_type.name, contents.get(''))
    if fields is None:
        raise ValueError(f'{topic} is taken as {message_type.name}, not as {listed(contents)}')
    message = partial(_message, node, message_type, fields)
    moves = standstill(topic, kind, message()) is not None
    publisher = endpoints.create_publisher(node, kind, topic)
    yield from _pause(DISCOVERY_TIME)
    end_time = monotonic() + (node.options.duration or DURATION * moves)
    is_sent = False
    try:
        while not is_sent or monotonic() < end_time:
            if rivals := endpoints.other_publishers(node, topic) - {''}:
                raise ValueError(f'{listed(rivals, 3)} publishes {topic}: end it first')
            publisher.publish(message())
            is_sent = True
            yield
        endpoints.flush([publisher])
    finally:
        if is_sent and moves:
            endpoints.publish_last(publisher, standstill(topic, kind, message()))


def _message(node: DriveNode, message_type: MessageType, fields: Any) -> bytes:
    """Return a message of the present time."""
    if not isinstance(fields, dict):
        raise ArgumentTypeError("fields are needed, such as '{data: 1}'")
    paths = [field.path for field in message_type.fields]
    for path in fields.keys() - {*paths}:
        raise ArgumentTypeError(f'there is no field {printable(path)}; there are {listed(paths)}')
    if 'header.stamp.sec' in paths:
        stamp = node.get_clock().now().seconds_nanoseconds()
        fields |= dict(zip(('header.stamp.sec', 'header.stamp.nanosec'), stamp, strict=True))
    try:
        return message_type.write(fields)
    except (struct.error, ArithmeticError, AttributeError, TypeError, ValueError) as error:
        raise ArgumentTypeError(f'this is no {message_type.name}: {error}') from error


def _crank(node: DriveNode, *quantities: str) -> Steps:
    names = [argument.rpartition('=')[0] for argument in quantities]
    state: dict[str, Any] = {'name': [name or 'crank' for name in names]}
    for field, unit in (('position', 'rad'), ('velocity', 'rad/s')):
        numbers = [read_quantity(text.rpartition('=')[2], unit) for text in quantities]
        if all(number is not None and isfinite(number) for number in numbers):
            state[field] = numbers
    if len(state) != 2:
        text = 'all are angles or all are rates, with a unit: 60deg, or left=0.5rad/s'
        raise ArgumentTypeError(text)
    if 'velocity' in state:
        yield from _send(node, 'crank_command', {JOINT_STATE: state})
    elif any(names):
        yield from _send(node, 'crank_state', {JOINT_STATE: state})
    else:
        angle = {'data': state['position'][0]}
        yield from _send(node, 'crank_angle', dict.fromkeys(ANGLE_TYPES, angle))


def _walk(node: DriveNode, speed: str) -> Steps:
    number = number_type(isfinite, 'a speed', unit='m/s')(speed)
    twist = {'linear.x': number, 'angular.z': node.options.turn}
    contents = {TWIST.name: twist}
    contents[TWIST_STAMPED.name] = {f'twist.{path}': twist[path] for path in twist}
    yield from _send(node, 'cmd_vel', contents)


def _pub(node: DriveNode, topic: str, content: str) -> Steps:
    yield from _send(node, topic, {'': yaml_text.parse(content)})


def _echo(node: DriveNode, topic: str) -> Steps:
    """Print the messages of a topic, or their number every second."""
    topic, kind, message_type = yield from _find(node, topic, 'publishers')
    received: list[bytes] = []
    qos = qos_profile_best_available
    node.create_subscription(kind, topic, received.append, qos, raw=True)
    while node.options.command == 'hz':
        yield from _pause(1.0)
        print(f'{len(received)} a second', flush=True)
        received.clear()
    while True:
        for data in received:
            _print(message_type.read(data), node.options.field)
            if node.options.once:
                return
            print('---', flush=True)
        received.clear()
        yield


def _print(content: Mapping[str, Any], field: str | None) -> None:
    """Print a message with its submessages, or a field: a text for a file as it is."""
    if field and field not in content:
        raise ArgumentTypeError(f'the fields are {listed(content)}')
    for path in [field] if field else content:
        value = content[path]
        if value and isinstance(value, list) and isinstance(value[0], dict):
            for number, item in enumerate(value):
                _print({f'{path}[{number}].{name}': item[name] for name in item}, None)
            continue
        text = str([*value] if isinstance(value, tuple) else value)
        if not field or sys.stdout.isatty():
            text = f'{path}: {printable(text, 1_000_000)}'
        print(text.removesuffix('\n'), flush=True)


def _list(node: DriveNode, text: str = '') -> Steps:
    yield from _pause(2.0 * DISCOVERY_TIME)
    topics = [pair for pair in node.get_topic_names_and_types() if text in pair[0]]
    if not topics:
        raise ValueError(f'no topic has {text} in its name')
    for topic, types in topics:
        print(f'{topic}  {listed(types)}')
        for role in ('publishers', 'subscriptions'):
            infos = getattr(node, f'get_{role}_info_by_topic')(topic)
            print(f'    {role}: {listed(sorted({*map(endpoints.node_of, infos)}))}')


def _call(node: DriveNode, service: str) -> Steps:
    client = node.create_client(Trigger, service)
    yield from _await(client.service_is_ready, f'no node offers {service}')
    future = client.call_async(Trigger.Request())
    yield from _await(future.done, f'{service} does not answer')
    print(printable(future.result().message))
    return 0 if future.result().success else 1


COMMANDS: dict[str, Callable[..., Steps]] = {'list': _list, 'echo': _echo, 'hz': _echo}
COMMANDS |= {'crank': _crank, 'walk': _walk, 'pub': _pub, 'call': _call}


def read_options(argv: Sequence[str]) -> Namespace:
    """Return the options; exits with a line for those that are refused."""
    parser = ArgumentParser(
        'drive',
        'Move cranks and walkers by hand, send messages, call services, show topics. WHAT LISTENS '
        'MOVES, until the time is over, Ctrl-C, or the terminal ends: then zero is sent.',
        EXAMPLES,
    )
    parser.add_argument('command', choices=[*COMMANDS], help='see the examples')
    parser.add_argument('words', nargs='*', metavar='ARGUMENT')
    help_text = f'time; without it a motion takes {DURATION:g} s, and a message is sent once'
    parser.add_argument('--for', dest='duration', type=SECONDS, help=help_text)
    turn = number_type(isfinite, 'a rate', unit='rad/s')
    parser.add_argument('--turn', type=turn, default=0.0, help='walk to the left [rad/s]')
    parser.add_argument('--once', action='store_true', help='echo one message')
    parser.add_argument('--field', help='echo this field, such as data or header.stamp.sec')
    options = arguments(parser, argv)
    try:
        signature(COMMANDS[options.command]).bind(None, *options.words)
    except TypeError as error:
        parser.error(f'{options.command}: {error}')
    return options


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run a command; return the exit code."""
    return run('drive', partial(DriveNode, read_options(argv)), argv, stop)
