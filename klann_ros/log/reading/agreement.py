"""Whether the summary of a file says what is in it."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from klann_ros.log.wording import counted, verb
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .block import Block
    from .summary import Summary

    # How many messages a chunk holds, and their first and last log time [ns].
    Held = tuple[int, int, int]


class Count:
    """Counts what is in a file, to be held against its summary."""

    def __init__(self) -> None:
        self._chunks: dict[int, Held] = {}
        self._messages: Counter[int] = Counter()

    def add(self, offset: int, block: Block) -> set[int]:
        """Count the messages of the chunk or message at an offset; return their channels."""
        channels, counts = np.unique(block.heads['channel'], return_counts=True)
        self._messages.update(dict(zip(channels.tolist(), counts.tolist(), strict=True)))
        times = block.heads['log_time']
        held = (len(times), int(times.min()), int(times.max())) if len(times) else (0, 0, 0)
        self._chunks[offset] = held
        return set(channels.tolist())

    def disagreements(self, summary: Summary) -> Iterator[str]:
        """Yield what a summary says otherwise, one line each; nothing for what it leaves out."""
        said = summary.statistics
        if said is not None:
            total = self._messages.total()
            if said.message_count != total:
                count = counted(said.message_count, 'message')
                yield f'the statistics count {count}, there {verb(total, "is", "are")} {total}'
            elif said.channel_message_counts and +Counter(said.channel_message_counts) != +(
                self._messages
            ):
                yield 'the statistics count other messages for each channel than there are'
        index = {
            chunk.chunk_start_offset: (chunk.message_start_time, chunk.message_end_time)
            for chunk in summary.chunks
        }
        wrong = sum(self._is_wrong(offset, times) for offset, times in index.items())
        missing = sum(self._chunks[offset][0] for offset in self._chunks.keys() - index.keys())
        if wrong:
            yield f'the index is wrong about {counted(wrong, "chunk")}'
        if index and missing:
            yield f'the index leaves out {counted(missing, "message")}'

    def _is_wrong(self, offset: int, times: tuple[int, int]) -> bool:
        held = self._chunks.get(offset)
        return held is None or (held[0] > 0 and held[1:] != times)
