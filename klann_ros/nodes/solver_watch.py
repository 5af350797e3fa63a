"""The parameters of the solvers that a recording hears: a log must explain itself."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from rclpy.topic_endpoint_info import TopicEndpointInfo

from . import geometry_parameters

_UNKNOWN = '_UNKNOWN_'


class SolverParameters:
    """
    Ask the nodes that publish joint states for their parameters, once each.

    Parameters
    ----------
    node : rclpy.node.Node
        Who asks.
    found : callable
        Is given the full name of a node and its parameters by name, if it has a leg's geometry.

    """

    def __init__(self, node: Node, found: Callable[[str, dict[str, Any]], None]) -> None:
        """Know of no solver yet."""
        self._node = node
        self._found = found
        self._clients: dict[str, AsyncParameterClient] = {}
        self._waiting: set[str] = set()

    def add(self, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Add the nodes of publishers, those that are new; to be called again and again."""
        for publisher in publishers:
            name = f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
            # Discovery knows a publisher before it knows its node.
            if name not in self._clients and _UNKNOWN not in name:
                self._clients[name] = AsyncParameterClient(self._node, name)
                self._waiting.add(name)

    def ask(self) -> None:
        """Ask those that can be asked by now; to be called again and again."""
        for name in [name for name in self._waiting if self._clients[name].services_are_ready()]:
            self._waiting.remove(name)
            self._clients[name].list_parameters(callback=partial(self._on_names, name))

    def _on_names(self, name: str, future: Future) -> None:
        names = list(future.result().result.names)
        if set(geometry_parameters.NAMES) <= set(names):
            answer = partial(self._on_values, name, names)
            self._clients[name].get_parameters(names, callback=answer)

    def _on_values(self, name: str, names: list[str], future: Future) -> None:
        values = map(parameter_value_to_python, future.result().values)
        # Arrays come as array.array.
        plain = {
            key: list(value) if hasattr(value, 'typecode') else value
            for key, value in zip(names, values, strict=True)
        }
        self._found(name, plain)
