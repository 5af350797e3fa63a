"""A walk is held against its commands and the ground truth, and blamed for no more than it did."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from klann_ros.log.records import Message
from klann_ros.log.writing.writer import RunWriter
from klann_ros.review import review_run
from klann_ros.review.model.review import Review
from leg_runs import STORE, topic_of
import numpy as np
import pytest

START = 1_700_000_000_000_000_000
ODOMETRY, STATE = 'nav_msgs/msg/Odometry', 'sensor_msgs/msg/JointState'
JOINTS = ['left_crank', 'right_crank']
# So fast [m/s], for so many messages of each topic, at 100 Hz.
SPEED, COUNT = 0.5, 400
WAY = SPEED * (COUNT - 1) / 100


def make(kind: str, **fields: Any) -> Any:
    return STORE.types[kind](**fields)


@dataclass
class Walking:
    """A walk straight on, and what is wrong with it."""

    scale: float = 1.0
    truth: bool = True
    lag: tuple[float, float] = (0.0, 0.0)
    cut: int | None = None
    turning: float = 0.0
    late: int = 0

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
        return Message(topic_of(name, kind), data, stamp + 200_000, stamp, number + 1)

    def _header(self, stamp: int) -> Any:
        time = make('builtin_interfaces/msg/Time', sec=stamp // 10**9, nanosec=stamp % 10**9)
        return make('std_msgs/msg/Header', stamp=time, frame_id='odom')

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
            header=self._header(stamp),
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
        empty = np.empty(0)
        content = make(
            STATE,
            header=self._header(stamp),
            name=JOINTS,
            position=turned,
            velocity=empty,
            effort=empty,
        )
        return self._message(name, STATE, stamp, number, content)


@pytest.fixture
def reviewed(tmp_path: Path) -> Any:
    return lambda walking: review_run(walking.write(tmp_path / 'run'))


def checks(review: Review) -> set[str]:
    return {finding.check for finding in review.findings} & {'odometry', 'crank_lag', 'phase'}


def test_a_walk_without_a_fault_has_figures_and_no_finding(reviewed: Any) -> None:
    review = reviewed(Walking(scale=1.01))
    (walk,) = review.walks
    assert walk.way == pytest.approx(WAY, rel=1e-6)
    assert walk.odometry_error == pytest.approx(0.01 * WAY, rel=1e-6)
    assert walk.heading_error == pytest.approx(0.0, abs=1e-12)
    assert (walk.crank_lag, walk.phase_error) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert checks(review) == set()


def test_a_heading_that_goes_around_is_no_difference(reviewed: Any) -> None:
    # Between the messages that tell the truth, one of which comes before a turn and one after it.
    (walk,) = reviewed(Walking(turning=3.0, late=4_000_000)).walks
    assert walk.heading_error == pytest.approx(0.0, abs=1e-9)


def test_odometry_that_is_far_from_the_truth_is_found(reviewed: Any) -> None:
    review = reviewed(Walking(scale=1.1))
    (finding,) = (each for each in review.findings if each.check == 'odometry')
    assert finding.text.startswith('odometry was up to 0.2 m off the ground truth on a way of 2 m')
    assert finding.time == pytest.approx(3.99, abs=1e-3)


def test_without_ground_truth_nobody_is_blamed(reviewed: Any) -> None:
    review = reviewed(Walking(scale=1.1, truth=False))
    (walk,) = review.walks
    assert np.isnan(walk.odometry_error)
    assert walk.way == pytest.approx(1.1 * WAY, rel=1e-6)
    assert checks(review) == set()


@pytest.mark.parametrize(
    ('lag', 'found'),
    [((0.5, 0.5), {'crank_lag'}), ((0.3, 0.0), {'phase'}), ((0.5, 0.0), {'crank_lag', 'phase'})],
)
def test_cranks_that_are_not_where_they_should_be_are_found(
    lag: tuple[float, float], found: set[str], reviewed: Any
) -> None:
    review = reviewed(Walking(lag=lag))
    assert checks(review) == found
    times = [each.time for each in review.findings if each.check in found]
    assert times == pytest.approx([3.0] * len(found), abs=1e-3)


def test_a_message_that_is_none_is_counted_and_the_rest_is_judged(reviewed: Any) -> None:
    review = reviewed(Walking(cut=10))
    assert {(each.topic, each.count) for each in review.recording.undecoded} == {
        ('/odom', 1),
        ('/ground_truth', 1),
    }
    assert checks(review) == set()


def test_what_cranks_are_to_do_is_no_question_to_a_solver(reviewed: Any) -> None:
    review = reviewed(Walking())
    assert all('/crank_command' not in leg.recording.crank_topics for leg in review.legs)
