"""From a block of a log to numbers: all messages of a topic that are alike at once."""

from collections.abc import Callable, Iterator
from itertools import chain
from typing import Any, NamedTuple

from klann_ros.log.reading.block import Block
from klann_ros.log.records import Topic
import numpy as np
from numpy.typing import NDArray

from .decoders import decoder
from .layouts import CRANK_ANGLE, Floats, FOOT, JOINT_STATE, Layout, LAYOUTS, Times
from .standard_fields import has_standard_fields

Rows = NDArray[np.intp]
# Messages that are all unlike each other are faster read one by one.
_MOST_LAYOUTS = 16
# Differences of two times fit in 64 bits with a sign; this one is in the year 2116.
LAST_TIME = 2**62


class Piece(NamedTuple):
    """
    What messages of a topic say that have the same joints.

    Attributes
    ----------
    rows : numpy.ndarray, shape (n,)
        Which messages of the block they are.
    stamps : numpy.ndarray, shape (n,)
        Their header stamps [ns]; 0 for a type without.
    names : tuple of str
        The joints in a JointState.
    values : numpy.ndarray, shape (n, k)
        The number; x, y and z; or the positions.
    velocities : numpy.ndarray, shape (n, k) or (n, 0)
        The velocities of a JointState.

    """

    rows: Rows
    stamps: Times
    names: tuple[str, ...]
    values: Floats
    velocities: Floats


def nanoseconds(times: NDArray[np.uint64]) -> Times:
    """Return times as numbers with a sign: a log may hold any 64 bits."""
    signed: Times = np.minimum(times, np.uint64(LAST_TIME)).astype(np.int64)
    return signed


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

    def read(self, block: Block, rows: Rows) -> Iterator[Piece]:
        """Yield what these messages of a block say, in no particular order."""
        others: list[Rows] = []
        sizes = block.sizes[rows]
        for size in np.unique(sizes).tolist():
            yield from self._of_size(block, rows[sizes == size], size, others)
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

    def _of_size(self, block: Block, rows: Rows, size: int, others: list[Rows]) -> Iterator[Piece]:
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

    def _one(self, block: Block, row: int) -> Piece:
        """Return what one message says, by the library that knows all types."""
        decoded = self._decode(block.message(row))
        stamp, names, values, velocities = _FIELDS[self._type](decoded)
        return Piece(
            np.array([row]),
            np.array([min(max(stamp, -LAST_TIME), LAST_TIME)]),
            tuple(map(str, names)),
            np.array([values], dtype=np.float64),
            np.array([velocities], dtype=np.float64),
        )


def _piece(layout: Layout, rows: Rows, data: NDArray[np.uint8]) -> Piece:
    count = len(rows)
    stamps = layout.stamps(data) if layout.is_stamped else np.zeros(count, dtype=np.int64)
    joints = len(layout.numbers) > 1
    velocities = layout.doubles(data, 1) if joints else np.empty((count, 0))
    return Piece(rows, stamps, layout.names, layout.doubles(data, 0), velocities)


Fields = tuple[int, Any, Any, Any]


def _stamp(decoded: Any) -> int:
    stamp = decoded.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _crank_angle(decoded: Any) -> Fields:
    return 0, (), (float(decoded.data),), ()


def _foot(decoded: Any) -> Fields:
    point = decoded.point
    return _stamp(decoded), (), tuple(map(float, (point.x, point.y, point.z))), ()


def _joint_state(decoded: Any) -> Fields:
    return _stamp(decoded), decoded.name, tuple(decoded.position), tuple(decoded.velocity)


_FIELDS: dict[str, Callable[[Any], Fields]] = {
    CRANK_ANGLE: _crank_angle,
    FOOT: _foot,
    JOINT_STATE: _joint_state,
}
