"""Control of a playback: command line, services, parameters and keys."""

import argparse
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf
from typing import Any

from klann_ros.cli import number_type, path
from klann_ros.log import LOG_HELP, PlaybackError, RATES, Transport
from klann_ros.nodes.endpoints import create_trigger
from klann_ros.nodes.parameters import Declaration, number, on_change
from rclpy.node import Node
from rclpy.parameter import Parameter

DESCRIPTION = """\
Play a run back onto its topics: the recorded bytes, with the recorded quality of service.
Play under a namespace or remap, so that a replay does not meet the live topics:
  player_node runs/x --ros-args -r __ns:=/replay"""
EPILOG = """\
While a page of view_node drives a crank_angle or cmd_vel that the log plays, the log is paused.
While it plays:
  services ~/pause, ~/resume, and ~/step, which plays exactly the next message of a paused log
  parameter rate: 2 is twice as fast; parameter position: set it to go there [s]
  keys, in the foreground of a terminal, as ros2 bag play has them:
    space           pause and resume
    right arrow     play exactly the next message of a paused log
    up, down arrow  10 % faster, slower
Latched topics offer at each start what they offered there in the log. A loop, or going back, is a
jump back in time: give --clock to let nodes with use_sim_time follow."""
_CLOCK_RATES = (1e-3, 1e4)
KEYS_IN_WORDS = (
    'space pauses and resumes, right arrow plays the next message of a paused log, up and down '
    'arrow make it 10 % faster and slower'
)
# Factor of a key on the rate.
_RATE_FACTOR = 1.1
# Queued keys: more, of a held key or a pasted text, are dropped.
_MAX_KEYS = 20


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a player; names of topics become full names."""
    rate = _number_within(*RATES)
    clock_rate = _number_within(*_CLOCK_RATES)
    not_negative = number_type(lambda n: 0.0 <= n < inf, 'a number >= 0')
    positive = number_type(lambda n: 0.0 < n <= inf, 'a number > 0')
    add = parser.add_argument
    add('log', metavar='LOG', type=path, help=LOG_HELP)
    add('--rate', type=rate, default=1.0, metavar='R', help='2 is twice as fast')
    add('--loop', action='store_true', help='play again and again')
    add('--start-offset', type=not_negative, default=0.0, metavar='S', help='leave out S seconds')
    add('--duration', type=positive, default=inf, metavar='S', help='play S seconds of the log')
    add(
        '--delay',
        type=not_negative,
        default=0.5,
        metavar='S',
        help='wait S seconds first, so that subscribers find the publishers (default: 0.5)',
    )
    add('--topics', nargs='+', type=_full_name, metavar='T', help='play these topics only')
    remap: dict[str, Any] = {'nargs': '+', 'type': _renaming, 'default': [], 'metavar': 'OLD:=NEW'}
    add('--remap', **remap, help='publish OLD as NEW')
    add(
        '--clock',
        type=clock_rate,
        metavar='HZ',
        help="publish the log's time on /clock, so often a second; a recorded /clock is left out",
    )
    add('--start-paused', action='store_true', help='wait for ~/resume, ~/step or a key')
    add('--disable-keyboard-controls', action='store_true', help='leave the terminal alone')


def _number_within(lower: float, upper: float) -> Callable[[str], Any]:
    return number_type(lambda n: lower <= n <= upper, f'within {lower:g} .. {upper:g}')


def _renaming(text: str) -> tuple[str, str]:
    old_name, _, new_name = text.partition(':=')
    if not (old_name and new_name):
        raise argparse.ArgumentTypeError(f'{text} is refused: write OLD:=NEW')
    return _full_name(old_name), _full_name(new_name)


def _full_name(name: str) -> str:
    return name if name.startswith('/') else f'/{name}'


def declarations(rate: float, position: float, length: float) -> tuple[Declaration, Declaration]:
    """Return the parameters, with their values at start, of a log of a length [s]."""
    return (
        number('rate', rate, '2 plays the log twice as fast', *RATES, read_only=False),
        number(
            'position',
            position,
            'set it to jump; after a jump, a pause or a step it is the present position, from the '
            'start of the log [s]',
            0.0,
            max(position, length),
            read_only=False,
        ),
    )


PLAYER_PARAMETERS = declarations(1.0, 0.0, 0.0)


class PlayerControls:
    """Services, declared parameters and keys of a node that control a transport."""

    def __init__(
        self, node: Node, transport: Transport, parameters: Sequence[Declaration]
    ) -> None:
        self._node = node
        self._transport = transport
        self._updates_position = False
        # The drivers by topic, and whether the log resumes when they leave.
        self._drivers: dict[str, str] = {}
        self._resumes = False
        self._actions = {
            'pause': (transport.pause, 'paused at'),
            'resume': (transport.resume, 'playing from'),
            'step': (transport.step, 'one message on, at'),
        }
        for name in self._actions:
            create_trigger(node, name, partial(self._run_action, name))
        self._keys: deque[str] = deque(maxlen=_MAX_KEYS)
        self._pressed = node.create_guard_condition(self._on_keys)
        on_change(node, parameters, self._apply_parameters)

    def on_lease(self, topic: str, driver: str) -> None:
        """Pause while a topic of the log has a driver; resume when the last one leaves."""
        was_driven = bool(self._drivers)
        if driver:
            self._drivers[topic] = driver
            self._node.get_logger().info(f'pauses: {driver} drives {topic}')
            if not was_driven:
                self._resumes = not self._transport.paused
                self._transport.pause()
            return
        self._drivers.pop(topic, None)
        if was_driven and not self._drivers and self._resumes:
            self._transport.resume()
            self._node.get_logger().info('goes on: the driver has left')

    def press(self, key: str) -> None:
        """Queue a key's action for the node's thread; thread safe."""
        self._keys.append(key)
        self._pressed.trigger()

    def _run_action(self, name: str) -> tuple[bool, str]:
        act, state = self._actions[name]
        if self._drivers and name != 'pause':
            topic, driver = next(iter(self._drivers.items()))
            return False, f'{driver} drives {topic}; the log can go on when it has left'
        # A user's pause outlasts the drivers.
        self._resumes = False
        try:
            act()
        except PlaybackError as error:
            return False, str(error)
        return True, f'{state} {self._update_position():.6f} s'

    def _toggle(self) -> tuple[bool, str]:
        return self._run_action('resume' if self._transport.paused else 'pause')

    def _change_rate(self, factor: float) -> tuple[bool, str]:
        # Rounding makes one key undo the other.
        rate = float(f'{self._node.get_parameter("rate").value * factor:.9g}')
        (answer,) = self._node.set_parameters([Parameter('rate', value=rate)])
        return answer.successful, answer.reason or f'rate {rate:g}'

    def _on_keys(self) -> None:
        actions: dict[str, Callable[[], tuple[bool, str]]] = {
            'space': self._toggle,
            'right': partial(self._run_action, 'step'),
            'up': partial(self._change_rate, _RATE_FACTOR),
            'down': partial(self._change_rate, 1.0 / _RATE_FACTOR),
        }
        while self._keys:
            is_done, message = actions[self._keys.popleft()]()
            if is_done:
                self._node.get_logger().info(message)
            else:
                self._node.get_logger().warning(message)

    def _update_position(self) -> float:
        """Set the parameter to the present position, without a seek; return it [s]."""
        position = self._transport.position
        self._updates_position = True
        self._node.set_parameters([Parameter('position', value=position)])
        self._updates_position = False
        return position

    def _apply_parameters(self, values: Mapping[str, Any]) -> None:
        """Change the rate, and seek to a position that a user has set."""
        if 'rate' in values:
            self._transport.set_rate(float(values['rate']))
        if 'position' in values and not self._updates_position:
            self._transport.seek(float(values['position']))
