"""Which topics are recorded: each from when it appears, with all of its publishers."""

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from threading import Event, Thread
import time
from time import monotonic, time_ns

from klann_ros.log.errors import LogError
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import Pause
from klann_ros.log.write.ledger import Ledger
from klann_ros.log.write.recording import Pauses
from klann_ros.nodes.endpoints import name_refusal, UnknownMessageTypeError
from klann_ros.nodes.process import ros_error, ROS_ERRORS
from klann_ros.nodes.raw_executor import RawCallbackGroup
from klann_ros.sanitize.text import printable, printable_line
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.topic_endpoint_info import TopicEndpointInfo

from .interface import RecordingDiagnostics
from .recorded_topic import RecordedTopic
from .solver_watch import SolverWatch

# How often new topics are looked for, and how often without news where something is awaited [s].
PERIOD, PATIENCE = 0.1, 1.0
# Discovery tells of a publisher before it tells its node: so long is it looked at again [s].
SETTLING = 1.0
# A thread that is so late did not run: the process was stopped, or the machine suspended [s].
MAX_DELAY = 0.9
# NTP moves a clock by less between two looks; a larger step is a clock that was set [s].
MAX_CLOCK_STEP = 0.05
# Runs on while the machine is suspended, where the system has it.
_STEADY_CLOCK = getattr(time, 'CLOCK_BOOTTIME', time.CLOCK_MONOTONIC)
# Anybody may publish, so often that a log of complaints would fill the disk.
MOST_COMPLAINTS = 500
# What one topic, or one of its publishers, can be wrong about; the others are recorded.
TOPIC_ERRORS = (UnknownMessageTypeError, LogError, *ROS_ERRORS)


class Heartbeat:
    """Detects, from one call of `beat` to the next, that this process did not run."""

    def __init__(self) -> None:
        self._before = time.clock_gettime(_STEADY_CLOCK), time_ns()

    @property
    def is_late(self) -> bool:
        """Return whether the next call is overdue."""
        return time.clock_gettime(_STEADY_CLOCK) - self._before[0] > PERIOD + MAX_DELAY

    def beat(self) -> Pause | None:
        """Return the time since the last call if the process did not run, or its clock jumped."""
        (steady, wall), now = self._before, (time.clock_gettime(_STEADY_CLOCK), time_ns())
        self._before = now
        passed, shown = now[0] - steady, (now[1] - wall) / 1e9
        if passed > PERIOD + MAX_DELAY:
            why = f'the recorder did not run for {passed:.1f} s (stopped, or suspended)'
        elif shown - passed > MAX_CLOCK_STEP:
            why = f'the clock was set forward by {shown - passed:.2f} s'
        else:
            return None
        return Pause(wall, now[1], {}, why)


