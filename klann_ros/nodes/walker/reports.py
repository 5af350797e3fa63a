"""The diagnostics and log lines of `walker_node`."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from klann_ros.nodes.endpoints import (
    create_publisher,
    create_steady_timer,
    diagnostic_array,
    diagnostic_status,
    node_of,
    TypeCheck,
)
from klann_ros.robot import Robot
from klann_ros.sanitize.text import printable, printable_line
from klann_ros.walker import DiagnosticLevel, Fault, Walker
from rclpy.node import Node

from .declarations import TYPE_REMEDIES
from .timing import ControlClock, steady_time

# Minimum time between two log lines about events [s].
EVENT_PERIOD = 1.0
# Events in one line of the log.
MAX_LOGGED = 5


class WalkerReports:
    """
    Publisher of a walker's diagnostics, once in a period [s]; it logs faults and events.

    With `described_robot` they contain the largest effort of each crank by the masses in its file.
    """

    def __init__(
        self,
        node: Node,
        walker: Walker,
        clock: ControlClock,
        period: float,
        described_robot: Robot | None = None,
    ) -> None:
        self._node = node
        self._walker = walker
        self._clock = clock
        # [N m] by joint.
        self._described_efforts: dict[str, float] = {}
        if described_robot is not None:
            # The data sheet takes 15 ms to import.
            from klann_ros.datasheet import peak_efforts  # noqa: PLC0415

            self._described_efforts = peak_efforts(described_robot)
        self._publisher: Any = create_publisher(node, DiagnosticArray, '/diagnostics')
        self._types = TypeCheck(node, TYPE_REMEDIES)
        self._logged_warnings: set[str] = set()
        # Steady time of the last line about events [s].
        self._event_log_time = -EVENT_PERIOD
        self._logged_fault: Fault | None = None
        # Also where simulated time stands still.
        create_steady_timer(node, period, self._publish)

    def log_events(self) -> None:
        """Log a new fault, and now and then the events since the last line."""
        controller = self._walker.controller
        latch, events = controller.latch, controller.events
        if latch.fault is not self._logged_fault:
            self._logged_fault = latch.fault
            if latch.fault:
                self._node.get_logger().error(printable_line(f'fault: {latch.reason}'))
        now = steady_time()
        if not events or now - self._event_log_time < EVENT_PERIOD:
            return
        self._event_log_time = now
        texts = [*events][:MAX_LOGGED]
        more = f'; and {len(events) - len(texts)} more' if len(events) > len(texts) else ''
        events.clear()
        self._node.get_logger().warning(printable_line('; '.join(texts) + more))

    def _publish(self) -> None:
        """Publish the state of the walker as diagnostics, and warn once of each trouble."""
        now = self._clock.now()
        level, message = self._walker.verdict(now)
        figures = self._walker.values(now)
        for joint, effort in self._described_efforts.items():
            figures[f'{joint} described_effort'] = f'{effort:.3f}'
        for rivalry in self._rivalries():
            self._warn_once(rivalry)
            level = DiagnosticLevel.WARN if level == DiagnosticLevel.OK else level
            message = f'{message}; {rivalry}'
        for crank in self._walker.controller.cranks:
            self._warn_once(crank.units.suspicion)
        verdict = self._types.add_to(bytes([level.value]), message)
        status = diagnostic_status(self._node, 'walker', *verdict, figures.items())
        self._publisher.publish(diagnostic_array(self._node, [status]))

    def _rivalries(self) -> list[str]:
        """Return the inputs and outputs with several publishers, in words."""
        rivalries = []
        commander_count = len(self._publishing_nodes('crank_command', 'watchdog_node'))
        if commander_count > 1:
            publishers = f'{commander_count} publishers: only one may drive the cranks'
            rivalries.append(f'crank_command has {publishers}')
        # sim_node gives way to others.
        drivers = self._publishing_nodes('cmd_vel', 'sim_node')
        if len(drivers) > 1:
            names = ', '.join(map(printable, drivers))
            rivalries.append(f'cmd_vel has {len(drivers)} publishers: {names}')
        switches = self._publishing_nodes('e_stop')
        if len(switches) > 1:
            names = ', '.join(map(printable, switches))
            rivalries.append(
                f'e_stop has {len(switches)} publishers, whose silence hides: {names}'
            )
        return rivalries

    def _publishing_nodes(self, name: str, harmless: str = '') -> list[str]:
        """Return the nodes that publish a topic, if there are several, but the harmless ones."""
        topic = self._node.resolve_topic_name(name)
        if self._node.count_publishers(topic) < 2:
            return []
        nodes = map(node_of, self._node.get_publishers_info_by_topic(topic))
        return sorted(node for node in nodes if node.rpartition('/')[2] not in ('', harmless))

    def _warn_once(self, text: str) -> None:
        """Log a warning, unless it is empty or was logged before."""
        if text and text not in self._logged_warnings:
            self._logged_warnings.add(text)
            self._node.get_logger().warning(printable_line(text))
