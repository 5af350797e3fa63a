"""The last seconds of what passes, as a log that a review can load."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from klann_ros.log.reading.block import block_of_messages, HEAD, MessageBlock
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import SOLVER_RECORD, solver_record, SolverParameters
from klann_ros.review.loading.gathering import may_be_of_a_leg
import numpy as np

# What a message takes beside its data [bytes], about.
_OVERHEAD = 400


class Window:
    """
    The last messages, by the times at which they were received.

    Parameters
    ----------
    length : float
        How far back it reaches [s].
    most : int
        No more messages are kept.
    most_bytes : int
        And no more than they take.

    """

    path = Path('window')
    paths: tuple[Path, ...] = ()
    problems: tuple[str, ...] = ()
    holes: tuple[tuple[int, int], ...] = ()

    def __init__(self, length: float, most: int, most_bytes: int) -> None:
        """Begin empty."""
        self.metadata: dict[str, list[Mapping[str, str]]] = {}
        self._length = round(length * 1e9)
        self._messages: deque[Message] = deque()
        self._most, self._most_bytes, self._size = most, most_bytes, 0
        # Of a topic that tells nothing of a leg only the times are kept.
        self._kept: dict[Topic, Topic | None] = {}
        # By its name: one that was changed is told with its times.
        self._solvers: dict[str, list[SolverParameters]] = {}

    def add(self, message: Message) -> None:
        """Add a message, received after all others."""
        kept = self._kept.get(message.topic, message.topic)
        if kept is message.topic:
            kept = self._kept[message.topic] = _without_content(message.topic)
        if kept is not None:
            times = message.log_time, message.publish_time
            message = Message(kept, b'', *times, message.sequence)
        self._messages.append(message)
        self._size += len(message.data) + _OVERHEAD
        while len(self._messages) > self._most or self._size > self._most_bytes:
            self._drop()

    def clear(self) -> None:
        """Forget all messages."""
        self._messages.clear()
        self._size = 0

    def _drop(self) -> None:
        self._size -= len(self._messages.popleft().data) + _OVERHEAD

    def __len__(self) -> int:
        return len(self._messages)

    @property
    def start_time(self) -> int:
        """Return the log time of the earliest message [ns]."""
        return min(message.log_time for message in self._messages)

    @property
    def end_time(self) -> int:
        """Return the log time of the latest message [ns]."""
        return max(message.log_time for message in self._messages)

    def tell(self, solver: SolverParameters) -> None:
        """Add what a solver has from now on."""
        # The one before holds for what is still in the window; those before it for nothing.
        known = [*self._solvers.get(solver.node, ())[-1:], solver]
        self._solvers[solver.node] = known
        records = [each for told in self._solvers.values() for each in told]
        self.metadata = {SOLVER_RECORD: [solver_record(each) for each in records]}

    def solver(self, node: str) -> SolverParameters | None:
        """Return what a solver has, as far as it was told."""
        return self._solvers[node][-1] if node in self._solvers else None

    def move(self, now: int) -> None:
        """Forget what is too long ago."""
        messages, first = self._messages, now - self._length
        while messages and messages[0].log_time < first:
            self._drop()

    def blocks(self, progress: Callable[[float], object] | None = None) -> Iterator[MessageBlock]:
        """Yield all messages, in one block."""
        if not self._messages:
            return
        if progress is not None:
            progress(0.0)
        messages = [*self._messages]
        channels: dict[Topic, int] = {}
        heads = np.zeros(len(messages), HEAD)
        heads['channel'] = [channels.setdefault(m.topic, len(channels)) for m in messages]
        heads['sequence'] = [m.sequence & 0xFFFFFFFF for m in messages]
        heads['log_time'] = [m.log_time for m in messages]
        heads['publish_time'] = [m.publish_time for m in messages]
        topics = {number: topic for topic, number in channels.items()}
        yield block_of_messages(heads, [m.data for m in messages], topics)


def _without_content(topic: Topic) -> Topic | None:
    """Return what stands for a topic that tells nothing of a leg; None for one that may."""
    return None if may_be_of_a_leg(topic) else Topic(topic.name, '')
