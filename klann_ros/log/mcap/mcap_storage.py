"""An MCAP file as a storage: its messages one by one, in blocks, and what is intact of them."""

from collections.abc import Iterator

from klann_ros.log.read.block import MessageBlock
from klann_ros.log.read.sources import Source
from klann_ros.log.read.storage import Overview
from klann_ros.log.records import Attachment, Message
from klann_ros.sanitize.text import counted, verb

from .file_messages import blocks_of, messages_in, sources_of
from .layout import RecordSpan
from .log_file import LogFile
from .walk import Walk


class McapStorage(LogFile):
    """An MCAP file (:class:`~klann_ros.log.mcap.log_file.LogFile`), and its messages."""

    def sources(self, overview: Overview) -> Iterator[Source]:
        """Yield what can be read by itself: each chunk in the index, or all messages as one."""
        return sources_of(self, overview)

    def blocks(self) -> Iterator[tuple[int, MessageBlock]]:
        """Yield all messages chunk by chunk as they stand in it, and how far that is."""
        return blocks_of(self)

    def first_data(self) -> bytes:
        """Return the bytes of the message that stands first; b'' if there is none."""
        with self.open() as stream:
            for _, content in self.walk(stream).contents():
                for *_, data in content.rows():
                    return data
        return b''

    def salvage(self) -> 'McapSalvage':
        """Return a pass over all that is intact in it."""
        return McapSalvage(self)


class McapSalvage:
    """
    All that is intact in an MCAP file, found record by record.

    Parameters
    ----------
    file
        The file.

    Attributes
    ----------
    lost, remarks
        See :class:`~klann_ros.log.read.storage.Salvage`.

    """

    def __init__(self, file: McapStorage) -> None:
        self.lost: list[str] = []
        self.remarks = [f'{file.name}: {item.text}' for item in file.problems.values()]
        self._file = file
        self._attachments = list[RecordSpan]()
        self._metadata = list[RecordSpan]()
        self._unverified = self._unknown = self._unknown_offset = self._other = 0

    def messages(self) -> Iterator[Message]:
        """Yield all intact messages in the order in which they stand in it."""
        file, count = self._file, 0
        if not (file.summary.is_index and file.summary.verified):
            file.survey()
        self.remarks += [f'{file.name}: {text}' for text in file.channels().contradictions]
        with file.open() as stream:
            walk = file.walk(stream)
            for offset, content in walk.contents():
                self._other += content.unknown
                self._unverified += 0 if content.verified else len(content)
                missing = len(content)
                for message in messages_in(file, offset, content, None):
                    missing -= 1
                    count += 1
                    yield message
                self._note_unknown(offset, missing)
        self._attachments, self._metadata = walk.attachments, walk.metadata
        self._tell(walk, count)

    def attachments(self) -> Iterator[Attachment]:
        """Yield the intact attachments."""
        for span in self._attachments:
            found = self._file.attachment_at(span.offset)
            if found is not None:
                yield found
            else:
                self._lose(span.offset, self._file.problems[span.offset].text)

    def metadata(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Yield the names and contents of the intact metadata records."""
        for span in self._metadata:
            found = self._file.metadata_at(span.offset)
            if found is not None:
                yield found
            else:
                self._lose(span.offset, self._file.problems[span.offset].text)

    def _note_unknown(self, offset: int, count: int) -> None:
        if count and not self._unknown:
            self._unknown_offset = offset
        self._unknown += count

    def _lose(self, offset: int, what: str) -> None:
        self.lost.append(f'{self._file.name} at byte {offset}: {what}')

    def _tell(self, walk: Walk, count: int) -> None:
        """Note what is left out, what was not checked, and whether it is all that was counted."""
        for loss in walk.losses:
            self._lose(loss.offset, str(loss))
        if self._unknown:
            what = f'{counted(self._unknown, "message")} of topics whose description is lost'
            self._lose(self._unknown_offset, what)
        name = self._file.name
        self.remarks += [f'{name}{problem.place}: {problem.text}' for problem in walk.wrong]
        self.remarks += [f'{name} {remark}' for remark in walk.remarks]
        if self._other + walk.unknown:
            other = self._other + walk.unknown
            self.remarks.append(
                f'{name}: {counted(other, "record")} of kinds that are private, or of a later '
                f'version of MCAP, {verb(other, "is", "are")} left out'
            )
        if self._unverified and not walk.verified:
            have = verb(self._unverified, 'message has', 'messages have')
            self.remarks.append(
                f'{name}: {self._unverified} {have} no CRC, so nobody knows what is intact'
            )
        statistics = self._file.summary.statistics
        if statistics is not None and statistics.message_count > count and not len(walk.losses):
            missing = statistics.message_count - count
            self._lose(self._file.size, f'{missing} of the messages that it counts are not there')
