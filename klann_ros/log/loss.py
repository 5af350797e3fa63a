"""Lost messages, counted by the gaps in their publication sequence numbers."""


class LossCounter:
    """
    Count lost messages by the gaps in their publication sequence numbers.

    The numbers are each publisher's own, so the count is exact for a topic with one publisher at
    a time. Whoever knows that publishers have changed says so by `forget`; without that word, a
    number that is not above the last is a publisher that has started anew.

    Attributes
    ----------
    lost : int
        Messages lost so far.
    shared : bool
        Whether there ever was more than one publisher at a time: then `lost` is not all.

    """

    def __init__(self) -> None:
        """Start before the first message."""
        self.lost = 0
        self.shared = False
        self._last: int | None = None

    def forget(self) -> None:
        """Begin anew with the next message: it may be another publisher's."""
        self._last = None

    def count(self, sequence: int | None, publishers: int = 1) -> None:
        """
        Count what is missing before a message.

        Parameters
        ----------
        sequence : int or None
            Its publication sequence number; None where the middleware has none.
        publishers : int
            How many publishers the topic has: the numbers of several cannot be told apart.

        """
        self.shared = self.shared or publishers > 1
        if sequence is None or publishers > 1:
            self._last = None
            return
        if self._last is not None and sequence > self._last:
            self.lost += sequence - self._last - 1
        self._last = sequence
