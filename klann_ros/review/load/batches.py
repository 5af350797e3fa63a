"""The messages of a topic in a block, decoded."""

from collections.abc import Iterator
from dataclasses import dataclass

from klann_ros.kinematics.arrays import FloatArray, IndexArray, IntArray
from klann_ros.log import MessageBlock, Topic
from klann_ros.messages import ColumnReader, MessageType
from klann_ros.review.model.recording import Undecoded
from klann_ros.review.model.times import nanoseconds


@dataclass(frozen=True, eq=False)
class Batch:
    """Decoded messages of a topic with equal texts; arrays have n rows."""

    namespace: str  # of the topic; '' for the root
    last_name: str  # last part of the topic's name
    times: IntArray  # log times [ns]
    publish_times: IntArray  # [ns]
    stamps: IntArray  # of the headers [ns]; 0 for a type without
    names: tuple[str, ...]  # the joints in a JointState
    numbers: dict[str, FloatArray]  # by fields, shape (n, k)

    @property
    def topic(self) -> str:
        """Return the full name of the topic."""
        return f'{self.namespace}/{self.last_name}'


class TopicReader:
    """
    Reads the messages of a topic of a type, and counts those that do not match it.

    `paths` are the fields to be read; `names` is a sequence of texts.
    """

    def __init__(
        self, topic: Topic, message_type: MessageType, paths: tuple[str, ...], names: str = ''
    ) -> None:
        self._topic = topic.name
        is_cdr = topic.message_encoding == 'cdr'
        is_defined = message_type.is_defined_by(topic.definition, topic.schema_encoding)
        self._is_readable = is_cdr and is_defined
        self._reader = ColumnReader(message_type, paths, names)
        # Number of messages that do not match their type, and log time of the first [ns].
        self._refused_count = 0
        self._first_refused = 0

    def read(self, block: MessageBlock, rows: IndexArray) -> Iterator[Batch]:
        """Yield the messages of a block, in any order."""
        log_times = block.heads['log_time']
        publish_times = block.heads['publish_time']

        def refuse(refused: IndexArray) -> None:
            self.refuse(nanoseconds(log_times[refused]))

        if not self._is_readable:
            refuse(rows)
            return
        namespace, _, last_name = self._topic.rpartition('/')
        for columns in self._reader.read(block, rows, refuse):
            yield Batch(
                namespace,
                last_name,
                nanoseconds(log_times[columns.rows]),
                nanoseconds(publish_times[columns.rows]),
                columns.stamps,
                columns.names,
                columns.numbers,
            )

    def refuse(self, times: IntArray) -> None:
        """Count undecodable messages, by their log times [ns]."""
        first = int(times.min())
        self._first_refused = min(self._first_refused, first) if self._refused_count else first
        self._refused_count += len(times)

    def undecoded(self) -> Iterator[Undecoded]:
        """Yield the undecodable messages, if any."""
        if self._refused_count:
            yield Undecoded(self._topic, self._refused_count, self._first_refused)
