"""From a block of a log to numbers: all messages of a topic that are alike at once."""

from collections.abc import Callable, Iterator
from contextlib import redirect_stderr
from functools import lru_cache
from io import StringIO
from itertools import chain
import re
from typing import Any, NamedTuple

from klann_ros.log.read.block import MessageBlock
from klann_ros.log.records import Topic
from klann_ros.review.model.times import Floats, LAST_TIME, nanoseconds, RowIndices, Times
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
import numpy as np
from numpy.typing import NDArray

from .layouts import (
    CRANK_ANGLE,
    FOOT,
    has_standard_fields,
    JOINT_STATE,
    Layout,
    LAYOUTS,
    ODOMETRY,
)

# A message that tells of a leg is much smaller; what a small file unpacks to may be anything.
MAX_MESSAGE = 256 * 1024
# A DiagnosticArray's, without comments, has 600 characters.
MAX_DEFINITION = 16 * 1024

_COMMENT = re.compile('#[^\r\n]*')
Decode = Callable[[bytes], Any]


def decoder(topic: Topic) -> Decode:
    """
    Return what decodes a topic's messages; it raises whatever comes of the bytes.

    The library that knows all types prints what it cannot parse, and takes the square of the time
    for comments and fields that are many. Definitions may be anybody's; so it is given no
    comments, no definition that is longer than those of legs, and no terminal.
    """
    return _decoder(topic.type, topic.definition, topic.schema_encoding, topic.message_encoding)


@lru_cache(maxsize=16)
def _decoder(name: str, definition: str, schema_encoding: str, encoding: str) -> Decode:
    text = _COMMENT.sub('', definition)
    if len(text) > MAX_DEFINITION:
        return _refuse
    schema = Schema(id=1, data=text.encode(), encoding=schema_encoding, name=name)
    try:
        with redirect_stderr(StringIO()):
            decode = DecoderFactory().decoder_for(encoding, schema)
    except Exception:  # noqa: BLE001, RUF100 - the text may be anything
        decode = None
    if decode is None:
        return _refuse

    def bounded(data: bytes) -> Any:
        if len(data) > MAX_MESSAGE:
            raise ValueError(f'{len(data)} bytes, more than the limit of {MAX_MESSAGE}')
        return decode(data)

    return bounded


def _refuse(_: bytes) -> Any:
    raise ValueError('no decoder for this topic')


# Messages that are all unlike each other are faster read one by one.
_MOST_LAYOUTS = 16


class DecodedRows(NamedTuple):
    """What messages of a topic say that have the same joints."""

    # Shape (n,): which messages of the block they are.
    rows: RowIndices
    # Shape (n,): their header stamps [ns]; 0 for a type without.
    stamps: Times
    # The joints in a JointState.
    names: tuple[str, ...]
    # Shape (n, k): the number; x, y and z; the pose; or the positions.
    values: Floats
    # Shape (n, k) or (n, 0): the velocities of a JointState.
    velocities: Floats
    # Shape (n, k) or (n, 0): the efforts of a JointState.
    efforts: Floats


