"""The messages of one file in blocks, held against what the file's summary says of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .agreement import Count
from .block import block_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .block import Block
    from .log_file import LogFile


def blocks_of(file: LogFile) -> Iterator[tuple[int, Block]]:
    """Yield all messages chunk by chunk as they stand in the file, and how far that is."""
    channels, count = file.channels(), Count()
    topics = {number: channels.topic(number) for number in channels.numbers()}
    known = {number: topic for number, topic in topics.items() if topic is not None}
    with file.open() as stream:
        walk = file.walk(stream)
        for offset, content in walk.contents():
            block = block_of(content, known)
            for number in sorted(count.add(offset, block) - known.keys()):
                file.note(offset, f'messages of channel {number}, which is not known')
            yield offset, block
        file.note_losses(walk)
    wrong = '; '.join(count.disagreements(file.summary))
    # What is damaged is not there, and nobody can count it.
    if wrong and not len(walk.losses):
        file.note(file.size, wrong)
