"""Lost messages, counted by the gaps in their publication sequence numbers."""


class LossCounter:
    """
    Count lost messages by the gaps in their publication sequence numbers.

    The numbers are each publisher's own, so the count is exact for a topic with one publisher. A
    number that is not above the last is a publisher that has started anew.

    Attributes
    ----------
    lost : int
        Messages lost so far.

    """

    def __init__(self) -> None:
        """Start before the first message."""
        self.lost = 0
        self._last: int | None = None

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
        if sequence is not None and publishers == 1:
            if self._last is not None and sequence > self._last:
                self.lost += sequence - self._last - 1
            self._last = sequence
        else:
            self._last = None
