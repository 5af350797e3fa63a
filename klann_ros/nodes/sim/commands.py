"""What cranks are asked for: read from `crank_command`, held against what makes sense, counted."""

from collections import Counter
from collections.abc import Callable
from math import isfinite
from typing import Any

from klann_ros.nodes.endpoints import INPUT, overridden
from klann_ros.nodes.raw_executor import Info, RawCallbackGroup
from klann_ros.nodes.solver.cdr import JointReader
from klann_ros.sanitize.text import printable
from klann_ros.twin import Twin
from rclpy.node import Node
from sensor_msgs.msg import JointState

# How often a complaint about commands is logged at most [s].
WARNING_PERIOD = 2.0


class CrankCommands:
    """
    Subscription to crank_command.

    Parameters
    ----------
    node : rclpy.node.Node
        The node.
    twin : Twin
        Whose cranks they are.
    now : callable
        Returns the time by which commands grow old [s].
    timeout : float
        Without a younger command a crank is held [s].

    Attributes
    ----------
    counts : Counter
        How many commands were `commands`, `rejected`, `limited`, and how many cranks were `held`.
    topic : str
        Where they come from.

    """

    def __init__(
        self, node: Node, twin: Twin, now: Callable[[], float], *, timeout: float
    ) -> None:
        self._node, self._twin, self._now, self._timeout = node, twin, now, timeout
        self.counts: Counter[str] = Counter()
        self._readers = {joint: JointReader(joint) for joint in twin.joints}
        self._last: dict[str, float] = {}
        self.topic = node.resolve_topic_name('crank_command')
        node.create_subscription(
            JointState,
            'crank_command',
            self._on_command,
            overridden(node, 'crank_command', 'subscription', INPUT),
            raw=True,
            callback_group=RawCallbackGroup(),
        )

    @property
    def silent(self) -> list[str]:
        """Return the joints without a command."""
        return [joint for joint in self._twin.joints if joint not in self._last]

    def expire_commands(self) -> None:
        """Hold the cranks whose last command is too old."""
        now = self._now()
        for joint, at in [*self._last.items()]:
            if now - at > self._timeout:
                del self._last[joint]
                self._twin.command(joint, 0.0)
                self.counts['held'] += 1

    def forget(self) -> None:
        """Hold all cranks until somebody turns them."""
        self._last.clear()

    def _on_command(self, data: bytes, _: Info) -> None:
        self.counts['commands'] += 1
        try:
            asked = self._asked(data)
        except ValueError as error:
            self.counts['rejected'] += 1
            what = f'{self.topic} is rejected: {error}'
            self._node.get_logger().warning(what, throttle_duration_sec=WARNING_PERIOD)
            return
        for joint, velocity in asked.items():
            self._last[joint] = self._now()
            if self._twin.command(joint, velocity) != velocity:
                self.counts['limited'] += 1

    def _asked(self, data: bytes) -> dict[str, float]:
        """Return the speeds that a message asks for; a ValueError if it makes no sense."""
        asked, strangers = {}, []
        for joint, reader in self._readers.items():
            try:
                velocity = reader.read(data).velocity
            except ValueError as error:
                strangers.append(error)
                continue
            if velocity is None:
                msg = 'it has no velocities, and positions move no motor'
                raise ValueError(msg)
            if not isfinite(velocity):
                raise ValueError(f'velocity of {printable(joint)} is {velocity}')
            asked[joint] = velocity
        if not asked:
            raise strangers[0]
        return asked


def as_values(counts: Counter[str]) -> dict[str, Any]:
    """Return the counts by their names, those that are 0 as well."""
    return {name: counts[name] for name in ('commands', 'rejected', 'limited', 'held')}
