"""`drive`: moves cranks and walkers by hand, sends messages, calls services, shows topics."""

import argparse
from array import array
from collections.abc import Callable, Generator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from math import isfinite, isnan
import os
import sys
from time import monotonic
from typing import Any, TypeVar

from klann_ros.cli import ArgumentParser, number_type, print_error, SECONDS
from klann_ros.nodes import endpoints
from klann_ros.nodes.crank_output import standstill
from klann_ros.nodes.endpoints import message_class, node_of
from klann_ros.nodes.lease import Lease, leased_topic
from klann_ros.nodes.process import arguments, Finish, ProcessNode, run
from klann_ros.sanitize import yaml_text
from klann_ros.sanitize.quantity import read_quantity
from klann_ros.sanitize.text import did_you_mean, listed, printable, refusal
from klann_ros.stop_signals import StopSignals
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message

# Period of steps and messages, time of discovery, timeout of a wait, time without --for [s].
PERIOD = 0.05
DISCOVERY_TIME = 0.7
TIMEOUT = 5.0
DURATION = 5.0
# Codes of array for the sizes of integers.
INTEGER_CODES = {'int8': 'b', 'uint8': 'B', 'int16': 'h', 'uint16': 'H', 'int32': 'i'}
INTEGER_CODES |= {'uint32': 'I', 'int64': 'q', 'uint64': 'Q'}
# Members of an array that are shown.
MAX_MEMBERS = 128
# It matches every publisher, and takes what latched ones have published.
AVAILABLE = ReliabilityPolicy.BEST_AVAILABLE, DurabilityPolicy.BEST_AVAILABLE
EXAMPLES = """\
examples:
  drive list                               topics, their types and nodes
  drive echo joint_states --once           the next message; a latched one too
  drive hz crank_state                     messages a second
  drive crank 60deg                        an angle, to a solver
  drive crank left_crank=0.5rad/s --for 3  a rate, to the driver of a motor
  drive walk 0.05 --turn 10deg/s --for 5   a velocity, to a walker
  drive pub crank_state '{data: 408}'      any message, in the type that the listening node takes
  drive call walker_node/reset_fault       any service
in a namespace: drive list --ros-args -r __ns:=/left"""
AwaitedT = TypeVar('AwaitedT')
Steps = Generator[None, None, AwaitedT]


class DriveError(ValueError):
    """What cannot be done; the text says why."""


class DriveNode(ProcessNode):
    """Take the steps of a command one by one; their `finally` stops what they have moved."""

    def __init__(self, options: argparse.Namespace, finish: Finish, **node_options: Any) -> None:
        """Begin."""
        super().__init__(f'drive_{os.getpid()}', enable_rosout=False, **node_options)
        self._finish = finish
        self._steps: Steps[int | None] = options.steps(self, options)
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
            print_error('drive', error)
            self._finish(1)


def _awaited(node: Node, name: str, find: Callable[[str], AwaitedT], verb: str) -> Steps[AwaitedT]:
    """Wait until a topic or service is found, and return what was; a DriveError after TIMEOUT."""
    deadline = monotonic() + TIMEOUT
    while not (endpoints_or_types := find(name)):
        if monotonic() > deadline:
            names = {topic for topic, _ in node.get_topic_names_and_types()} - {name}
            hint = did_you_mean(name, names) or '; drive list shows what this ROS_DOMAIN_ID has'
            raise DriveError(f'no node {verb} {name}{hint}')
        yield
    return endpoints_or_types


def _type_of(topic: str, ends: Sequence[Any]) -> str:
    types = sorted({end.topic_type for end in ends})
    if len(types) != 1:
        raise DriveError(f'{topic} has several types: {listed(types)}')
    return str(types[0])


def _pause(duration: float) -> Steps[None]:
    end = monotonic() + duration
    while monotonic() < end:
        yield


def _send(node: Node, topic: str, contents: Mapping[str, Any], duration: float) -> Steps[None]:
    """
    Publish for a time [s], or once for 0, as soon as a node listens and nobody else publishes.

    `contents` are fields by the type that the listening node takes, by '' for any type. What moves
    a robot ends with zero.
    """
    topic = node.resolve_topic_name(topic)
    find = node.get_subscriptions_info_by_topic
    yield from _awaited(node, topic, find, 'listens to')
    yield from _pause(DISCOVERY_TIME)
    type_name = _type_of(topic, find(topic))
    content = contents.get(type_name, contents.get(''))
    if content is None:
        nodes = listed(map(node_of, find(topic)), 3)
        raise DriveError(f'{topic} is taken as {printable(type_name)} by {nodes}')
    message = fill(message_class(type_name)(), content)
    publisher = endpoints.create_publisher(node, type(message), topic)
    lease = Lease(node, topic) if leased_topic(topic) else None
    begin = monotonic() + DISCOVERY_TIME
    is_sent = False

    def set_stamp() -> None:
        if hasattr(message, 'header'):
            message.header.stamp = node.get_clock().now().to_msg()

    try:
        while not is_sent or monotonic() < begin + duration:
            if lease is not None:
                lease.announce()
            if monotonic() >= begin:
                _refuse_others(node, topic, lease)
                set_stamp()
                publisher.publish(message)
                is_sent = True
            yield
        endpoints.flush([publisher])
    finally:
        set_stamp()
        last = standstill(topic, type(message), serialize_message(message))
        if is_sent and last is not None:
            endpoints.publish_last(publisher, last)
        if lease is not None:
            lease.close()


