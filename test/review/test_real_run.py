"""Runs of the real nodes: a healthy one has no finding, a stopped node or a second one has."""

from dataclasses import replace
from itertools import pairwise
from math import isnan
from pathlib import Path
import signal

from domain import own_domain
from findings import checks
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import PAUSE_RECORD
from klann_ros.nodes.endpoints import OUTPUT
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.review import Review
from klann_ros.review.reviewing import review_run
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_domain import Domain, open_domain, Process, RecorderReports
from sensor_msgs.msg import JointState
from std_msgs.msg import String

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
WALKER = Path(__file__).resolve().parents[2] / 'config' / 'walker4.yaml'
# This machine may hold anything up for a moment, but for no second; a node is stopped for longer.
LIMITS = Limits(gap_time=1.0, latency=1.0)
STOPPED = 1.3
# What waited for a node that stood still is as old as that when it is answered.
AFTER_A_STOP = replace(LIMITS, clock_offset=60.0)
LEGS = ('front_left', 'front_right', 'rear_left', 'rear_right')
TOPICS = [
    '/crank_state',
    '/joint_states',
    '/point_h',
    '/velocity_h',
    '/walker/crank_angle',
    '/walker/joint_states',
    *(f'/walker/{leg}/point_h' for leg in LEGS),
]


class Scene:
    """A leg and a walker in one domain, and runs of them one after the other."""

    def __init__(self, ros: Domain, folder: Path) -> None:
        self._ros = ros
        self._folder = folder
        namespaced = ('--ros-args', '-r', '__ns:=/walker')
        self.solver = ros.solver()
        ros.solver(*namespaced, '--params-file', str(WALKER), namespace='/walker')
        self.poses = ros.probe.listen(JointState, 'joint_states')
        self.others = ros.probe.listen(JointState, '/walker/joint_states')
        options = {'rate': 50.0, 'min_subscribers': 1}
        self.crank = ros.start('crank_node', output='crank_state', **options)
        ros.start('crank_node', *namespaced, **options)
        ros.probe.until(lambda: self.poses and self.others)

    def record(self, name: str, stopped: Process) -> Path:
        """Record two seconds with a process that stands still between them."""
        run, probe = self._folder / name, self._ros.probe
        listeners = {topic: probe.node.count_subscribers(topic) for topic in TOPICS}
        reports = RecorderReports(probe)
        recorder = self._ros.start('recorder_node', output=run, topics=f'[{", ".join(TOPICS)}]')
        probe.until(lambda: all(probe.node.count_subscribers(t) > n for t, n in listeners.items()))
        # Whom the publishers know of they still have to find, and what came before is no matter.
        probe.spin(0.3)
        hear_poses(reports, 40)
        stopped.popen.send_signal(signal.SIGSTOP)
        probe.spin(STOPPED)
        stopped.popen.send_signal(signal.SIGCONT)
        hear_poses(reports, 40)
        assert recorder.stop() == 0
        return run

    def record_undisturbed(self, name: str, stopped: Process, others: str) -> Path:
        """Record the same, again where the machine held up the recorder, or others as long."""
        for attempt in range(3):
            run = self.record(f'{name}_{attempt}', stopped)
            with open_log(run) as log:
                times = [message.log_time / 1e9 for message in log.messages([others])]
                steps = [after - before for before, after in pairwise(times)]
                if max(steps) < LIMITS.gap_time and PAUSE_RECORD not in log.metadata:
                    break
        return run


def hear_poses(reports: RecorderReports, count: int) -> None:
    """Wait until the recorder has heard so many poses more, of either solver, and questions."""
    # It may find whoever asks later than whoever answers.
    topics = ('/joint_states', '/walker/joint_states', '/crank_state', '/walker/crank_angle')
    before = {topic: reports.count(f'{topic} received') for topic in topics}
    reports.until_received({topic: count + before[topic] for topic in topics})


def two_cranks(ros: Domain) -> Path:
    """Record two cranks at 500 Hz, and what was latched long before."""
    described = ros.probe.node.create_publisher(String, 'robot_description', LATCHED)
    described.publish(String(data='<robot name="none"/>'))
    ros.probe.spin(1.5)
    reports = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output=ros.folder / 'cranks')
    for n in range(2):
        named = ('--ros-args', '-r', f'__node:=crank_{n}')
        # So slow that they are apart whenever each of them begins.
        ros.start('crank_node', *named, start=4.0 * n, speed=0.3, rate=500.0, min_subscribers=1)
    # As soon as it hears both it can no longer tell what is lost.
    ros.probe.until(lambda: any(s.get('/crank_angle lost') == 'unknown' for s in reports.values()))
    reports.until_received({'/crank_angle': reports.count('/crank_angle received') + 1000})
    reports.until_received({'/robot_description': 1})
    assert recorder.stop() == 0
    return ros.folder / 'cranks'


