"""
Names, message classes and quality of service of topics, and services without arguments.

DDS matches no publisher with a subscription of another type, and Fast DDS reports none either (an
`incompatible_type` event of rclpy never comes): `TypeCheck` finds them in the graph.

Names and types may be untrusted: from a log, or a publisher on the network.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from importlib import import_module
from time import monotonic, sleep
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from klann_ros.log import is_installed, split_type
from klann_ros.sanitize.text import listed, printable, printable_line, verb
from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.type_support import check_is_valid_msg_type
from rclpy.validate_full_topic_name import validate_full_topic_name
from std_srvs.srv import Trigger

from .parameters import Declaration, declare, overrides
from .raw_executor import Info, RawCallbackGroup

# Bursts would overwrite a shallow queue.
DEPTH = 2000
INPUT = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
OUTPUT = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
# Fast DDS sends a heartbeat every 3 s; a shorter wait may miss a retransmission [s].
ARRIVES = 3.5
# Repetitions of a last message, their period, and the timeout of their acknowledgement [s].
LAST_MESSAGES = 5
LAST_PERIOD = 0.02
LAST_TIMEOUT = 0.2

# Quality of service as parameters: `qos_overrides.TOPIC.publisher.POLICY`, as in ROS 2.
_POLICIES = {
    'history': HistoryPolicy,
    'reliability': ReliabilityPolicy,
    'durability': DurabilityPolicy,
    'liveliness': LivelinessPolicy,
}
_DURATIONS = ('deadline', 'lifespan', 'liveliness_lease_duration')
# The rare policies are parameters only where they are given, which keeps `ros2 param list` short.
_COMMON = ('history', 'depth', 'reliability', 'durability')
_RARE = ('deadline', 'lifespan', 'liveliness', 'liveliness_lease_duration')
_MAX_DEPTH = 1_000_000
# Period of queries for publishers of another type [s]; their topics in a status, and those that
# are logged, as untrusted publishers could fill the disk.
_TYPE_CHECK_PERIOD, _MAX_MISMATCHES, _MAX_TYPE_WARNINGS = 1.0, 3, 100
# Queries until a publisher without a node's name is logged.
_MIN_SIGHTINGS = 5
_MAX_DURATION = 2**63 - 1
QOS_USAGE = f"""\
 quality of service of each topic, by its full name:
  qos_overrides./TOPIC.publisher.POLICY, or qos_overrides./TOPIC.subscription.POLICY; policies:
  {', '.join(_COMMON)}; in ns: {', '.join(_DURATIONS)};
  liveliness"""


class UnknownMessageTypeError(Exception):
    """A message type that is malformed or not installed; the text says which."""


def name_refusal(name: str) -> str:
    """Return ROS's reason for refusing a full name of a topic or service; '' for a good one."""
    # ROS's own check ends at a NUL, and cannot take a lone surrogate.
    if '\0' in name or not name.isascii():
        return "topic name must not contain characters other than alphanumerics, '_', or '/'"
    try:
        validate_full_topic_name(name)
    except NameValidationException as error:
        # The untrusted name follows, and a line that points into it.
        return str(error).partition(':\n')[0].removeprefix('Invalid topic name: ')
    return ''


def message_class(type_name: str) -> Any:
    """
    Return the class of a message type such as `sensor_msgs/msg/JointState`.

    An import runs code, so only installed packages of interfaces are imported. A module of the
    same name earlier on Python's path, as in PYTHONPATH, is out of scope. UnknownMessageTypeError
    if the type is malformed or not installed.
    """
    printable_name = printable(type_name)
    package_and_name = split_type(type_name)
    if package_and_name is None:
        raise UnknownMessageTypeError(
            f"'{printable_name}' is no message type, such as std_msgs/msg/String"
        )
    package, name = package_and_name
    kind = None
    try:
        if is_installed(package):
            kind = getattr(import_module(f'{package}.msg'), name, None)
        if kind is not None:
            check_is_valid_msg_type(kind)
    # A partly installed package may raise anything.
    except Exception as error:
        reason = f"message type '{printable_name}' cannot be used: {printable(error)}"
        raise UnknownMessageTypeError(reason) from error
    if kind is None:
        raise UnknownMessageTypeError(f"message type '{printable_name}' is not installed")
    return kind