class TopicReader:
    """
    Reads the messages of a topic of one of LAYOUTS's types.

    Attributes
    ----------
    failed : int
        How many messages do not hold what their type says.
    failed_at : int
        Log time of the first of them [ns].

    """

    def __init__(self, topic: Topic) -> None:
        self.failed = 0
        self.failed_at = 0
        self._type = topic.type
        self._make_layout = LAYOUTS[topic.type] if has_standard_fields(topic) else None
        self._layout: Layout | None = None
        self._decode = decoder(topic)

    def read(self, block: MessageBlock, rows: RowIndices) -> Iterator[DecodedRows]:
        """Yield what these messages of a block say, in no particular order."""
        others: list[RowIndices] = []
        sizes = block.sizes[rows]
        # As a rule all have one size.
        found = sizes[:1] if (sizes == sizes[:1]).all() else np.unique(sizes)
        for size in found.tolist():
            alike = rows if len(found) == 1 else rows[sizes == size]
            yield from self._of_size(block, alike, size, others)
        for row in chain.from_iterable(others):
            try:
                yield self._one(block, row)
            except Exception:  # noqa: BLE001, PERF203, RUF100 - the bytes may be anything
                self.refuse(nanoseconds(block.heads['log_time'][[row]]))

    def refuse(self, times: Times) -> None:
        """Count messages that cannot be used, by their log times [ns]."""
        first = int(times.min())
        self.failed_at = min(self.failed_at, first) if self.failed else first
        self.failed += len(times)

    def _of_size(
        self, block: MessageBlock, rows: RowIndices, size: int, others: list[RowIndices]
    ) -> Iterator[DecodedRows]:
        """Yield what messages of one size say; add those that no layout fits to `others`."""
        for _ in range(_MOST_LAYOUTS):
            if not rows.size or not size:
                break
            data = block.rows(rows, size)
            layout = self._layout_for(data[0].tobytes())
            if layout is None:
                others.append(rows[:1])
                rows = rows[1:]
                continue
            alike = layout.alike(data)
            if alike.all():
                yield _piece(layout, rows, data)
                return
            yield _piece(layout, rows[alike], data[alike])
            rows = rows[~alike]
        others.append(rows)

    def _layout_for(self, data: bytes) -> Layout | None:
        known = self._layout
        if known is not None and len(data) == len(known.data):
            row = np.frombuffer(data, np.uint8)[np.newaxis]
            if known.alike(row)[0]:
                return known
        if self._make_layout is None:
            return None
        try:
            self._layout = self._make_layout(data)
        except ValueError:
            return None
        return self._layout

    def _one(self, block: MessageBlock, row: int) -> DecodedRows:
        """Return what one message says, by the library that knows all types."""
        decoded = self._decode(block.message(row))
        stamp, names, values, velocities, efforts = _FIELDS[self._type](decoded)
        return DecodedRows(
            np.array([row]),
            np.array([min(max(stamp, -LAST_TIME), LAST_TIME)]),
            tuple(map(str, names)),
            np.array([values], dtype=np.float64),
            np.array([velocities], dtype=np.float64),
            np.array([efforts], dtype=np.float64),
        )


def _piece(layout: Layout, rows: RowIndices, data: NDArray[np.uint8]) -> DecodedRows:
    count = len(rows)
    stamps = layout.stamps(data) if layout.is_stamped else np.zeros(count, dtype=np.int64)
    joints = len(layout.numbers) > 1
    others = [layout.doubles(data, which) if joints else np.empty((count, 0)) for which in (1, 2)]
    return DecodedRows(rows, stamps, layout.names, layout.doubles(data, 0), *others)


def _stamp(decoded: Any) -> int:
    stamp = decoded.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _point(decoded: Any) -> tuple[float, ...]:
    return tuple(float(getattr(decoded.point, axis)) for axis in 'xyz')


def _pose(decoded: Any) -> tuple[float, ...]:
    at, turned = decoded.pose.pose.position, decoded.pose.pose.orientation
    return (
        *(float(getattr(at, axis)) for axis in 'xyz'),
        *(float(getattr(turned, axis)) for axis in 'xyzw'),
    )


# Stamp, names, values, velocities and efforts.
_FIELDS: dict[str, Callable[[Any], tuple[int, Any, Any, Any, Any]]] = {
    CRANK_ANGLE: lambda decoded: (0, (), (float(decoded.data),), (), ()),
    FOOT: lambda decoded: (_stamp(decoded), (), _point(decoded), (), ()),
    ODOMETRY: lambda decoded: (_stamp(decoded), (), _pose(decoded), (), ()),
    JOINT_STATE: lambda decoded: (
        _stamp(decoded),
        decoded.name,
        tuple(decoded.position),
        tuple(decoded.velocity),
        tuple(decoded.effort),
    ),
}
