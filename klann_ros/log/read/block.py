"""The messages of a chunk as arrays, for readers of millions of messages."""

from collections.abc import Iterator, Mapping, Sequence
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

    def messages(self) -> Iterator[Message]:
        """Yield the messages of known topics."""
        places = zip(self.starts.tolist(), (self.starts + self.sizes).tolist(), strict=True)
        for head, (begin, end) in zip(self.heads.tolist(), places, strict=True):
            _, _, channel, sequence, log_time, publish_time = head
            topic = self.topics.get(channel)
            if topic is not None:
                data = self.data[begin:end].tobytes()
                yield Message(topic, data, log_time, publish_time, sequence)

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
