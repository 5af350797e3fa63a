"""The last messages of a recording, which are loaded like a log."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from operator import attrgetter
from pathlib import Path

from klann_ros.log import (
    block_of_messages,
    HEAD,
    LogTimes,
    Message,
    MessageBlock,
    SolverParameters,
    Topic,
)
import numpy as np

from .roles import LEG_ROLES, reading_of

# Length of the window [s]: a short gap falls into one.
LENGTH = 1.0
# Largest window [messages], [bytes].
MAX_MESSAGES = 40_000
MAX_BYTES = 64_000_000
# Largest channel number of a block.
_MAX_CHANNEL = 2**16 - 1


class Window:
    """
    The last messages, which a review loads like a log.

    New messages become a block once, as consecutive windows share most messages.
    """

    path = Path('window')
    paths: tuple[Path, ...] = ()
    problems: tuple[str, ...] = ()
    is_refused_only: bool = False
    refused_descriptions: tuple[str, ...] = ()
    # A recorder has the clock of its machine.
    times = LogTimes(0, 0)
    metadata: Mapping[str, list[dict[str, str]]] = {}

    def __init__(self) -> None:
        self.solvers: Sequence[SolverParameters] = ()
        # Intervals without reception, log times [ns].
        self.gaps: tuple[tuple[int, int], ...] = ()
        # The messages since the last move.
        self.new: deque[Message] = deque(maxlen=MAX_MESSAGES)
        self._blocks: deque[MessageBlock] = deque()
        # Channels by the id of their topic, which stays alive here: comparing topics is slow.
        self._channels: dict[int, tuple[int, Topic]] = {}
        self._topics: dict[int, Topic] = {}
        self.types: dict[str, str] = {}
        # The last two parameter sets of each node.
        self._solvers: dict[str, list[SolverParameters]] = {}

    def clear(self) -> None:
        """Forget all messages."""
        self.new.clear()
        self._blocks.clear()

    def __len__(self) -> int:
        return sum(map(len, self._blocks)) + len(self.new)

    @property
    def start_time(self) -> int:
        """Return the log time of the earliest message [ns]."""
        return min(int(block.heads['log_time'].min()) for block in self._blocks)

    @property
    def end_time(self) -> int:
        """Return the log time of the latest message [ns]."""
        return max(int(block.heads['log_time'].max()) for block in self._blocks)

    def set_solver(self, solver: SolverParameters) -> None:
        """Set the parameters of a solver."""
        # The previous one holds for older messages in the window.
        self._solvers[solver.node] = [*self._solvers.get(solver.node, ())[-1:], solver]
        self.solvers = sorted(chain(*self._solvers.values()), key=attrgetter('time'))

    def solver(self, node: str) -> SolverParameters | None:
        """Return the parameters of a solver, if known."""
        return self._solvers[node][-1] if node in self._solvers else None

    def move(self, now: int) -> None:
        """Move the window to a time: add new messages, drop old ones."""
        if self.new:
            self._blocks.append(self._block([*self.new]))
            self.new.clear()
        begin = now - round(LENGTH * 1e9)
        current = [_messages_since(block, begin) for block in self._blocks]
        self._blocks = deque(filter(len, current))
        self.gaps = tuple(gap for gap in self.gaps if gap[1] >= begin)
        while len(self._blocks) > 1 and self._is_too_much():
            self._blocks.popleft()

    def blocks(self, progress: Callable[[float], object] | None = None) -> Iterator[MessageBlock]:
        """Yield all messages."""
        if progress is not None:
            progress(0.0)
        yield from self._blocks

    def _is_too_much(self) -> bool:
        size = sum(len(block.data) for block in self._blocks)
        return len(self) > MAX_MESSAGES or size > MAX_BYTES

    def _block(self, messages: Sequence[Message]) -> MessageBlock:
        """Return messages as a block; those of topics that are no leg's have no data."""
        for message in messages:
            if id(message.topic) not in self._channels:
                self._know(message.topic)
        channels = self._channels
        heads = np.zeros(len(messages), HEAD)
        heads['channel'] = numbers = [channels[id(message.topic)][0] for message in messages]
        heads['sequence'] = [message.sequence & 0xFFFFFFFF for message in messages]
        heads['log_time'] = [*map(attrgetter('log_time'), messages)]
        heads['publish_time'] = [*map(attrgetter('publish_time'), messages)]
        topics = self._topics
        data = [message.data for message in messages]
        for index, number in enumerate(numbers):
            if not topics[number].type:
                data[index] = b''
        return block_of_messages(heads, data, topics)

    def _know(self, topic: Topic) -> None:
        """Add a topic; only topics of legs keep their data."""
        number = len(self._channels)
        if number > _MAX_CHANNEL:
            raise ValueError(f'more than {_MAX_CHANNEL + 1} topics')
        self._channels[id(topic)] = number, topic
        self.types[topic.name] = topic.type
        reading = reading_of(topic)
        is_of_leg = reading is not None and reading.role in LEG_ROLES
        self._topics[number] = topic if is_of_leg else Topic(topic.name, '')


def _messages_since(block: MessageBlock, start_time: int) -> MessageBlock:
    """Return the messages of a block whose log time is at or after a time [ns]."""
    times = block.heads['log_time']
    if not len(times) or times.min() >= start_time:
        return block
    is_inside = times >= start_time
    return replace(block, heads=block.heads[is_inside], starts=block.starts[is_inside])
