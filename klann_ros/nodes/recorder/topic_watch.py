"""Discovery of topics to record, each from when it appears, with all its publishers."""

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from threading import Event, Thread
import time
from time import monotonic, time_ns

from klann_ros.log import Message, Pause, Recording
from klann_ros.log.errors import LogError
from klann_ros.nodes.endpoints import name_refusal, UnknownMessageTypeError
from klann_ros.nodes.process import ros_error, ROS_ERRORS
from klann_ros.nodes.raw_executor import RawCallbackGroup
from klann_ros.nodes.solver_watch import SolverWatch
from klann_ros.sanitize.text import printable, printable_line
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.topic_endpoint_info import TopicEndpointInfo

from .interface import RecordingDiagnostics
from .recorded_topic import RecordedTopic

# Period of discovery, and that of pending requests without changes [s].
_PERIOD, _REQUEST_PERIOD = 0.1, 1.0
# Discovery of a publisher's node may follow that of the publisher within this time [s].
_SETTLING_TIME = 1.0
# A longer delay means that the process was stopped, or the machine suspended [s].
MAX_DELAY = 0.9
# NTP adjusts a clock by less in a period; a larger step is a clock that was set [s].
MAX_CLOCK_STEP = 0.05
# Also runs while the machine is suspended, if the system has it.
_STEADY_CLOCK = getattr(time, 'CLOCK_BOOTTIME', time.CLOCK_MONOTONIC)
# Limit of warnings, as untrusted topics could fill the disk with them.
_MAX_WARNINGS = 500
# Errors of one topic or publisher; the others are recorded.
_TOPIC_ERRORS = (UnknownMessageTypeError, LogError, *ROS_ERRORS)


class Heartbeat:
    """Detects stalls of this process and steps of its clock between calls of `beat`."""

    def __init__(self) -> None:
        self._before = time.clock_gettime(_STEADY_CLOCK), time_ns()

    @property
    def is_late(self) -> bool:
        """Return whether the next call is overdue."""
        return time.clock_gettime(_STEADY_CLOCK) - self._before[0] > _PERIOD + MAX_DELAY

    def beat(self) -> Pause | None:
        """Return the time since the last call if the process stalled, or its clock was set."""
        (steady, wall), now = self._before, (time.clock_gettime(_STEADY_CLOCK), time_ns())
        self._before = now
        passed, shown = now[0] - steady, (now[1] - wall) / 1e9
        if passed > _PERIOD + MAX_DELAY:
            reason = f'the recorder stalled for {passed:.1f} s (stopped, or suspended)'
        elif shown - passed > MAX_CLOCK_STEP:
            reason = f'the clock was set forward by {shown - passed:.2f} s'
        else:
            return None
        return Pause(wall, now[1], {}, reason)


