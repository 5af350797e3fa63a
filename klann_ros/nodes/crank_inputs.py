"""The topics that turn cranks: taken in order, stamped, counted."""

from collections.abc import Callable, Collection, Mapping
from typing import Any

from builtin_interfaces.msg import Time
from klann_ros.kinematics import KinematicsError
from klann_ros.log.loss import LossCounter
from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from .crank_input import BadMessageError, Crank, cranks, stamp_of
from .qos import INPUT
from .taking import drain, forgetful, Info


class CrankInputs:
    """
    Subscriptions to crank_angle and crank_state.

    Parameters
    ----------
    node : rclpy.node.Node
        Who listens.
    joints : collection of str
        The joints that turn cranks; crank_angle turns all of them.
    turn : callable
        Is given, for each message, the cranks by their joints, and the stamp.
    reject : callable
        Is given why a message says nothing.

    Attributes
    ----------
    out_of_order : int
        Messages that were older than the one before.

    """

    def __init__(
        self,
        node: Node,
        joints: Collection[str],
        turn: Callable[[Mapping[str, Crank], Time], None],
        reject: Callable[[KinematicsError], None],
    ) -> None:
        """Subscribe."""
        self.out_of_order = 0
        self._clock = node.get_clock()
        self._joints, self._turn, self._reject = joints, turn, reject
        self._last_stamp = (0, 0)
        self._losses = (LossCounter(), LossCounter())
        self._heard = [0, 0]
        overridable = QoSOverridingOptions.with_default_policies()

        def subscription(kind: type, topic: str, callback: Any, loss: LossCounter) -> Subscription:
            return node.create_subscription(
                kind,
                topic,
                callback,
                INPUT,
                qos_overriding_options=overridable,
                event_callbacks=forgetful(loss),
            )

        loss_1, loss_2 = self._losses
        self._subscriptions = (
            subscription(Float64, 'crank_angle', self._on_crank_angle, loss_1),
            subscription(JointState, 'crank_state', self._on_crank_state, loss_2),
        )

    @property
    def lost(self) -> int:
        """Return how many messages were lost since the start."""
        return sum(loss.lost for loss in self._losses)

    def sources(self) -> str:
        """Return who turns the crank, where it is more than one; call it once a report."""
        heard, self._heard = self._heard, [0, 0]
        told = [
            f'{s.topic_name} ({s.get_publisher_count()} publishers)'
            for s, count in zip(self._subscriptions, heard, strict=True)
            if count
        ]
        publishers = [
            s.get_publisher_count()
            for s, count in zip(self._subscriptions, heard, strict=True)
            if count
        ]
        return ' and '.join(told) if sum(publishers) > 1 else ''

    def _on_crank_angle(self, message: Float64, info: Info) -> None:
        for taken, about in self._taken(0, message, info):
            crank = Crank(taken.data, None)
            self._answer(dict.fromkeys(self._joints, crank), None, about)

    def _on_crank_state(self, message: JointState, info: Info) -> None:
        for taken, about in self._taken(1, message, info):
            self._answer_state(taken, about)

    def _answer_state(self, message: JointState, info: Info) -> None:
        try:
            found = cranks(message, self._joints)
        except BadMessageError as error:
            self._reject(error)
        else:
            self._answer(found, stamp_of(message), info)

    def _taken(self, which: int, message: Any, info: Info) -> Any:
        """Yield a message and all that wait behind it, and count what was lost before each."""
        subscription, loss = self._subscriptions[which], self._losses[which]
        publishers = subscription.get_publisher_count()
        for taken, about in drain(subscription, message, info):
            self._heard[which] += 1
            loss.count(about['publication_sequence_number'], publishers)
            yield taken, about

    def _answer(self, found: Mapping[str, Crank], stamp: Time | None, info: Info) -> None:
        stamp = stamp or self._stamp(info)
        moment = (stamp.sec, stamp.nanosec)
        if moment < self._last_stamp:
            self.out_of_order += 1
        self._last_stamp = moment
        self._turn(found, stamp)

    def _stamp(self, info: Info) -> Time:
        """Return the source's time for a message without a stamp, or simulated time."""
        if self._clock.ros_time_is_active:
            return self._clock.now().to_msg()
        seconds, nanoseconds = divmod(info['source_timestamp'], 10**9)
        return Time(sec=seconds, nanosec=nanoseconds)
