"""What one file of a log holds, and what is wrong in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from klann_ros.untrusted.text import printable_line

if TYPE_CHECKING:
    from klann_ros.log.records import Topic


@dataclass(frozen=True)
class Problem:
    """Something wrong in a file: the offset [bytes], and what, in one line."""

    offset: int
    text: str

    @property
    def place(self) -> str:
        """Return where it is, to stand behind the file's name; '' if it is the file as a whole."""
        return f' at byte {self.offset}' if self.offset >= 0 else ''


class Problems(dict[int, Problem]):
    """What was found to be wrong in a file so far, the first at each offset."""

    def note(self, offset: int, text: str) -> None:
        """Remember that something is wrong at an offset [bytes]."""
        self.setdefault(offset, Problem(offset, printable_line(text)))

    def note_whole(self, text: str) -> None:
        """Remember that something is wrong that has no place, once."""
        shown = printable_line(text)
        if all(problem.text != shown for problem in self.values()):
            self.note(-1 - len(self), shown)


@dataclass(frozen=True)
class Overview:
    """What a file holds: topics, first and last log time [ns], offsets of other records."""

    topics: list[Topic]
    times: tuple[int, int] | None
    metadata: list[int]
    attachments: list[int]
