"""Discovery of topics to record, each from when it appears, with all its publishers."""

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from functools import partial
from threading import Event, Thread
from time import monotonic, time_ns

from klann_ros.log import Message, Pause, Recording
from klann_ros.log.errors import LogError
from klann_ros.nodes.clocks import steady_time
from klann_ros.nodes.endpoints import name_refusal, UnknownMessageTypeError
from klann_ros.nodes.process import ros_error, ROS_ERRORS
from klann_ros.nodes.raw_executor import RawCallbackGroup
from klann_ros.nodes.solver_watch import SolverWatch
from klann_ros.sanitize.text import printable, printable_line
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.topic_endpoint_info import TopicEndpointInfo

from .interface import RecordingDiagnostics
from .recorded_topic import RecordedTopic

# Period of discovery, and of pending requests without changes [s].
_DISCOVERY_PERIOD = 0.1
_REQUEST_PERIOD = 1.0
# A publisher's node may be discovered later than the publisher by this time [s].
_SETTLING_TIME = 1.0
# A longer delay means that the process was stopped, or the machine suspended [s].
MAX_DELAY = 0.9
# NTP adjusts a clock by less in a period; a larger step is a clock that was set [s].
MAX_CLOCK_STEP = 0.05
# Limit of warnings, as untrusted topics could fill the disk with them.
_MAX_WARNINGS = 500
# Errors of one topic or publisher; the others are recorded.
_TOPIC_ERRORS = (UnknownMessageTypeError, LogError, *ROS_ERRORS)