class TopicWatch:
    """
    Subscribe to topics as they appear, by full names with the wildcard *.

    `put` receives the messages of the recording, `solvers` the publishers of joint states, and
    `on_stall` each stall of this process. `diagnostics` are the node's own, and not recorded.
    """

    def __init__(
        self,
        node: Node,
        patterns: Sequence[str],
        *,
        recording: Recording,
        put: Callable[[Message], None],
        solvers: SolverWatch,
        diagnostics: RecordingDiagnostics,
        on_stall: Callable[[Pause], None],
    ) -> None:
        self._on_stall, self._stalls = on_stall, deque[Pause]()
        self._heartbeat = Heartbeat()
        self._topics: dict[str, RecordedTopic] = {}
        self._node, self._patterns, self._solvers = node, patterns, solvers
        self._recording, self._put, self._diagnostics = recording, put, diagnostics
        self._group = RawCallbackGroup()
        self._refused: set[tuple[str, str]] = set()
        self._warnings: set[str] = set()
        self._unsettled: dict[str, float] = {}
        self._unpublished: set[str] = set()
        self._stopped = Event()
        self._graph_changed = node.create_guard_condition(self._update)
        self._thread = Thread(target=self._watch_graph, name='graph', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the discovery."""
        self._stopped.set()
        self._thread.join()

    @property
    def has_stalled(self) -> bool:
        """Return whether this process has just stalled, and `on_stall` has not returned yet."""
        return bool(self._stalls) or self._heartbeat.is_late

    @property
    def published(self) -> set[str]:
        """Return the recorded topics that have a publisher now."""
        return {name for name, topic in self._topics.items() if topic.has_publisher}

    def take_queued(self) -> None:
        """Read all messages received so far."""
        for topic in self._topics.values():
            topic.take_queued()

    def _watch_graph(self) -> None:
        """
        Trigger `_update` in the node's loop when topics or publishers appear.

        A timer would rebuild the executor's wait set each time, at fifty times the cost.
        """
        before: object = None
        ticks = 0
        while not self._stopped.wait(_PERIOD):
            ticks += 1
            is_late = ticks >= _REQUEST_PERIOD / _PERIOD
            stall = self._heartbeat.beat()
            if stall is not None:
                self._stalls.append(stall)
            now = self._graph()
            is_due = self._unsettled or (is_late and self._solvers.pending)
            if now != before or stall is not None or is_due:
                self._graph_changed.trigger()
                before, ticks = now, 0

    def _graph(self) -> object:
        """Return the topics, and the publishers of those that had none."""
        counts = [(name, self._node.count_publishers(name)) for name in self._unpublished.copy()]
        return _topics_and_types(self._node), counts

    def _update(self) -> None:
        while self._stalls:
            self._on_stall(self._stalls[0])
            self._stalls.popleft()
        for name, kinds in _topics_and_types(self._node):
            if all(self._is_known(name, kind) for kind in kinds):
                continue
            if name in self._topics:
                # A publisher of another type matches no subscription.
                self._on_change(name)
            elif self._is_selected(name):
                self._try(name, kinds)
        now = monotonic()
        for name, until in list(self._unsettled.items()):
            self._adapt(name)
            if now > until:
                del self._unsettled[name]
        self._solvers.send_requests()

    def _is_known(self, name: str, kind: str) -> bool:
        recorded = self._topics.get(name)
        return (name, kind) in self._refused or (recorded is not None and recorded.type == kind)

    def _is_selected(self, name: str) -> bool:
        hidden = any(part.startswith('_') for part in name.split('/'))
        return not hidden and any(fnmatchcase(name, pattern) for pattern in self._patterns)

    def _try(self, name: str, kinds: Sequence[str]) -> None:
        # Participants outside ROS may have names that ROS refuses.
        reason = name_refusal(name)
        if reason:
            for kind in kinds:
                self._refuse(name, kind, reason)
            return
        try:
            self._subscribe(name)
        except _TOPIC_ERRORS as error:
            self._warn(f'{name} is not recorded: {ros_error(error)}')

    def _subscribe(self, name: str) -> None:
        publishers = [
            publisher
            for publisher in self._publishers(name)
            if (name, publisher.topic_type) not in self._refused
        ]
        if not publishers:
            self._unpublished.add(name)
            return
        self._unpublished.discard(name)
        own = self._diagnostics
        try:
            self._topics[name] = RecordedTopic(
                self._node,
                self._group,
                name,
                publishers,
                recording=self._recording,
                put=self._put,
                on_change=self._on_change,
                is_own=own.has_published if name == own.topic else None,
            )
        except _TOPIC_ERRORS as error:
            self._refuse(name, publishers[0].topic_type, ros_error(error))
        else:
            self._on_change(name)

    def _publishers(self, name: str) -> list[TopicEndpointInfo]:
        """Return the publishers of a topic, without this node's."""
        own = self._node.get_name(), self._node.get_namespace()
        return [
            publisher
            for publisher in self._node.get_publishers_info_by_topic(name)
            if (publisher.node_name, publisher.node_namespace) != own
        ]

    def _on_change(self, name: str) -> None:
        self._unsettled[name] = monotonic() + _SETTLING_TIME

    def _adapt(self, name: str) -> None:
        topic = self._topics[name]
        try:
            publishers = self._publishers(name)
            for kind in topic.adapt(publishers):
                self._refuse(name, kind, f'the topic is recorded as {topic.type}')
        except _TOPIC_ERRORS as error:
            self._warn(f'a publisher of {name} is not recorded: {ros_error(error)}')
            return
        if topic.type == 'sensor_msgs/msg/JointState':
            self._solvers.add(publishers)

    def _refuse(self, name: str, kind: str, reason: str) -> None:
        self._refused.add((name, kind))
        of = f'{printable(name)} of type {printable(kind)}'
        self._warn(f'{of} is not recorded: {reason}')

    def _warn(self, text: str) -> None:
        if text in self._warnings or len(self._warnings) >= _MAX_WARNINGS:
            return
        self._warnings.add(text)
        if len(self._warnings) == _MAX_WARNINGS:
            text += '; further warnings are suppressed'
        self._node.get_logger().warning(printable_line(text))


def _topics_and_types(node: Node) -> list[tuple[str, list[str]]]:
    """
    Return the topics and their types.

    DDS accepts any bytes as a name, and rclpy fails if one is no text. Then the nodes are queried
    one by one, and those without a valid name are skipped.
    """
    with suppress(UnicodeDecodeError):
        known: list[tuple[str, list[str]]] = node.get_topic_names_and_types()
        return known
    types: dict[str, set[str]] = {}
    with suppress(UnicodeDecodeError):
        for name, namespace in node.get_node_names_and_namespaces():
            with suppress(UnicodeDecodeError, NodeNameNonExistentError):
                for topic, kinds in node.get_publisher_names_and_types_by_node(name, namespace):
                    types.setdefault(topic, set()).update(kinds)
    return [(topic, sorted(types[topic])) for topic in sorted(types)]