def _refuse_others(node: Node, topic: str, lease: Lease | None) -> None:
    others = endpoints.other_publishers(node, topic)
    if lease is not None:
        others = {lease.other} if lease.other else others - {*lease.yielded}
    if others:
        raise DriveError(f'{listed(others, 3)} publishes {topic}: end it first')


def _crank(node: Node, options: argparse.Namespace) -> Steps[None]:
    """Send angles to a solver, or rates to the driver of motors."""
    angles: dict[str, float] = {}
    rates: dict[str, float] = {}
    for argument in options.quantity:
        joint, _, text = argument.rpartition('=')
        angle = read_quantity(text, 'rad')
        rate = read_quantity(text, 'rad/s')
        if angle is None or rate is None or isnan(angle) == isnan(rate):
            raise DriveError(f'{printable(text)} is no angle or rate with a unit, such as 60deg')
        if isnan(angle):
            rates[joint] = rate
        else:
            angles[joint] = angle
    if (angles and rates) or ('' in {**angles, **rates} and len(options.quantity) > 1):
        raise DriveError('angles and rates are not mixed; each of several has a joint: left=60deg')
    if '' in angles:
        scalar = {'data': angles['']}
        contents = {'std_msgs/msg/Float64': scalar, 'std_msgs/msg/Float32': scalar}
        yield from _send(node, 'crank_angle', contents, options.duration)
        return
    state: dict[str, Any] = {'name': [joint or 'crank' for joint in angles or rates]}
    state |= {'position': [*angles.values()], 'velocity': [*rates.values()]}
    contents = {'sensor_msgs/msg/JointState': state}
    topic = 'crank_command' if rates else 'crank_state'
    yield from _send(node, topic, contents, options.duration or (DURATION if rates else 0.0))


def _walk(node: Node, options: argparse.Namespace) -> Steps[None]:
    """Send a velocity to a walker."""
    twist = {'linear': {'x': options.speed}, 'angular': {'z': options.turn}}
    contents = {'geometry_msgs/msg/TwistStamped': {'twist': twist}}
    contents['geometry_msgs/msg/Twist'] = twist
    yield from _send(node, 'cmd_vel', contents, options.duration or DURATION)


def _pub(node: Node, options: argparse.Namespace) -> Steps[None]:
    """Send a message."""
    contents = {'': yaml_text.parse(options.content)}
    yield from _send(node, options.topic, contents, options.duration)


def _subscribe(node: Node, topic: str, take: Callable[[Any], object], *, raw: bool) -> Steps[None]:
    topic = node.resolve_topic_name(topic)
    ends = yield from _awaited(node, topic, node.get_publishers_info_by_topic, 'publishes')
    reliability, durability = AVAILABLE
    qos = QoSProfile(depth=endpoints.DEPTH, reliability=reliability, durability=durability)
    node.create_subscription(message_class(_type_of(topic, ends)), topic, take, qos, raw=raw)


def _echo(node: Node, options: argparse.Namespace) -> Steps[None]:
    """Print the messages of a topic."""
    received: list[Any] = []
    yield from _subscribe(node, options.topic, received.append, raw=False)
    while True:
        for message in received:
            content = content_of(message)
            for name in filter(None, options.field.split('.')):
                if not isinstance(content, Mapping) or name not in content:
                    raise DriveError(f'there is no field {options.field}')
                content = content[name]
            if isinstance(content, str) and not sys.stdout.isatty():
                # A text for a file, such as leg_description.
                print(content.removesuffix('\n'), flush=True)
            else:
                _print(yaml_text.dump(content))
            if options.once:
                return
            print('---', flush=True)
        received.clear()
        yield


def _hz(node: Node, options: argparse.Namespace) -> Steps[None]:
    """Print the rate of a topic every second."""
    times: list[float] = []
    yield from _subscribe(node, options.topic, lambda _: times.append(monotonic()), raw=True)
    while True:
        yield from _pause(1.0)
        gap = max((later - earlier for earlier, later in pairwise(times)), default=0.0)
        print(f'{len(times)} a second, longest gap {1e3 * gap:.0f} ms', flush=True)
        times.clear()


def _list(node: Node, options: argparse.Namespace) -> Steps[None]:
    """Print topics, their types, and their nodes."""
    yield from _pause(2.0 * DISCOVERY_TIME)
    for topic, types in node.get_topic_names_and_types():
        nodes = []
        for find in (node.get_publishers_info_by_topic, node.get_subscriptions_info_by_topic):
            names = {*map(node_of, find(topic))} - {node.get_fully_qualified_name()}
            nodes.append(listed(sorted(names)) or 'nobody')
        if options.text in topic and nodes != ['nobody', 'nobody']:
            _print(f'{topic}  {listed(types)}\n    from {nodes[0]} to {nodes[1]}')


