"""
The pages that look, and what is under way to each: one frame at most, always the newest.

A page says when it has drawn a frame, and only then is the next one made, of what is so by then.
What came in between is not kept for it. So a page that is slow sees less, one that stands still
costs a socket, and no page has anything of the others.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Mapping
import json
from time import monotonic
from typing import Any, Protocol

from aiohttp import web
from klann_ros.live.protocol import parsed, ProtocolError, RateLimit, Wish

# Answers wait for the next frame, as nothing is sent beside it.
_MOST_ANSWERS = 32
# Frames of one version are alike for all that ask within [s].
_ALIKE = 0.004

Answer = Callable[[bool, str], None]


class World(Protocol):
    """What the pages look at: the ROS side, or a made-up one. Any thread may call all of it."""

    @property
    def version(self) -> int:
        """Return a number that grows whenever there is something new."""

    def poses(self) -> str:
        """Return the poses of now, as JSON."""

    def parts(self) -> Mapping[str, tuple[int, str]]:
        """Return what changes seldom: by name its version, and what it is as JSON."""

    def wake_at_news(self, wake: Callable[[], None]) -> None:
        """Have a function called once, when there is something new; any thread may call it."""

    def wish(self, page: int, wish: Wish, answer: Answer) -> None:
        """Do what a page that may drive wants; tell it later whether that was done, or why not."""

    def heard(self, page: int) -> None:
        """Note that a page is there."""

    def left(self, page: int) -> None:
        """Note that a page is gone: all that it drives stops."""


class News:
    """
    Wake those that wait, when a world has something new.

    Parameters
    ----------
    world : World
        The world.

    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._loop = asyncio.get_running_loop()
        self._event = asyncio.Event()
        self._is_awaited = False
        self._frame: tuple[int, float, str] = (-1, 0.0, '{}')

    async def after(self, version: int) -> None:
        """Wait until there is something newer than a version."""
        while self._world.version <= version:
            event = self._event
            if not self._is_awaited:
                self._is_awaited = True
                self._world.wake_at_news(self._wake)
            await event.wait()

    def poses(self, seen: int) -> tuple[int, str]:
        """
        Return a version and its poses as JSON: made once for all that ask at a time.

        Parameters
        ----------
        seen : int
            The version that who asks has; it is given a newer one, if there is any.

        """
        version = self._world.version
        known, made, text = self._frame
        if version != known and (known <= seen or monotonic() - made >= _ALIKE):
            known, text = version, self._world.poses()
            self._frame = known, monotonic(), text
        return known, text

    def _wake(self) -> None:
        self._loop.call_soon_threadsafe(self._tell)

    def _tell(self) -> None:
        self._is_awaited = False
        event, self._event = self._event, asyncio.Event()
        event.set()


class Client:
    """
    A page that looks.

    Parameters
    ----------
    number : int
        Its number, of no other page.
    socket : aiohttp.web.WebSocketResponse
        Its socket.
    world : World
        What it looks at.
    news : News
        Tells when there is something new.
    may_drive : bool
        Whether it knows the secret.
    has_runs : bool
        Whether there is a list of runs for who knows it.

    """

    def __init__(
        self,
        number: int,
        socket: web.WebSocketResponse,
        world: World,
        news: News,
        *,
        may_drive: bool,
        has_runs: bool = False,
    ) -> None:
        self.number = number
        self._socket, self._world, self._news = socket, world, news
        self._may_drive = may_drive
        self._you = {'page': number, 'may': may_drive, 'runs': has_runs}
        self._loop = asyncio.get_running_loop()
        self._limit = RateLimit()
        self._drawn = asyncio.Event()
        self._drawn.set()
        self._sent = 0
        self._answers: deque[dict[str, Any]] = deque(maxlen=_MOST_ANSWERS)
        self._answered = asyncio.Event()
        self._versions: dict[str, int] = {}

    async def write(self) -> None:
        """Send the newest frame whenever the one before was drawn, until the page is gone."""
        version = -1
        while True:
            await self._drawn.wait()
            if self._sent:
                await self._something(version)
            self._drawn.clear()
            self._answered.clear()
            seen, (version, poses) = version, self._news.poses(version)
            self._sent += 1
            await self._socket.send_str(self._frame(poses if version > seen else ''))

    def read(self, text: str) -> str:
        """
        Take what the page says.

        Returns
        -------
        str
            Why it is not listened to any more; '' while it is.

        """
        if not self._limit.allows():
            return 'too many messages'
        try:
            said = parsed(text)
        except ProtocolError as error:
            return str(error)
        self._world.heard(self.number)
        if isinstance(said, Wish):
            self._want(said)
        elif said is not None and said == self._sent:
            self._drawn.set()
        return ''

    async def _something(self, version: int) -> None:
        """Wait for news, or for an answer to what the page wanted."""
        waits = [
            asyncio.ensure_future(self._news.after(version)),
            asyncio.ensure_future(self._answered.wait()),
        ]
        try:
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for wait in waits:
                wait.cancel()

    def _want(self, wish: Wish) -> None:
        if not self._may_drive:
            self._answer(wish.number, is_done=False, said='this page may only look')
            return

        def answer(is_done: bool, said: str) -> None:
            self._loop.call_soon_threadsafe(lambda: self._answer(wish.number, is_done, said))

        self._world.wish(self.number, wish, answer)

    def _answer(self, number: int, is_done: bool, said: str) -> None:
        self._answers.append({'id': number, 'done': is_done, 'said': said})
        self._answered.set()

    def _frame(self, poses: str) -> str:
        fields = [f'"n":{self._sent}']
        if poses:
            fields.append(f'"poses":{poses}')
        if self._sent == 1:
            fields.append(f'"you":{json.dumps(self._you)}')
        for name, (version, text) in self._world.parts().items():
            if self._versions.get(name) != version:
                self._versions[name] = version
                fields.append(f'{json.dumps(name)}:{text}')
        if self._answers:
            fields.append(f'"answers":{json.dumps(list(self._answers))}')
            self._answers.clear()
        return '{' + ','.join(fields) + '}'
