"""Recordings by a recorder_node of one topic of numbers."""

from pathlib import Path
import struct

from klann_ros.log.reader import open_log

TOPIC = '/crank_angle'


def numbers(path: Path, topic: str = TOPIC) -> list[float]:
    """Return the Float64 values of a topic in a run."""
    with open_log(path) as log:
        data = [message.data for message in log.messages([topic])]
    return [float(struct.unpack_from('<d', item, 4)[0]) for item in data]
