"""Calls of other nodes' services for the page: made in the ROS thread, answered in one line."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from time import monotonic
from typing import Any

from klann_ros.live.clients import Answer
from klann_ros.sanitize.text import printable
from rcl_interfaces.msg import Parameter as ParameterMessage  # noqa: TC002 - a message
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import Trigger

# Timeout of a call [s].
CALL_TIMEOUT = 3.0
# Pending calls at most.
MAX_PENDING_CALLS = 64
_MAX_CLIENTS = 64

Work = Callable[[], object]


@dataclass
class _Call:
    """A request that is under way."""

    client: Client
    future: Future
    answer: Answer
    end: float


class ServiceCalls:
    """
    Run work in the ROS thread, and call services.

    Parameters
    ----------
    node : rclpy.node.Node
        Who calls.

    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._due: deque[Work] = deque()
        self._lock = Lock()
        self._calls: list[_Call] = []
        self._clients: dict[str, Client] = {}
        self._guard = node.create_guard_condition(self._run)

    def put(self, work: Work) -> bool:
        """Have something run soon, unless there is too much already; any thread may ask."""
        with self._lock:
            if len(self._due) >= MAX_PENDING_CALLS:
                return False
            self._due.append(work)
        self._guard.trigger()
        return True

    def look(self) -> None:
        """Expire calls without an answer; to be called periodically in the ROS thread."""
        now = monotonic()
        for call in [call for call in self._calls if now > call.end]:
            self._calls.remove(call)
            call.client.remove_pending_request(call.future)
            call.answer(False, f'no answer for {CALL_TIMEOUT:g} s')

    def trigger(self, service: str, answer: Answer) -> None:
        """Call a service without arguments."""

        def done(response: Any) -> None:
            answer(bool(response.success), printable(response.message))

        self._call(Trigger, service, Trigger.Request(), done, answer)

    def set_parameters(self, node: str, values: Mapping[str, Any], answer: Answer) -> None:
        """Set parameters of a node, all or none."""
        messages: list[ParameterMessage] = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]

        def done(response: Any) -> None:
            result = response.result
            said = printable(result.reason, 600) or (
                '' if result.successful else 'no reason given'
            )
            answer(bool(result.successful), said)

        request = SetParametersAtomically.Request(parameters=messages)
        service = f'{node}/set_parameters_atomically'
        self._call(SetParametersAtomically, service, request, done, answer)

    def get_number(self, node: str, name: str, on_value: Callable[[float], object]) -> None:
        """Ask a node for a parameter that is a number."""

        def done(response: Any) -> None:
            for value in response.values[:1]:
                on_value(float(value.double_value or value.integer_value))

        request = GetParameters.Request(names=[name])
        self._call(GetParameters, f'{node}/get_parameters', request, done, _ignore)

    def _run(self) -> None:
        while True:
            with self._lock:
                if not self._due:
                    return
                work = self._due.popleft()
            work()

    def _call(
        self,
        kind: Any,
        service: str,
        request: Any,
        done: Callable[[Any], object],
        answer: Answer,
    ) -> None:
        if len(self._calls) >= MAX_PENDING_CALLS:
            answer(False, 'too much is under way already')
            return
        client = self._client(kind, service)
        call = _Call(client, client.call_async(request), answer, monotonic() + CALL_TIMEOUT)
        self._calls.append(call)

        def on_done(future: Future) -> None:
            if call in self._calls:
                self._calls.remove(call)
                error = future.exception()
                if error is None:
                    done(future.result())
                else:
                    answer(False, printable(error))

        call.future.add_done_callback(on_done)

    def _client(self, kind: Any, service: str) -> Client:
        client = self._clients.get(service)
        if client is None:
            if len(self._clients) >= _MAX_CLIENTS:
                _, oldest = self._clients.popitem()
                self._node.destroy_client(oldest)
            client = self._clients[service] = self._node.create_client(kind, service)
        return client


def _ignore(_: bool, __: str) -> None:
    """Discard an answer."""
