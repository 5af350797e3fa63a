"""One MCAP file being read, from any recorder and in any state."""

from array import array
from pathlib import Path
from typing import BinaryIO

from klann_ros.log.errors import DamagedError, NotALogError
from klann_ros.log.read.storage import Overview, Problems
from klann_ros.log.read.temporary import TemporaryFile
from klann_ros.log.records import Attachment
from klann_ros.sanitize.files import open_regular
from klann_ros.sanitize.text import printable
from mcap.opcode import Opcode
from mcap.records import Header, Metadata
import numpy as np
from numpy.typing import NDArray

from .channels import Channels
from .container import find_footer, MAGIC, read, span_at
from .content import chunk_content, Content
from .damage import holes
from .decompression import DecompressionBudget
from .evidence import Evidence
from .parsing import parse, parse_attachment
from .resync import Search
from .summary import read_summary, Summary
from .walk import Walk

_NEVER = 2**64
_START = MAGIC + bytes([Opcode.HEADER])


class LogFile:
    """
    A file of a log.

    Parameters
    ----------
    path
        The file.
    unpacked
        What was in it, if it is compressed as a whole.

    Attributes
    ----------
    path, size
        The file, and the size of what was in it [bytes].
    name
        How to call it in a line to people.
    profile
        What the header says, such as ``ros2``; '' if it is damaged.
    closed
        Whether it ends as a file does that was closed.
    summary
        What its summary says; empty if it has none that holds.
    problems
        What was found to be wrong so far, by offset; it grows while the file is read.
    holes
        From when to when messages stood in what is damaged [ns], as far as that is known.

    Raises
    ------
    NotALogError
        It is not the start of an MCAP file, or cannot be opened.

    """

    def __init__(self, path: Path, unpacked: TemporaryFile | None = None) -> None:
        self.path = path
        self.name = printable(path.name) + (' (unpacked)' if unpacked else '')
        self._unpacked = unpacked
        self.problems = Problems()
        self.holes: set[tuple[int, int]] = set()
        self.summary = Summary()
        self.profile = ''
        self._channels: Channels | None = None
        # The earliest log time in each part of a walk.
        self._starts: array[int] | None = None
        self._largest = 0
        self._budget = DecompressionBudget()
        self._rotten: set[int] = set()
        try:
            with self.open() as file:
                self.size = file.seek(0, 2)
                file.seek(0)
                start = file.read(len(MAGIC) + 1)
                if start != _START:
                    self._check_start(start, file)
                self.profile = self._read_profile(file)
                footer = find_footer(file, self.size)
                self.closed = footer is not None
                self._end = self.size if footer is None else footer.offset
                if footer is None:
                    self.note(self.size, 'it was not closed: there is no footer at its end')
                else:
                    self.summary = read_summary(file, footer)
                    if not self.summary.is_sound:
                        text = 'the index is wrong: what it names is not one behind the other'
                        self.note(self.summary.start, text)
                        self.summary.forget_places()
        except OSError as error:
            raise NotALogError(path, error.strerror or str(error)) from None
        except DamagedError as damage:
            self.note(damage.offset, f'the summary is damaged: {damage.reason}')
            self.summary = Summary()

    def open(self) -> BinaryIO:  # noqa: A003, RUF100 - as a path calls it; ruff lets it be
        """Open the file, or what was unpacked from it."""
        return open_regular(self._unpacked.path if self._unpacked else self.path)

    def close(self) -> None:
        """Let go of what was unpacked."""
        if self._unpacked is not None:
            self._unpacked.close()

    def note(self, offset: int, text: str) -> None:
        """Remember that something is wrong at an offset [bytes]."""
        self.problems.note(offset, text)

    def note_losses(self, walk: Walk) -> None:
        """Remember what a walk stepped over."""
        for loss in walk.losses:
            self.note(loss.offset, str(loss))
        for problem in walk.wrong:
            self.note(problem.offset, problem.text)
        with self.open() as file:
            self.holes.update(holes(file, walk.losses, self.summary.chunks))

    def channels(self) -> Channels:
        """
        Return the channels of the whole file.

        Without a summary that tells them all, the file is gone through once: what describes a
        channel may stand behind its messages, when the first of it is rotten.
        """
        if self._channels is None and not self.summary.is_index:
            self.survey()
        return self._channels or self.summary.channels

    def walk(self, file: BinaryIO, channels: Channels | None = None) -> Walk:
        """Return a pass over the open file, which gathers what it meets into the channels."""
        end = self.summary.start if self.summary.is_index else self._end
        return Walk(file, end, channels or Channels(), summary=self.summary)

    def overview(self) -> Overview:
        """Return what the file holds, from its index or else by going through all of it."""
        summary = self.summary
        if summary.is_index and summary.statistics is not None:
            said = summary.statistics
            times = (said.message_start_time, said.message_end_time)
            return Overview(
                summary.channels.topics(),
                times if said.message_count else None,
                summary.metadata,
                summary.attachments,
            )
        return self.survey()

    def survey(self) -> Overview:
        """Go through the file for what it describes and where its other records are."""
        channels = Channels()
        channels.update(self.summary.channels)
        first, last = _NEVER, -1
        starts = array('Q')
        with self.open() as file:
            walk = self.walk(file, channels)
            for _, content in walk.contents():
                self._largest = max(self._largest, len(content.data))
                times = np.frombuffer(content.times(), np.uint64)
                starts.append(int(times.min()) if len(times) else _NEVER - 1)
                first = min(first, starts[-1])
                last = max(last, int(times.max()) if len(times) else last)
            self.note_losses(walk)
        self._channels = channels
        self._starts = starts
        for text in channels.contradictions:
            self.note(self.size, text)
        return Overview(
            channels.topics(),
            (first, last) if last >= 0 else None,
            [span.offset for span in walk.metadata],
            [span.offset for span in walk.attachments],
        )

    def largest_content(self) -> int:
        """Return the size of the largest part of a walk, unpacked [bytes]; after a survey."""
        return self._largest

    def later_starts(self) -> NDArray[np.uint64]:
        """Return of each part of a walk the earliest log time in the parts behind it [ns]."""
        if self._starts is None:
            self.survey()
        starts = np.array([*(self._starts or ()), _NEVER - 1], dtype=np.uint64)
        later: NDArray[np.uint64] = np.minimum.accumulate(starts[::-1])[::-1][1:]
        return later

    def content_at(self, offset: int, opcode: Opcode) -> bytes | None:
        """Return the content of a record of this kind; None, and a problem, if it is not there."""
        try:
            with self.open() as file:
                end = self.summary.end_of(offset) or self._end
                span = span_at(file, offset, min(end, self._end))
                if span.opcode == opcode:
                    return read(file, span)
                self.note(offset, f'the index is wrong: no {opcode.name.lower()} stands there')
        except DamagedError as damage:
            self.note(offset, damage.reason)
        return None

    def chunk_at(self, offset: int) -> Content | None:
        """Return what is in a chunk of the index; None, and a problem, if it is damaged."""
        # One that was found to be rotten is not unpacked again.
        record = None if offset in self._rotten else self.content_at(offset, Opcode.CHUNK)
        if record is None:
            return None
        try:
            return chunk_content(record, offset, self._budget)
        except DamagedError as damage:
            self._rotten.add(offset)
            self.note(offset, damage.reason)
            return None

    def metadata_at(self, offset: int) -> tuple[str, dict[str, str]] | None:
        """Return the name and content of a metadata record; None if it is damaged."""
        content = self.content_at(offset, Opcode.METADATA)
        try:
            record = None if content is None else parse(Metadata, content, offset)
        except DamagedError as damage:
            self.note(offset, damage.reason)
            return None
        return None if record is None else (record.name, record.metadata)

    def attachment_at(self, offset: int) -> Attachment | None:
        """Return an attachment; None if it is damaged."""
        content = self.content_at(offset, Opcode.ATTACHMENT)
        try:
            return None if content is None else parse_attachment(content, offset)
        except DamagedError as damage:
            self.note(offset, damage.reason)
            return None

    def _check_start(self, start: bytes, file: BinaryIO) -> None:
        """Refuse what is no log; one whose first bytes are damaged has sound chunks in it."""
        evidence = Evidence(file, self.size, self._budget)
        if Search(evidence).chunk(0, self.size) is not None:
            self.note(0, 'its first bytes are not those of an MCAP file')
            return
        if not start:
            raise NotALogError(self.path, 'the file is empty')
        if not start.startswith(MAGIC):
            raise NotALogError(self.path, 'it does not start as an MCAP file does')
        raise NotALogError(self.path, 'there is no header at its start')

    def _read_profile(self, file: BinaryIO) -> str:
        try:
            span = span_at(file, len(MAGIC), self.size)
            return parse(Header, read(file, span)).profile if span.opcode == Opcode.HEADER else ''
        except DamagedError as damage:
            self.note(len(MAGIC), f'the header is damaged: {damage.reason}')
            return ''
