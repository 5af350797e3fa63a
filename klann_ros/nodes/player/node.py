"""`player_node`: an MCAP run back onto topics."""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from functools import partial
import sys
from threading import Event, Thread
from typing import Any, TYPE_CHECKING

from klann_ros.cli import ArgumentParser
from klann_ros.log import (
    latched_count,
    length,
    Log,
    Message,
    open_log,
    Playback,
    Qos,
    QosTexts,
    REPLAYED_PARAMETER,
    replayed_solvers_json,
    Selection,
    Topic,
)
from klann_ros.log.errors import LogError, MalformedQosError
from klann_ros.messages import MAX_STAMP
from klann_ros.nodes import endpoints
from klann_ros.nodes.crank_output import standstill
from klann_ros.nodes.keyboard import Keyboard
from klann_ros.nodes.lease import leased_topic, LeaseListener
from klann_ros.nodes.parameters import declare, declare_constant, StartError
from klann_ros.nodes.process import (
    arguments,
    Finish,
    LOG_PERIOD,
    ProcessNode,
    ros_error,
    ROS_ERRORS,
    run,
)
from klann_ros.sanitize.text import counted, listed, printable, printable_line
from klann_ros.stop_signals import StopSignals
from rclpy._rclpy_pybind11 import RCLError
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rosgraph_msgs.msg import Clock as ClockMessage

from .controls import add_options, declarations, DESCRIPTION, EPILOG, KEYS_IN_WORDS, PlayerControls

if TYPE_CHECKING:
    from rclpy.publisher import Publisher


# The same in every namespace.
_CLOCK = '/clock'
# Shutdown timeout of the player's thread [s].
_SHUTDOWN_TIMEOUT = 2.0
# Period of reports about late messages [s].
_REPORT_PERIOD = 5.0
# Python's thread switch interval, 5 ms by default: the reading thread must not delay messages [s].
_SWITCH_INTERVAL = 0.0005


class PlayerNode(ProcessNode):
    """Publish an open log, byte for byte, with the recorded quality of service."""

    def __init__(
        self, log: Log, options: argparse.Namespace, keyboard: Keyboard, finish: Finish
    ) -> None:
        """Declare and validate the parameters; a StartError names a refused one."""
        super().__init__('player_node')
        self._log = log
        self._delay: float = options.delay
        self._finish = finish
        self._reported = {'', log.problem}
        end = min(length(log), options.start_offset + options.duration)
        parameters = declarations(options.rate, options.start_offset, end)
        values = declare(self, parameters)
        declare_constant(
            self, 'length', float(end), "where playing ends, from the log's start [s]"
        )
        # The live page shows the played legs with these lengths.
        declare_constant(
            self,
            REPLAYED_PARAMETER,
            replayed_solvers_json(log.solvers),
            'parameters of the solvers in the log [JSON]',
        )
        self._topics = PlayedTopics(self, _selected_topics(log, options), dict(options.remap))
        if not self._topics.names:
            raise StartError(
                f'nothing to play: {printable(options.log)} has {_listed_topics(log)}'
            )
        self._playback = Playback(
            log,
            Selection(
                self._topics.names,
                self._topics.latched,
                float(values['position']),
                options.start_offset + options.duration,
                loop=options.loop,
            ),
            rate=float(values['rate']),
            paused=options.start_paused,
        )
        controls = PlayerControls(self, self._playback.transport, parameters)
        leased = {*map(leased_topic, self._topics.published_names)} - {''}
        for topic in sorted(leased):
            LeaseListener(self, topic, partial(controls.on_lease, topic))
        self.get_logger().info(self._summary(options))
        self._warn(options)
        endpoints.create_steady_timer(self, _REPORT_PERIOD, self._report)
        self._clock_publisher: Any = None
        if options.clock:
            # Also before the first message, and while the log is paused.
            qos = QoSProfile(depth=10)
            self._clock_publisher = self.create_publisher(ClockMessage, _CLOCK, qos)
            endpoints.create_steady_timer(self, 1.0 / options.clock, self._publish_clock)
        self._stopped = Event()
        self._thread = Thread(target=self._play, name='player', daemon=True)
        self._thread.start()
        self._keyboard = keyboard
        if not options.disable_keyboard_controls:
            keyboard.start(
                controls.press, lambda: self.get_logger().info(f'keys: {KEYS_IN_WORDS}')
            )

    def close(self) -> int:
        """Stop playing, then the moved robots; wait until the last messages have arrived."""
        self._stopped.set()
        self._playback.transport.stop()
        self._thread.join(_SHUTDOWN_TIMEOUT)
        self._topics.stop_robots()
        self._keyboard.close()
        self._topics.flush()
        return 0

    def _play(self) -> None:
        """Publish the log pass by pass, in the thread of the playback."""
        try:
            self._stopped.wait(self._delay)
            for messages in self._playback.passes():
                # The messages after a jump are of the new time.
                if self._clock_publisher is not None:
                    self._publish_clock()
                for message in messages:
                    self._topics.publish(message)
                self._report()
            self._finish()
        # The process must not outlive this thread.
        except Exception as error:
            if not self._stopped.is_set():
                self.get_logger().error(
                    f'the log cannot be played any further: {printable_line(error)}'
                )
            self._finish(1)

    def _publish_clock(self) -> None:
        message = ClockMessage()
        time = min(self._playback.time, MAX_STAMP)
        message.clock.sec, message.clock.nanosec = divmod(time, 10**9)
        self._clock_publisher.publish(message)

    def _summary(self, options: argparse.Namespace) -> str:
        rate = self.get_parameter('rate').value
        position = self.get_parameter('position').value
        topics = counted(len(self._topics.names), 'topic')
        summary = f'ready: {printable(options.log)}, {topics}, {length(self._log):.3f} s'
        summary += f' at rate {rate:g}'
        if position:
            summary += f', from {position:g} s'
        if options.loop:
            summary += ', again and again'
        if options.start_paused:
            summary += ', paused'
        return summary

    def _warn(self, options: argparse.Namespace) -> None:
        """Log what of the log or of the options has no effect."""
        warnings = [self._log.problem] if self._log.problem else []
        if self._log.times.impossible_count:
            warnings.append(f'{self._log.times}; such messages are not played')
        names = {topic.name for topic in self._log.topics}
        for name in sorted(set(options.topics or ()) - names):
            warnings.append(
                f'{printable(name)} is not in the log; it has {_listed_topics(self._log)}'
            )
        excess = options.start_offset - length(self._log)
        if excess > 0.0:
            warnings.append(f'the log is {excess:.3f} s shorter than the start offset')
        if options.clock and _CLOCK in names:
            warnings.append(f'the {_CLOCK} in the log is not played: --clock publishes it')
        for warning in warnings:
            self.get_logger().warning(printable_line(warning))

    def _report(self) -> None:
        """Report late messages, damage found while reading, and other publishers, each once."""
        texts = [str(self._playback.transport.lateness), self._log.problem]
        shared_names = self._topics.shared_names()
        if shared_names:
            names = listed(shared_names)
            texts.append(f'other nodes publish on {names} too; subscribers receive both')
        for text in texts:
            if text not in self._reported:
                self._reported.add(text)
                self.get_logger().warning(printable_line(text))


