"""`player_node`: an MCAP run back onto topics."""

import argparse
from collections.abc import Sequence
from functools import partial
from math import inf, nan
import sys
from threading import Event, Thread
from time import monotonic

from klann_ros.log.errors import LogError, MalformedQosError
from klann_ros.log.playback import schedule, span
from klann_ros.log.qos import qos_from_yaml
from klann_ros.log.reader import Log, open_log
from klann_ros.log.records import Topic
from klann_ros.stop_signals import StopSignals
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException
from rclpy.publisher import Publisher
from rclpy.qos import ReliabilityPolicy

from .message_types import message_class, UnknownMessageTypeError
from .process import arguments, command_line, Finish, ProcessNode, run
from .qos import to_publish

# A log of one moment is not looped faster than this [s].
SHORTEST_LOOP = 0.1
# What is under way at the end is waited for at most so long [s].
LAST_WORDS = 2.0


class PlayerNode(ProcessNode):
    """
    Publish what a log holds, byte for byte, with the recorded quality of service.

    Parameters
    ----------
    log : Log
        An open log.
    options : argparse.Namespace
        The command line's options.
    finish : Finish
        Is called at the end.

    """

    def __init__(self, log: Log, options: argparse.Namespace, finish: Finish) -> None:
        """Make a publisher for each topic, and begin."""
        super().__init__('player_node')
        self._log = log
        self._options = options
        self._finish = finish
        self._stopped = Event()
        self._renamed = dict(options.remap)
        self._publishers_by_topic = self._make_publishers()
        self._span = span(log, options.start_offset, options.duration)
        self._warn()
        self._thread = Thread(target=self._play, name='player', daemon=True)
        self._thread.start()

    def close(self) -> int:
        """Stop playing, and wait for what is under way."""
        self._stopped.set()
        self._thread.join()
        for publisher in self._publishers_by_topic.values():
            if publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE:
                publisher.wait_for_all_acked(Duration(seconds=LAST_WORDS))
        return 0

    def _warn(self) -> None:
        """Say what is wrong with the log, and why nothing will be heard."""
        warnings = [self._log.problem] if self._log.problem else []
        names = sorted(topic.name for topic in self._log.topics)
        unknown = sorted((self._options.topics or set()) - set(names))
        has = ', '.join(names) or 'no topics'
        warnings += [f'{name} is not in the log; it has {has}' for name in unknown]
        if self._span < 0.0:
            warnings.append(f'the log is {-self._span:.3f} s shorter than the start offset')
        for warning in warnings:
            self.get_logger().warning(warning)

    def _make_publishers(self) -> dict[Topic, Publisher]:
        wanted = self._options.topics
        publishers = {}
        for topic in self._log.topics:
            if wanted is not None and topic.name not in wanted:
                continue
            try:
                publishers[topic] = self._make_publisher(topic)
            except (UnknownMessageTypeError, NameValidationException) as error:
                reason = ' '.join(str(error).split())
                self.get_logger().warning(f'{topic.name} is not played: {reason}')
        return publishers

    def _make_publisher(self, topic: Topic) -> Publisher:
        if topic.message_encoding != 'cdr':
            msg = f'its messages are {topic.message_encoding or "of no encoding"}, not cdr'
            raise UnknownMessageTypeError(msg)
        try:
            offered = qos_from_yaml(topic.qos)
        except MalformedQosError as error:
            self.get_logger().warning(f'{topic.name} is played reliable and volatile: {error}')
            offered = []
        # In a namespace a replay does not meet the live topics.
        name = self._renamed.get(topic.name, topic.name)
        name = f'{self.get_namespace().rstrip("/")}/{name.lstrip("/")}'
        return self.create_publisher(message_class(topic.type), name, to_publish(offered))

    def _play(self) -> None:
        try:
            self._stopped.wait(self._options.delay)
            while not self._stopped.is_set():
                self._play_once()
                if not self._options.loop:
                    break
            self._finish()
        # Whatever it is: a thread that ends without a word would leave the process for ever.
        except Exception as error:
            self.get_logger().error(f'the log cannot be played any further: {error}')
            self._finish(1)

    def _play_once(self) -> None:
        options, publishers = self._options, self._publishers_by_topic
        due_messages = schedule(
            self._log,
            rate=options.rate,
            start_offset=options.start_offset,
            duration=options.duration,
            topics={topic.name for topic in publishers},
        )
        begin = monotonic()
        for due, message in due_messages:
            if self._stopped.wait(max(0.0, begin + due - monotonic())):
                return
            if message.topic in publishers:
                publishers[message.topic].publish(message.data)
        # The next turn of a loop comes when the time of this one is over.
        end = begin + max(self._span / options.rate, SHORTEST_LOOP)
        if options.loop:
            self._stopped.wait(end - monotonic())


def _parser() -> argparse.ArgumentParser:
    parser = command_line(
        'player_node',
        'Play a run back onto its topics: the recorded bytes, with the recorded quality of '
        'service.\nPlay under a namespace or remap, so that a replay does not meet the live '
        'topics:\n  player_node runs/x --ros-args -r __ns:=/replay',
    )
    parser.add_argument('log', metavar='LOG', help='a run folder or an .mcap file')
    parser.add_argument('--rate', type=_rate, default=1.0, help='2 is twice as fast')
    parser.add_argument('--loop', action='store_true', help='play again and again')
    parser.add_argument(
        '--start-offset', type=_not_negative, default=0.0, metavar='S', help='leave out S seconds'
    )
    parser.add_argument(
        '--duration', type=_positive, default=inf, metavar='S', help='play S seconds of the log'
    )
    parser.add_argument(
        '--delay',
        type=_not_negative,
        default=0.5,
        metavar='S',
        help='wait S seconds first, so that subscribers find the publishers (default: 0.5)',
    )
    parser.add_argument('--topics', nargs='+', metavar='T', help='play these topics only')
    parser.add_argument(
        '--remap',
        nargs='+',
        type=_renaming,
        default=[],
        metavar='OLD:=NEW',
        help='publish OLD as NEW',
    )
    return parser


def _positive(text: str) -> float:
    number = _number(text)
    if not 0.0 < number <= inf:
        raise argparse.ArgumentTypeError(f'{text} is refused: it must be a number > 0')
    return number


def _not_negative(text: str) -> float:
    number = _number(text)
    if not 0.0 <= number < inf:
        raise argparse.ArgumentTypeError(f'{text} is refused: it must be a number >= 0')
    return number


def _rate(text: str) -> float:
    number = _number(text)
    if not 1e-6 <= number <= 1e6:
        raise argparse.ArgumentTypeError(f'{text} is refused: it must be within 1e-6 .. 1e6')
    return number


def _number(text: str) -> float:
    """Return a number, or NaN, which fails every comparison."""
    try:
        return float(text)
    except ValueError:
        return nan


def _renaming(text: str) -> tuple[str, str]:
    old, given, new = text.partition(':=')
    if not (old and given and new):
        raise argparse.ArgumentTypeError(f'{text} is refused: write OLD:=NEW')
    return _full(old), _full(new)


def _full(name: str) -> str:
    return name if name.startswith('/') else f'/{name}'


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    options = arguments(_parser(), argv)
    if options.topics is not None:
        options.topics = {_full(name) for name in options.topics}
    try:
        log = open_log(options.log)
    except (LogError, OSError) as error:
        print(f'player_node: {error}', file=sys.stderr)
        return 2
    with log:
        return run('player_node', partial(PlayerNode, log, options), argv, stop)