def two_solvers(ros: Domain) -> Path:
    """Record two solvers that answer the same crank."""
    reports = RecorderReports(ros.probe)
    recorder = ros.start('recorder_node', output=ros.folder / 'solvers')
    for name in ('first', 'second'):
        ros.solver('--ros-args', '-r', f'__node:={name}')
    ros.probe.listen(JointState, 'joint_states', OUTPUT)
    ros.probe.await_publishers('joint_states', publishers=2)
    # Both answer from the first question on, and the recorder knows both by then.
    ros.start('crank_node', rate=100.0, min_subscribers=3)
    reports.until_received({'/joint_states': 200})
    assert recorder.stop() == 0
    return ros.folder / 'solvers'


@pytest.fixture(scope='module')
def reviews(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Review]:
    """Return the reviews of what the real nodes made."""
    folder = tmp_path_factory.mktemp('real')
    with own_domain() as domain, open_domain(domain, folder) as ros:
        scene = Scene(ros, folder)
        runs = {
            'stalled crank': scene.record_undisturbed(
                'stalled_crank', scene.crank, '/walker/joint_states'
            ),
            'stalled solver': scene.record_undisturbed(
                'stalled_solver', scene.solver, '/crank_state'
            ),
        }
    found = {name: review_run(run, limits=AFTER_A_STOP) for name, run in runs.items()}
    for record in (two_cranks, two_solvers):
        other = tmp_path_factory.mktemp(record.__name__)
        with own_domain() as domain, open_domain(domain, other) as ros:
            found[record.__name__] = review_run(record(ros), limits=LIMITS)
    return found


def test_all_legs_of_a_real_run_are_judged(reviews) -> None:
    review = reviews['stalled crank']
    legs = {leg.recording.title: len(leg.evaluated.poses) for leg in review.legs}
    walker = {f'walker/{leg}' for leg in LEGS}
    assert legs.keys() == {'', *walker}
    assert min(legs.values()) >= 30
    for leg in review.legs:
        assert leg.errors is not None
        assert leg.figures.worst_angle_error < 1e-9
        assert leg.figures.worst_foot_error < 1e-9


def test_every_pose_of_a_real_run_is_matched_with_its_input(reviews) -> None:
    for leg in reviews['stalled crank'].legs:
        asked = set(leg.evaluated.cranks.stamps.tolist())
        # What was asked before the recorder listened is not in the run, nor what came at its end.
        inside = [s for s in leg.evaluated.poses.stamps.tolist() if min(asked) <= s <= max(asked)]
        assert len(inside) >= 30
        assert asked.issuperset(inside)


def test_a_crank_that_stood_still_is_one_gap(reviews) -> None:
    review = reviews['stalled crank']
    assert checks(review) == ['gap']
    (finding,) = review.findings
    # What follows from the crank has the same gap; the walker has one of its own and none.
    for topic in ('/crank_state', '/joint_states', '/point_h', '/velocity_h'):
        assert topic in finding.text
    assert 'walker' not in finding.text
    assert finding.time is not None
    assert 0 < finding.time < review.recording.duration - STOPPED + 0.5


def test_a_solver_that_stood_still_is_one_gap_of_its_answers(reviews) -> None:
    review = reviews['stalled solver']
    assert checks(review) == ['gap']
    (finding,) = review.findings
    assert '/joint_states' in finding.text
    assert '/crank_state' not in finding.text


def test_two_cranks_are_named_and_not_a_clock_jump(reviews: dict[str, Review]) -> None:
    review = reviews['two_cranks']
    (topic,) = [topic for topic in review.recording.topics if topic.name == '/crank_angle']
    assert len(topic.times) >= 1000
    assert (topic.lost, topic.shared) == (None, True)
    # There is no solver in this run.
    assert checks(review) == ['poses', 'jump']
    meaning = 'multiple publishers set the crank at once (/crank_angle), each with its own angle'
    assert review.findings[1].meaning == meaning


def test_messages_latched_before_the_start_have_no_latency(reviews: dict[str, Review]) -> None:
    (topic,) = [t for t in reviews['two_cranks'].topics if t.name == '/robot_description']
    assert topic.count == 1
    assert isnan(topic.latency_p50)


def test_two_solvers_are_named(reviews: dict[str, Review]) -> None:
    review = reviews['two_solvers']
    assert checks(review) == ['solvers']
    text = review.findings[0].text
    assert text.startswith('two solvers (/first, /second) answer on /joint_states: ')
    (leg,) = review.legs
    answers, asked = leg.answers.count, leg.answers.asked
    assert text.endswith(f': {answers} answers to {asked} crank angles')
    # The last question may have been answered by one of them only when the recorder stopped.
    assert 2 * asked - 2 <= answers <= 2 * asked
