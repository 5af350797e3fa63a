"""Which messages are in a file that the disk did not let end: chunk by chunk."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from mcap.opcode import Opcode

if TYPE_CHECKING:
    from collections.abc import Callable

    from klann_ros.log.bag_metadata import FileSummary

    from .durable_file import DurableFile

_CHUNK = bytes([Opcode.CHUNK])


class NotedFile:
    """
    What the MCAP library writes to: a file that notes what is in it whenever a chunk is written.

    Parameters
    ----------
    file
        The file.
    taken
        Returns which messages were given to the library so far. All of them are in chunks when a
        chunk is written.

    """

    def __init__(self, file: DurableFile, taken: Callable[[], FileSummary]) -> None:
        self.tell, self.flush = file.tell, file.flush
        self._file, self._taken = file, taken
        # Where each chunk ends [bytes], and what the file holds up to there.
        self._chunks = deque([(0, taken())])

    def write(self, data: bytes) -> int:
        """Take what the library writes: a chunk's record always comes by itself."""
        if data[:1] == _CHUNK:
            # Noted before, for to write it may hand it over.
            self._forget()
            self._chunks.append((self.tell() + len(data), self._taken()))
        return self._file.write(data)

    def kept(self) -> FileSummary:
        """Return what is known to be in the file, after a failure."""
        return [summary for end, summary in self._chunks if end <= self._file.held][-1]

    def _forget(self) -> None:
        while len(self._chunks) > 1 and self._chunks[1][0] <= self._file.synced:
            self._chunks.popleft()
