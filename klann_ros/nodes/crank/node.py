"""`crank_node`: drives the crank."""

from array import array
from collections.abc import Mapping, Sequence
from math import inf, isfinite
from time import monotonic
from typing import Any

from klann_ros.cli import ArgumentParser
from klann_ros.nodes import endpoints
from klann_ros.nodes.endpoints import create_publisher, create_steady_timer, flush, QOS_USAGE
from klann_ros.nodes.lease import LeaseListener
from klann_ros.nodes.parameters import declare, require, StartError, usage
from klann_ros.nodes.process import arguments, Finish, ProcessNode, run
from klann_ros.sanitize.text import listed
from klann_ros.stop_signals import StopSignals
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from .motion import CRANK_PARAMETERS, CrankMotion, CrankMotionError, MOTION, ResumableMotion

# Time for a subscriber to match the publisher once the publisher knows of it, and for a driver's
# lease to be heard before the first message [s].
DISCOVERY_TIME = 0.3
# After a longer stop the motion continues from its last angle, without a burst [s].
_MAX_CATCH_UP = 0.5


class CrankPublisher:
    """Publisher of the crank's angle, or of angle and rate as a joint's state."""

    def __init__(self, node: Node, output: str, crank_joint: str) -> None:
        # Whether a motor listens, which must stand at the end.
        self.is_command = output == 'crank_command'
        self.is_state = self.is_command or output == 'crank_state'
        kind = JointState if self.is_state else Float64
        self.publisher: Any = create_publisher(node, kind, output)
        self.state = JointState(name=[crank_joint])

    def publish(self, angle: float, rate: float, time: Time) -> None:
        """Publish angle [rad] and rate [rad/s] at a time."""
        if not self.is_state:
            self.publisher.publish(Float64(data=angle))
            return
        self.state.header.stamp = time.to_msg()
        self.state.position = array('d', [angle])
        self.state.velocity = array('d', [rate])
        self.publisher.publish(self.state)


class CrankNode(ProcessNode):
    """
    Publish the crank's angle, the n-th as a function of n / rate alone, then finish.

    While a driver holds the lease of the topic nothing is published. Afterwards the motion
    continues from the driver's last angle.
    """

    def __init__(self, finish: Finish, **options: Any) -> None:
        """Declare and validate the parameters; a StartError names a refused one."""
        super().__init__('crank_node', **options)
        self._finish = finish
        parameters = declare(self, CRANK_PARAMETERS)
        try:
            motion = CrankMotion(**{p.name: parameters[p.name] for p in MOTION})
        except CrankMotionError as error:
            raise StartError(str(error)) from error
        self._rate: float = parameters['rate']
        self._motion = ResumableMotion(motion, self._rate)
        # The number of messages, and of those that were sent.
        self._count = self._message_count(parameters['revolutions'], motion.period)
        self._sent_count = 0
        self._min_subscribers: int = parameters['min_subscribers']
        self._output = CrankPublisher(self, parameters['output'], parameters['crank_joint'])
        # Steady time of the first message [s], infinite before, and its time by the node's clock:
        # simulated time may stand still or jump; the crank turns all the same.
        self._begin = inf
        self._begin_stamp = self.get_clock().now()
        # To a driver's angles, and the last one [rad]; None before the first.
        self._driver_subscription: Any = None
        self._driver_angle: float | None = None
        self._lease = LeaseListener(self, self._output.publisher.topic_name, self._on_lease)
        self._start_timer = create_steady_timer(self, 0.02, self._start_if_ready)
        self.get_logger().info(f'ready: {self._summary(parameters)}')

    def close(self) -> int:
        """Let a motor stand that was commanded."""
        if self._output.is_command and self._sent_count:
            self._output.state.velocity = array('d', [0.0])
            endpoints.publish_last(self._output.publisher, self._output.state)
        return 0

    def _summary(self, parameters: Mapping[str, Any]) -> str:
        mode = parameters['mode']
        size = f'{parameters["speed"]:g} rad/s'
        if mode in ('sine', 'step'):
            size = f'{parameters["amplitude"]:g} rad at {parameters["frequency"]:g} Hz'
        end = f'{parameters["revolutions"]:g} revolutions' if self._count < inf else 'endless'
        condition = ''
        if self._min_subscribers:
            condition = f', as soon as {self._min_subscribers} subscribe'
        return (
            f'{mode} ({size}), {end}, {self._rate:g} messages a second on '
            f'{self._output.publisher.topic_name}{condition}'
        )

    def _message_count(self, revolutions: float, period: float) -> float:
        require(0.0 <= revolutions < inf, 'revolutions', revolutions, 'finite and >= 0')
        if revolutions == 0.0:
            return inf
        duration = revolutions * period
        require(isfinite(duration), 'revolutions', revolutions, '0 where speed is 0')
        return float(round(duration * self._rate) + 1)

    def _start_if_ready(self) -> None:
        now = monotonic()
        subscriber_count = self._output.publisher.get_subscription_count()
        if subscriber_count < self._min_subscribers or self._lease.holder:
            self._begin = inf
        elif self._begin == inf:
            self._begin = now + DISCOVERY_TIME
        if now >= self._begin:
            self._start_timer.cancel()
            rivals = endpoints.other_publishers(self, self._output.publisher.topic_name)
            if self._output.is_command and rivals:
                self.get_logger().error(f'{listed(rivals)} publishes crank_command: end it first')
                self._finish(1)
                return
            self._begin = now
            self._begin_stamp = self.get_clock().now()
            create_steady_timer(self, 1.0 / self._rate, self._publish_due)
            self._publish_due()

    def _publish_due(self) -> None:
        """Publish the due angles: a late timer catches up, so that no angle is skipped."""
        if self._lease.holder:
            return
        delay = monotonic() - self._begin - self._sent_count / self._rate
        if delay > _MAX_CATCH_UP:
            self._begin += delay
            self._begin_stamp += Duration(seconds=delay)
        due_count = int((monotonic() - self._begin) * self._rate + 1e-6) + 1
        while self._sent_count < min(due_count, self._count):
            t = self._sent_count / self._rate
            angle, rate = self._motion.step(t)
            self._output.publish(angle, rate, self._begin_stamp + Duration(seconds=t))
            self._sent_count += 1
        if self._sent_count >= self._count:
            flush([self._output.publisher])
            self._finish()

    def _on_lease(self, driver: str) -> None:
        """Yield to a driver, or resume at its last angle."""
        topic = self._lease.topic
        if driver:
            self.get_logger().info(f'yields to {driver}, which drives {topic}')
            self._driver_subscription = self.create_subscription(Float64, topic, self._on_angle, 1)
            return
        t = self._sent_count / self._rate
        self.destroy_subscription(self._driver_subscription)
        if self._driver_angle is not None:
            self._motion.resume(t, self._driver_angle)
        self._driver_angle = None
        if self._begin < inf:
            self._begin = monotonic() - t
            self._begin_stamp = self.get_clock().now() - Duration(seconds=t)
        self.get_logger().info('the driver has left: resumes where the crank is')

    def _on_angle(self, message: Float64) -> None:
        if isfinite(message.data):
            self._driver_angle = message.data


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = ArgumentParser(
        'crank_node',
        'Drive the crank: publish its angle on crank_angle, or angle and rate on crank_state, '
        'or crank_command, which ends with a rate of 0.',
        f'{usage({"": CRANK_PARAMETERS})}\n{QOS_USAGE}',
    )
    arguments(parser, argv)
    return run('crank_node', CrankNode, argv, stop)
