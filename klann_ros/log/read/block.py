"""The messages of a chunk as arrays, for readers of millions of messages."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from klann_ros.log.mcap.content import Content
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

# Of these the record's length includes all but opcode and length [bytes].
_HEAD_LENGTH = HEAD.itemsize - 9
# Millions of small messages would take more memory as Python's numbers than they have.
_ROWS_AT_ONCE = 4096


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
    def channels(self) -> set[int]:
        """Return the channels of the messages."""
        return set(np.flatnonzero(np.bincount(self.heads['channel'])).tolist())

    def messages(
        self, names: Collection[str] | None = None, *, by_time: bool = False
    ) -> Iterator[Message]:
        """Yield the messages of known topics, of some names or all, by log time if wanted."""
        order = np.argsort(self.heads['log_time'], kind='stable') if by_time else None
        wanted: dict[int, Topic | None] = {}
        data = self.data
        for first in range(0, len(self), _ROWS_AT_ONCE):
            part = slice(first, first + _ROWS_AT_ONCE)
            rows = part if order is None else order[part]
            heads, starts = self.heads[rows].tolist(), self.starts[rows].tolist()
            for (_, length, channel, sequence, log_time, publish_time), start in zip(
                heads, starts, strict=True
            ):
                if channel not in wanted:
                    topic = self.topics.get(channel)
                    is_wanted = topic is not None and (names is None or topic.name in names)
                    wanted[channel] = topic if is_wanted else None
                topic = wanted[channel]
                if topic is not None:
                    end = start + length - _HEAD_LENGTH
                    content = data[start:end].tobytes()
                    yield Message(topic, content, log_time, publish_time, sequence)

    def rows(self, which: NDArray[np.bool_] | NDArray[np.intp], size: int) -> NDArray[np.uint8]:
        """Return the data of some messages of the same size, shape (number, size)."""
        windows = sliding_window_view(np.frombuffer(self.data, np.uint8), size)
        found: NDArray[np.uint8] = windows[self.starts[which]]
        return found


def block_of(content: Content, topics: Mapping[int, Topic]) -> MessageBlock:
    """Return the messages of a chunk, or those outside of chunks, as arrays."""
    if not len(content):
        nothing = np.empty(0, dtype=np.int64)
        return MessageBlock(content.data, np.empty(0, HEAD), nothing, topics)
    starts = np.frombuffer(content.starts, dtype=np.uint64).astype(np.int64)
    rows = sliding_window_view(np.frombuffer(content.data, np.uint8), HEAD.itemsize)[starts]
    return MessageBlock(content.data, rows.view(HEAD)[:, 0], starts + HEAD.itemsize, topics)


def block_of_messages(
    heads: NDArray[np.void], messages: Sequence[bytes], topics: Mapping[int, Topic]
) -> MessageBlock:
    """Return separate messages as a block; the heads get their lengths."""
    sizes = np.fromiter(map(len, messages), dtype=np.int64, count=len(messages))
    heads['length'] = sizes + _HEAD_LENGTH
    return MessageBlock(memoryview(b''.join(messages)), heads, np.cumsum(sizes) - sizes, topics)
