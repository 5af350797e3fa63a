"""Runs of real nodes: healthy ones have no fault, a stopped or a second node is the only one."""

from collections.abc import Iterator
from dataclasses import replace
from math import isnan
from pathlib import Path
import signal
import struct
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from domain import own_domain
from geometry_msgs.msg import Twist
from klann_ros.log.reader import open_log
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import PAUSE_RECORD, recorded_pause, SolverParameters
from klann_ros.nodes.endpoints import OUTPUT
from klann_ros.review.model.limits import Limits
from klann_ros.review.model.review import Review
from klann_ros.review.reviewing import review_run
from klann_ros.sanitize.text import counted, verb
import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from review_findings import checks
from ros_domain import Domain, open_domain, Process, RecorderReports
from rosbag2_bags import write_jazzy_bag
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[2]
WALKER = ROOT / 'config' / 'walker4.yaml'
# A loaded machine holds anything up, but for no longer than this [s].
HOLD_UP = 3.0
LIMITS = Limits(gap_time=HOLD_UP, latency=HOLD_UP, clock_offset=2.0 * HOLD_UP)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# What happens in the run lasts longer than a gap, and than the judge takes to find one [s].
LONG, STALL = HOLD_UP + 1.4, HOLD_UP + 0.5
# A node is stopped for longer than the machine may hold up the others [s]. What waited for it is
# as old as that when it is answered.
STOPPED, MAX_HOLD_UP = 1.3, 1.0
ATTEMPTS = 4
LEG = ('/crank_angle', '/joint_states', '/point_h')
LEGS = {'', *(f'walker/{end}_{side}' for end in ('front', 'rear') for side in ('left', 'right'))}


