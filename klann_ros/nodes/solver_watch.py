"""Read the parameters of solvers through their parameter services."""

from array import array
from collections.abc import Callable, Collection, Sequence
from functools import partial
from time import time_ns
from typing import Any

from klann_ros.log import SolverParameters
from rcl_interfaces.msg import ParameterEvent, ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import qos_profile_parameter_events
from rclpy.topic_endpoint_info import TopicEndpointInfo

from .endpoints import name_refusal, node_of
from .leg_declarations import GEOMETRY_NAMES
from .process import ros_error
from .service_calls import ServiceCalls

_SERVICES = ((ListParameters, 'list_parameters'), (GetParameters, 'get_parameters'))
# A response is lost if the server has not discovered the client yet. The timeout [s] doubles with
# each retry, so that a slow response arrives in the end.
_FIRST_TIMEOUT = 0.5
_MAX_TIMEOUT = 60.0


class SolverWatch:
    """
    Read the parameters of nodes that publish joint states, and again after changes.

    `on_parameters` receives the parameters of nodes that have a leg's geometry, or one of
    `other_names`.
    """

    def __init__(
        self,
        node: Node,
        on_parameters: Callable[[SolverParameters], None],
        other_names: Collection[str] = (),
    ) -> None:
        # Full names of the nodes whose parameters are still to be read.
        self.pending: set[str] = set()
        self._other_names = frozenset(other_names)
        self._node = node
        self._on_parameters = on_parameters
        self._calls = ServiceCalls(node)
        # The identities of the known publishers, and the names of their nodes.
        self._publishers: set[tuple[int, ...]] = set()
        self._nodes: set[str] = set()
        # Timeouts of requests [s] by node: the due ones, and those that were sent.
        self._due: dict[str, float] = {}
        self._asked: dict[str, float] = {}
        self._parameters: dict[str, dict[str, Any]] = {}
        node.create_subscription(
            ParameterEvent, '/parameter_events', self._on_event, qos_profile_parameter_events
        )

    def add(self, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Add the nodes of new publishers; to be called repeatedly."""
        for publisher in publishers:
            name = node_of(publisher)
            # A restarted solver has its old name and a new publisher.
            identity = tuple(publisher.endpoint_gid)
            if name and identity not in self._publishers:
                self._publishers.add(identity)
                # Nodes outside ROS may have any name, and have no parameters.
                if not name_refusal(f'{name}/list_parameters'):
                    self._nodes.add(name)
                    self._request(name)

    def send_requests(self) -> None:
        """Send due and repeated requests; to be called repeatedly."""
        self._calls.expire_calls()
        for name in list(self._due):
            if name in self._asked:
                continue
            ready = [self._calls.is_ready(kind, f'{name}/{last}') for kind, last in _SERVICES]
            if all(ready):
                self._asked[name] = self._due.pop(name)
                self._call(name, _SERVICES[0], ListParameters.Request(), self._on_names)

    def _request(self, name: str) -> None:
        self._due[name] = _FIRST_TIMEOUT
        self.pending.add(name)

    def _on_event(self, event: ParameterEvent) -> None:
        parameters = (*event.new_parameters, *event.changed_parameters)
        # A named leg's length has its name before it.
        changed = {parameter.name.rpartition('.')[2] for parameter in parameters}
        if event.node in self._nodes and changed & set(GEOMETRY_NAMES):
            self._request(event.node)

    def _call(
        self,
        name: str,
        service: tuple[Any, str],
        request: Any,
        on_response: Callable[[str, Any], object],
    ) -> None:
        def repeat(*_: object) -> None:
            self._due[name] = min(2.0 * self._asked.pop(name), _MAX_TIMEOUT)

        kind, last = service
        timeout = self._asked[name]
        answer = partial(on_response, name)
        self._calls.call(kind, f'{name}/{last}', request, answer, repeat, timeout=timeout)

    def _on_names(self, name: str, response: ListParameters.Response) -> None:
        names = list(response.result.names)
        if set(GEOMETRY_NAMES) <= set(names) or self._other_names & set(names):
            request = GetParameters.Request(names=names)
            self._call(name, _SERVICES[1], request, partial(self._on_values, names))
        else:
            self._finish(name)

    def _on_values(self, names: list[str], name: str, response: GetParameters.Response) -> None:
        self._finish(name)
        try:
            values = [_plain_value(value) for value in response.values]
            parameters = dict(zip(names, values, strict=True))
        except (RuntimeError, ValueError) as error:
            # A wrong number of values, or an unknown type.
            text = f'{name} returned invalid parameters: {ros_error(error)}'
            self._node.get_logger().warning(text)
            return
        # Parameter events at the start may arrive before and after the response.
        if parameters != self._parameters.get(name):
            self._parameters[name] = parameters
            self._on_parameters(SolverParameters(name, time_ns(), parameters))

    def _finish(self, name: str) -> None:
        del self._asked[name]
        if name not in self._due:
            self.pending.discard(name)


def _plain_value(value: ParameterValue) -> Any:
    """Return a parameter's value as a log can hold it: arrays are lists, bytes are numbers."""
    plain = parameter_value_to_python(value)
    if isinstance(plain, str) or not isinstance(plain, Sequence | array):
        return plain
    return [member[0] if isinstance(member, bytes) else member for member in plain]
