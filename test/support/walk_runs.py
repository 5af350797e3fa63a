"""Runs of a robot that walks straight on, and what may be wrong with them."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from klann_ros.log.records import Message
from klann_ros.log.write.writer import RunWriter
from leg_runs import filled, joint_state, stamp_fields, START, STATE, STORE, topic_of
import numpy as np

ODOMETRY = 'nav_msgs/msg/Odometry'
JOINTS = ['left_crank', 'right_crank']
# Speed [m/s], and the messages of each topic at 100 Hz.
SPEED = 0.5
COUNT = 400
WAY = SPEED * (COUNT - 1) / 100


@dataclass
class Walking:
    """A walk straight on, and what is wrong with it."""

    scale: float = 1.0
    truth: bool = True
    lag: tuple[float, float] = (0.0, 0.0)
    cut: int | None = None
    turning: float = 0.0
    late: int = 0  # of the odometry [ns]
    space: str = ''  # the namespace of its topics
    norm: float = 1.0  # of the quaternions of the odometry

    def write(self, folder: Path) -> Path:
        # Small chunks: what is said of a walk goes over their edges.
        with RunWriter(folder, chunk_size=8192) as run:
            for message in self.messages():
                run.write(message)
        return folder

    def messages(self) -> Iterator[Message]:
        for k in range(COUNT):
            t = k / 100
            stamp = START + k * 10_000_000
            # The odometry began elsewhere, and looks another way.
            late = t + self.late / 1e9
            place = 5.0, 1.0 + SPEED * self.scale * late
            yaw = np.pi / 2 + self.turning * late
            yield self._odometry('/odom', stamp + self.late, k, place, yaw)
            if self.truth:
                yield self._odometry('/ground_truth', stamp, k, (SPEED * t, 0.0), self.turning * t)
            cranks = np.array([t, t + np.pi])
            yield self._cranks('/crank_command', stamp, k, cranks)
            behind = np.array(self.lag) if k == 300 else 0.0
            yield self._cranks('/crank_state', stamp, k, cranks - behind)

    def _message(self, name: str, kind: str, stamp: int, number: int, content: Any) -> Message:
        data = bytes(STORE.serialize_cdr(content, kind))
        if self.cut == number and kind == ODOMETRY:
            data = data[:40]
        return Message(
            topic_of(f'{self.space}{name}', kind), data, stamp + 200_000, stamp, number + 1
        )

    def _odometry(
        self, name: str, stamp: int, number: int, place: tuple[float, float], yaw: float
    ) -> Message:
        position = {'x': place[0], 'y': place[1], 'z': 0.3}
        norm = self.norm if name == '/odom' else 1.0
        rotation = {'z': norm * np.sin(yaw / 2), 'w': norm * np.cos(yaw / 2)}
        content = filled(
            ODOMETRY,
            {
                'header': {'stamp': stamp_fields(stamp), 'frame_id': 'odom'},
                'child_frame_id': 'base_link',
                'pose': {'pose': {'position': position, 'orientation': rotation}},
            },
        )
        return self._message(name, ODOMETRY, stamp, number, content)

    def _cranks(self, name: str, stamp: int, number: int, angles: Any) -> Message:
        return self._message(name, STATE, stamp, number, joint_state(stamp, JOINTS, angles))