class TopicWatch:
    """
    Subscribe to topics as they appear.

    Parameters
    ----------
    node : rclpy.node.Node
        Who subscribes.
    patterns : sequence of str
        Full names of topics; * stands for anything.
    put : callable
        Takes every message.
    ledger : Ledger
        Where every message is counted.
    pauses : Pauses
        What is left out.
    solvers : SolverWatch
        Is told who publishes joint states.
    diagnostics : RecordingDiagnostics
        What is published by the node itself, and not recorded.
    on_stall : callable
        Is given each time in which this process did not run.

    """

    def __init__(
        self,
        node: Node,
        patterns: Sequence[str],
        *,
        put: Callable[[Message], None],
        ledger: Ledger,
        pauses: Pauses,
        solvers: SolverWatch,
        diagnostics: RecordingDiagnostics,
        on_stall: Callable[[Pause], None],
    ) -> None:
        """Look at once, and from then on."""
        self._on_stall, self._stalls = on_stall, deque[Pause]()
        self._heartbeat = Heartbeat()
        self._topics: dict[str, RecordedTopic] = {}
        self._node, self._patterns, self._solvers = node, patterns, solvers
        self._put, self._ledger = put, ledger
        self._pauses, self._diagnostics = pauses, diagnostics
        self._group = RawCallbackGroup()
        self._refused: set[tuple[str, str]] = set()
        self._complaints: set[str] = set()
        self._unsettled: dict[str, float] = {}
        self._silent: set[str] = set()
        self._stopped = Event()
        self._news = node.create_guard_condition(self._look)
        self._thread = Thread(target=self._watch_graph, name='graph', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Look for new topics no more."""
        self._stopped.set()
        self._thread.join()

    @property
    def has_stalled(self) -> bool:
        """Return whether this process did not run just now, and nobody has been told yet."""
        return bool(self._stalls) or self._heartbeat.is_late

    def published(self) -> set[str]:
        """Return the recorded topics that have a publisher now."""
        return {name for name, topic in self._topics.items() if topic.has_publisher}

    def take_queued(self) -> None:
        """Take all that was received so far."""
        for topic in self._topics.values():
            topic.take_queued()

    def _watch_graph(self) -> None:
        """
        Have `_look` called when topics or publishers have appeared, in a thread of its own.

        A timer would have the executor build its wait set anew each time, which takes fifty times
        as long as to look.
        """
        before: object = None
        looks = 0
        while not self._stopped.wait(PERIOD):
            looks += 1
            is_late = looks >= PATIENCE / PERIOD
            stall = self._heartbeat.beat()
            if stall is not None:
                self._stalls.append(stall)
            now = self._graph()
            if now != before or stall is not None or self._is_due(is_late):
                self._news.trigger()
                before, looks = now, 0

    def _graph(self) -> object:
        """Return what may be news: topics, and publishers of those that had none."""
        counts = [(name, self._node.count_publishers(name)) for name in self._silent.copy()]
        return _topics_and_types(self._node), counts

    def _is_due(self, is_late: bool) -> bool:
        return bool(self._unsettled) or (is_late and bool(self._solvers.unanswered))

    def _look(self) -> None:
        while self._stalls:
            self._on_stall(self._stalls.popleft())
        for name, kinds in _topics_and_types(self._node):
            if all(self._is_known(name, kind) for kind in kinds):
                continue
            if name in self._topics:
                # Of another type: no subscription hears of its publisher.
                self._on_change(name)
            elif self._is_wanted(name):
                self._try(name, kinds)
        now = monotonic()
        for name, until in list(self._unsettled.items()):
            self._look_at(name)
            if now > until:
                del self._unsettled[name]
        self._solvers.ask()

    def _is_known(self, name: str, kind: str) -> bool:
        recorded = self._topics.get(name)
        return (name, kind) in self._refused or (recorded is not None and recorded.type == kind)

    def _is_wanted(self, name: str) -> bool:
        hidden = any(part.startswith('_') for part in name.split('/'))
        return not hidden and any(fnmatchcase(name, pattern) for pattern in self._patterns)

    def _try(self, name: str, kinds: Sequence[str]) -> None:
        # A middleware tells of names that ROS refuses: not all that it meets comes from ROS.
        reason = name_refusal(name)
        if reason:
            for kind in kinds:
                self._refuse(name, kind, reason)
            return
        try:
            self._subscribe(name)
        except TOPIC_ERRORS as error:
            self._complain(f'{name} is not recorded: {ros_error(error)}')

    def _subscribe(self, name: str) -> None:
        publishers = [
            publisher
            for publisher in self._publishers(name)
            if (name, publisher.topic_type) not in self._refused
        ]
        if not publishers:
            self._silent.add(name)
            return
        self._silent.discard(name)
        own = self._diagnostics
        try:
            self._topics[name] = RecordedTopic(
                self._node,
                self._group,
                name,
                publishers,
                put=self._put,
                ledger=self._ledger,
                pauses=self._pauses,
                changed=self._on_change,
                is_own=own.has_published if name == own.topic else None,
            )
        except TOPIC_ERRORS as error:
            self._refuse(name, publishers[0].topic_type, ros_error(error))
        else:
            self._on_change(name)

    def _publishers(self, name: str) -> list[TopicEndpointInfo]:
        """Return who publishes a topic, without this node."""
        own = self._node.get_name(), self._node.get_namespace()
        return [
            publisher
            for publisher in self._node.get_publishers_info_by_topic(name)
            if (publisher.node_name, publisher.node_namespace) != own
        ]

    def _on_change(self, name: str) -> None:
        self._unsettled[name] = monotonic() + SETTLING

    def _look_at(self, name: str) -> None:
        topic = self._topics[name]
        try:
            publishers = self._publishers(name)
            for kind in topic.adapt(publishers):
                self._refuse(name, kind, f'the topic is recorded as {topic.type}')
        except TOPIC_ERRORS as error:
            self._complain(f'a publisher of {name} is not heard: {ros_error(error)}')
            return
        if topic.type == 'sensor_msgs/msg/JointState':
            self._solvers.add(publishers)

    def _refuse(self, name: str, kind: str, reason: str) -> None:
        self._refused.add((name, kind))
        of = f'{printable(name)} of type {printable(kind)}'
        self._complain(f'{of} is not recorded: {reason}')

    def _complain(self, text: str) -> None:
        """Say what is left out, each once."""
        if text in self._complaints or len(self._complaints) >= MOST_COMPLAINTS:
            return
        self._complaints.add(text)
        if len(self._complaints) == MOST_COMPLAINTS:
            text += '; and that is enough of such complaints'
        self._node.get_logger().warning(printable_line(text))


def _topics_and_types(node: Node) -> list[tuple[str, list[str]]]:
    """
    Return what is published or heard, and the types of it.

    DDS takes any bytes for a name, and rclpy tells none at all where one is no text. Then the
    nodes are asked one by one, and whose names are no text is left out.
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
