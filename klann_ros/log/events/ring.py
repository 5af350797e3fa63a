"""The last seconds of what was received, in memory that is bounded."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from klann_ros.log.records import Message, Topic
from klann_ros.log.write.background_writer import OVERHEAD
from klann_ros.log.write.ledger import Mark

# How often a piece is finished [s]; what is too old is forgotten piece by piece.
TURN = 0.25
# So many pieces there are at least where memory is what ends them.
_PIECES = 16
# So many messages of a latched topic outlive their time, in so much of the memory at most.
MOST_LATCHED, _LATCHED_SHARE = 100, 0.125


@dataclass
class Piece:
    """Messages in the order in which they were taken."""

    # When it was begun, by a clock that nobody sets [s].
    begin: float
    # What had become of all messages before.
    before: Mark
    # What was taken since then.
    messages: list[Message] = field(default_factory=list)
    # What that takes [bytes].
    size: int = 0


class Ring:
    """
    Hold the last messages, and the last ones of latched topics however old.

    Parameters
    ----------
    length : float
        How far back it reaches [s].
    most_bytes : int
        It takes no more; what is forgotten early for that is counted.
    mark : callable
        Returns what became of all messages so far.
    now : float
        The time, by a clock that nobody sets [s].

    Attributes
    ----------
    fell_out : int
        How many messages were forgotten before their time.

    """

    def __init__(
        self, length: float, most_bytes: int, mark: Callable[[], Mark], now: float
    ) -> None:
        """Begin empty."""
        self.fell_out = 0
        self._length, self._most_bytes, self._mark, self._now = length, most_bytes, mark, now
        self._last = now
        self._most_in_piece = max(most_bytes // _PIECES, 1)
        self._pieces = deque([Piece(now, mark())])
        self._piece = self._pieces[-1]
        # What finished pieces take [bytes].
        self._size = 0
        self._latched = _Latched(round(_LATCHED_SHARE * most_bytes))

    def put(self, message: Message) -> None:
        """Take a message, when it has been counted as received."""
        piece = self._piece
        piece.messages.append(message)
        piece.size += len(message.data) + OVERHEAD
        if piece.size > self._most_in_piece:
            self.turn(self._now, self._last)

    def turn(self, now: float, last: float) -> None:
        """
        Begin a new piece, and forget what is too old or too much; every `TURN` seconds.

        Too old is what was received longer before a last moment that is wanted than it reaches.
        """
        self._now, self._last = now, last
        self._size += self._piece.size
        self._piece = Piece(now, self._mark())
        self._pieces.append(self._piece)
        while len(self._pieces) > 1 and self._pieces[1].begin <= last - self._length:
            self._forget()
        while len(self._pieces) > 1 and self._size > self._most_bytes:
            self.fell_out += self._forget()

    @property
    def before(self) -> Mark:
        """Return what had become of all messages before the first one here."""
        return self._pieces[0].before

    @property
    def size(self) -> int:
        """Return what all of it takes [bytes]."""
        return self._size + self._piece.size

    def reach(self, now: float) -> float:
        """Return how far back it reaches [s]."""
        return now - self._pieces[0].begin

    def messages(self) -> Iterator[Message]:
        """Yield all messages in the order in which they were taken."""
        for piece in self._pieces:
            yield from piece.messages

    def latched(self, time: int) -> list[Message]:
        """
        Return the last messages of latched topics that are forgotten otherwise.

        They are received at a given time [ns since the epoch], as by who begins to listen then.
        """
        return [replace(message, log_time=time) for message in self._latched.messages()]

    def _forget(self) -> int:
        """Forget the first piece; return how many messages that were."""
        piece = self._pieces.popleft()
        self._size -= piece.size
        for message in piece.messages:
            self._latched.keep(message)
        return len(piece.messages)


class _Latched:
    """The last messages of topics whose publishers send them again to who comes late."""

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes, self._size = most_bytes, 0
        # By the object, as to compare topics takes long; and the topic stays alive.
        self._kinds: dict[int, tuple[Topic, bool]] = {}
        self._kept: dict[str, deque[Message]] = {}

    def keep(self, message: Message) -> None:
        topic = message.topic
        known = self._kinds.get(id(topic))
        if known is None:
            known = self._kinds[id(topic)] = topic, 'transient_local' in topic.qos
        if not known[1]:
            return
        kept = self._kept.setdefault(topic.name, deque())
        kept.append(message)
        self._size += len(message.data) + OVERHEAD
        while len(kept) > MOST_LATCHED or (len(kept) > 1 and self._size > self._most_bytes):
            self._size -= len(kept.popleft().data) + OVERHEAD

    def messages(self) -> Iterator[Message]:
        for kept in self._kept.values():
            yield from kept
