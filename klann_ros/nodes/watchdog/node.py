"""
`watchdog_node`: sends zero to a velocity controller that is no longer commanded.

JointGroupVelocityController repeats its last command for ever. This node listens to the commands
beside the controller, and is not between it and walker_node: neither of the two processes, stopped
or killed, leaves a command standing that the other cannot replace.
"""

from collections.abc import Sequence
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from klann_ros.cli import ArgumentParser
from klann_ros.nodes.endpoints import (
    create_publisher,
    create_steady_timer,
    diagnostic_array,
    diagnostic_status,
    publish_last,
    QOS_USAGE,
    subscribe_raw,
    TypeCheck,
)
from klann_ros.nodes.parameters import Declaration, declare, number, require, usage
from klann_ros.nodes.process import arguments, ProcessNode, run
from klann_ros.nodes.raw_executor import Info, RawCallbackGroup
from klann_ros.stop_signals import StopSignals
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64MultiArray

WATCHDOG_PARAMETERS = (
    Declaration(
        'joints',
        [''],
        'joints of the controller, which takes as many numbers',
        constraint='the names of its joints',
    ),
    number('command_timeout', 0.5, 'without a younger command zero is sent [s]', 0.01, 60.0),
    number('diagnostics_period', 1.0, 'time between diagnostics [s]', 0.01, 3600.0),
)
# What to do about a publisher of another type, by the type that is taken and the published one.
TYPE_REMEDIES = {
    ('std_msgs/msg/Float64MultiArray', 'sensor_msgs/msg/JointState'): (
        'command_type:=velocities of walker_node'
    ),
}
# Period of the timer, in timeouts: zero is late by this part of the timeout.
TICKS = 0.1
# Zero is repeated with this period [s]: it may be lost, as where walker_node was killed while it
# held the shared memory of the middleware, and a command that was on its way may arrive after it.
REPEAT_PERIOD = 0.1


class WatchdogNode(ProcessNode):
    """Send zero while no other node commands the joints, and at the end."""

    def __init__(self, **options: Any) -> None:
        """Declare, validate and connect; a StartError names a refused parameter."""
        super().__init__('watchdog_node', **options)
        parameters = declare(self, WATCHDOG_PARAMETERS)
        joints = [joint for joint in parameters['joints'] if joint]
        require(bool(joints), 'joints', parameters['joints'], 'the names of its joints')
        self._timeout: float = parameters['command_timeout']
        self._zero = bytes(serialize_message(Float64MultiArray(data=[0.0] * len(joints))))
        self._publisher = create_publisher(self, Float64MultiArray, 'crank_command')
        # Arrival of the last command of another node, and time of the last zero [s].
        self._command_time = self._zero_time = monotonic()
        # Zeros that the middleware has still to deliver to this node's own subscription.
        self._expected_echoes = 0
        self._is_silent = False
        self._timeouts = 0
        subscribe_raw(self, Float64MultiArray, 'crank_command', self._on_command)
        create_steady_timer(self, TICKS * self._timeout, self._on_timer, RawCallbackGroup())
        self._diagnostics = create_publisher(self, DiagnosticArray, '/diagnostics')
        self._types = TypeCheck(self, TYPE_REMEDIES)
        create_steady_timer(self, parameters['diagnostics_period'], self._report)
        topic = self._publisher.topic_name
        self.get_logger().info(f'ready: {topic} of {len(joints)} joints, {self._timeout:g} s')

    def close(self) -> int:
        """Send zero."""
        publish_last(self._publisher, self._zero)
        return 0

    def _on_command(self, message: bytes, _: Info) -> None:
        if self._expected_echoes and message == self._zero:
            self._expected_echoes -= 1
            return
        # Echoes may be lost.
        self._expected_echoes = 0
        self._command_time = monotonic()

    def _on_timer(self) -> None:
        now = monotonic()
        was_silent = self._is_silent
        self._is_silent = now - self._command_time > self._timeout
        if not self._is_silent:
            return
        if not was_silent:
            self._timeouts += 1
            text = f'no command for {self._timeout:g} s: zero is sent'
            self.get_logger().warning(f'{self._publisher.topic_name}: {text}')
        if not was_silent or now - self._zero_time > REPEAT_PERIOD:
            self._zero_time = now
            self._expected_echoes += 1
            self._publisher.publish(self._zero)

    def _report(self) -> None:
        silence = f'no command for {monotonic() - self._command_time:.1f} s: zero is sent'
        message = silence if self._is_silent else 'commanded'
        level, message = self._types.add_to(DiagnosticStatus.OK, message)
        timeouts = ('timeouts', self._timeouts)
        status = diagnostic_status(self, 'commands', level, message, [timeouts])
        self._diagnostics.publish(diagnostic_array(self, [status]))


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = ArgumentParser(
        'watchdog_node',
        'Stop the cranks: send zero to a velocity controller of ros2_control whose commands '
        '(crank_command, std_msgs/Float64MultiArray) have stopped.',
        f'{usage({"": WATCHDOG_PARAMETERS})}\n{QOS_USAGE}',
    )
    arguments(parser, argv)
    return run('watchdog_node', lambda _: WatchdogNode(), argv, stop, raw=True)