def _listed_topics(log: Log) -> str:
    return listed(sorted({topic.name for topic in log.topics})) or 'no topics'


def _selected_topics(log: Log, options: argparse.Namespace) -> list[Topic]:
    topics = []
    for topic in log.topics:
        is_chosen = options.topics is None or topic.name in options.topics
        if is_chosen and not (options.clock and topic.name == _CLOCK):
            topics.append(topic)
    return topics


# Topics with several publishers in every system.
_SHARED_TOPICS = {'/diagnostics', '/parameter_events', '/rosout', '/tf', '/tf_static'}
# Warnings about topics at the start.
_MAX_WARNINGS = 20
# Depth of a queue, as a damaged log may hold any number.
MAX_QUEUE_DEPTH = 100_000
# Depth of a latched topic whose depth is not in the log; most keep 1 message.
LATCHED_DEPTH = 10


class PlayedTopics:
    """A publisher for each topic, under its own or its new full name; refusals are logged."""

    def __init__(self, node: Node, topics: Iterable[Topic], renamed: Mapping[str, str]) -> None:
        self._node = node
        self._renamed = renamed
        self._publishers: dict[Topic, Publisher] = {}
        # The last message of each publisher that has published any.
        self._last_messages: dict[Publisher, bytes] = {}
        # The number of messages that each latched topic keeps for late subscribers.
        self.latched: dict[str, int] = {}
        self._qos = QosTexts()
        self._warnings: list[str] = []
        by_name: dict[str, list[Topic]] = {}
        for topic in topics:
            by_name.setdefault(topic.name, []).append(topic)
        for name, channels in by_name.items():
            try:
                self._create_publisher(name, channels)
            except (endpoints.UnknownMessageTypeError, *ROS_ERRORS) as error:  # noqa: PERF203, RUF100
                self._warnings.append(f'{printable(name)} is not played: {ros_error(error)}')
        for warning in self._warnings[:_MAX_WARNINGS]:
            node.get_logger().warning(printable_line(warning))
        excess = len(self._warnings) - _MAX_WARNINGS
        if excess > 0:
            node.get_logger().warning(f'and {counted(excess, "more warning")} about topics')

    @property
    def names(self) -> frozenset[str]:
        """Return the played topics' names in the log."""
        return frozenset(topic.name for topic in self._publishers)

    @property
    def published_names(self) -> frozenset[str]:
        """Return the full names of the published topics."""
        return frozenset(publisher.topic_name for publisher in self._publishers.values())

    def shared_names(self) -> list[str]:
        """Return the topics on which other nodes publish as well, though one is usual."""
        names = sorted(self.published_names - _SHARED_TOPICS)
        return [name for name in names if self._node.count_publishers(name) > 1]

    def publish(self, message: Message) -> None:
        """Publish a message's bytes."""
        publisher = self._publishers.get(message.topic)
        if publisher is None:
            return
        try:
            publisher.publish(message.data)
            self._last_messages[publisher] = message.data
        except RCLError as error:
            self._node.get_logger().error(
                f'a message of {printable(message.topic.name)} is left out: {ros_error(error)}',
                throttle_duration_sec=LOG_PERIOD,
            )

    def stop_robots(self) -> None:
        """Publish zero wherever a robot was commanded."""
        for publisher, data in self._last_messages.items():
            command = standstill(publisher.topic_name, publisher.msg_type, data)
            if command is not None:
                endpoints.publish_last(publisher, command)

    def flush(self) -> None:
        """Wait until the last messages have arrived, up to a timeout."""
        endpoints.flush(set(self._publishers.values()))

    def _create_publisher(self, name: str, channels: Sequence[Topic]) -> None:
        """Make the publisher of a topic that may have several channels in the log."""
        first = channels[0]
        namespace = self._node.get_namespace().rstrip('/')
        full_name = f'{namespace}/{self._renamed.get(name, name).removeprefix("/")}'
        reason = endpoints.name_refusal(full_name)
        if first.message_encoding != 'cdr':
            encoding = printable(first.message_encoding) or 'of no encoding'
            reason = reason or f'its messages are {encoding}, not cdr'
        if reason:
            raise ValueError(reason)
        kind = endpoints.message_class(first.type)
        playable = []
        for topic in channels:
            if (topic.type, topic.message_encoding) == (first.type, first.message_encoding):
                playable.append(topic)
            else:
                self._warnings.append(
                    f'{printable(name)} is not played as {printable(topic.type)} '
                    f'({printable(topic.message_encoding)}): in the same log it is '
                    f'{printable(first.type)}'
                )
        offered: list[Qos] = []
        for topic in playable:
            offered += self._offered_qos(topic)
        publisher = self._node.create_publisher(kind, full_name, publishing_profile(offered))
        self._publishers.update(dict.fromkeys(playable, publisher))
        if offered and latched_count(offered):
            self.latched[name] = latched_count(offered)

    def _offered_qos(self, topic: Topic) -> list[Qos]:
        try:
            return self._qos.profiles(topic.qos)
        except MalformedQosError as error:
            name = printable(topic.name)
            self._warnings.append(f'{name} is played reliable and volatile: {error}')
            return []


