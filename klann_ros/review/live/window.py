"""The window of the last messages, which a review loads like a log."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from klann_ros.log.read.block import block_of_messages, HEAD, MessageBlock
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import SOLVER_RECORD, solver_record, SolverParameters
from klann_ros.review.load.legs import is_leg_topic
from klann_ros.review.model.times import Interval, merge_intervals
import numpy as np

# The channels of a block are numbers of 16 bits.
_MAX_TOPICS = 2**16


class Window:
    """
    The last messages, by their log times.

    New messages become a block once, as consecutive windows share most messages.

    Parameters
    ----------
    length : float
        How far back it reaches [s].
    most : int
        No more messages are kept.
    most_bytes : int
        And no more than these have, about.

    """

    path = Path('window')
    paths: tuple[Path, ...] = ()
    problems: tuple[str, ...] = ()

    def __init__(self, length: float, most: int, most_bytes: int) -> None:
        """Begin empty."""
        self.metadata: dict[str, list[Mapping[str, str]]] = {}
        # When silence is no fault: log times [ns].
        self.gaps: tuple[Interval, ...] = ()
        self._length = round(length * 1e9)
        self._most, self._most_bytes = most, most_bytes
        self._new: deque[Message] = deque(maxlen=most)
        self._blocks: deque[MessageBlock] = deque()
        # By the object, as to compare topics takes long; and the topic stays alive.
        self._channels: dict[int, tuple[int, Topic]] = {}
        self._topics: dict[int, Topic] = {}
        self.types: dict[str, str] = {}
        # By node: the last two parameter sets.
        self._solvers: dict[str, list[SolverParameters]] = {}

    def add(self, messages: Iterable[Message]) -> None:
        """Add messages, received after all others."""
        self._new.extend(messages)

    def clear(self) -> None:
        """Forget all messages."""
        self._new.clear()
        self._blocks.clear()

    def __len__(self) -> int:
        return sum(map(len, self._blocks)) + len(self._new)

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
        known = [*self._solvers.get(solver.node, ())[-1:], solver]
        self._solvers[solver.node] = known
        records = [each for sets in self._solvers.values() for each in sets]
        self.metadata = {SOLVER_RECORD: [solver_record(each) for each in records]}

    def excuse(self, begin: int, end: int) -> None:
        """Add an interval without reception."""
        self.gaps = merge_intervals([*self.gaps, (begin, end)])

    def solver(self, node: str) -> SolverParameters | None:
        """Return the parameters of a solver, if known."""
        return self._solvers[node][-1] if node in self._solvers else None

    @property
    def new(self) -> Iterable[Message]:
        """Return the messages since the last move."""
        return self._new

    def move(self, now: int) -> None:
        """Move the window to a time: add new messages, drop old ones."""
        if self._new:
            messages = [*self._new]
            self._new.clear()
            self._blocks.append(self._block(messages))
        current = (_since(block, now - self._length) for block in self._blocks)
        self._blocks = deque(block for block in current if len(block))
        self.gaps = tuple(gap for gap in self.gaps if gap[1] >= now - self._length)
        while len(self._blocks) > 1 and self._is_too_much():
            self._blocks.popleft()

    def blocks(self, progress: Callable[[float], object] | None = None) -> Iterator[MessageBlock]:
        """Yield all messages."""
        if progress is not None:
            progress(0.0)
        yield from self._blocks

    def _is_too_much(self) -> bool:
        size = sum(len(block.data) for block in self._blocks)
        return len(self) > self._most or size > self._most_bytes

    def _block(self, messages: Sequence[Message]) -> MessageBlock:
        ids = [id(message.topic) for message in messages]
        if not self._channels.keys() >= set(ids):
            for message in messages:
                self._know(message.topic)
        channels = self._channels
        heads = np.zeros(len(messages), HEAD)
        heads['channel'] = numbers = [channels[key][0] for key in ids]
        heads['sequence'] = [m.sequence & 0xFFFFFFFF for m in messages]
        heads['log_time'] = [m.log_time for m in messages]
        heads['publish_time'] = [m.publish_time for m in messages]
        topics, data = self._topics, [m.data for m in messages]
        if any(not topic.type for topic in topics.values()):
            data = [d if topics[n].type else b'' for n, d in zip(numbers, data, strict=True)]
        return block_of_messages(heads, data, topics)

    def _know(self, topic: Topic) -> None:
        """Add a topic; only topics of legs keep their data."""
        if id(topic) not in self._channels:
            number = len(self._channels)
            if number >= _MAX_TOPICS:
                msg = f'more than {_MAX_TOPICS} topics'
                raise ValueError(msg)
            self._channels[id(topic)] = number, topic
            self.types[topic.name] = topic.type
            self._topics[number] = topic if is_leg_topic(topic) else Topic(topic.name, '')


def _since(block: MessageBlock, time: int) -> MessageBlock:
    """Return the messages of a block that were received since a time [ns]."""
    times = block.heads['log_time']
    if not len(times) or times.min() >= time:
        return block
    rows = times >= time
    return replace(block, heads=block.heads[rows], starts=block.starts[rows])
