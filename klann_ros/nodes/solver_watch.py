"""The parameters of the solvers that a recording hears: a log must explain itself."""

from collections.abc import Callable, Sequence
from functools import partial
from time import time_ns

from klann_ros.log.run_parameters import SolverParameters
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import qos_profile_parameter_events
from rclpy.task import Future
from rclpy.topic_endpoint_info import TopicEndpointInfo

from . import geometry_parameters

_UNKNOWN = '_UNKNOWN_'


class SolverWatch:
    """
    Ask the nodes that publish joint states for their parameters, whenever these may be new.

    Parameters
    ----------
    node : rclpy.node.Node
        Who asks.
    found : callable
        Is given a solver's parameters each time; a node without a leg's geometry is none.

    Attributes
    ----------
    waiting : set of str
        Full names of the nodes whose answers are still to come.

    """

    def __init__(self, node: Node, found: Callable[[SolverParameters], None]) -> None:
        """Know of no solver yet."""
        self.waiting: set[str] = set()
        self._node = node
        self._found = found
        self._clients: dict[str, AsyncParameterClient] = {}
        self._known: set[tuple[int, ...]] = set()
        self._due: set[str] = set()
        node.create_subscription(
            ParameterEvent, '/parameter_events', self._on_event, qos_profile_parameter_events
        )

    def add(self, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Add the nodes of publishers, those that are new; to be called again and again."""
        for publisher in publishers:
            name = f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
            # A solver that was started anew has its old name and a new publisher.
            identity = tuple(publisher.endpoint_gid)
            # Discovery knows a publisher before it knows its node.
            if identity not in self._known and _UNKNOWN not in name:
                self._known.add(identity)
                self._want(name)

    def ask(self) -> None:
        """Ask those that can be asked by now; to be called again and again."""
        for name in [name for name in self._due if self._clients[name].services_are_ready()]:
            self._due.remove(name)
            self._clients[name].list_parameters(callback=partial(self._on_names, name))

    def _want(self, name: str) -> None:
        if name not in self._clients:
            self._clients[name] = AsyncParameterClient(self._node, name)
        self._due.add(name)
        self.waiting.add(name)

    def _on_event(self, event: ParameterEvent) -> None:
        changed = {p.name for p in (*event.new_parameters, *event.changed_parameters)}
        if event.node in self._clients and changed & set(geometry_parameters.NAMES):
            self._want(event.node)

    def _on_names(self, name: str, future: Future) -> None:
        names = list(future.result().result.names)
        if set(geometry_parameters.NAMES) <= set(names):
            answer = partial(self._on_values, name, names)
            self._clients[name].get_parameters(names, callback=answer)
        else:
            self.waiting.discard(name)

    def _on_values(self, name: str, names: list[str], future: Future) -> None:
        self.waiting.discard(name)
        values = map(parameter_value_to_python, future.result().values)
        # Arrays come as array.array.
        plain = {
            key: list(value) if hasattr(value, 'typecode') else value
            for key, value in zip(names, values, strict=True)
        }
        self._found(SolverParameters(name, time_ns(), plain))
