"""
Make a readable run out of a damaged one.

The files are walked record by record (:mod:`klann_ros.log.reading.walk`); every message,
attachment and metadata record that is intact goes into a new run as it was: times, sequence
numbers, schemas and channel metadata. The files of a split run become one. The input is opened for
reading only.

What no CRC covers cannot be judged: messages outside of chunks, chunks of recorders that write
none (rosbag2 by default), metadata records and the header. A bit that flipped there is kept as it
is, and the recovery says how much of the run has no CRC. Of schemas and channels, which have none
either, the version in a chunk or summary whose CRC holds is taken.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
import shutil
from typing import TYPE_CHECKING

from .bag_metadata import RECORD_NAME
from .errors import MalformedQosError, NotALogError, UnwritableError
from .qos import qos_for_writing
from .reader import open_files
from .reading.file_messages import messages_in
from .reading.repeats import attachment_key, metadata_key, Repeats
from .writing.writer import RunWriter

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .errors import AnyPath
    from .reading.log_file import LogFile
    from .reading.walk import Walk
    from .records import Message, Topic


@dataclass
class Recovery:
    """
    What became of a log.

    Attributes
    ----------
    messages, attachments, metadata
        How many of each are in the new run.
    counts
        The messages by topic.
    lost
        What was discarded, and where, one line each.
    remarks
        What else was found, one line each.

    """

    messages: int = 0
    attachments: int = 0
    metadata: int = 0
    counts: dict[str, int] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def recover(log: AnyPath, output: AnyPath) -> Recovery:
    """
    Write all that is intact in a log to a new run.

    Parameters
    ----------
    log
        A run's folder or an MCAP file, in any state; it is not changed.
    output
        The new run's folder. If the recovery fails or is interrupted, it is removed again.

    Raises
    ------
    NotALogError
        Nothing in it can be read.
    RunExistsError
        There is something at the output already.
    OSError
        The disk said no.

    """
    files, found = open_files(log)
    repeats = Repeats()
    _check_output(log, output)
    recovery = Recovery(lost=found.missing, remarks=found.remarks)
    writer = RunWriter(output, profile=files[0].profile or 'ros2')
    try:
        with writer:
            for file in files:
                _FileRecovery(file, writer, recovery, repeats).run()
        recovery.counts = writer.counts
        _check_found(log, files, recovery)
    except BaseException:
        # Half a recovery looks like a whole run.
        shutil.rmtree(writer.path, ignore_errors=True)
        raise
    return recovery


def _check_output(log: AnyPath, output: AnyPath) -> None:
    if Path(log).resolve() in Path(output).resolve().parents:
        raise UnwritableError(f'{output} is inside {log}, which is not to be changed')


def _check_found(log: AnyPath, files: list[LogFile], recovery: Recovery) -> None:
    found = recovery.messages or recovery.attachments or recovery.metadata
    whole = all(file.closed for file in files) and not recovery.lost
    if not found and not whole:
        reason = '; '.join(recovery.lost[-3:]) or 'it ends before its first message'
        raise NotALogError(log, f'nothing can be recovered: {reason}')


class _FileRecovery:
    """The recovery of one file into a run."""

    def __init__(
        self, file: LogFile, writer: RunWriter, recovery: Recovery, repeats: Repeats
    ) -> None:
        self._file = file
        self._writer = writer
        self._recovery = recovery
        self._repeats = repeats
        self._topics: dict[Topic, Topic] = {}
        self._unverified = self._unknown = self._unknown_offset = 0

    def run(self) -> None:
        """Write what is intact, and say what is not."""
        file, recovery = self._file, self._recovery
        recovery.remarks += [f'{file.path.name}: {item.text}' for item in file.problems.values()]
        before = recovery.messages
        if not (file.summary.is_index and file.summary.verified):
            file.survey()
        recovery.remarks += [
            f'{file.path.name}: {text}' for text in file.channels().contradictions
        ]
        with file.path.open('rb') as stream:
            walk = file.walk(stream)
            for offset, content in walk.contents():
                self._unverified += not content.verified
                written = self._write(messages_in(file, offset, content, None))
                self._note_unknown(offset, len(content) - written)
        self._copy_attachments(walk)
        self._copy_metadata(walk)
        for loss in walk.losses:
            self._lose(loss.offset, str(loss))
        if self._unknown:
            what = f'{self._unknown} messages of topics whose description is lost'
            self._lose(self._unknown_offset, what)
        self._tell(walk, recovery.messages - before)

    def _write(self, messages: Iterator[Message]) -> int:
        written = 0
        for message in messages:
            topic = self._topics.get(message.topic) or self._writable(message.topic)
            kept = message if topic is message.topic else replace(message, topic=topic)
            self._writer.write(kept)
            written += 1
        self._recovery.messages += written
        return written

    def _writable(self, topic: Topic) -> Topic:
        """Return the topic without its quality of service if rosbag2 would choke on it."""
        writable = topic
        try:
            qos_for_writing(topic.qos)
        except MalformedQosError as error:
            self._recovery.remarks.append(f'{topic.name}: left out: {error}')
            writable = replace(topic, qos='')
        return self._topics.setdefault(topic, writable)

    def _copy_attachments(self, walk: Walk) -> None:
        for span in walk.attachments:
            found = self._file.attachment_at(span.offset)
            if found is None:
                self._lose(span.offset, self._file.problems[span.offset].text)
                continue
            if self._repeats.is_one(self._file.path, attachment_key(found)):
                continue
            self._writer.attach(
                found.name, found.media_type, found.data, found.log_time, found.create_time
            )
            self._recovery.attachments += 1

    def _copy_metadata(self, walk: Walk) -> None:
        for span in walk.metadata:
            found = self._file.metadata_at(span.offset)
            if found is None:
                self._lose(span.offset, self._file.problems[span.offset].text)
            elif found[0] == RECORD_NAME:
                pass  # the writer makes that one anew
            elif not self._repeats.is_one(self._file.path, metadata_key(*found)):
                self._writer.add_metadata(*found)
                self._recovery.metadata += 1

    def _note_unknown(self, offset: int, count: int) -> None:
        if count and not self._unknown:
            self._unknown_offset = offset
        self._unknown += count

    def _lose(self, offset: int, what: str) -> None:
        self._recovery.lost.append(f'{self._file.path.name} at byte {offset}: {what}')

    def _tell(self, walk: Walk, written: int) -> None:
        """Note what was not checked, and compare what was found with the file's statistics."""
        if self._unverified:
            self._recovery.remarks.append(
                f'{self._file.path.name}: {self._unverified} chunks or single messages have no '
                'CRC, so whether they are intact is not known'
            )
        statistics = self._file.summary.statistics
        if statistics is not None and statistics.message_count > written and not len(walk.losses):
            missing = statistics.message_count - written
            self._lose(self._file.size, f'{missing} of the messages that it counts are not there')
