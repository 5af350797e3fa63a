"""
How much a file may cost beyond its own bytes and the messages in it.

A kilobyte can unpack to millions of bytes, and these may be no messages: zeros, records of kinds
that nobody knows, or what no CRC holds for. So what is looked at in vain is counted, in bytes: a
multiple of those in the file is free, and beyond that there is an amount once for the file. A file
that is sound never gets there; one that has used it up is still read, but what is behind that in
it is unpacked to the free multiple only.
"""

FREE = 64
"""So many bytes may be unpacked in vain for one in the file."""

_EACH = 16 * 1024
_ONCE = 256 * 1024 * 1024

# What a record costs that is stepped over, one that describes something, and what each message
# pays for those around it [bytes that could be unpacked in that time].
RECORD, DEFINITION, MESSAGE = 256, 1024, 4096


class Patience:
    """What is left of it for one pass over a file."""

    def __init__(self) -> None:
        self._left = _ONCE

    def allowed(self, packed: int) -> int:
        """Return how much may be looked at in vain for a chunk of so many bytes in the file."""
        return max(self._left, 0) + FREE * packed + _EACH

    def spend(self, wasted: int, packed: int) -> None:
        """Note how much was looked at in vain for a chunk."""
        self._left -= max(0, wasted - FREE * packed)
