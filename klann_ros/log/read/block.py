"""The messages of a chunk as arrays, for whoever has millions of them to look at."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from klann_ros.log.mcap.content import Content
from klann_ros.log.records import Topic
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
"""What stands before the bytes of a message."""

# So much of it counts for the length of the record; opcode and length do not [bytes].
_COUNTED = HEAD.itemsize - 9


@dataclass(frozen=True, eq=False)
class MessageBlock:
    """Messages that stand together in a log, in the order in which they stand there."""

    # The bytes in which they stand.
    data: memoryview
    # A row of type HEAD each: its channel, sequence, log time and publish time [ns].
    heads: NDArray[np.void]
    # Where in ``data`` the bytes of each begin; shape (n,).
    starts: NDArray[np.int64]
    # What their channels stand for, as far as that is known.
    topics: Mapping[int, Topic]

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def sizes(self) -> NDArray[np.int64]:
        """Return how many bytes each message has, shape (n,)."""
        return self.heads['length'].astype(np.int64) - _COUNTED

    def message(self, row: int) -> bytes:
        """Return the bytes of one message."""
        begin = int(self.starts[row])
        end = begin + int(self.heads['length'][row]) - _COUNTED
        return self.data[begin:end].tobytes()

    def rows(self, which: NDArray[np.bool_] | NDArray[np.intp], size: int) -> NDArray[np.uint8]:
        """Return the bytes of some messages of the same size, shape (number, size)."""
        windows = sliding_window_view(np.frombuffer(self.data, np.uint8), size)
        found: NDArray[np.uint8] = windows[self.starts[which]]
        return found


def block_of(content: Content, topics: Mapping[int, Topic]) -> MessageBlock:
    """Return the messages of a chunk, or of a message outside of chunks, as arrays."""
    if not len(content):
        nothing = np.empty(0, dtype=np.int64)
        return MessageBlock(content.data, np.empty(0, HEAD), nothing, topics)
    at = np.frombuffer(content.starts, dtype=np.uint64).astype(np.int64)
    rows = sliding_window_view(np.frombuffer(content.data, np.uint8), HEAD.itemsize)[at]
    return MessageBlock(content.data, rows.view(HEAD)[:, 0], at + HEAD.itemsize, topics)


def block_of_messages(
    heads: NDArray[np.void], messages: Sequence[bytes], topics: Mapping[int, Topic]
) -> MessageBlock:
    """Return messages that do not stand in one piece as a block; the heads get their lengths."""
    sizes = np.fromiter(map(len, messages), dtype=np.int64, count=len(messages))
    heads['length'] = sizes + _COUNTED
    return MessageBlock(memoryview(b''.join(messages)), heads, np.cumsum(sizes) - sizes, topics)
