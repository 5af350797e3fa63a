"""When a file of a run is finished and the next one is begun."""

from dataclasses import dataclass
from typing import Protocol


class Growing(Protocol):
    """A file that is being written."""

    @property
    def file_size(self) -> int:
        """Return its size [bytes]."""

    @property
    def file_duration(self) -> float:
        """Return the time between its first and its last message [s]."""


@dataclass(frozen=True)
class SplitLimits:
    """
    A file is finished as soon as it has reached a limit; 0 is none.

    Parameters
    ----------
    size
        Of the file [bytes].
    duration
        Between its first and its last message [s].

    """

    size: int = 0
    duration: float = 0.0

    def are_reached(self, file: Growing) -> bool:
        """Return whether a file is as large or as long as it may be."""
        return (0 < self.size <= file.file_size) or (0.0 < self.duration <= file.file_duration)
