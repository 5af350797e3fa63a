"""Lost messages, counted by the gaps in their publication sequence numbers."""


class LossCounter:
    """
    Count lost messages by the gaps in their publication sequence numbers.

    The numbers are each publisher's own and begin at 1, so the count is exact for a topic with one
    publisher at a time, between the first and the last message that is heard of each. Whoever
    knows that publishers have changed says so by `forget`, and by `identify` who is heard since
    then; without that word, a number that is not above the last is a publisher that has started
    anew.

    Attributes
    ----------
    lost : int
        Messages lost so far, between two that were heard of a publisher.
    early : int
        What publishers had sent before they were first heard; that of the topic's first one is
        not counted, which may have been there long before.
    left : int
        How many publishers have left: of what each sent last nobody knows. It is told from
        outside.
    latched : bool
        Whether who comes late hears the last messages again, so that the first number tells
        nothing. It is told from outside.
    shared : bool
        Whether there ever was more than one publisher at a time: then `lost` is not all.
    numbered : bool
        Whether all messages had a number; else `lost` is not all either.

    """

    def __init__(self) -> None:
        self.lost = self.early = self.left = 0
        self.latched = self.shared = False
        self.numbered = True
        self._last: int | None = None
        # What had been reached when publishers changed, and who had.
        self._reached: int | None = None
        self._heard: object = None
        # The first number since then, where that is not enough to tell who it is.
        self._first: int | None = None

    @property
    def is_known(self) -> bool:
        """Return whether the numbers tell what was lost."""
        return self.numbered and not self.shared

    def forget(self) -> None:
        """Begin anew with the next message: it may be another publisher's."""
        if self._last is not None:
            self._last, self._reached = None, self._last
            self._first = None

    def identify(self, who: object) -> None:
        """Tell who has been heard since publishers changed; None where that is not known."""
        if self._last is None:
            return
        first, reached = self._first, self._reached
        self._first = None
        if who is None:
            return
        if first is not None and reached is not None and self._heard is not None:
            if who == self._heard:
                self.lost += first - reached - 1
            else:
                self._begin(first)
        self._heard = who

    def count(self, sequence: int | None, publishers: int = 1) -> bool:
        """
        Count what is missing before a message.

        Parameters
        ----------
        sequence : int or None
            Its publication sequence number; None where the middleware has none.
        publishers : int
            How many publishers the topic has: the numbers of several cannot be told apart.

        Returns
        -------
        bool
            Whether it is the first since publishers changed: now they can be identified.

        """
        if sequence is None or publishers > 1:
            self.shared = self.shared or publishers > 1
            self.numbered = self.numbered and sequence is not None
            self._last = self._reached = self._first = None
            return False
        last, self._last = self._last, sequence
        if last is None:
            self._resume(sequence)
            return True
        if sequence > last:
            self.lost += sequence - last - 1
        else:
            # Who came before was the one that was heard until then.
            self._first = None
            self._begin(sequence)
        return False

    def _resume(self, sequence: int) -> None:
        """Take the first number since publishers changed."""
        if self._reached is None:
            return
        if sequence <= self._reached:
            self._begin(sequence)
        elif sequence > self._reached + 1:
            self._first = sequence

    def _begin(self, sequence: int) -> None:
        """Take the first number of a publisher that came later than the topic's first."""
        if not self.latched:
            self.early += sequence - 1