def type_name(kind: type) -> str:
    """Return the name of a message class, such as `sensor_msgs/msg/JointState`."""
    package, _, _ = kind.__module__.partition('.')
    return f'{package}/msg/{kind.__name__}'


def create_publisher(
    node: Node, kind: type, topic: str, profile: QoSProfile = OUTPUT, **options: Any
) -> Any:
    """Make a publisher, with the quality of service as overridden by parameters."""
    profile = overridden(node, topic, 'publisher', profile)
    return node.create_publisher(kind, topic, profile, **options)


def flush(publishers: Iterable[Publisher], seconds: float = ARRIVES) -> None:
    """Wait until reliable subscribers have acknowledged all messages, or a timeout [s]."""
    end = monotonic() + seconds
    for publisher in publishers:
        if publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE:
            publisher.wait_for_all_acked(Duration(seconds=max(0.0, end - monotonic())))


def publish_last(publisher: Publisher, message: Any) -> None:
    """Publish what stops a robot, several times, as best-effort subscribers may lose one."""
    end = monotonic() + LAST_TIMEOUT
    for _ in range(LAST_MESSAGES):
        publisher.publish(message)
        sleep(LAST_PERIOD)
    flush([publisher], end - monotonic())


def subscribe_raw(
    node: Node,
    kind: type,
    topic: str,
    callback: Callable[[bytes, Info], None],
    *,
    wakes: bool = True,
    on_matched: Callable[[Any], None] | None = None,
) -> Subscription:
    """Subscribe to an input, its QoS as overridden by parameters; `wakes` as RawCallbackGroup."""
    profile = overridden(node, topic, 'subscription', INPUT)
    # Each event costs at every wait. An input that matches every publisher needs no other.
    events = SubscriptionEventCallbacks(matched=on_matched, use_default_callbacks=profile != INPUT)
    group = RawCallbackGroup(wakes=wakes)
    return node.create_subscription(
        kind, topic, callback, profile, raw=True, callback_group=group, event_callbacks=events
    )


def create_steady_timer(
    node: Node, period: float, callback: Callable[[], object], group: CallbackGroup | None = None
) -> Any:
    """Return a timer [s] on the steady clock, which neither jumps nor stands still."""
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    return node.create_timer(period, callback, group, steady)


def diagnostic_array(node: Node, statuses: Iterable[DiagnosticStatus]) -> DiagnosticArray:
    """Return statuses as a message of the present time."""
    array = DiagnosticArray(status=list(statuses))
    array.header.stamp = node.get_clock().now().to_msg()
    return array


def diagnostic_status(
    node: Node, part: str, level: bytes, message: str, figures: Iterable[tuple[str, object]]
) -> DiagnosticStatus:
    """Return the status of a part of a node; its texts, which users print, are printable."""
    name = f'{node.get_name()}: {part}'
    status = DiagnosticStatus(level=level, name=name, hardware_id=name)
    status.message = printable_line(message)
    for key, figure in figures:
        status.values.append(KeyValue(key=printable_line(key), value=printable_line(figure)))
    return status