def _call(node: Node, options: argparse.Namespace) -> Steps[int]:
    """Call a service, and print the answer; return 1 if it tells of no success."""
    service = node.resolve_service_name(options.service)
    types = yield from _awaited(
        node,
        service,
        lambda name: dict(node.get_service_names_and_types()).get(name, []),
        'offers',
    )
    kind = message_class(types[0], is_service=True)
    request = fill(kind.Request(), yaml_text.parse(options.content))
    client = node.create_client(kind, service)
    yield from _awaited(node, service, lambda _: client.service_is_ready(), 'offers')
    future = client.call_async(request)
    yield from _awaited(node, service, lambda _: future.done(), 'answers')
    content = content_of(future.result())
    _print(yaml_text.dump(content))
    return 0 if content.get('success', True) else 1


def fill(message: Any, content: Any) -> Any:
    """Set fields of a message by a mapping, and return it; a DriveError names a refused one."""
    types = message.get_fields_and_field_types()
    if not isinstance(content, Mapping):
        raise DriveError(f'fields are needed, such as {{{next(iter(types), "data")}: 1}}')
    for name, value in content.items():
        if name not in types:
            hint = did_you_mean(name, types) or f'; there are {listed(types) or "none"}'
            raise DriveError(f'there is no field {printable(name)}{hint}')
        field = getattr(message, name)
        if hasattr(field, 'get_fields_and_field_types'):
            fill(field, value)
            continue
        try:
            setattr(message, name, _converted(field, types[name], value))
        except (LookupError, OverflowError, TypeError, ValueError):
            raise DriveError(refusal(name, value, f'of type {types[name]}')) from None
    return message


def _converted(field: Any, type_name: str, value: Any) -> Any:
    """Return a value as a field has it: of what is wrong here the middleware may crash."""
    if isinstance(field, array):
        return array(field.typecode, value)
    if hasattr(field, 'dtype'):
        field[:] = value
        return field
    if isinstance(field, list):
        kind = {'sequence<string>': str, 'sequence<boolean>': bool}[type_name]
        return [_converted(kind(), '', member) for member in value]
    if type(value) is int:
        number = array('d' if isinstance(field, float) else INTEGER_CODES[type_name], [value])
        return number[0]
    if type(field) is not type(value):
        raise TypeError
    return value


def content_of(field: Any) -> Any:
    """Return a message or a field as mappings, lists, numbers and texts; a long array is cut."""
    if hasattr(field, 'get_fields_and_field_types'):
        return {n: content_of(getattr(field, n)) for n in field.get_fields_and_field_types()}
    if isinstance(field, str | int | float | bytes):
        return field[0] if isinstance(field, bytes) else field
    plain = field.tolist() if hasattr(field, 'tolist') else field
    members = [content_of(member) for member in plain[:MAX_MEMBERS]]
    return members if len(plain) <= MAX_MEMBERS else [*members, f'... ({len(plain)} in all)']


def _print(text: str) -> None:
    """Print lines of others so that they cannot control a terminal."""
    print(*(printable(line, 1_000_000) for line in text.splitlines()), sep='\n', flush=True)


def read_options(argv: Sequence[str]) -> argparse.Namespace:
    """Return the options of a command; exits with a line for those that are refused."""
    parser = ArgumentParser(
        'drive',
        'Move cranks and walkers by hand, send messages, call services, show topics. WHAT LISTENS '
        'MOVES, until the time is over, Ctrl-C, or the end of the terminal: then zero is sent.',
        EXAMPLES,
    )
    commands = parser.add_subparsers(required=True, metavar='COMMAND')

    def add(steps: Callable[..., Any], *words: str) -> Any:
        summary = (steps.__doc__ or '').partition(';')[0].strip('.')
        command = commands.add_parser(steps.__name__[1:], help=summary, description=summary)
        command.set_defaults(steps=steps)
        for word in words:
            command.add_argument(word)
        return command

    number = partial(number_type, isfinite, 'a finite number')
    add(_list).add_argument('text', nargs='?', default='', help='only topics with this text')
    echo = add(_echo, 'topic')
    echo.add_argument('--once', action='store_true', help='end after one message')
    echo.add_argument('--field', default='', help='such as data, or header.stamp')
    add(_hz, 'topic')
    crank = add(_crank)
    crank.add_argument('quantity', nargs='+', metavar='[JOINT=]60deg')
    walk = add(_walk)
    walk.add_argument('speed', type=number(unit='m/s'), help='forwards [m/s]')
    walk.add_argument('--turn', type=number(unit='rad/s'), default=0.0, help='to the left [rad/s]')
    add(_call, 'service').add_argument('content', nargs='?', default='{}', metavar='YAML')
    help_text = f'time of a motion ({DURATION:g} s), or of a message (once)'
    for command in (crank, walk, add(_pub, 'topic', 'content')):
        command.add_argument('--for', dest='duration', type=SECONDS, default=0.0, help=help_text)
    return arguments(parser, argv)


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run a command; return the exit code."""
    return run('drive', partial(DriveNode, read_options(argv)), argv, stop)
