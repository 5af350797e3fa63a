"""Quality of service as parameters: `qos_overrides.TOPIC.publisher.POLICY`, as ROS 2 has it."""

from copy import copy
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

from .given_parameters import given
from .parameters import declare, Declared

WORDS = {
    'history': HistoryPolicy,
    'reliability': ReliabilityPolicy,
    'durability': DurabilityPolicy,
    'liveliness': LivelinessPolicy,
}
DURATIONS = ('deadline', 'lifespan', 'liveliness_lease_duration')
# Hardly anybody needs the others, which are parameters only where they are given: `ros2 param
# list` is to be read by people.
COMMON = ('history', 'depth', 'reliability', 'durability')
RARE = ('deadline', 'lifespan', 'liveliness', 'liveliness_lease_duration')
MOST_DEPTH = 1_000_000
LONGEST = 2**63 - 1
USAGE = f"""\
 quality of service of each topic, by its full name:
  qos_overrides./TOPIC.publisher.POLICY, or qos_overrides./TOPIC.subscription.POLICY; policies:
  {', '.join(COMMON)}; in ns: {', '.join(DURATIONS)};
  liveliness"""


def of_publisher(node: Node, topic: str, profile: QoSProfile) -> QoSProfile:
    """
    Return the profile of a publisher: the given one, but for what parameters say.

    rclpy's own QoSOverridingOptions leaves durability out, without a word, declares only when the
    publisher is made, which may be long after the start, and changes the profile for everybody.

    Raises
    ------
    StartError
        A parameter is refused; the text says why.

    """
    return _overridden(node, topic, 'publisher', profile)


def of_subscription(node: Node, topic: str, profile: QoSProfile) -> QoSProfile:
    """Return the profile of a subscription; see `of_publisher`."""
    return _overridden(node, topic, 'subscription', profile)


def _overridden(node: Node, topic: str, kind: str, profile: QoSProfile) -> QoSProfile:
    prefix = f'qos_overrides.{node.resolve_topic_name(topic)}.{kind}.'
    # Who receives has no say in how long a message is worth sending.
    possible = [policy for policy in RARE if (kind, policy) != ('subscription', 'lifespan')]
    rare = [policy for policy in possible if f'{prefix}{policy}' in given(node)]
    # Others use the same profile.
    overridden = copy(profile)
    for policy in (*COMMON, *rare):
        setattr(overridden, policy, _value(node, prefix, policy, getattr(profile, policy)))
    return overridden


def _value(node: Node, prefix: str, policy: str, default: Any) -> Any:
    """Return what a policy's parameter says; two endpoints of one topic share it."""
    parameter = _declared(prefix, policy, default)
    if not node.has_parameter(parameter.name):
        declare(node, [parameter])
    value = node.get_parameter(parameter.name).value
    if policy in WORDS:
        return WORDS[policy][value.upper()]
    return Duration(nanoseconds=value) if policy in DURATIONS else value


def _declared(prefix: str, policy: str, default: Any) -> Declared:
    name, description = f'{prefix}{policy}', f'{policy} of the topic'
    if policy in WORDS:
        known = [word.name.lower() for word in WORDS[policy] if word.name != 'UNKNOWN']
        return Declared(name, default.name.lower(), description, choices=known)
    if policy in DURATIONS:
        limits = (0, LONGEST)
        return Declared(name, default.nanoseconds, f'{description} [ns]', limits=limits)
    return Declared(name, default, description, limits=(1, MOST_DEPTH))
