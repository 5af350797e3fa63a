"""A server of the live page with a made-up world: no ROS is needed to attack it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
import json

from klann_ros.live.clients import Answer
from klann_ros.live.guard import Guard
from klann_ros.live.protocol import Command
from klann_ros.live.server import LiveServer

# What a stranger may call his node.
EVIL = '<img src=x onerror=alert(1)>'


@dataclass
class MadeUpWorld:
    """A world that remembers what was wanted of it."""

    version: int = 1
    wishes: list[Command] = field(default_factory=list)
    gone: list[int] = field(default_factory=list)
    padding: str = ''
    wake: Callable[[], None] | None = None

    def poses(self) -> str:
        return json.dumps({'of': 0, 'legs': {}, 'version': self.version, 'padding': self.padding})

    def parts(self) -> Mapping[str, tuple[int, str]]:
        status = {'who': EVIL, 'level': 'look', 'meaning': '', 'text': EVIL, 'figures': {}}
        return {'diagnostics': (1, json.dumps([status]))}

    def notify_once(self, wake: Callable[[], None]) -> None:
        self.wake = wake

    def command(self, page: int, command: Command, answer: Answer) -> None:
        self.wishes.append(command)
        answer(True, f'done for {page}')

    def keep_alive(self, page: int) -> None:
        pass

    def disconnected(self, page: int) -> None:
        self.gone.append(page)

    def goes_on(self) -> None:
        """Have something new."""
        self.version += 1
        wake, self.wake = self.wake, None
        if wake is not None:
            wake()


@dataclass
class Served:
    """A world and its server."""

    world: MadeUpWorld
    server: LiveServer

    @property
    def guard(self) -> Guard:
        return self.server.guard

    @property
    def place(self) -> str:
        return f'127.0.0.1:{self.guard.port}'
