"""Calls of services of other nodes, each with a timeout."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Any

from klann_ros.sanitize.text import printable
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import Trigger

# Timeout of a call [s].
CALL_TIMEOUT = 3.0
# Calls and other work that wait at once, and clients that are kept.
_MAX_PENDING = 64
_MAX_CLIENTS = 512
BUSY = 'too much is under way already'
# Takes the success of a call and a message.
Reply = Callable[[bool, str], None]


@dataclass(eq=False)
class _Call:
    """A pending request, its timeout [s], and its deadline on the steady clock [s]."""

    client: Client
    future: Future
    on_failure: Reply
    timeout: float
    deadline: float


class ServiceCalls:
    """Calls in ROS's thread, and other work for it; `expire_calls` is called periodically."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._due: deque[Callable[[], object]] = deque()
        self._pending: list[_Call] = []
        self._clients: dict[str, Client] = {}
        self._guard = node.create_guard_condition(self._run)

    def put(self, work: Callable[[], object]) -> bool:
        """Run a function soon, unless too many are due; thread safe."""
        if len(self._due) >= _MAX_PENDING:
            return False
        self._due.append(work)
        self._guard.trigger()
        return True

    def expire_calls(self) -> None:
        """Give up the calls that got no answer within their timeout."""
        now = monotonic()
        for call in list(self._pending):
            if now > call.deadline:
                self._pending.remove(call)
                call.client.remove_pending_request(call.future)
                call.on_failure(False, f'no answer for {call.timeout:g} s')

    def is_ready(self, kind: Any, service: str) -> bool:
        """Return whether a service is known."""
        return bool(self._client(kind, service).service_is_ready())

    def call(
        self,
        kind: Any,
        service: str,
        request: Any,
        on_response: Callable[[Any], object],
        on_failure: Reply,
        *,
        timeout: float = CALL_TIMEOUT,
    ) -> None:
        """Call a service; without a response within a timeout [s] on_failure gets the reason."""
        if len(self._pending) >= _MAX_PENDING:
            on_failure(False, BUSY)
            return
        client = self._client(kind, service)
        deadline = monotonic() + timeout
        call = _Call(client, client.call_async(request), on_failure, timeout, deadline)
        self._pending.append(call)

        def on_done(future: Future) -> None:
            if call in self._pending:
                self._pending.remove(call)
                error = future.exception()
                if error is None:
                    on_response(future.result())
                else:
                    on_failure(False, printable(error))

        call.future.add_done_callback(on_done)

    def trigger(self, service: str, answer: Reply) -> None:
        """Call a service without arguments."""

        def on_response(response: Any) -> None:
            answer(bool(response.success), printable(response.message))

        self.call(Trigger, service, Trigger.Request(), on_response, answer)

    def set_parameters(self, node: str, values: Mapping[str, Any], answer: Reply) -> None:
        """Set parameters of a node, all or none."""

        def on_response(response: Any) -> None:
            reason = printable(response.result.reason, 600)
            if not (reason or response.result.successful):
                reason = 'no reason given'
            answer(bool(response.result.successful), reason)

        parameters = [Parameter(name, value=v).to_parameter_msg() for name, v in values.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        service = f'{node}/set_parameters_atomically'
        self.call(SetParametersAtomically, service, request, on_response, answer)

    def get_numbers(
        self, node: str, names: Sequence[str], on_values: Callable[[dict[str, float]], object]
    ) -> None:
        """Read numeric parameters of a node."""

        def on_response(response: Any) -> None:
            numbers = {}
            for name, value in zip(names, response.values, strict=False):
                numbers[name] = float(value.double_value or value.integer_value)
            on_values(numbers)

        request = GetParameters.Request(names=names)
        service = f'{node}/get_parameters'
        self.call(GetParameters, service, request, on_response, lambda *_: None)

    def _run(self) -> None:
        while self._due:
            self._due.popleft()()

    def _client(self, kind: Any, service: str) -> Client:
        if service not in self._clients:
            if len(self._clients) >= _MAX_CLIENTS:
                oldest = next(iter(self._clients))
                self._node.destroy_client(self._clients.pop(oldest))
            self._clients[service] = self._node.create_client(kind, service)
        return self._clients[service]
