"""Messages in bulk: the numbers of many messages of a type as columns."""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from .cdr import HEADER_SIZE, STAMP_SIZE
from .message_type import Layout, MessageType

# Messages of legs are much smaller; a small file may unpack to any size [bytes].
MAX_MESSAGE_SIZE = 256 * 1024
# Layouts of a topic; with more, single messages are faster.
_MAX_LAYOUTS = 16


class Messages(Protocol):
    """Messages of any topics, as a log has them."""

    @property
    def sizes(self) -> NDArray[np.int64]:
        """Return the size of each message [bytes], shape (n,)."""

    def rows(self, which: NDArray[np.intp], size: int) -> NDArray[np.uint8]:
        """Return the bytes of some messages of one size, shape (number, size)."""


class MessageColumns(NamedTuple):
    """Messages of a topic with equal texts; arrays have n rows."""

    # Indices of the messages.
    rows: NDArray[np.intp]
    # Stamps of their headers [ns]; 0 for a type without.
    stamps: NDArray[np.int64]
    # The texts of the sequence that was asked for, such as the joints of a JointState.
    names: tuple[str, ...]
    # Shape (n, k): the numbers of each field, or submessage, that was asked for.
    numbers: dict[str, NDArray[np.float64]]


class ColumnReader:
    """
    Reads the messages of one topic.

    `paths` are the fields to be read, in the message's order, `names` is a sequence of texts.
    """

    def __init__(self, message_type: MessageType, paths: Sequence[str], names: str = '') -> None:
        self._type = message_type
        self._paths = paths
        self._names = names
        # The last field that is read.
        self._last = ''
        for field in message_type.fields:
            if paths and f'{field.path}.'.startswith(f'{paths[-1]}.'):
                self._last = field.path
        self._layout: _BulkLayout | None = None

    def read(
        self,
        messages: Messages,
        rows: NDArray[np.intp],
        refuse: Callable[[NDArray[np.intp]], object],
    ) -> Iterator[MessageColumns]:
        """Yield the columns of some messages, in any order; refuse rows of another type."""
        sizes = messages.sizes[rows]
        # Usually all have one size.
        unique_sizes = sizes[:1] if (sizes == sizes[:1]).all() else np.unique(sizes)
        for size in unique_sizes.tolist():
            same_size = rows if len(unique_sizes) == 1 else rows[sizes == size]
            if 0 < size <= MAX_MESSAGE_SIZE:
                yield from self._read_size(messages, same_size, size, refuse)
            else:
                refuse(same_size)

    def _read_size(
        self,
        messages: Messages,
        rows: NDArray[np.intp],
        size: int,
        refuse: Callable[[NDArray[np.intp]], object],
    ) -> Iterator[MessageColumns]:
        """Yield the columns of messages of one size."""
        layout_count = 0
        while rows.size:
            # With many layouts, single messages are faster.
            tried = rows if layout_count < _MAX_LAYOUTS else rows[:1]
            layout_count += 1
            data = messages.rows(tried, size)
            layout = self._layout_of(data[:1])
            if layout is None:
                refuse(rows[:1])
                rows = rows[1:]
                continue
            matches = layout.matches(data)
            if matches.all():
                yield self._columns(layout, tried, data)
                rows = rows[slice(len(tried), None)]
            else:
                yield self._columns(layout, rows[matches], data[matches])
                rows = rows[~matches]

    def _layout_of(self, row: NDArray[np.uint8]) -> '_BulkLayout | None':
        """Return the layout of one message, usually the one of the message before."""
        last = self._layout
        if last is None or row.shape[1] != last.size or not last.matches(row)[0]:
            try:
                layout = self._type.layout(row.tobytes(), self._last)
            except ValueError:
                return None
            self._layout = last = _BulkLayout(layout, self._paths)
        return last

    def _columns(
        self, layout: '_BulkLayout', rows: NDArray[np.intp], data: NDArray[np.uint8]
    ) -> MessageColumns:
        is_stamped = self._type.is_stamped
        stamps = layout.stamps(data) if is_stamped else np.zeros(len(rows), dtype=np.int64)
        numbers = {path: layout.numbers(data, path) for path in self._paths}
        return MessageColumns(rows, stamps, layout.texts(self._names), numbers)


class _BulkLayout:
    """Reads the numbers of messages with one layout, shape (n, size)."""

    def __init__(self, layout: Layout, paths: Sequence[str]) -> None:
        self.size = len(layout.data)
        self._layout = layout
        # The bytes of each field's numbers, and their type.
        self._numbers: dict[str, tuple[slice, str]] = {}
        for path in paths:
            span = layout.span(path)
            self._numbers[path] = slice(span.begin, span.end), f'{layout.order}{span.code}'
        ranges = [np.arange(part.start, part.stop) for part in layout.structure]
        # Indices and values of the bytes that all such messages share.
        self._shared = np.concatenate(ranges)
        self._shared_bytes = np.frombuffer(layout.data, np.uint8)[self._shared]

    def matches(self, data: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Return which messages differ in numbers and padding only."""
        return np.asarray((data[:, self._shared] == self._shared_bytes).all(axis=1))

    def texts(self, path: str) -> tuple[str, ...]:
        """Return the texts of a field."""
        return tuple(text.decode(errors='replace') for text in self._layout.texts.get(path, ()))

    def stamps(self, data: NDArray[np.uint8]) -> NDArray[np.int64]:
        """Return the stamps, shape (n,) [ns]."""
        order = self._layout.order
        stamps = np.ascontiguousarray(data[:, slice(HEADER_SIZE, HEADER_SIZE + STAMP_SIZE)])
        seconds = stamps[:, :4].copy().view(f'{order}i4')[:, 0].astype(np.int64)
        return np.asarray(seconds * 10**9 + stamps[:, 4:].copy().view(f'{order}u4')[:, 0])

    def numbers(self, data: NDArray[np.uint8], path: str) -> NDArray[np.float64]:
        """Return the numbers of a field, shape (n, count)."""
        span, kind = self._numbers[path]
        return np.ascontiguousarray(data[:, span]).view(kind).astype(np.float64)
