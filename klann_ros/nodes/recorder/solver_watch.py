"""Read the parameters of solvers through their parameter services."""

from array import array
from collections.abc import Callable, Collection, Sequence
from functools import partial
from time import monotonic, time_ns
from typing import Any

from klann_ros.log.run_parameters import SolverParameters
from klann_ros.nodes.endpoints import name_refusal, node_of
from klann_ros.nodes.process import ros_error
from klann_ros.nodes.solver.declarations import GEOMETRY_NAMES
from rcl_interfaces.msg import ParameterEvent, ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import qos_profile_parameter_events
from rclpy.task import Future
from rclpy.topic_endpoint_info import TopicEndpointInfo

_UNKNOWN = '_UNKNOWN_'
# A response is lost if the server has not discovered the client yet. The timeout [s] doubles with
# each retry, so that a slow response arrives in the end.
_FIRST_TIMEOUT = 0.5
_MAX_TIMEOUT = 60.0


class _ParameterClient:
    """Parameter services of a node, with one request at a time."""

    def __init__(self, node: Node, name: str) -> None:
        self.names = node.create_client(ListParameters, f'{name}/list_parameters')
        self.values = node.create_client(GetParameters, f'{name}/get_parameters')
        self.parameters: dict[str, Any] | None = None
        self._request: tuple[Client, Future] | None = None
        self._end = 0.0
        self._timeout = _FIRST_TIMEOUT

    def is_ready(self) -> bool:
        """Return whether the services exist and no request is pending."""
        ready = self.names.service_is_ready() and self.values.service_is_ready()
        return ready and self._request is None

    def send(self, client: Client, request: Any, on_response: Callable[[Future], None]) -> None:
        future = client.call_async(request)
        self._request = client, future
        self._end = monotonic() + self._timeout
        future.add_done_callback(on_response)

    def finish(self) -> None:
        self._request = None
        self._timeout = _FIRST_TIMEOUT

    def cancel_late(self) -> bool:
        """Cancel a request after its timeout; return whether there was one."""
        if self._request is None or monotonic() < self._end:
            return False
        client, future = self._request
        client.remove_pending_request(future)
        self._request = None
        self._timeout = min(2 * self._timeout, _MAX_TIMEOUT)
        return True


class SolverWatch:
    """
    Read the parameters of nodes that publish joint states, and again after changes.

    `on_parameters` receives those of nodes that have a leg's geometry, or one of the parameters
    `others`.
    """

    def __init__(
        self,
        node: Node,
        on_parameters: Callable[[SolverParameters], None],
        others: Collection[str] = (),
    ) -> None:
        # Full names of the nodes with pending requests.
        self.pending: set[str] = set()
        self._others = frozenset(others)
        self._node = node
        self._on_parameters = on_parameters
        self._clients: dict[str, _ParameterClient] = {}
        self._known: set[tuple[int, ...]] = set()
        self._due: set[str] = set()
        node.create_subscription(
            ParameterEvent, '/parameter_events', self._on_event, qos_profile_parameter_events
        )

    def add(self, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Add the nodes of new publishers; to be called repeatedly."""
        for publisher in publishers:
            name = node_of(publisher)
            # A restarted solver has its old name and a new publisher.
            identity = tuple(publisher.endpoint_gid)
            # Discovery knows a publisher before it knows its node.
            if identity not in self._known and _UNKNOWN not in name:
                self._known.add(identity)
                # Nodes outside ROS may have any name, and have no parameters.
                if not name_refusal(f'{name}/list_parameters'):
                    self._request(name)

    def send_requests(self) -> None:
        """Send due and repeated requests; to be called repeatedly."""
        self._due |= {name for name, client in self._clients.items() if client.cancel_late()}
        for name in [name for name in self._due if self._clients[name].is_ready()]:
            self._due.remove(name)
            client = self._clients[name]
            on_response = partial(self._on_names, name)
            client.send(client.names, ListParameters.Request(), on_response)

    def _request(self, name: str) -> None:
        if name not in self._clients:
            self._clients[name] = _ParameterClient(self._node, name)
        self._due.add(name)
        self.pending.add(name)

    def _on_event(self, event: ParameterEvent) -> None:
        parameters = (*event.new_parameters, *event.changed_parameters)
        # A named leg's length has its name before it.
        changed = {parameter.name.rpartition('.')[2] for parameter in parameters}
        if event.node in self._clients and changed & set(GEOMETRY_NAMES):
            self._request(event.node)

    def _on_names(self, name: str, future: Future) -> None:
        names = list(future.result().result.names)
        if set(GEOMETRY_NAMES) <= set(names) or self._others & set(names):
            client = self._clients[name]
            on_response = partial(self._on_values, name, names)
            client.send(client.values, GetParameters.Request(names=names), on_response)
        else:
            self._finish(name)

    def _on_values(self, name: str, names: list[str], future: Future) -> None:
        self._finish(name)
        try:
            values = [_plain(value) for value in future.result().values]
            plain = dict(zip(names, values, strict=True))
        except (RuntimeError, ValueError) as error:
            # A wrong number of values, or an unknown type.
            text = f'{name} returned invalid parameters: {ros_error(error)}'
            self._node.get_logger().warning(text)
            return
        # Parameter events at the start may arrive before and after the response.
        if plain != self._clients[name].parameters:
            self._clients[name].parameters = plain
            self._on_parameters(SolverParameters(name, time_ns(), plain))

    def _finish(self, name: str) -> None:
        self._clients[name].finish()
        if name not in self._due:
            self.pending.discard(name)


def _plain(value: ParameterValue) -> Any:
    """Return a parameter's value as a log can hold it: arrays are lists, bytes are numbers."""
    plain = parameter_value_to_python(value)
    if isinstance(plain, str) or not isinstance(plain, Sequence | array):
        return plain
    return [item[0] if isinstance(item, bytes) else item for item in plain]
