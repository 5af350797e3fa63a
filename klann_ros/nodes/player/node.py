"""`player_node`: an MCAP run back onto topics."""

import argparse
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
import sys
from threading import Event, Thread

from klann_ros.log.errors import LogError
from klann_ros.log.play.playback import length, Playback, Selection
from klann_ros.log.reader import Log, open_log
from klann_ros.log.records import Topic
from klann_ros.log.run_parameters import REPLAYED_PARAMETER, replayed_solvers_json, SOLVER_RECORD
from klann_ros.nodes.lease import leased_topic, LeaseListener
from klann_ros.nodes.parameters import declare, declare_constant
from klann_ros.nodes.process import arguments, Finish, ProcessNode, run
from klann_ros.sanitize.arguments import ArgumentParser
from klann_ros.sanitize.text import listed, printable, printable_line
from klann_ros.stop_signals import StopSignals
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock as ClockMessage

from .controls import (
    add_options,
    declarations,
    DESCRIPTION,
    EPILOG,
    KEYS_IN_WORDS,
    PlayerControls,
)
from .keyboard import Keyboard
from .topics import PlayedTopics

# Nodes listen there whatever their namespace is.
CLOCK = '/clock'
# A message cannot hold later times [ns].
LATEST = 2**31 * 10**9 - 1
# Whoever reads the log is waited for at most so long [s].
LAST_WORDS = 2.0
# How often late messages are told of at most while it plays [s].
REPORT_PERIOD = 5.0
# How long a thread keeps the interpreter from one that wants it: the reading one must not make
# messages late; Python's default is 5 ms [s].
SWITCH_INTERVAL = 0.0005


class PlayerNode(ProcessNode):
    """
    Publish what a log holds, byte for byte, with the recorded quality of service.

    Parameters
    ----------
    log : Log
        An open log.
    options : argparse.Namespace
        The command line's options.
    keyboard : Keyboard
        The terminal's keys.
    finish : Finish
        Is called at the end.

    Raises
    ------
    StartError
        A parameter is refused; the text says why.

    """

    def __init__(
        self, log: Log, options: argparse.Namespace, keyboard: Keyboard, finish: Finish
    ) -> None:
        super().__init__('player_node')
        self._log = log
        self._delay: float = options.delay
        self._finish = finish
        self._said = {'', log.problem}
        end = min(length(log), options.start_offset + options.duration)
        parameters = declarations(options.rate, options.start_offset, end)
        values = declare(self, parameters)
        declare_constant(
            self, 'length', float(end), "where playing ends, from the log's start [s]"
        )
        # Who shows the legs that are played has to know their lengths.
        declare_constant(
            self,
            REPLAYED_PARAMETER,
            replayed_solvers_json(log.metadata.get(SOLVER_RECORD, [])),
            "what the log tells of its solvers' parameters [JSON]",
        )
        self._topics = PlayedTopics(self, _selected_topics(log, options), dict(options.remap))
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
        leased = set(map(leased_topic, self._topics.published_names)) - {''}
        self._leases = [
            LeaseListener(self, topic, partial(controls.on_lease, topic))
            for topic in sorted(leased)
        ]
        self.get_logger().info(self._summary(options))
        self._warn(options)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(REPORT_PERIOD, self._report, clock=steady)
        self._log_clock = _LogClock(self, options.clock, self._time) if options.clock else None
        self._stopped = Event()
        self._thread = Thread(target=self._play, name='player', daemon=True)
        self._thread.start()
        self._keyboard = keyboard
        if not options.disable_keyboard_controls:
            keyboard.start(
                controls.press, lambda: self.get_logger().info(f'keys: {KEYS_IN_WORDS}')
            )

    def close(self) -> int:
        """Stop playing, and wait for what is under way."""
        self._keyboard.close()
        self._stopped.set()
        self._playback.transport.stop()
        self._thread.join(LAST_WORDS)
        self._topics.flush()
        return 0

    def _play(self) -> None:
        try:
            self._stopped.wait(self._delay)
            for messages in self._playback.passes():
                # The messages after a jump are of the new time.
                if self._log_clock is not None:
                    self._log_clock.publish()
                for message in messages:
                    self._topics.publish(message)
                self._report()
            self._finish()
        # Whatever it is: a thread that ends without a word would leave the process for ever.
        except Exception as error:
            if not self._stopped.is_set():
                self.get_logger().error(
                    f'the log cannot be played any further: {printable_line(error)}'
                )
            self._finish(1)

    def _time(self) -> int:
        return self._playback.time

    def _summary(self, options: argparse.Namespace) -> str:
        """Return what is about to be played, in words."""
        rate, position = (self.get_parameter(name).value for name in ('rate', 'position'))
        count = len(self._topics.names)
        parts = [
            f'ready: {printable(options.log)}, {count} topic{"" if count == 1 else "s"}',
            f'{length(self._log):.3f} s at rate {rate:g}',
            f'from {position:g} s' if position else '',
            'again and again' if options.loop else '',
            'paused' if options.start_paused else '',
        ]
        return ', '.join(filter(None, parts))

    def _warn(self, options: argparse.Namespace) -> None:
        """Say what is wrong with the log, and why nothing will be heard."""
        warnings = [self._log.problem] if self._log.problem else []
        names = sorted({topic.name for topic in self._log.topics})
        unknown = sorted(set(options.topics or ()) - set(names))
        has = listed(names) or 'no topics'
        warnings += [f'{printable(name)} is not in the log; it has {has}' for name in unknown]
        short = options.start_offset - length(self._log)
        if short > 0.0:
            warnings.append(f'the log is {short:.3f} s shorter than the start offset')
        if options.clock and CLOCK in names:
            warnings.append(f'the {CLOCK} in the log is not played: --clock publishes it')
        for warning in warnings:
            self.get_logger().warning(printable_line(warning))

    def _report(self) -> None:
        """Say what was late, and what reading has found to be damaged, each once."""
        for text in (str(self._playback.transport.lateness), self._log.problem):
            if text not in self._said:
                self._said.add(text)
                self.get_logger().warning(printable_line(text))


def _selected_topics(log: Log, options: argparse.Namespace) -> list[Topic]:
    return [
        topic
        for topic in log.topics
        if (options.topics is None or topic.name in options.topics)
        and not (options.clock and topic.name == CLOCK)
    ]


class _LogClock:
    """
    Simulated time: publish the log's all the while.

    Also before the first message, and while it stands still.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose publisher and timer they are.
    rate : float
        How often a second of real time.
    time : callable
        Returns the time [ns].

    """

    def __init__(self, node: Node, rate: float, time: Callable[[], int]) -> None:
        self._time = time
        self._publisher = node.create_publisher(ClockMessage, CLOCK, QoSProfile(depth=10))
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(1.0 / rate, self.publish, clock=steady)

    def publish(self) -> None:
        """Publish it now."""
        message = ClockMessage()
        time = min(self._time(), LATEST)
        message.clock.sec, message.clock.nanosec = divmod(time, 10**9)
        self._publisher.publish(message)


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
    sys.setswitchinterval(SWITCH_INTERVAL)
    with log, closing(Keyboard()) as keyboard:
        stop.on_suspend(keyboard.released)
        return run('player_node', partial(PlayerNode, log, options, keyboard), argv, stop)
