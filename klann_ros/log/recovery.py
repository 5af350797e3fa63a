"""
Make a readable run from a damaged or truncated file.

Everything that a reader finds, every intact message, attachment and metadata record, is copied to
a new run with its times, sequence number, schema and channel metadata. The files of a split run
become one. The input is opened for reading only.

Damage is undetectable in what no CRC covers: messages outside of chunks, chunks of recorders that
write none (rosbag2 by default), metadata records and the header. The recovery reports how much of
the run has no CRC. Schemas and channels are taken from a chunk or summary with a matching CRC.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

from klann_ros.sanitize.files import is_within
from klann_ros.sanitize.text import printable

from .bag_metadata import RECORD_NAME
from .errors import AnyPath, MalformedQosError, NotALogError, UnwritableError
from .qos import QosTexts
from .read.opening import open_files
from .read.storage import Storage
from .reader import Log
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

    lost: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
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
    files, log_files = open_files(log)
    check_output(log, output)
    recovery = Recovery(lost=log_files.missing, remarks=log_files.remarks)
    writer = RunWriter(output)
    try:
        with writer, Log(Path(log), files, []) as source:
            _copy(source, writer, recovery)
        for file in files:
            recovery.lost += file.problems.lines(file.name, losses=True)
            recovery.remarks += file.problems.lines(file.name, losses=False)
            recovery.remarks += [f'{file.name}: {remark}' for remark in file.remarks]
        recovery.counts = writer.counts
        _check_recovered(log, files, recovery)
    except BaseException:
        # Half a recovery looks like a whole run.
        writer.discard()
        raise
    return recovery


def _copy(source: Log, writer: RunWriter, recovery: Recovery) -> None:
    """Write the intact content, messages first in the order of the file."""
    topics: dict[Topic, Topic] = {}
    qos = QosTexts()
    for block in source.blocks():
        for message in block.messages():
            topic = topics.get(message.topic)
            if topic is None:
                topic = topics[message.topic] = _writable(message.topic, qos, recovery)
            writer.write(message if topic is message.topic else replace(message, topic=topic))
            recovery.messages += 1
    for file in source.each_attachment():
        writer.attach(file.name, file.media_type, file.data, file.log_time, file.create_time)
        recovery.attachments += 1
    for name, records in source.metadata.items():
        # The writer adds rosbag2's own.
        for content in records if name != RECORD_NAME else ():
            writer.add_metadata(name, content)
            recovery.metadata += 1


def _writable(topic: Topic, qos: QosTexts, recovery: Recovery) -> Topic:
    """Return a topic, without a quality of service that rosbag2 could not read."""
    try:
        qos.profiles(topic.qos)
    except MalformedQosError as error:
        recovery.remarks.append(f'{printable(topic.name)}: left out: {error}')
        return replace(topic, qos='')
    return topic


def check_output(log: AnyPath, output: AnyPath) -> None:
    """Raise an UnwritableError if an output would be inside of the log."""
    if not Path(output).exists() and is_within(output, log):
        raise UnwritableError(
            f'{printable(output)} is inside {printable(log)}, which is not to be changed'
        )


def _check_recovered(log: AnyPath, files: list[Storage], recovery: Recovery) -> None:
    """Raise a NotALogError if nothing of a damaged log was recovered."""
    has_content = recovery.messages or recovery.attachments or recovery.metadata
    is_whole = all(file.closed for file in files) and not recovery.lost
    if not has_content and not is_whole:
        reason = '; '.join(recovery.lost[-3:]) or 'it ends before its first message'
        raise NotALogError(log, f'nothing can be recovered: {reason}')
