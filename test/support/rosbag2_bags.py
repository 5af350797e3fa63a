"""Bags of rosbag2's own variety, written and read by rosbags."""

from collections.abc import Iterable
from dataclasses import replace
import hashlib
from pathlib import Path
from typing import Any

from crank_runs import write_mcap
from db3_files import HASH
from klann_ros.log.reader import open_log
from klann_ros.log.records import Message
from rosbags import rosbag2
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin

MODES = (CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE)
KINDS = [(storage, mode) for storage in StoragePlugin for mode in MODES]
NAMES = [f'{storage.name}-{mode.name}' for storage, mode in KINDS]
LATCHED = Qos(
    QosHistory.KEEP_LAST,
    3,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    QosTime(9223372036, 854775807),
    QosTime(9223372036, 854775807),
    QosLiveliness.AUTOMATIC,
    QosTime(9223372036, 854775807),
    avoid_ros_namespace_conventions=False,
)


def convert(run: Path, folder: Path, storage: Any, mode: Any) -> Path:
    """Write a run again as a bag of some kind, by rosbags."""
    with open_log(run) as log:
        return write_bag(folder, log.messages(), storage, mode)


def write_bag(
    folder: Path, messages: Any, storage: Any, mode: Any, *, qos: tuple[Qos, ...] = (LATCHED,)
) -> Path:
    """Write messages as a bag of some kind, by rosbags, in their order."""
    writer = rosbag2.Writer(folder, version=9, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    topics: dict[Any, Any] = {}
    with writer:
        for message in messages:
            topic = message.topic
            if topic not in topics:
                topics[topic] = writer.add_connection(
                    topic.name,
                    topic.type,
                    msgdef=topic.definition,
                    rihs01=topic.type_hash or HASH,
                    offered_qos_profiles=qos,
                )
            writer.write(topics[topic], message.log_time, message.data)
    return folder


def write_jazzy_bag(path: Path, messages: Iterable[Message]) -> Path:
    """
    Write messages as `ros2 bag record` of Jazzy does: times of sending and receiving, no numbers.

    rosbags' writer knows one time only.
    """
    return write_mcap(path, [(replace(message, sequence=0) for message in messages)])


def read_by_rosbags(bag: Path) -> list[tuple[str, str, int, bytes]]:
    """Return name, type, time and bytes of each message, by rosbags."""
    with rosbag2.Reader(bag) as reader:
        return [(c.topic, c.msgtype, time, bytes(data)) for c, time, data in reader.messages()]


def read_messages(bag: Path) -> list[tuple[str, str, int, bytes]]:
    """Return the same by our reader, of a log that is whole."""
    with open_log(bag) as log:
        messages = [(m.topic.name, m.topic.type, m.log_time, m.data) for m in log.messages()]
        assert log.complete, log.problem
    return messages


def digest(log: Path) -> dict[str, str]:
    """Return the digest of a file, or those of the files in a folder."""
    paths = [log] if log.is_file() else log.iterdir()
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}
