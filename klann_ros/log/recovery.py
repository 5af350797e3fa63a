"""
Make a readable run from a damaged one.

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
from .read.storage import Storage
from .reader import attachment_key, metadata_key, Repetitions
from .records import Topic
from .write.writer import RunWriter


@dataclass
class Recovery:
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
    lost: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


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
    _check_output(log, output)
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
    _repetitions: Repetitions
    _qos: QosTexts
    _topics: dict[Topic, Topic] = field(default_factory=dict)

    def run(self) -> None:
        """Write the intact content, and report the rest."""
        recovery, salvage = self._recovery, self._file.salvage()
        for message in salvage.messages():
            topic = self._topics.get(message.topic) or self._writable(message.topic)
            self._writer.write(
                message if topic is message.topic else replace(message, topic=topic)
            )
            recovery.messages += 1
        for found in salvage.attachments():
            if not self._is_repeated(attachment_key(found)):
                self._writer.attach(
                    found.name, found.media_type, found.data, found.log_time, found.create_time
                )
                recovery.attachments += 1
        for name, content in salvage.metadata():
            # The writer adds rosbag2's own.
            if name != RECORD_NAME and not self._is_repeated(metadata_key(name, content)):
                self._writer.add_metadata(name, content)
                recovery.metadata += 1
        recovery.lost += salvage.lost
        recovery.remarks += salvage.remarks

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
