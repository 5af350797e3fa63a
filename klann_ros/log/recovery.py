"""
Make a readable run from a damaged or truncated file.

Every intact message, attachment and metadata record (:mod:`klann_ros.log.mcap.recovery`) is
copied to a new run with its times, sequence number, schema and channel metadata. The files of a
split run become one. The input is opened for reading only.

Damage is undetectable in what no CRC covers: messages outside of chunks, chunks of recorders that
write none (rosbag2 by default), metadata records and the header. The recovery reports how much of
the run has no CRC. Schemas and channels are taken from a chunk or summary with a matching CRC.
"""

from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from pathlib import Path

from klann_ros.sanitize.files import is_within
from klann_ros.sanitize.text import printable

from .bag_metadata import RECORD_NAME
from .errors import AnyPath, MalformedQosError, NotALogError, UnwritableError
from .qos import QosTexts
from .read.opening import open_files
from .read.storage import SalvageReport, Storage
from .reader import attachment_key, metadata_key, Repetitions
from .records import Attachment, Message, Topic
from .write.writer import RunWriter


@dataclass
class Recovery(SalvageReport):
    """
    The result of a recovery.

    Attributes
    ----------
    messages, attachments, metadata
        The number of each in the new run.
    counts
        The messages by topic.
    lost
        The discarded parts with their places, one line each.
    remarks
        Other observations, one line each.

    """

    messages: int = 0
    attachments: int = 0
    metadata: int = 0
    counts: dict[str, int] = field(default_factory=dict)


def recover(log: AnyPath, output: AnyPath) -> Recovery:
    """
    Write the intact content of a log to a new run.

    Parameters
    ----------
    log
        A run's folder or a file of it, in any state; it is not changed.
    output
        The new run's folder. If the recovery fails or is interrupted, it is removed again.

    Raises
    ------
    NotALogError
        Nothing in it can be read.
    RunExistsError
        The output exists.
    OSError
        The disk refused.

    """
    files, found = open_files(log)
    repetitions, qos = Repetitions(), QosTexts()
    check_output(log, output)
    recovery = Recovery(lost=found.missing, remarks=found.remarks)
    writer = RunWriter(output, profile=files[0].profile or 'ros2')
    try:
        with writer:
            for file in files:
                _FileRecovery(file, writer, recovery, repetitions, qos).run()
        recovery.counts = writer.counts
        _check_found(log, files, recovery)
    except BaseException:
        # Half a recovery looks like a whole run.
        writer.discard()
        raise
    return recovery


def check_output(log: AnyPath, output: AnyPath) -> None:
    """Raise an UnwritableError if an output would be inside of the log."""
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
    _repetitions: Repetitions
    _qos: QosTexts
    _topics: dict[Topic, Topic] = field(default_factory=dict)

    def run(self) -> None:
        """Write the intact content, and report the rest."""
        recovery, writer = self._recovery, self._writer
        for item in self._file.salvage(recovery):
            if isinstance(item, Message):
                topic = self._topics.get(item.topic) or self._writable(item.topic)
                writer.write(item if topic is item.topic else replace(item, topic=topic))
                recovery.messages += 1
            elif isinstance(item, Attachment):
                if not self._is_repeated(attachment_key(item)):
                    writer.attach(
                        item.name, item.media_type, item.data, item.log_time, item.create_time
                    )
                    recovery.attachments += 1
            # The writer adds rosbag2's own.
            elif item[0] != RECORD_NAME and not self._is_repeated(metadata_key(*item)):
                writer.add_metadata(*item)
                recovery.metadata += 1

    def _is_repeated(self, key: Hashable) -> bool:
        return self._repetitions.is_one(self._file.path, key)

    def _writable(self, topic: Topic) -> Topic:
        """Return the topic, without a quality of service that rosbag2 could not read."""
        writable = topic
        try:
            self._qos.profiles(topic.qos)
        except MalformedQosError as error:
            self._recovery.remarks.append(f'{printable(topic.name)}: left out: {error}')
            writable = replace(topic, qos='')
        return self._topics.setdefault(topic, writable)
