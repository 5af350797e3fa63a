"""The last seconds of what passes, as a log that a review can load."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from klann_ros.log.reading.block import block_of_messages, HEAD, MessageBlock
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import SOLVER_RECORD, solver_record, SolverParameters
import numpy as np


class Window:
    """
    The last messages, by the times at which they were received.

    Parameters
    ----------
    length : float
        How far back it reaches [s].
    most : int
        No more messages are kept.

    """

    path = Path('window')
    paths: tuple[Path, ...] = ()
    problems: tuple[str, ...] = ()
    holes: tuple[tuple[int, int], ...] = ()

    def __init__(self, length: float, most: int) -> None:
        """Begin empty."""
        self.metadata: dict[str, list[Mapping[str, str]]] = {}
        self._length = round(length * 1e9)
        self._messages: deque[Message] = deque(maxlen=most)
        # By its name: one that was changed is told with its times.
        self._solvers: dict[str, list[SolverParameters]] = {}

    def add(self, message: Message) -> None:
        """Add a message, received after all others."""
        self._messages.append(message)

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
            messages.popleft()

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
