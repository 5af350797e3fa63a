"""Runs of a robot that walks straight on, and what may be wrong with them."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from klann_ros.log.records import Message
from klann_ros.log.write.writer import RunWriter
from leg_runs import header, joint_state, make, START, STATE, STORE, topic_of
import numpy as np

ODOMETRY = 'nav_msgs/msg/Odometry'
JOINTS = ['left_crank', 'right_crank']
# So fast [m/s], for so many messages of each topic, at 100 Hz.
SPEED, COUNT = 0.5, 400
WAY = SPEED * (COUNT - 1) / 100


@dataclass
class Walking:
    """A walk straight on, and what is wrong with it."""

    scale: float = 1.0
    truth: bool = True
    lag: tuple[float, float] = (0.0, 0.0)
    cut: int | None = None
    turning: float = 0.0
    late: int = 0
    # The namespace of its topics.
    space: str = ''

    def write(self, folder: Path) -> Path:
        # Small chunks: what is said of a walk goes over their edges.
        with RunWriter(folder, chunk_size=8192) as run:
            for message in self._messages():
                run.write(message)
        return folder

    def _messages(self) -> Iterator[Message]:
        for k in range(COUNT):
            t = k / 100
            stamp = START + k * 10_000_000
            # The odometry began elsewhere, and looks another way.
            late = t + self.late / 1e9
            at = 5.0, 1.0 + SPEED * self.scale * late
            turned = np.pi / 2 + self.turning * late
            yield self._odometry('/odom', stamp + self.late, k, at, turned)
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
        self, name: str, stamp: int, number: int, at: tuple[float, float], yaw: float
    ) -> Message:
        point = make('geometry_msgs/msg/Point', x=at[0], y=at[1], z=0.3)
        turned = make(
            'geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2)
        )
        zero = make('geometry_msgs/msg/Vector3', x=0.0, y=0.0, z=0.0)
        content = make(
            ODOMETRY,
            header=header(stamp, 'odom'),
            child_frame_id='base_link',
            pose=make(
                'geometry_msgs/msg/PoseWithCovariance',
                pose=make('geometry_msgs/msg/Pose', position=point, orientation=turned),
                covariance=np.zeros(36),
            ),
            twist=make(
                'geometry_msgs/msg/TwistWithCovariance',
                twist=make('geometry_msgs/msg/Twist', linear=zero, angular=zero),
                covariance=np.zeros(36),
            ),
        )
        return self._message(name, ODOMETRY, stamp, number, content)

    def _cranks(self, name: str, stamp: int, number: int, turned: Any) -> Message:
        return self._message(name, STATE, stamp, number, joint_state(stamp, JOINTS, turned))
