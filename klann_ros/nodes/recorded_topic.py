"""One topic of a recording: its subscription, its place in the run, and what was lost of it."""

from collections.abc import Callable, Sequence

from klann_ros.log.definitions import definition
from klann_ros.log.loss import LossCounter
from klann_ros.log.qos import qos_to_yaml
from klann_ros.log.records import Message, Topic
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from .message_types import message_class
from .qos import recorded, to_receive
from .taking import drain, forgetful, Info, waiting


class RecordedTopic:
    """
    Subscribe to a topic as its publishers offer it, and hand on what it receives as raw bytes.

    Parameters
    ----------
    node : rclpy.node.Node
        Who subscribes.
    name : str
        The topic's full name.
    publishers : sequence of TopicEndpointInfo
        Its publishers, at least one.
    put : callable
        Takes every message.

    Raises
    ------
    UnknownMessageTypeError, UnknownTypeError
        The message type is not installed.

    """

    def __init__(
        self,
        node: Node,
        name: str,
        publishers: Sequence[TopicEndpointInfo],
        put: Callable[[Message], None],
    ) -> None:
        """Subscribe."""
        first, profiles = publishers[0], [publisher.qos_profile for publisher in publishers]
        self.topic = Topic(
            name,
            first.topic_type,
            definition(first.topic_type),
            qos_to_yaml(recorded(profile) for profile in profiles),
            str(first.topic_type_hash),
        )
        self.received = 0
        self.loss = LossCounter()
        self._put = put
        self._subscription = node.create_subscription(
            message_class(first.topic_type),
            name,
            self._on_message,
            to_receive(profiles),
            raw=True,
            event_callbacks=forgetful(self.loss),
        )

    def _on_message(self, data: bytes, info: Info) -> None:
        publishers = self._subscription.get_publisher_count()
        for taken, about in drain(self._subscription, data, info):
            self._record(taken, about, publishers)

    def take_waiting(self) -> None:
        """Take what no executor will take any more: the last messages before the end."""
        publishers = self._subscription.get_publisher_count()
        for taken, about in waiting(self._subscription):
            self._record(taken, about, publishers)

    def _record(self, data: bytes, info: Info, publishers: int) -> None:
        sequence = info['publication_sequence_number']
        self.received += 1
        self.loss.count(sequence, publishers)
        self._put(
            Message(
                self.topic,
                data,
                info['received_timestamp'],
                info['source_timestamp'],
                sequence or 0,
            )
        )