def publishing_profile(offered: Sequence[Qos]) -> QoSProfile:
    """
    Return the profile that matches every subscription to one of the recorded publishers.

    It is reliable or latched if one of them was; durations and liveliness are the first's.
    Discovery does not include history and depth, so most logs lack them.
    """
    if not offered:
        return endpoints.OUTPUT
    first = offered[0]
    latched = latched_count(offered)
    has_depth = any(profile.depth or profile.history == 'keep_all' for profile in offered)
    # A latched topic must not repeat more than was latched; other queues have at least the depth
    # of this package's own.
    min_depth = (1 if has_depth else LATCHED_DEPTH) if latched else endpoints.DEPTH
    depth = min(max(latched or first.depth, min_depth), MAX_QUEUE_DEPTH)
    reliable = any(
        _policy_of(ReliabilityPolicy, profile.reliability, ReliabilityPolicy.RELIABLE)
        == ReliabilityPolicy.RELIABLE
        for profile in offered
    )
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        deadline=Duration(nanoseconds=first.deadline),
        lifespan=Duration(nanoseconds=first.lifespan),
        liveliness=_policy_of(LivelinessPolicy, first.liveliness, LivelinessPolicy.AUTOMATIC),
        liveliness_lease_duration=Duration(nanoseconds=first.liveliness_lease_duration),
        avoid_ros_namespace_conventions=first.avoid_ros_namespace_conventions,
    )


def _policy_of(policies: type, word: str, default: object) -> object:
    """Return the policy of a recorded word; `default` for one that no publisher can offer."""
    if word in ('unknown', 'system_default', 'best_available'):
        return default
    return policies.__members__.get(word.upper(), default)  # type: ignore[attr-defined]


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = ArgumentParser('player_node', DESCRIPTION, EPILOG)
    add_options(parser)
    options = arguments(parser, argv)
    try:
        log = open_log(options.log)
    except (LogError, OSError) as error:
        print(f'player_node: {printable_line(error)}', file=sys.stderr)
        return 2
    sys.setswitchinterval(_SWITCH_INTERVAL)
    with log, closing(Keyboard()) as keyboard:
        stop.on_suspend(keyboard.released)
        return run('player_node', partial(PlayerNode, log, options, keyboard), argv, stop)
