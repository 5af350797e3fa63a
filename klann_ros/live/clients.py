"""
The state of the live page and its clients, each with at most one frame in flight.

Back-pressure works by conflation. A client acknowledges each frame that it has drawn; only then is
the next one made, of the current state. Updates in between are not queued. A slow client sees
fewer frames, a stalled one costs a socket, and no client delays another.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Mapping, Sequence
import json
import re
from threading import Lock
from time import monotonic
from typing import Any

from aiohttp import web
from klann_ros.live.protocol import Answer, Command, parse_message, ProtocolError, RateLimit
from klann_ros.sanitize.text import printable

# Answers wait for the next frame: nothing is sent between frames.
_MAX_ANSWERS = 32
# Clients that ask within this time share a frame [s].
_SHARING_TIME = 0.004

# Maximum number of values read of a status.
MAX_VALUES = 64
LEVELS = ('ok', 'warning', 'error', 'stale')
# Patterns of messages and their meanings; the first match counts. Without a match the message is
# shown as it is: other nodes have texts of their own.
_MEANINGS: Sequence[tuple[str, str]] = (
    (r'no input for', 'The crank is not driven: no crank angle arrives.'),
    (
        r'cannot be reached: dyad|loops of block',
        'The leg cannot take this crank angle: its bars do not reach. It goes on where they do.',
    ),
    (
        r'is refused: it must be (one number, )?finite',
        'What came in was no crank angle; it was left out.',
    ),
    (
        r'turned by more than one',
        'Two or more turn this crank at once: the leg jumps between them. Stop all but one.',
    ),
    (r'inputs? (was|were) lost', 'Crank angles were lost on their way to the solver.'),
    (
        r'nearly singular',
        'Two bars of the leg are almost in line: there it may jam, and errors grow.',
    ),
    (r'did not converge', 'The iteration found no pose for this angle.'),
    (r'does not turn fully', 'The crank cannot make whole turns with these lengths.'),
    (r'the recording has ended', 'The recorder has stopped; the run can be read.'),
    (r'messages? (was|were) lost', 'Messages were lost on their way to the recorder.'),
    (r'^solving$', 'The leg is solved.'),
    (r'^recording$', 'The run is being recorded.'),
    (
        r'^waiting for a trigger$',
        'The recorder keeps the last seconds if it finds a fault or you press Keep this moment.',
    ),
    (r'^recording an event$', 'The recorder writes the last seconds and what comes now.'),
    (r'^paused$', 'The recording is paused.'),
)
_COMPILED = tuple((re.compile(pattern), meaning) for pattern, meaning in _MEANINGS)
# Values that the page shows.
_SHOWN_VALUES = ('solved', 'rejected', 'failed', 'lost', 'rate', 'file')


class PageState:
    """The versioned state that clients see; a subclass adds poses and commands. Thread safe."""

    def __init__(self) -> None:
        self._lock = Lock()
        # Grows with every change.
        self.version = 0
        # Parts that change seldom: version and JSON by name; replaced, not changed.
        self.parts: Mapping[str, tuple[int, str]] = {}
        self._wake: Callable[[], None] | None = None

    def notify_once(self, wake: Callable[[], None]) -> None:
        """Call a function once, at the next change, from any thread."""
        self._wake = wake

    def changed(self) -> None:
        """Announce a change."""
        with self._lock:
            self.version += 1
            wake, self._wake = self._wake, None
        if wake is not None:
            wake()

    def set_part(self, name: str, data: Any) -> None:
        """Set a part, and announce it if it has changed."""
        text = json.dumps(data, separators=(',', ':'), allow_nan=False)
        version, old_text = self.parts.get(name, (0, ''))
        if text != old_text:
            self.parts = {**self.parts, name: (version + 1, text)}
            self.changed()

    def poses(self) -> str:
        """Return the current poses as JSON."""
        raise NotImplementedError

    def command(self, page: int, command: Command, answer: Answer) -> None:
        """Carry out a command; answer later with the success and a message."""
        raise NotImplementedError

    def keep_alive(self, page: int) -> None:
        """Note that a client is alive."""

    def disconnected(self, page: int) -> None:
        """Note that a client has gone: its drives stop."""


class ChangeNotifier:
    """Wake the clients when the state changes; made in the server's event loop."""

    def __init__(self, state: PageState) -> None:
        self._state = state
        self._loop = asyncio.get_running_loop()
        self._event = asyncio.Event()
        self._is_waiting = False
        # Version, time [s] and poses of the last frame.
        self._frame: tuple[int, float, str] = (-1, 0.0, '{}')

    async def after(self, version: int) -> None:
        """Wait until the state is newer than a version."""
        while self._state.version <= version:
            event = self._event
            if not self._is_waiting:
                self._is_waiting = True
                self._state.notify_once(self._wake)
            await event.wait()

    def poses(self, seen: int) -> tuple[int, str]:
        """Return a version newer than a client's, if any, and its poses; shared by clients."""
        version = self._state.version
        frame_version, frame_time, _ = self._frame
        is_due = frame_version <= seen or monotonic() - frame_time >= _SHARING_TIME
        if version != frame_version and is_due:
            poses = self._state.poses()
            self._frame = (version, monotonic(), poses)
        frame_version, _, poses = self._frame
        return frame_version, poses

    def _wake(self) -> None:
        self._loop.call_soon_threadsafe(self._notify)

    def _notify(self) -> None:
        self._is_waiting = False
        event, self._event = self._event, asyncio.Event()
        event.set()