class TypeCheck:
    """
    Warn about publishers of another type on the topics that a node subscribes to.

    `remedies` are what the user can do, by the type that the node takes and the published type.
    """

    def __init__(self, node: Node, remedies: Mapping[tuple[str, str], str] | None = None) -> None:
        self._node = node
        self._remedies = remedies or {}
        # Time of the next query [s].
        self._query_time = 0.0
        # The present mismatches in words, by topic and published type.
        self._mismatches: dict[tuple[str, str], str] = {}
        # The number of queries that had them, and those that were logged.
        self._sightings: Counter[tuple[str, str]] = Counter()
        self._logged: set[tuple[str, str]] = set()

    def check(self) -> str:
        """Return the mismatches in words, '' for none, and log each once; call it repeatedly."""
        if monotonic() >= self._query_time:
            self._query_time = monotonic() + _TYPE_CHECK_PERIOD
            self._update()
        return '; '.join([*self._mismatches.values()][:_MAX_MISMATCHES])

    def add_to(self, level: bytes, message: str) -> tuple[bytes, str]:
        """Return the level and message of a status with the mismatches, which are a warning."""
        mismatches = self.check()
        if not mismatches:
            return level, message
        return max(level, DiagnosticStatus.WARN), f'{message}; {mismatches}'

    def _update(self) -> None:
        """Find the publishers of other types than the subscriptions', and log each."""
        self._mismatches = {}
        for subscription in self._node.subscriptions:
            subscribed_type = type_name(subscription.msg_type)
            topic = subscription.topic_name
            publishers: dict[str, set[str]] = {}
            try:
                for endpoint in self._node.get_publishers_info_by_topic(topic):
                    if endpoint.topic_type != subscribed_type:
                        publishers.setdefault(endpoint.topic_type, set()).add(node_of(endpoint))
            # DDS accepts any bytes, and rclpy returns nothing then.
            except UnicodeDecodeError:
                publishers['a type that is no text'] = {''}
            for published_type, names in publishers.items():
                text = self._mismatch(topic, subscribed_type, published_type, names)
                mismatch = topic, published_type
                self._mismatches[mismatch] = text
                self._sightings[mismatch] += 1
                # Discovery knows a publisher before its node, which may have none.
                if '' not in names or self._sightings[mismatch] >= _MIN_SIGHTINGS:
                    self._log(mismatch, text)

    def _mismatch(
        self, topic: str, subscribed_type: str, published_type: str, names: set[str]
    ) -> str:
        remedy = self._remedies.get((subscribed_type, published_type), '')
        return (
            f'{topic}: {listed(sorted(names - {""}), 3) or "a publisher"} '
            f'{verb(len(names), "publishes", "publish")} {printable(published_type)}, '
            f'this node takes {subscribed_type}{remedy and f": set {remedy}"}'
        )

    def _log(self, mismatch: tuple[str, str], text: str) -> None:
        if mismatch not in self._logged and len(self._logged) < _MAX_TYPE_WARNINGS:
            self._logged.add(mismatch)
            self._node.get_logger().warning(text)


def create_trigger(node: Node, name: str, action: Callable[[], tuple[bool, str]]) -> None:
    """Offer a service ~/NAME whose action returns the success and the message."""

    def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = action()
        return response

    node.create_service(Trigger, f'~/{name}', answer)


def node_of(endpoint: TopicEndpointInfo) -> str:
    """Return the full name of an endpoint's node; '' until discovery knows it."""
    if '_UNKNOWN_' in endpoint.node_name:
        return ''
    return f'{endpoint.node_namespace.rstrip("/")}/{endpoint.node_name}'


def other_publishers(node: Node, topic: str) -> set[str]:
    """Return the other nodes that publish a topic; '' for those that are not yet discovered."""
    publishers = {*map(node_of, node.get_publishers_info_by_topic(topic))}
    return publishers - {node.get_fully_qualified_name()}


def overridden(node: Node, topic: str, kind: str, profile: QoSProfile) -> QoSProfile:
    """
    Return the profile of a publisher or subscription, as overridden by parameters.

    rclpy's own QoSOverridingOptions silently omits durability, declares only when the publisher is
    made, which may be long after the start, and changes the shared profile. A StartError names a
    refused parameter.
    """
    prefix = f'qos_overrides.{node.resolve_topic_name(topic)}.{kind}.'
    # A lifespan is a publisher's policy.
    possible = [policy for policy in _RARE if (kind, policy) != ('subscription', 'lifespan')]
    rare = [policy for policy in possible if f'{prefix}{policy}' in overrides(node)]
    endpoint_profile = copy(profile)
    for policy in (*_COMMON, *rare):
        parameter = _declaration(prefix, policy, getattr(profile, policy))
        # Two endpoints of one topic share it.
        if not node.has_parameter(parameter.name):
            declare(node, [parameter])
        setting = node.get_parameter(parameter.name).value
        if policy in _POLICIES:
            setting = _POLICIES[policy][setting.upper()]
        elif policy in _DURATIONS:
            setting = Duration(nanoseconds=setting)
        setattr(endpoint_profile, policy, setting)
    return endpoint_profile


def _declaration(prefix: str, policy: str, default: Any) -> Declaration:
    name = f'{prefix}{policy}'
    description = f'{policy} of the topic'
    if policy in _POLICIES:
        choices = [choice.name.lower() for choice in _POLICIES[policy] if choice.name != 'UNKNOWN']
        return Declaration(name, default.name.lower(), description, choices=choices)
    if policy in _DURATIONS:
        limits = (0, _MAX_DURATION)
        return Declaration(name, default.nanoseconds, f'{description} [ns]', limits=limits)
    return Declaration(name, default, description, limits=(1, _MAX_DEPTH))
