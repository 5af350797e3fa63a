"""A recorder_node of one topic of numbers, and its run."""

from pathlib import Path
import struct
from typing import Any

from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import open_log
from ros_domain import Domain, RecorderReports
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

TOPIC = '/crank_angle'


class Recording:
    """A recorder and the one publisher that it hears, whose numbers count up from 0."""

    def __init__(self, ros: Domain, name: str = 'run', **parameters: Any) -> None:
        self.ros, self.folder, self.next = ros, ros.folder / name, 0
        self.reports = RecorderReports(ros.probe)
        self.publisher = ros.probe.node.create_publisher(Float64, TOPIC, 2000)
        self.process = ros.start('recorder_node', output=self.folder, **parameters)
        ros.probe.await_subscribers(self.publisher)

    def publish(self, count: int = 100) -> None:
        for _ in range(count):
            self.publisher.publish(Float64(data=float(self.next)))
            self.next += 1
        self.ros.probe.spin(0.2)

    def until_received(self) -> None:
        """Wait until all that was published is received, or known to be lost."""
        count, keys = self.reports.count, (f'{TOPIC} received', f'{TOPIC} lost')
        self.ros.probe.until(lambda: sum(map(count, keys)) >= self.next)

    def until_value(self, key: str, value: object) -> None:
        self.ros.probe.until(lambda: self.reports.values.get(key) == str(value))

    def until_level(self, level: bytes) -> None:
        """Wait for a status of a level."""
        found = self.reports
        self.ros.probe.until(lambda: any(status.level == level for status in found.statuses))

    def call(self, name: str) -> Trigger.Response:
        return self.ros.probe.call(Trigger, f'recorder_node/{name}', Trigger.Request())


def numbers(path: Path, topic: str = TOPIC) -> list[float]:
    """Return the Float64 values of a topic in a run, which may be on its way."""
    try:
        with open_log(path) as log:
            data = [message.data for message in log.messages([topic])]
    except NotALogError:
        return []
    return [float(struct.unpack_from('<d', item, 4)[0]) for item in data]
