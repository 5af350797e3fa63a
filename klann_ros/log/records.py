"""The content of a log: topics, messages, attachments."""

from dataclasses import dataclass, fields
from functools import cached_property


@dataclass(frozen=True)
class Topic:
    """
    A topic with the data to decode its messages and to publish them again.

    Parameters
    ----------
    name
        The topic's full name, such as ``/joint_states``.
    type
        The message type, such as ``sensor_msgs/msg/JointState``; '' if the log does not say.
    definition
        The complete text of the schema (see :func:`klann_ros.log.definitions.definition`).
    qos
        The publishers' quality of service, the YAML text of ``offered_qos_profiles`` (see
        :mod:`klann_ros.log.qos`); '' if unknown.
    type_hash
        ``RIHS01_...``; '' if unknown.
    message_encoding, schema_encoding
        Encodings of data and definition; other recorders use others than ROS 2's.
    extra
        Other entries of the channel's metadata, as (key, value) pairs.

    """

    name: str
    type: str  # noqa: A003, RUF100 - as all tools call it; ruff lets it be
    definition: str = ''
    qos: str = ''
    type_hash: str = ''
    message_encoding: str = 'cdr'
    schema_encoding: str = 'ros2msg'
    extra: tuple[tuple[str, str], ...] = ()

    def __hash__(self) -> int:
        # Cached: a writer looks up a topic for each message.
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(self._values())

    def _values(self) -> tuple[object, ...]:
        return tuple(getattr(self, field.name) for field in fields(self))

    def __reduce__(self) -> tuple[object, ...]:
        # Another process hashes texts differently.
        return Topic, self._values()


# Entry of a channel's metadata: a review wrote the topic beside those of the run.
ANNOTATION = ('klann_ros', 'review --annotate')


# Not frozen, which would take three times as long to create.
@dataclass(slots=True, unsafe_hash=True)
class Message:
    """
    A received message, never changed.

    Parameters
    ----------
    topic
        Its topic.
    data
        The serialized bytes.
    log_time
        Time of reception [ns since the epoch].
    publish_time
        Time of publication, the source time [ns since the epoch].
    sequence
        The publication sequence number; a log keeps its lower 32 bits.

    """

    topic: Topic
    data: bytes
    log_time: int
    publish_time: int
    sequence: int


@dataclass(frozen=True)
class Attachment:
    """A file inside the log; times in [ns since the epoch], ``create_time`` 0 if unknown."""

    name: str
    media_type: str
    data: bytes
    log_time: int
    create_time: int = 0