class Heartbeat:
    """Detects stalls of this process and steps of its clock between calls of `beat`."""

    def __init__(self) -> None:
        # Those that the node has not processed yet.
        self.stalls = deque[Pause]()
        # Times of the last beat: steady [s], and of the log [ns since the epoch].
        self._steady_time = steady_time()
        self._log_time = time_ns()

    @property
    def is_late(self) -> bool:
        """Return whether the next call is overdue."""
        return steady_time() - self._steady_time > _DISCOVERY_PERIOD + MAX_DELAY

    def beat(self) -> Pause | None:
        """Return the time since the last call if the process stalled, or its clock was set."""
        begin = self._log_time
        last_beat = self._steady_time
        self._steady_time = steady_time()
        self._log_time = time_ns()
        passed = self._steady_time - last_beat
        clock_step = (self._log_time - begin) / 1e9 - passed
        if passed > _DISCOVERY_PERIOD + MAX_DELAY:
            reason = f'the recorder stalled for {passed:.1f} s (stopped, or suspended)'
        elif clock_step > MAX_CLOCK_STEP:
            reason = f'the clock was set forward by {clock_step:.2f} s'
        else:
            return None
        self.stalls.append(Pause(begin, self._log_time, {}, reason))
        return self.stalls[-1]


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
        self._node = node
        self._patterns = patterns
        self._solvers = solvers
        self._diagnostics = diagnostics
        self._on_stall = on_stall
        # Takes a name, its publishers, and `is_own`.
        self._make_topic = partial(
            RecordedTopic,
            node,
            RawCallbackGroup(),
            recording=recording,
            put=put,
            on_change=self._on_change,
        )
        self._topics: dict[str, RecordedTopic] = {}
        # Names and types that are not recorded, and the warnings about them.
        self._refused: set[tuple[str, str]] = set()
        self._warnings: set[str] = set()
        # Changed topics, until [s] they are looked at again; and those without a publisher.
        self._unsettled: dict[str, float] = {}
        self._unpublished: set[str] = set()
        self._graph_changed = node.create_guard_condition(self._update)
        self._heartbeat = Heartbeat()
        self._stopped = Event()
        self._thread = Thread(target=self._watch_graph, name='graph', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the discovery."""
        self._stopped.set()
        self._thread.join()

    @property
    def has_stalled(self) -> bool:
        """Return whether this process has just stalled, and `on_stall` has not returned yet."""
        return bool(self._heartbeat.stalls) or self._heartbeat.is_late

    @property
    def published(self) -> set[str]:
        """Return the recorded topics that have a publisher now."""
        return {name for name, topic in self._topics.items() if topic.publisher_count}

    def take_queued(self) -> None:
        """Read all messages received so far."""
        for topic in self._topics.values():
            topic.take_queued()

    def _watch_graph(self) -> None:
        """
        Look in a thread for topics, publishers and stalls, and wake the node's loop.

        A timer in it would rebuild the executor's wait set each time, at fifty times the cost.
        """
        last_graph: object = None
        ticks = 0
        while not self._stopped.wait(_DISCOVERY_PERIOD):
            ticks += 1
            stall = self._heartbeat.beat()
            unpublished = self._unpublished.copy()
            counts = [(name, self._node.count_publishers(name)) for name in unpublished]
            graph = _topics_and_types(self._node), counts
            is_repeated = ticks >= _REQUEST_PERIOD / _DISCOVERY_PERIOD and self._solvers.pending
            if graph != last_graph or stall is not None or self._unsettled or is_repeated:
                self._graph_changed.trigger()
                last_graph = graph
                ticks = 0

    def _update(self) -> None:
        """Record new topics, and adapt those whose publishers have changed."""
        stalls = self._heartbeat.stalls
        while stalls:
            self._on_stall(stalls[0])
            stalls.popleft()
        for name, kinds in _topics_and_types(self._node):
            if all(self._is_known(name, kind) for kind in kinds):
                continue
            if name in self._topics:
                # A publisher of another type matches no subscription.
                self._on_change(name)
            elif self._is_selected(name):
                self._record_or_refuse(name, kinds)
        now = monotonic()
        for name, settled_at in list(self._unsettled.items()):
            self._adapt(name)
            if now > settled_at:
                del self._unsettled[name]
        self._solvers.send_requests()

    def _is_known(self, name: str, kind: str) -> bool:
        topic = self._topics.get(name)
        return (name, kind) in self._refused or (topic is not None and topic.type == kind)

    def _is_selected(self, name: str) -> bool:
        hidden = any(part.startswith('_') for part in name.split('/'))
        return not hidden and any(fnmatchcase(name, pattern) for pattern in self._patterns)

    def _record_or_refuse(self, name: str, kinds: Sequence[str]) -> None:
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
        """Record a topic by its publishers, unless there is none or its types are refused."""
        publishers = self._publishers(name)
        publishers = [p for p in publishers if (name, p.topic_type) not in self._refused]
        if not publishers:
            self._unpublished.add(name)
            return
        self._unpublished.discard(name)
        is_own = None
        if name == self._diagnostics.topic:
            is_own = self._diagnostics.has_published
        try:
            self._topics[name] = self._make_topic(name, publishers, is_own=is_own)
        except _TOPIC_ERRORS as error:
            self._refuse(name, publishers[0].topic_type, ros_error(error))
        else:
            self._on_change(name)

    def _publishers(self, name: str) -> list[TopicEndpointInfo]:
        """Return the publishers of a topic, without this node's."""
        node = (self._node.get_name(), self._node.get_namespace())
        publishers = self._node.get_publishers_info_by_topic(name)
        return [p for p in publishers if (p.node_name, p.node_namespace) != node]

    def _on_change(self, name: str) -> None:
        self._unsettled[name] = monotonic() + _SETTLING_TIME

    def _adapt(self, name: str) -> None:
        """Adapt the subscription of a recorded topic to its present publishers."""
        topic = self._topics[name]
        try:
            publishers = self._publishers(name)
            for other_type in topic.adapt(publishers):
                self._refuse(name, other_type, f'the topic is recorded as {topic.type}')
        except _TOPIC_ERRORS as error:
            self._warn(f'a publisher of {name} is not recorded: {ros_error(error)}')
            return
        if topic.type == 'sensor_msgs/msg/JointState':
            self._solvers.add(publishers)

    def _refuse(self, name: str, type_name: str, reason: str) -> None:
        self._refused.add((name, type_name))
        self._warn(f'{printable(name)} of type {printable(type_name)} is not recorded: {reason}')

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
        topics_and_types: list[tuple[str, list[str]]] = node.get_topic_names_and_types()
        return topics_and_types
    types: dict[str, set[str]] = {}
    with suppress(UnicodeDecodeError):
        for name, namespace in node.get_node_names_and_namespaces():
            with suppress(UnicodeDecodeError, NodeNameNonExistentError):
                for topic, kinds in node.get_publisher_names_and_types_by_node(name, namespace):
                    types.setdefault(topic, set()).update(kinds)
    return [(topic, sorted(types[topic])) for topic in sorted(types)]