class Client:
    """
    A page in a browser, with a unique number.

    `may_drive`: it presented the token. `has_runs`: it did, and a list of runs exists.
    """

    def __init__(
        self,
        number: int,
        socket: web.WebSocketResponse,
        state: PageState,
        notifier: ChangeNotifier,
        *,
        may_drive: bool,
        has_runs: bool = False,
    ) -> None:
        self.number = number
        self._socket = socket
        self._state = state
        self._notifier = notifier
        self._may_drive = may_drive
        self._client = {'page': number, 'may_drive': may_drive, 'runs': has_runs}
        self._loop = asyncio.get_running_loop()
        self._rate_limit = RateLimit()
        self._frame_drawn = asyncio.Event()
        self._frame_drawn.set()
        self._frame_number = 0
        self._answers: deque[dict[str, Any]] = deque(maxlen=_MAX_ANSWERS)
        self._answered = asyncio.Event()
        self._versions: dict[str, int] = {}

    async def write(self) -> None:
        """Send the newest frame after each acknowledgement, until the client has gone."""
        version = -1
        while True:
            await self._frame_drawn.wait()
            if self._frame_number:
                await self._change_or_answer(version)
            self._frame_drawn.clear()
            self._answered.clear()
            seen = version
            version, poses = self._notifier.poses(seen)
            self._frame_number += 1
            await self._socket.send_str(self._frame(poses if version > seen else ''))

    def handle(self, text: str) -> str:
        """Act on a message from the page; return the reason for closing the connection, or ''."""
        if not self._rate_limit.take_token():
            return 'too many messages'
        try:
            message = parse_message(text)
        except ProtocolError as error:
            return str(error)
        self._state.keep_alive(self.number)
        if isinstance(message, Command):
            self._run_command(message)
        elif message == self._frame_number:
            # The page returns the number of the frame that it has drawn.
            self._frame_drawn.set()
        return ''

    async def _change_or_answer(self, version: int) -> None:
        waits = [
            asyncio.ensure_future(self._notifier.after(version)),
            asyncio.ensure_future(self._answered.wait()),
        ]
        try:
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for wait in waits:
                wait.cancel()

    def _run_command(self, command: Command) -> None:
        if not self._may_drive:
            self._answer(command.number, is_done=False, message='this page may only view')
            return

        def answer(is_done: bool, message: str) -> None:
            self._loop.call_soon_threadsafe(lambda: self._answer(command.number, is_done, message))

        self._state.command(self.number, command, answer)

    def _answer(self, number: int, is_done: bool, message: str) -> None:
        self._answers.append({'id': number, 'done': is_done, 'message': message})
        self._answered.set()

    def _frame(self, poses: str) -> str:
        fields = [f'"n":{self._frame_number}']
        if poses:
            fields.append(f'"poses":{poses}')
        if self._frame_number == 1:
            fields.append(f'"client":{json.dumps(self._client)}')
        for name, (version, text) in self._state.parts.items():
            if self._versions.get(name) != version:
                self._versions[name] = version
                fields.append(f'{json.dumps(name)}:{text}')
        if self._answers:
            fields.append(f'"answers":{json.dumps(list(self._answers))}')
            self._answers.clear()
        return '{' + ','.join(fields) + '}'


def status_text(
    level: int, name: str, message: str, values: Sequence[tuple[str, str]]
) -> dict[str, Any]:
    """
    Return a status of diagnostic_msgs for the page, ready for JSON; its texts are untrusted.

    `level` is one of LEVELS, `meaning` in plain words, '' if only its own text explains it, and
    `figures` its values.
    """
    text = printable(message)
    meaning = next((m for pattern, m in _COMPILED if pattern.search(text)), '')
    if meaning and level == 0 and 'does not turn fully' in text:
        meaning = f'The leg is solved. {meaning}'
    return {
        'name': printable(name, 100),
        'level': LEVELS[level] if 0 <= level < len(LEVELS) else 'error',
        'meaning': meaning,
        'text': text,
        'figures': {k: printable(v, 60) for k, v in values[:MAX_VALUES] if k in _SHOWN_VALUES},
    }


def recorded_counts(values: Sequence[tuple[str, str]]) -> dict[str, int]:
    """Return the sums of received, written and lost messages in a recorder's status."""
    sums = dict.fromkeys(('received', 'written', 'lost'), 0)
    for key, number in values:
        last = key.rpartition(' ')[2]
        if key.startswith('/') and last in sums and number.isdecimal() and len(number) < 19:
            sums[last] += int(number)
    return sums
