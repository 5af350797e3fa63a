"""Count lost messages by gaps in their publication sequence numbers."""


class LossCounter:
    """
    Count lost messages by gaps in their publication sequence numbers.

    Each publisher numbers its messages from 1, so the count is exact for a topic with one
    publisher at a time, between its first and its last received message. `publishers_changed`
    and `identify` report changes of publishers; without them, a number that is not above the last
    one is that of a restarted publisher.
    """

    def __init__(self) -> None:
        # Messages lost between two received ones of a publisher.
        self.lost = 0
        # Messages that later publishers had sent before their first received one.
        self.before_discovery = 0
        # Publishers that left (set from outside): losses at their end cannot be detected.
        self.departed = 0
        # Whether late subscribers receive the last messages again (set from outside), so that the
        # first number means nothing.
        self.latched = False
        # Whether there ever were several publishers at once.
        self.shared = False
        # Whether all messages had a number.
        self.numbered = True
        self._last: int | None = None
        # The last number before publishers changed, and its publisher.
        self._last_before_change: int | None = None
        self._publisher: object = None
        # The first number since then, if its publisher is ambiguous.
        self._first: int | None = None

    @property
    def is_known(self) -> bool:
        """Return whether `lost` is complete."""
        return self.numbered and not self.shared

    def publishers_changed(self) -> None:
        """Note that the next message may have another publisher."""
        if self._last is not None:
            self._last_before_change = self._last
            self._last = None
            self._first = None

    def identify(self, publisher: object) -> None:
        """Set the publisher since the last change; None if it is unknown."""
        if self._last is None:
            return
        first = self._first
        last_before = self._last_before_change
        self._first = None
        if publisher is None:
            return
        if first is not None and last_before is not None and self._publisher is not None:
            if publisher == self._publisher:
                self.lost += first - last_before - 1
            else:
                self._begin(first)
        self._publisher = publisher

    def count(self, sequence: int | None, publishers: int = 1) -> bool:
        """
        Count the gap before a message with a sequence number; None where there is none.

        The numbers of several publishers are ambiguous. Return whether it is the first message
        since publishers changed: now they can be identified.
        """
        if sequence is None or publishers > 1:
            self.shared = self.shared or publishers > 1
            self.numbered = self.numbered and sequence is not None
            self._last = self._last_before_change = self._first = None
            return False
        last = self._last
        self._last = sequence
        if last is None:
            self._resume(sequence)
            return True
        if sequence > last:
            self.lost += sequence - last - 1
        else:
            # The numbers before belong to the publisher known until now.
            self._first = None
            self._begin(sequence)
        return False

    def _resume(self, sequence: int) -> None:
        """Process the first number since publishers changed."""
        if self._last_before_change is None:
            return
        if sequence <= self._last_before_change:
            self._begin(sequence)
        elif sequence > self._last_before_change + 1:
            self._first = sequence

    def _begin(self, sequence: int) -> None:
        """Process the first number of a later publisher."""
        if not self.latched:
            self.before_discovery += sequence - 1
