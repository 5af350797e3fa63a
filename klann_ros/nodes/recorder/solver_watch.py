"""The parameters of the solvers that a recording hears: a log must explain itself."""

from array import array
from collections.abc import Callable, Collection, Sequence
from functools import partial
from time import monotonic, time_ns
from typing import Any

from klann_ros.log.run_parameters import SolverParameters
from klann_ros.nodes.endpoints import name_refusal
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
# An answer is lost where a server has not discovered yet who asks. The time after which it is
# asked again [s] doubles each time, so that an answer that takes long comes in time in the end.
FIRST_PATIENCE = 0.5
LAST_PATIENCE = 60.0


class _Question:
    """What a node is asked: one request at a time, in two steps."""

    def __init__(self, node: Node, name: str) -> None:
        self.names = node.create_client(ListParameters, f'{name}/list_parameters')
        self.values = node.create_client(GetParameters, f'{name}/get_parameters')
        self.parameters: dict[str, Any] | None = None
        self._request: tuple[Client, Future] | None = None
        self._end = 0.0
        self._patience = FIRST_PATIENCE

    def can_be_asked(self) -> bool:
        """Return whether the node is there, and no answer is awaited."""
        ready = self.names.service_is_ready() and self.values.service_is_ready()
        return ready and self._request is None

    def send(self, client: Client, request: Any, answer: Callable[[Future], None]) -> None:
        future = client.call_async(request)
        self._request = client, future
        self._end = monotonic() + self._patience
        future.add_done_callback(answer)

    def is_answered(self) -> None:
        self._request = None
        self._patience = FIRST_PATIENCE

    def gives_up(self) -> bool:
        """Forget a request that was in vain; return whether there was one."""
        if self._request is None or monotonic() < self._end:
            return False
        client, future = self._request
        client.remove_pending_request(future)
        self._request = None
        self._patience = min(2 * self._patience, LAST_PATIENCE)
        return True


class SolverWatch:
    """
    Ask the nodes that publish joint states for their parameters, whenever these may be new.

    Parameters
    ----------
    node : rclpy.node.Node
        Who asks.
    on_parameters : callable
        Is given a solver's parameters when they are others than before; a node without a leg's
        geometry is none.
    others : collection of str
        Whoever has a parameter of such a name is asked for its parameters as well.

    Attributes
    ----------
    unanswered : set of str
        Full names of the nodes whose answers are still to come.

    """

    def __init__(
        self,
        node: Node,
        on_parameters: Callable[[SolverParameters], None],
        others: Collection[str] = (),
    ) -> None:
        self.unanswered: set[str] = set()
        self._others = frozenset(others)
        self._node = node
        self._on_parameters = on_parameters
        self._questions: dict[str, _Question] = {}
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
                # A node that is none of ROS may have any name, and has no parameters.
                if not name_refusal(f'{name}/list_parameters'):
                    self._want(name)

    def ask(self) -> None:
        """Ask those that can be asked by now, or are silent; to be called again and again."""
        self._due |= {name for name, question in self._questions.items() if question.gives_up()}
        for name in [name for name in self._due if self._questions[name].can_be_asked()]:
            self._due.remove(name)
            question = self._questions[name]
            answer = partial(self._on_names, name)
            question.send(question.names, ListParameters.Request(), answer)

    def _want(self, name: str) -> None:
        if name not in self._questions:
            self._questions[name] = _Question(self._node, name)
        self._due.add(name)
        self.unanswered.add(name)

    def _on_event(self, event: ParameterEvent) -> None:
        parameters = (*event.new_parameters, *event.changed_parameters)
        # A named leg's length has its name before it.
        changed = {parameter.name.rpartition('.')[2] for parameter in parameters}
        if event.node in self._questions and changed & set(GEOMETRY_NAMES):
            self._want(event.node)

    def _on_names(self, name: str, future: Future) -> None:
        names = list(future.result().result.names)
        if set(GEOMETRY_NAMES) <= set(names) or self._others & set(names):
            question = self._questions[name]
            answer = partial(self._on_values, name, names)
            question.send(question.values, GetParameters.Request(names=names), answer)
        else:
            self._is_answered(name)

    def _on_values(self, name: str, names: list[str], future: Future) -> None:
        self._is_answered(name)
        try:
            values = [_plain(value) for value in future.result().values]
            plain = dict(zip(names, values, strict=True))
        except (RuntimeError, ValueError) as error:
            # Not as many as were asked for, or of a type that there is not.
            said = f'{name} does not answer for its parameters: {ros_error(error)}'
            self._node.get_logger().warning(said)
            return
        # What a solver says of itself at its start may come before and after it was asked.
        if plain != self._questions[name].parameters:
            self._questions[name].parameters = plain
            self._on_parameters(SolverParameters(name, time_ns(), plain))

    def _is_answered(self, name: str) -> None:
        self._questions[name].is_answered()
        if name not in self._due:
            self.unanswered.discard(name)


def _plain(value: ParameterValue) -> Any:
    """Return a parameter's value as a log can hold it: arrays are lists, bytes are numbers."""
    plain = parameter_value_to_python(value)
    if isinstance(plain, str) or not isinstance(plain, Sequence | array):
        return plain
    return [item[0] if isinstance(item, bytes) else item for item in plain]
