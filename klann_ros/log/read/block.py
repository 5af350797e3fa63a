"""Messages as arrays, for readers of millions of them."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from klann_ros.log.records import Message, Topic
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

HEAD = np.dtype(
    [
        ('opcode', 'u1'),
        ('length', '<u8'),
        ('channel', '<u2'),
        ('sequence', '<u4'),
        ('log_time', '<u8'),
        ('publish_time', '<u8'),
    ]
)
"""Fields of an MCAP message record before its data."""

# Size of the fields that the record's length includes: all but opcode and length [bytes].
_HEAD_LENGTH = HEAD.itemsize - 9
# Millions of small messages would take more memory as Python's numbers than they have.
_MAX_BATCH = 4096


@dataclass(frozen=True, eq=False)
class MessageBlock:
    """Consecutive messages of a log, in the order of the file."""

    # The bytes that contain them.
    data: memoryview
    # Channel, sequence, log time and publish time [ns] of each; dtype HEAD.
    heads: NDArray[np.void]
    # Offset of each message's data in ``data``; shape (n,).
    starts: NDArray[np.int64]
    # The topics of the known channels.
    topics: Mapping[int, Topic]

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def sizes(self) -> NDArray[np.int64]:
        """Return the size of each message's data [bytes], shape (n,)."""
        return self.heads['length'].astype(np.int64) - _HEAD_LENGTH

    def message(self, row: int) -> bytes:
        """Return the data of one message."""
        begin = int(self.starts[row])
        end = begin + int(self.heads['length'][row]) - _HEAD_LENGTH
        return self.data[begin:end].tobytes()

    @property
    def times(self) -> tuple[int, int] | None:
        """Return the earliest and the latest log time [ns]; None without a message."""
        times = self.heads['log_time']
        return (int(times.min()), int(times.max())) if len(times) else None

    @property
    def channels(self) -> set[int]:
        """Return the channels of the messages."""
        return set(np.flatnonzero(np.bincount(self.heads['channel'])).tolist())

    def messages(
        self, names: Collection[str] | None = None, *, by_time: bool = False
    ) -> Iterator[Message]:
        """Yield the messages of known topics, of some names or all, by log time if wanted."""
        order = np.argsort(self.heads['log_time'], kind='stable') if by_time else None
        topics = self.topics
        data = self.data
        for first in range(0, len(self), _MAX_BATCH):
            batch = slice(first, first + _MAX_BATCH)
            indices = batch if order is None else order[batch]
            starts = self.starts[indices].tolist()
            for start, head in zip(starts, self.heads[indices].tolist(), strict=True):
                _, length, channel, sequence, log_time, publish_time = head
                topic = topics.get(channel)
                if topic is not None and (names is None or topic.name in names):
                    end = start + length - _HEAD_LENGTH
                    yield Message(
                        topic, data[start:end].tobytes(), log_time, publish_time, sequence
                    )

    def rows(self, which: NDArray[np.bool_] | NDArray[np.intp], size: int) -> NDArray[np.uint8]:
        """Return the data of some messages of the same size, shape (number, size)."""
        windows = sliding_window_view(np.frombuffer(self.data, np.uint8), size)
        return np.asarray(windows[self.starts[which]])


def block_of_messages(
    heads: NDArray[np.void], messages: Sequence[bytes], topics: Mapping[int, Topic]
) -> MessageBlock:
    """Return separate messages as a block; the heads get their lengths."""
    sizes = np.fromiter(map(len, messages), dtype=np.int64, count=len(messages))
    heads['length'] = sizes + _HEAD_LENGTH
    return MessageBlock(memoryview(b''.join(messages)), heads, np.cumsum(sizes) - sizes, topics)
