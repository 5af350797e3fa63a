"""What one file of a log holds, and what is wrong in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from klann_ros.log.records import Topic


@dataclass(frozen=True)
class Problem:
    """Something wrong in a file: the offset [bytes], and what, in one line."""

    offset: int
    text: str


@dataclass(frozen=True)
class Overview:
    """What a file holds: topics, first and last log time [ns], offsets of other records."""

    topics: list[Topic]
    times: tuple[int, int] | None
    metadata: list[int]
    attachments: list[int]
