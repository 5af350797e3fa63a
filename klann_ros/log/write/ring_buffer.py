"""Ring buffer of the last received messages (pre-trigger), with bounded memory."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from klann_ros.log.loss import Counts
from klann_ros.log.records import Message, Topic

from .background_writer import MESSAGE_OVERHEAD

SEGMENT_SECONDS = 0.25
"""Duration of a segment; old messages are removed by segments [s]."""

MAX_LATCHED_MESSAGES = 100
"""Last messages of a latched topic that outlive the buffer's duration."""

# The minimum number of segments when memory is the limit, and the latched messages' share of it.
_MIN_SEGMENTS, _LATCHED_SHARE = 16, 0.125


@dataclass
class Segment:
    """Messages in the order of reception."""

    # Monotonic time [s].
    begin: float
    # Counters before its first message.
    counters: Counts
    messages: list[Message] = field(default_factory=list)
    # Memory [bytes].
    size: int = 0


class RingBuffer:
    """
    Hold the messages of the last seconds, and the last ones of latched topics of any age.

    Memory is bounded [bytes]; ``evicted`` counts messages that were removed early because of it.
    A snapshot returns the present counters of all messages. Times are monotonic [s].
    """

    def __init__(
        self, duration: float, max_bytes: int, snapshot: Callable[[], Counts], now: float
    ) -> None:
        self.evicted = 0
        # Time of the last rotation.
        self.rotated = now
        self._duration = duration
        self._max_bytes = max_bytes
        self._snapshot = snapshot
        self._newest = now
        self._max_segment_size = max(max_bytes // _MIN_SEGMENTS, 1)
        self._segments = deque([Segment(now, snapshot())])
        self._segment = self._segments[-1]
        # Memory of the finished segments [bytes].
        self._size = 0
        self._latched = _LatchedMessages(round(_LATCHED_SHARE * max_bytes))

    def put(self, message: Message) -> None:
        """Add a message that was counted as received."""
        segment = self._segment
        segment.messages.append(message)
        segment.size += len(message.data) + MESSAGE_OVERHEAD
        if segment.size > self._max_segment_size:
            self.rotate(self.rotated, self._newest)

    def rotate(self, now: float, newest: float) -> None:
        """
        Begin a new segment, and remove old ones; to be called every SEGMENT_SECONDS.

        The buffer's duration counts back from ``newest``.
        """
        self.rotated = now
        self._newest = newest
        self._size += self._segment.size
        self._segment = Segment(now, self._snapshot())
        self._segments.append(self._segment)
        while len(self._segments) > 1 and self._segments[1].begin <= newest - self._duration:
            self._remove_oldest()
        while len(self._segments) > 1 and self._size > self._max_bytes:
            self.evicted += self._remove_oldest()

    @property
    def counters(self) -> Counts:
        """Return the counters before the first message."""
        return self._segments[0].counters

    @property
    def size(self) -> int:
        """Return the memory in use [bytes]."""
        return self._size + self._segment.size

    def buffered_time(self, now: float) -> float:
        """Return the age of the oldest segment [s]."""
        return now - self._segments[0].begin

    def messages(self) -> Iterator[Message]:
        """Yield all messages in the order of reception."""
        for segment in self._segments:
            yield from segment.messages

    def latched(self, log_time: int) -> list[Message]:
        """Return the removed last messages of latched topics, with a new log time [ns]."""
        return [replace(message, log_time=log_time) for message in self._latched.messages()]

    def _remove_oldest(self) -> int:
        """Remove the oldest segment; return its number of messages."""
        segment = self._segments.popleft()
        self._size -= segment.size
        for message in segment.messages:
            self._latched.add(message)
        return len(segment.messages)


class _LatchedMessages:
    """The last messages of latched topics, which publishers repeat to late subscribers."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._size = 0
        # By identity, as comparing topics is slow; the stored topic keeps the id valid.
        self._is_latched: dict[int, tuple[Topic, bool]] = {}
        self._queues: dict[str, deque[Message]] = {}

    def add(self, message: Message) -> None:
        topic = message.topic
        if id(topic) not in self._is_latched:
            self._is_latched[id(topic)] = topic, 'transient_local' in topic.qos
        _, is_latched = self._is_latched[id(topic)]
        if not is_latched:
            return
        queue = self._queues.setdefault(topic.name, deque())
        queue.append(message)
        self._size += len(message.data) + MESSAGE_OVERHEAD
        while len(queue) > MAX_LATCHED_MESSAGES or (
            len(queue) > 1 and self._size > self._max_bytes
        ):
            self._size -= len(queue.popleft().data) + MESSAGE_OVERHEAD

    def messages(self) -> Iterator[Message]:
        for queue in self._queues.values():
            yield from queue
