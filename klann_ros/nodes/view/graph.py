"""Discovery: solvers, recorders and players by their topics and services."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from klann_ros.nodes.endpoints import name_refusal
from klann_ros.nodes.process import ROS_ERRORS
from rclpy.node import Node, NodeNameNonExistentError

from .subscriptions import CRANK_ANGLE, TWIST

_TRIGGER = 'std_srvs/srv/Trigger'
# By the services that only they have together.
_RECORDER = {'pause', 'resume', 'split'}
_PLAYER = {'pause', 'resume', 'step'}
# Services that identify them.
BUTTONS = {'recorder': ('pause', 'resume', 'split', 'trigger'), 'player': tuple(sorted(_PLAYER))}
# A machine with more of them shows no more.
MAX_MACHINES = 12

# Discovery knows a publisher before it knows its node.
_UNKNOWN_NODE = '_UNKNOWN_'

Names = Sequence[tuple[str, Sequence[str]]]


@dataclass(frozen=True)
class Machine:
    """A recorder or a player."""

    # 'recorder' or 'player'.
    kind: str
    # Its full name.
    node: str
    # What can be called of BUTTONS.
    services: tuple[str, ...]


class Graph:
    """
    Query the ROS graph.

    Parameters
    ----------
    node : rclpy.node.Node
        The node.

    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._own = _full(node.get_name(), node.get_namespace())

    def topics(self) -> list[tuple[str, list[str]]]:
        """Return the topics with their types; none where a name is no text."""
        return _asked(self._node.get_topic_names_and_types)

    def publishers(self, topic: str) -> list[Any]:
        """Return the publishers of a topic, without this node."""
        infos = _asked(lambda: self._node.get_publishers_info_by_topic(topic))
        known = (info for info in infos if _UNKNOWN_NODE not in info.node_name)
        return [info for info in known if node_of(info) != self._own]

    def names_of_publishers(self, topic: str) -> list[str]:
        """Return the names of those nodes, each once."""
        return list(dict.fromkeys(map(node_of, self.publishers(topic))))

    def names_of_subscribers(self, topic: str) -> list[str]:
        """Return the names of the nodes that subscribe to a topic, but for this node."""
        infos = _asked(lambda: self._node.get_subscriptions_info_by_topic(topic))
        return [name for name in map(node_of, infos) if name != self._own]

    def crank_topics(self, node: str) -> list[str]:
        """Return the topics of crank angles that a node hears."""
        namespace, _, name = node.rpartition('/')
        subscribed = _asked(
            lambda: self._node.get_subscriber_names_and_types_by_node(name, namespace or '/')
        )
        return sorted(t for t, kinds in subscribed if CRANK_ANGLE in kinds and not name_refusal(t))

    def walker_topics(self, topics: Names) -> list[str]:
        """Return the topics of velocities that somebody walks by."""
        return sorted(
            name
            for name, kinds in topics
            if TWIST in kinds
            and name.rpartition('/')[2] == 'cmd_vel'
            and not name_refusal(name)
            and self._node.count_subscribers(name) > 0
        )

    def machines(self) -> list[Machine]:
        """Return the recorders and players."""
        offered: dict[str, set[str]] = {}
        for service, kinds in _asked(self._node.get_service_names_and_types):
            if _TRIGGER in kinds and not name_refusal(service):
                node, _, name = service.rpartition('/')
                offered.setdefault(node, set()).add(name)
        found = []
        for node, names in sorted(offered.items()):
            kind = 'recorder' if names >= _RECORDER else 'player' if names >= _PLAYER else ''
            # A service is known as long as somebody would call it, as this node itself does.
            if kind and node and self._node.count_services(f'{node}/pause') > 0:
                services = tuple(name for name in BUTTONS[kind] if name in names)
                found.append(Machine(kind, node, services))
        return found[:MAX_MACHINES]


def node_of(info: Any) -> str:
    """Return the full name of an endpoint's node."""
    return _full(info.node_name, info.node_namespace)


def _full(name: str, namespace: str) -> str:
    return f'{namespace.rstrip("/")}/{name}'


def _asked(ask: Callable[[], Any]) -> list[Any]:
    """Return what the middleware tells; nothing where it cannot."""
    try:
        return list(ask())
    # A name of others that is no text, and a node that has just gone.
    except (UnicodeDecodeError, NodeNameNonExistentError, *ROS_ERRORS):
        return []