class Scene:
    """
    A leg by wall time, a walker by simulated time, three recorders, and others on their topics.

    Diagnostics have several publishers, commands come in bursts, and the description is latched.
    """

    def __init__(self, ros: Domain) -> None:
        self.ros, self.reports = ros, RecorderReports(ros.probe)
        self.limits = ros.folder / 'limits.yaml'
        self.limits.write_text(f'gap_time: {HOLD_UP}\nlatency: {HOLD_UP}\n')
        described = ros.probe.node.create_publisher(String, 'robot_description', LATCHED)
        described.publish(String(data='<robot name="none"/>'))
        for number in range(2):
            node = ros.probe.add_node(f'reporter_{number}')
            publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
            for _ in range(7 * number):
                publisher.publish(DiagnosticArray())
            node.create_timer(0.4, lambda p=publisher: p.publish(DiagnosticArray()))
        self._commands = ros.probe.node.create_publisher(Twist, '/walker/cmd_vel', 10)
        ros.probe.node.create_timer(0.05, self._command)
        self.recorders = [
            # The counters are those of the last report: each in turn, at the usual rate.
            self.record('all', all_topics='true', judge='true', diagnostics_period=1.0),
            self.record('second', diagnostics_period=1.0),
            self.record('waiting', pre_trigger=2.0, diagnostics_period=1.0),
        ]
        clock = ('--ros-args', '-r', '__ns:=/walker', '--params-file', str(WALKER))
        simulated = (*clock, '-p', 'use_sim_time:=true')
        # Latched markers have a queue of one: a busy machine overwrites it before it is read.
        depth = 'markers.publisher.depth'
        self.solver = ros.solver(**{f'qos_overrides./{depth}': 200})
        self.walker = [
            ros.solver(*simulated, namespace='/walker', **{f'qos_overrides./walker/{depth}': 200}),
            ros.start('walker_node', *simulated),
            ros.start('sim_node', *clock, '-p', 'use_clock:=true', '-p', 'rate:=50.0'),
        ]
        self.crank = self.turn()

    def _command(self) -> None:
        # Somebody drives half a second of every two.
        if time.monotonic() % 2.0 < 0.5:
            self._commands.publish(Twist())
        # Other nodes may log nothing while they are recorded.
        if time.monotonic() % 1.0 < 0.2:
            self.ros.probe.node.get_logger().info('driving')

    def turn(self) -> Process:
        return self.ros.start('crank_node', rate=100.0, min_subscribers=4)

    def record(self, name: str, **parameters: Any) -> Process:
        judged = 'judge' in parameters or 'pre_trigger' in parameters
        limits = {'judge_limits': self.limits} if judged else {}
        named = ('--ros-args', '-r', f'__node:={name}')
        output = self.ros.folder / name
        return self.ros.start('recorder_node', *named, output=output, **limits, **parameters)

    def hear(self, count: int) -> None:
        """Wait until the recorders have received more messages of the leg, and of the walker."""
        topics = ('/joint_states', '/walker/joint_states')
        first_counts = [self.reports.count(f'{topic} received') for topic in topics]
        # The walker publishes half as often.
        for topic, first_count, share in zip(topics, first_counts, (1, 2), strict=True):
            self.reports.until_received({topic: first_count + count // share})

    def end_in_order_and_begin(self) -> None:
        assert self.crank.stop() == 0
        self.ros.probe.spin(LONG)
        self.crank = self.turn()

    def suspend(self) -> None:
        """Stop everything at once, this process too."""
        running = [p for p in self.ros._processes if p.popen.poll() is None]
        for process in running:
            process.popen.send_signal(signal.SIGSTOP)
        time.sleep(STALL)
        for process in running:
            process.popen.send_signal(signal.SIGCONT)

    def record_stopped(self, name: str, stopped: Process, others: str) -> Review:
        """Review a process that is stopped; longer where the machine held up others as long."""
        for attempt in range(1, ATTEMPTS + 1):
            held_up = attempt * MAX_HOLD_UP
            run = f'{name}_{attempt}'
            self.reports = RecorderReports(self.ros.probe)
            recorder = self.record(run, all_topics='true')
            self.hear(40)
            # No gap begins in the first 0.3 s of a topic, and this one may be discovered last.
            self.reports.until_received({'/crank_angle': 40})
            stopped.popen.send_signal(signal.SIGSTOP)
            self.ros.probe.spin(attempt * STOPPED)
            stopped.popen.send_signal(signal.SIGCONT)
            self.hear(40)
            assert recorder.stop() == 0
            with open_log(self.ros.folder / run) as log:
                times = [message.log_time for message in log.messages([others])]
                if max(np.diff(times)) < 1e9 * held_up and PAUSE_RECORD not in log.metadata:
                    break
        limits = Limits(gap_time=held_up, latency=held_up, clock_offset=60.0)
        return review_run(self.ros.folder / run, limits=limits)

    def record_two_solvers(self) -> Path:
        """Record two solvers that answer the same crank, from its first angle on."""
        assert self.crank.stop() == 0
        reports = RecorderReports(self.ros.probe)
        run = self.ros.folder / 'solvers'
        recorder = self.record('solvers', topics=f'[{", ".join(LEG)}]')
        second = self.ros.solver('--ros-args', '-r', '__node:=second')
        self.ros.probe.listen(JointState, 'joint_states', OUTPUT)
        self.ros.probe.await_publishers('joint_states', publishers=2)
        self.crank = self.ros.start('crank_node', rate=100.0, min_subscribers=3)
        reports.until_received({'/joint_states': 200})
        # Their names are those of the nodes whose parameters it has read.
        self.ros.probe.until(lambda: len(solvers_in(run)) == 2)
        assert recorder.stop() == 0
        assert second.stop() == 0
        return run

    def record_two_cranks(self) -> Path:
        """Record the crank and another one, without their solver."""
        reports = RecorderReports(self.ros.probe)
        recorder = self.record('cranks', topics='[/crank_angle]')
        named = ('--ros-args', '-r', '__node:=slow')
        self.ros.start('crank_node', *named, speed=0.3, rate=500.0, min_subscribers=1)
        # As soon as it hears both it can no longer tell what is lost.
        lost = '/crank_angle lost'
        self.ros.probe.until(lambda: reports.values.get(lost) == 'unknown')
        count = reports.count('/crank_angle received')
        reports.until_received({'/crank_angle': count + 1000})
        assert recorder.stop() == 0
        return self.ros.folder / 'cranks'


def solvers_in(run: Path) -> list[SolverParameters]:
    with open_log(run) as log:
        return log.solvers


@pytest.fixture(scope='module')
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Let one thing happen after the other; return the runs, and what the recorders printed."""
    folder = tmp_path_factory.mktemp('healthy')
    seen: dict[str, Any] = {'folder': folder}
    with own_domain() as domain, open_domain(domain, folder) as ros:
        scene = Scene(ros)
        scene.hear(100)
        seen['end'] = time.time_ns()
        scene.end_in_order_and_begin()
        scene.hear(50)
        scene.suspend()
        scene.hear(100)
        assert [recorder.stop() for recorder in scene.recorders] == [0, 0, 0]
        seen['output'] = [recorder.errors for recorder in scene.recorders]
        seen['crank'] = scene.record_stopped('crank', scene.crank, '/walker/joint_states')
        seen['solver'] = scene.record_stopped('solver', scene.solver, '/crank_angle')
        assert [node.stop() for node in scene.walker] == [0, 0, 0]
        for record in (scene.record_two_solvers, scene.record_two_cranks):
            seen[record.__name__] = review_run(record(), limits=LIMITS)
    with own_domain() as domain, open_domain(domain, folder) as ros:
        scene = Scene.__new__(Scene)
        scene.ros, scene.limits = ros, folder / 'limits.yaml'
        recorder = scene.record('replayed', judge='true')
        ros.probe.until(lambda: 'recording to' in recorder.errors)
        # The run begins before the crank does, which waits for its subscribers.
        with open_log(folder / 'all') as log:
            first = next(iter(log.messages(['/joint_states']))).log_time - log.start_time
        flags = ['--rate', '2', '--clock', '100', '--start-offset', f'{first / 1e9:.3f}']
        flags += ['--duration', '2', '--start-paused', '--topics', *LEG]
        player = ros.start('player_node', str(folder / 'all'), *flags)
        count = ros.probe.node.count_subscribers
        ros.probe.until(lambda: all(count(topic) for topic in LEG))
        ros.probe.call(Trigger, 'player_node/resume', Trigger.Request())
        assert player.wait() == 0
        assert recorder.stop() == 0
        seen['output'].append(recorder.errors)
    return seen


def faults(review: Review) -> list[tuple[str, str]]:
    return [(f.check, f.text) for f in review.findings if f.is_fault and f.check != 'geometry']


def lost_inputs(review: Review) -> list[tuple[str, str]]:
    """
    Return the findings of inputs that are not in the run, and their answers are.

    A busy machine may lose the last ones of a crank that ends, which nobody repeats.
    """
    findings = set()
    for leg in review.legs:
        asked = leg.evaluated.cranks.stamps
        answered = leg.evaluated.poses.stamps
        is_inside = (asked.min() <= answered) & (answered <= asked.max())
        count = np.count_nonzero(~np.isin(answered[is_inside], asked))
        if count:
            (topic,) = leg.recording.crank_topics
            messages = f'{counted(count, "message")} of {topic} {verb(count, "was", "were")} lost'
            answers = verb(count, 'its answer is', 'their answers are')
            findings.add(('lost', f'{messages}: {answers} in the run'))
    return sorted(findings)


def test_the_judge_reports_nothing_but_the_stalls(seen: dict[str, Any]) -> None:
    warned = [line for text in seen['output'] for line in text.splitlines() if '[WARN]' in line]
    assert [line for line in warned if 'stalled for' not in line] == []
    assert len(warned) >= 3
    assert list((seen['folder'] / 'waiting').iterdir()) == []


def test_no_run_has_a_fault_and_notes_report_the_events(seen: dict[str, Any]) -> None:
    for name, legs in (('all', LEGS), ('second', {''})):
        review = review_run(seen['folder'] / name, limits=LIMITS)
        assert faults(review) == lost_inputs(review)
        check_names = {finding.check for finding in review.findings}
        assert check_names >= {'restart', 'stall'}
        assert 'recorder_finding' not in check_names
        # It was sent long before.
        (topic,) = [topic for topic in review.topics if topic.name == '/robot_description']
        assert (topic.count, isnan(topic.latency_p50)) == (1, True)
        assert {leg.recording.title for leg in review.legs} == legs
        for leg in review.legs:
            assert len(leg.evaluated.poses) >= 200
            assert leg.figures.worst_angle_error < 1e-9
            assert leg.figures.worst_foot_error < 1e-9
            # What was asked before the recorder listened is not in the run.
            asked = leg.evaluated.cranks.stamps
            answered = leg.evaluated.poses.stamps
            is_inside = (asked.min() <= answered) & (answered <= asked.max())
            assert np.count_nonzero(is_inside) >= 200


@pytest.mark.parametrize(('name', 'silent'), [('crank', LEG), ('solver', LEG[1:])])
def test_a_node_that_stood_still_is_one_gap(
    seen: dict[str, Any], name: str, silent: tuple[str, ...]
) -> None:
    review = seen[name]
    assert checks(review) == ['gap']
    (finding,) = review.findings
    # What follows from it has the same gap; the walker has none.
    topics, _, duration = finding.text.removeprefix('nothing on ').partition(' for ')
    assert (sorted(topics.split(', ')), duration[-2:]) == (sorted(silent), ' s')
    assert 0 < finding.time < review.recording.duration - STOPPED + 0.5


def test_two_solvers_are_named(seen: dict[str, Any]) -> None:
    review = seen['record_two_solvers']
    assert checks(review) == ['solvers']
    text = review.findings[0].text
    assert text.startswith('two solvers (/second, /solver_node) answer on /joint_states: ')
    (leg,) = review.legs
    answers, asked = leg.answers.count, leg.answers.asked
    assert text.endswith(f': {answers} answers to {asked} crank angles')
    # The last questions may have been answered by one of them, or none, when the recorder stopped.
    assert 1.9 * asked <= answers <= 2 * asked


def test_two_cranks_are_named_and_not_a_clock_jump(seen: dict[str, Any]) -> None:
    review = seen['record_two_cranks']
    (topic,) = review.recording.topics
    assert len(topic.times) >= 1000
    assert (topic.lost, topic.shared) == (None, True)
    assert checks(review) == ['poses', 'jump']
    meaning = 'multiple publishers set the crank at once (/crank_angle), each with its own angle'
    assert review.findings[1].meaning == meaning


def test_a_replay_at_another_rate_has_no_fault(seen: dict[str, Any]) -> None:
    review = review_run(seen['folder'] / 'replayed', limits=LIMITS)
    assert faults(review) == []
    assert all(len(leg.evaluated.poses) >= 50 for leg in review.legs)


@pytest.mark.parametrize('with_sim_time', [False, True], ids=['wall time', 'simulated time'])
def test_a_bag_of_all_topics_by_rosbag2_has_no_fault(
    seen: dict[str, Any], tmp_path: Path, with_sim_time: bool
) -> None:
    with open_log(seen['folder'] / 'all') as log:
        messages = [m for m in log.messages() if m.log_time < seen['end']]
        stalls = map(recorded_pause, log.metadata[PAUSE_RECORD])
        stalled = sum(s.end - s.begin for s in stalls if s.begin < seen['end']) / 1e9
    # A bag has no record of the stalls of its recorder, which a loaded machine causes.
    gap_time, latency = (limit + stalled for limit in (LIMITS.gap_time, LIMITS.latency))
    limits = replace(LIMITS, gap_time=gap_time, latency=latency)
    if with_sim_time:
        messages = [*by_clock(messages)]
    review = review_run(write_jazzy_bag(tmp_path / 'bag.mcap', messages), limits=limits)
    assert faults(review) == []
    assert len(review.legs) >= 4
    names = {topic.name for topic in review.topics}
    assert names >= {'/clock', '/walker/joint_states', *([] if with_sim_time else ['/rosout'])}


def by_clock(messages: list[Message]) -> Iterator[Message]:
    """Yield the messages of the walker as they are received by simulated time."""
    now = 0
    for message in messages:
        if message.topic.name == '/clock':
            seconds, nanoseconds = struct.unpack_from('<II', message.data, 4)
            now = seconds * 10**9 + nanoseconds
        if now and (message.topic.name == '/clock' or message.topic.name.startswith('/walker/')):
            yield replace(message, log_time=now)
