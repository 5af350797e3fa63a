"""`crank_node`: drives the crank."""

from array import array
from collections.abc import Mapping, Sequence
from math import copysign, inf, isfinite, remainder
from time import monotonic
from typing import Any, TYPE_CHECKING

from klann_ros.cli import ArgumentParser
from klann_ros.kinematics.angles import TURN
from klann_ros.nodes.endpoints import create_publisher, create_steady_timer, flush, QOS_USAGE
from klann_ros.nodes.lease import LeaseListener
from klann_ros.nodes.parameters import declare, require, StartError, usage
from klann_ros.nodes.process import arguments, Finish, run
from klann_ros.stop_signals import StopSignals
from rclpy.duration import Duration
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from .motion import CRANK_PARAMETERS, CrankMotion, CrankMotionError, MOTION

if TYPE_CHECKING:
    from rclpy.subscription import Subscription

# Time for a subscriber to match the publisher once the publisher knows of it, and for a driver's
# lease to be heard before the first message [s].
DISCOVERY_TIME = 0.3
# After a longer stop the motion continues from its last angle, without a burst [s].
_MAX_CATCH_UP = 0.5
# Rate of a bounded motion's return to its bounds after a driver [rad/s].
_RETURN_RATE = 1.0


class CrankNode(Node):
    """
    Publish the crank's angle, the n-th as a function of n / rate alone, then finish.

    While a driver holds the lease of the topic nothing is published. Afterwards the motion
    continues from the driver's last angle: `constant` without bounds; the others return to theirs.
    """

    def __init__(self, finish: Finish, **options: Any) -> None:
        """Declare and validate the parameters; a StartError names a refused one."""
        super().__init__('crank_node', **options)
        self._finish = finish
        values = declare(self, [*MOTION, *CRANK_PARAMETERS])
        try:
            self._motion = CrankMotion(**{p.name: values[p.name] for p in MOTION})
        except CrankMotionError as error:
            raise StartError(str(error)) from error
        self._rate: float = values['rate']
        self._count = self._messages(values['revolutions'])
        self._min_subscribers = values['min_subscribers']
        self._make_output(values['output'], values['crank_joint'])
        self._n = 0
        # Steady time [s]: simulated time may stand still or jump; the crank turns all the same.
        self._begin = inf
        # Offset of the motion since a driver has turned the crank [rad].
        self._offset = 0.0
        self._is_bounded = values['mode'] != 'constant'
        self._driver_angle: float | None = None
        self._driver_input: Subscription | None = None
        self._lease = LeaseListener(self, self._publisher.topic_name, self._on_lease)
        self._waiting = create_steady_timer(self, 0.02, self._wait)
        self.get_logger().info(f'ready: {self._summary(values)}')

    def _summary(self, values: Mapping[str, Any]) -> str:
        kind = f'{values["speed"]:g} rad/s'
        if values['mode'] in ('sine', 'step'):
            kind = f'{values["amplitude"]:g} rad at {values["frequency"]:g} Hz'
        until = f'{values["revolutions"]:g} revolutions' if self._count < inf else 'endless'
        least = self._min_subscribers
        condition = f', as soon as {least} subscribe' if least else ''
        return (
            f'{values["mode"]} ({kind}), {until}, {self._rate:g} messages a second on '
            f'{self._publisher.topic_name}{condition}'
        )

    def _messages(self, revolutions: float) -> float:
        require(0.0 <= revolutions < inf, 'revolutions', revolutions, 'finite and >= 0')
        if revolutions == 0.0:
            return inf
        duration = revolutions * self._motion.period
        require(isfinite(duration), 'revolutions', revolutions, '0 where speed is 0')
        return float(round(duration * self._rate) + 1)

    def _make_output(self, output: str, crank_joint: str) -> None:
        is_state = output == 'crank_state'
        self._publisher = create_publisher(self, JointState if is_state else Float64, output)
        self._publish = self._publish_state if is_state else self._publish_angle
        self._angle, self._state = Float64(), JointState(name=[crank_joint])

    def _wait(self) -> None:
        now = monotonic()
        has_too_few = self._publisher.get_subscription_count() < self._min_subscribers
        if has_too_few or self._lease.holder:
            self._begin = inf
        elif self._begin == inf:
            self._begin = now + DISCOVERY_TIME
        if now >= self._begin:
            self._waiting.cancel()
            self._begin = now
            self._origin = self.get_clock().now()
            create_steady_timer(self, 1.0 / self._rate, self._tick)
            self._tick()

    def _tick(self) -> None:
        """Publish the due angles: a late timer catches up, so that no angle is skipped."""
        if self._lease.holder:
            return
        late = self._elapsed() - self._n / self._rate
        if late > _MAX_CATCH_UP:
            self._begin += late
            self._origin += Duration(seconds=late)
        due = int(self._elapsed() * self._rate + 1e-6) + 1
        while self._n < min(due, self._count):
            angle, rate = self._motion.at(self._n / self._rate)
            return_rate = self._return()
            self._publish(angle + self._offset, rate + return_rate, self._n / self._rate)
            self._n += 1
        if self._n >= self._count:
            flush([self._publisher])
            self._finish()

    def _on_lease(self, driver: str) -> None:
        """Yield to a driver, or resume at its last angle."""
        if driver:
            topic = self._lease.topic
            self.get_logger().info(f'yields to {driver}, which drives {topic}')
            self._driver_input = self.create_subscription(Float64, topic, self._on_driver_angle, 1)
            return
        if self._driver_input is not None:
            self.destroy_subscription(self._driver_input)
        self._driver_input = None
        t = self._n / self._rate
        if self._driver_angle is not None:
            self._offset = self._driver_angle - self._motion.at(t)[0]
            self._driver_angle = None
        if self._begin < inf:
            self._begin = monotonic() - t
            self._origin = self.get_clock().now() - Duration(seconds=t)
        self.get_logger().info('the driver has left: resumes where the crank is')

    def _on_driver_angle(self, message: Float64) -> None:
        if isfinite(message.data):
            self._driver_angle = message.data

    def _return(self) -> float:
        """Step back towards the motion's bounds; return the rate of the step [rad/s]."""
        if not (self._offset and self._is_bounded):
            return 0.0
        # Whole turns are not unwound.
        excess = remainder(self._offset, TURN)
        step = min(_RETURN_RATE / self._rate, abs(excess))
        self._offset -= copysign(step, excess)
        return -copysign(step * self._rate, excess) if step else 0.0

    def _elapsed(self) -> float:
        return monotonic() - self._begin

    def _publish_angle(self, angle: float, *_: float) -> None:
        self._angle.data = angle
        self._publisher.publish(self._angle)

    def _publish_state(self, angle: float, rate: float, t: float) -> None:
        message = self._state
        message.header.stamp = (self._origin + Duration(seconds=t)).to_msg()
        message.position = array('d', [angle])
        message.velocity = array('d', [rate])
        self._publisher.publish(message)


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = ArgumentParser(
        'crank_node',
        'Drive the crank: publish its angle on crank_angle, or angle and rate on crank_state.',
        f'{usage({"": [*MOTION, *CRANK_PARAMETERS]})}\n{QOS_USAGE}',
    )
    arguments(parser, argv)
    return run('crank_node', CrankNode, argv, stop)
