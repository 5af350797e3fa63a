"""
The clients, each with at most one frame in flight: back-pressure by conflation.

A client acknowledges each frame that it has drawn; only then is the next one made, of the current
state. Updates in between are not queued. A slow client sees fewer frames, a stalled one costs a
socket, and no client delays another.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Mapping
import json
from time import monotonic
from typing import Any, Protocol

from aiohttp import web
from klann_ros.live.protocol import Command, parsed, ProtocolError, RateLimit

# Answers wait for the next frame: nothing is sent between frames.
_MAX_ANSWERS = 32
# Clients that ask within this time share a frame [s].
_ALIKE = 0.004

Answer = Callable[[bool, str], None]


class StateProvider(Protocol):
    """The state that clients see, of ROS or of a test. All methods are thread safe."""

    @property
    def version(self) -> int:
        """Return a number that grows with every change."""

    def poses(self) -> str:
        """Return the current poses as JSON."""

    def parts(self) -> Mapping[str, tuple[int, str]]:
        """Return the parts that change seldom: by name, version and JSON."""

    def notify_once(self, wake: Callable[[], None]) -> None:
        """Call a function once, at the next change, from any thread."""

    def command(self, page: int, command: Command, answer: Answer) -> None:
        """Carry out a command; answer later whether it was done, or why not."""

    def keep_alive(self, page: int) -> None:
        """Note that a client is alive."""

    def disconnected(self, page: int) -> None:
        """Note that a client has gone: its drives stop."""


class ChangeNotifier:
    """
    Wake the clients when the state changes.

    Parameters
    ----------
    state : StateProvider
        The world.

    """

    def __init__(self, state: StateProvider) -> None:
        self._state = state
        self._loop = asyncio.get_running_loop()
        self._event = asyncio.Event()
        self._is_waiting = False
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
        """
        Return a version and its poses as JSON, made once for simultaneous clients.

        Parameters
        ----------
        seen : int
            The client's version; a newer one is returned if it exists.

        """
        version = self._state.version
        known, made, text = self._frame
        if version != known and (known <= seen or monotonic() - made >= _ALIKE):
            known, text = version, self._state.poses()
            self._frame = known, monotonic(), text
        return known, text

    def _wake(self) -> None:
        self._loop.call_soon_threadsafe(self._notify)

    def _notify(self) -> None:
        self._is_waiting = False
        event, self._event = self._event, asyncio.Event()
        event.set()


class Client:
    """
    A page in a browser.

    Parameters
    ----------
    number : int
        Its number, unique.
    socket : aiohttp.web.WebSocketResponse
        Its socket.
    state : StateProvider
        The state that it sees.
    news : ChangeNotifier
        Announces changes.
    may_drive : bool
        Whether it presented the token.
    has_runs : bool
        Whether a list of runs exists; it is shown to clients with the token.

    """

    def __init__(
        self,
        number: int,
        socket: web.WebSocketResponse,
        state: StateProvider,
        notifier: ChangeNotifier,
        *,
        may_drive: bool,
        has_runs: bool = False,
    ) -> None:
        self.number = number
        self._socket, self._state, self._notifier = socket, state, notifier
        self._may_drive = may_drive
        self._you = {'page': number, 'may': may_drive, 'runs': has_runs}
        self._loop = asyncio.get_running_loop()
        self._limit = RateLimit()
        self._drawn = asyncio.Event()
        self._drawn.set()
        self._sent = 0
        self._answers: deque[dict[str, Any]] = deque(maxlen=_MAX_ANSWERS)
        self._answered = asyncio.Event()
        self._versions: dict[str, int] = {}

    async def write(self) -> None:
        """Send the newest frame after each acknowledgement, until the client has gone."""
        version = -1
        while True:
            await self._drawn.wait()
            if self._sent:
                await self._change_or_answer(version)
            self._drawn.clear()
            self._answered.clear()
            seen, (version, poses) = version, self._notifier.poses(version)
            self._sent += 1
            await self._socket.send_str(self._frame(poses if version > seen else ''))

    def read(self, text: str) -> str:
        """
        Process a message of the page.

        Returns
        -------
        str
            The reason for closing the connection; '' to keep it.

        """
        if not self._limit.allows():
            return 'too many messages'
        try:
            said = parsed(text)
        except ProtocolError as error:
            return str(error)
        self._state.keep_alive(self.number)
        if isinstance(said, Command):
            self._run_command(said)
        elif said is not None and said == self._sent:
            self._drawn.set()
        return ''

    async def _change_or_answer(self, version: int) -> None:
        """Wait for a change, or for the answer to a command."""
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
            self._answer(command.number, is_done=False, said='this page may only view')
            return

        def answer(is_done: bool, said: str) -> None:
            self._loop.call_soon_threadsafe(lambda: self._answer(command.number, is_done, said))

        self._state.command(self.number, command, answer)

    def _answer(self, number: int, is_done: bool, said: str) -> None:
        self._answers.append({'id': number, 'done': is_done, 'said': said})
        self._answered.set()

    def _frame(self, poses: str) -> str:
        fields = [f'"n":{self._sent}']
        if poses:
            fields.append(f'"poses":{poses}')
        if self._sent == 1:
            fields.append(f'"you":{json.dumps(self._you)}')
        for name, (version, text) in self._state.parts().items():
            if self._versions.get(name) != version:
                self._versions[name] = version
                fields.append(f'{json.dumps(name)}:{text}')
        if self._answers:
            fields.append(f'"answers":{json.dumps(list(self._answers))}')
            self._answers.clear()
        return '{' + ','.join(fields) + '}'
