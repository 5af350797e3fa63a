"""Possible log times, and impossible ones: a counter rolled over, or a clock was not set."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timezone

from klann_ros.sanitize.text import counted, verb
import numpy as np

from .storage import MessageBlock

MAX_LOG_DURATION = 10 * 365 * 86400 * 10**9
"""A log time further from the others is impossible [ns]: ten years."""
MAX_ROS_TIME = 2**63 - 1
"""ROS's times are signed [ns]."""


@dataclass(frozen=True)
class LogTimes:
    """The log times of a log [ns]: the first and the last possible one, and impossible ones."""

    start: int
    end: int
    count: int = 0
    impossible_count: int = 0
    # An impossible one [ns].
    example: int = 0

    def __str__(self) -> str:
        """Return the impossible log times in one line; '' for none."""
        if not self.impossible_count:
            return ''
        are_impossible = verb(self.impossible_count, 'is', 'are')
        date = datetime.fromtimestamp(self.example // 10**9, timezone.utc)
        return (
            f'{self.impossible_count} of {counted(self.count, "log time")} {are_impossible} '
            f'impossible ({date:%Y-%m-%d %H:%M:%S}), more than ten years from the others'
        )

    def repaired(self, blocks: Iterable[MessageBlock]) -> Iterator[MessageBlock]:
        """Yield blocks where an impossible log time is replaced by the one before it."""
        if not self.impossible_count:
            yield from blocks
            return
        last_time = np.uint64(self.start)
        for block in blocks:
            times = block.heads['log_time']
            is_possible = (times >= self.start) & (times <= self.end)
            rows = np.maximum.accumulate(np.where(is_possible, np.arange(len(times)), -1))
            heads = block.heads.copy()
            heads['log_time'] = np.where(rows < 0, last_time, times[rows])
            # An unknown publish time is the log time.
            heads['publish_time'] = np.where(is_possible, heads['publish_time'], heads['log_time'])
            last_time = heads['log_time'][-1] if len(heads) else last_time
            yield replace(block, heads=heads)


def possible_times(blocks: Iterable[MessageBlock]) -> LogTimes:
    """Return the possible log times: those less than MAX_LOG_DURATION from their median."""
    pieces = [block.heads['log_time'].copy() for block in blocks]
    times = np.concatenate(pieces) if pieces else np.empty(0, np.uint64)
    if not len(times):
        return LogTimes(0, 0)
    ros_times = times[times <= MAX_ROS_TIME]
    candidates = ros_times if len(ros_times) else times
    middle = len(candidates) // 2
    median = np.partition(candidates, middle)[middle]
    distances = np.maximum(times, median) - np.minimum(times, median)
    is_possible = distances < MAX_LOG_DURATION
    possible = times[is_possible]
    impossible = times[~is_possible]
    return LogTimes(
        int(possible.min()),
        int(possible.max()),
        len(times),
        len(impossible),
        int(impossible[0]) if len(impossible) else 0,
    )
