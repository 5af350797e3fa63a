"""
The messages of a page and their rate limit; each message is checked before it has an effect.

A page acknowledges a drawn frame (`{"ack": 7}`) or sends a command
(`{"id": 3, "command": "turn", "target": "...", "value": 1.5}`). All else is refused.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
import json
from time import monotonic
from typing import Any

# Size of a message [bytes].
MAX_MESSAGE_SIZE = 4096
# Sustained rate [Hz] and burst of messages: a page acknowledges each frame, on screens of 240 Hz
# too, and sends its slider as often.
RATE = 800.0
BURST = 1200.0
# The commands, and the fields of each.
COMMANDS = {
    'take': ('target',),
    'release': ('target',),
    'turn': ('target', 'value'),
    'spin': ('target', 'value'),
    'walk': ('target', 'value', 'turn'),
    'set': ('target', 'values'),
    'call': ('target', 'name'),
    'seek': ('target', 'value'),
    'rate': ('target', 'value'),
}
_MAX_TEXT = 256
_MAX_VALUES = 20
_MAX_NUMBER = 2**53


# Takes the success of a command and a message.
Answer = Callable[[bool, str], None]


class ProtocolError(Exception):
    """A malformed message of a page; the text says why."""


@dataclass(frozen=True)
class Command:
    """A command of a page."""

    number: int
    command: str
    # Its target: the name of a drive, a solver, a recorder or a player.
    target: str
    value: float = 0.0
    turn: float = 0.0
    # The name of a service, such as `pause`.
    name: str = ''
    # Parameters by name: numbers, or lists of two signs.
    values: dict[str, float | list[int]] = field(default_factory=dict)


def parse_message(text: str) -> Command | int | None:
    """
    Return the message from a page: a command, the number of a drawn frame, or None (keep-alive).

    A ProtocolError says why a message is invalid.
    """
    try:
        message = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise ProtocolError('no JSON') from error
    if not isinstance(message, dict):
        raise ProtocolError('no mapping')
    if set(message) == {'ack'}:
        return _whole(message['ack'])
    if not message:
        return None
    return _command(message)


def _command(message: dict[str, Any]) -> Command:
    command = message.get('command')
    if not isinstance(command, str) or command not in COMMANDS:
        raise ProtocolError('no known command')
    if set(message) != {'id', 'command', *COMMANDS[command]}:
        raise ProtocolError(f'{command} takes {", ".join(COMMANDS[command])}')
    fields = {key: _CHECKS[key](message[key]) for key in COMMANDS[command]}
    return Command(_whole(message['id']), command, **fields)


def _refuse(name: str) -> Any:
    raise ProtocolError(f'{name} is no number here')


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < _MAX_NUMBER:
        raise ProtocolError('a whole number >= 0 is missing')
    return value


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1e9:
        raise ProtocolError('a number within +-1e9 is missing')
    return float(value)


def _text(value: Any) -> str:
    if not isinstance(value, str) or len(value) > _MAX_TEXT:
        raise ProtocolError('a short text is missing')
    return value


def _values(value: Any) -> dict[str, float | list[int]]:
    if not isinstance(value, dict) or not 0 < len(value) <= _MAX_VALUES:
        raise ProtocolError('a mapping of parameters is missing')
    return {
        _text(key): _signs(v) if isinstance(v, list) else _number(v) for key, v in value.items()
    }


def _signs(value: list[Any]) -> list[int]:
    if len(value) != 2 or any(type(sign) is not int or sign not in {-1, 1} for sign in value):
        raise ProtocolError('two signs are missing, each +1 or -1')
    return list(value)


_CHECKS: dict[str, Callable[[Any], Any]] = {
    'target': _text,
    'name': _text,
    'value': _number,
    'turn': _number,
    'values': _values,
}


class RateLimit:
    """A token bucket of RATE and BURST for the messages of a client; `clock` is in seconds."""

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        # The tokens, and the time of the last message [s].
        self._tokens = BURST
        self._time = clock()

    def take_token(self) -> bool:
        """Count a message; return whether it is within the limit."""
        now = self._clock()
        self._tokens = min(BURST, self._tokens + (now - self._time) * RATE)
        self._time = now
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True
