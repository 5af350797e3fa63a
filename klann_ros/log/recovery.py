"""
Make a readable run out of a damaged one.

The files are walked record by record (:mod:`klann_ros.log.mcap.walk`); every message,
attachment and metadata record that is intact goes into a new run as it was: times, sequence
numbers, schemas and channel metadata. The files of a split run become one. The input is opened for
reading only.

What no CRC covers cannot be judged: messages outside of chunks, chunks of recorders that write
none (rosbag2 by default), metadata records and the header. A bit that flipped there is kept as it
is, and the recovery says how much of the run has no CRC. Of schemas and channels, which have none
either, the version in a chunk or summary whose CRC holds is taken.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from klann_ros.sanitize.files import is_within
from klann_ros.sanitize.text import printable

from .bag_metadata import RECORD_NAME
from .errors import AnyPath, MalformedQosError, NotALogError, UnwritableError
from .qos import QosTexts
from .read.opening import open_files
from .read.storage import Storage
from .reader import attachment_key, metadata_key, Repeats
from .records import Attachment, Topic
from .write.writer import RunWriter


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
        A run's folder or a file of it, in any state; it is not changed, and nothing is removed
        from it (an old recorder's ``.reserve`` goes when a recorder starts beside it).
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
    repeats, qos = Repeats(), QosTexts()
    _check_output(log, output)
    recovery = Recovery(lost=found.missing, remarks=found.remarks)
    writer = RunWriter(output, profile=files[0].profile or 'ros2')
    try:
        with writer:
            for file in files:
                _FileRecovery(file, writer, recovery, repeats, qos).run()
        recovery.counts = writer.counts
        _check_found(log, files, recovery)
    except BaseException:
        # Half a recovery looks like a whole run.
        writer.discard()
        raise
    return recovery


def _check_output(log: AnyPath, output: AnyPath) -> None:
    if not Path(output).exists() and is_within(output, log):
        raise UnwritableError(
            f'{printable(output)} is inside {printable(log)}, which is not to be changed'
        )


def _check_found(log: AnyPath, files: list[Storage], recovery: Recovery) -> None:
    found = recovery.messages or recovery.attachments or recovery.metadata
    whole = all(file.closed for file in files) and not recovery.lost
    if not found and not whole:
        reason = '; '.join(recovery.lost[-3:]) or 'it ends before its first message'
        raise NotALogError(log, f'nothing can be recovered: {reason}')


@dataclass
class _FileRecovery:
    """The recovery of one file into a run."""

    _file: Storage
    _writer: RunWriter
    _recovery: Recovery
    _repeats: Repeats
    _qos: QosTexts
    _topics: dict[Topic, Topic] = field(default_factory=dict)

    def run(self) -> None:
        """Write what is intact, and say what is not."""
        recovery, salvage = self._recovery, self._file.salvage()
        for message in salvage.messages():
            topic = self._topics.get(message.topic) or self._writable(message.topic)
            kept = message if topic is message.topic else replace(message, topic=topic)
            self._writer.write(kept)
            recovery.messages += 1
        self._copy_attachments(salvage.attachments())
        self._copy_metadata(salvage.metadata())
        recovery.lost += salvage.lost
        recovery.remarks += salvage.remarks

    def _writable(self, topic: Topic) -> Topic:
        """Return the topic without its quality of service if rosbag2 would choke on it."""
        writable = topic
        try:
            self._qos.profiles(topic.qos)
        except MalformedQosError as error:
            self._recovery.remarks.append(f'{printable(topic.name)}: left out: {error}')
            writable = replace(topic, qos='')
        return self._topics.setdefault(topic, writable)

    def _copy_attachments(self, attachments: Iterator[Attachment]) -> None:
        for found in attachments:
            if self._repeats.is_one(self._file.path, attachment_key(found)):
                continue
            self._writer.attach(
                found.name, found.media_type, found.data, found.log_time, found.create_time
            )
            self._recovery.attachments += 1

    def _copy_metadata(self, records: Iterator[tuple[str, dict[str, str]]]) -> None:
        for name, content in records:
            # The writer makes rosbag2's own anew.
            if name == RECORD_NAME or self._repeats.is_one(
                self._file.path, metadata_key(name, content)
            ):
                continue
            self._writer.add_metadata(name, content)
            self._recovery.metadata += 1
