"""A server of the live page with a fake state: attacks on it need no ROS."""

from dataclasses import dataclass
import json

from klann_ros.live.clients import PageState
from klann_ros.live.guard import Guard
from klann_ros.live.protocol import Answer, Command
from klann_ros.live.server import LiveServer

# A hostile name of a node.
EVIL = '<img src=x onerror=alert(1)>'


class FakeState(PageState):
    """A state that records its commands."""

    def __init__(self) -> None:
        super().__init__()
        self.commands: list[Command] = []
        self.gone: list[int] = []
        self.padding = ''
        status = {'who': EVIL, 'level': 'look', 'meaning': '', 'text': EVIL, 'figures': {}}
        self.set_part('diagnostics', [status])

    def poses(self) -> str:
        return json.dumps({'of': 0, 'legs': {}, 'version': self.version, 'padding': self.padding})

    def command(self, page: int, command: Command, answer: Answer) -> None:
        self.commands.append(command)
        answer(True, f'done for {page}')

    def disconnected(self, page: int) -> None:
        self.gone.append(page)


@dataclass
class Served:
    """A state and its server."""

    state: FakeState
    server: LiveServer

    @property
    def guard(self) -> Guard:
        return self.server.guard

    @property
    def place(self) -> str:
        return f'127.0.0.1:{self.guard.port}'
