"""recorder_node with judge and pre_trigger: faults are reported, and recorded as events."""

from pathlib import Path
import signal
from time import time_ns
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import (
    FINDING_RECORD,
    LOSS_RECORD,
    recorded_finding,
    SOLVER_RECORD,
    topic_counts,
)
from klann_ros.nodes.recorder import topic_watch
from klann_ros.review.reviewing import review_run
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time
from ros_domain import Domain, Process
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

RATE = 100.0
# Recorded before and after an event [s].
PRE_TRIGGER = 1.0
POST_TRIGGER = 1.5
# A busy machine may hold up the last messages of an event for as long [s].
MAX_HOLD_UP = 1.0
# Longer than a busy machine holds messages up: only what is stopped here is a gap.
LIMITS = 'gap_time: 1.5\nlatency: 3.0\n'
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Stage:
    """A crank, a solver, a recorder that waits, and all diagnostics."""

    def __init__(self, ros: Domain) -> None:
        self.ros = ros
        self.folder = ros.folder / 'runs'
        self.statuses = ros.probe.listen(DiagnosticArray, '/diagnostics')
        model = ros.probe.node.create_publisher(String, 'robot_description', LATCHED)
        model.publish(String(data='<robot name="leg"/>'))
        self.solver = ros.start('solver_node')
        limits = ros.folder / 'limits.yaml'
        limits.write_text(LIMITS)
        times = {'pre_trigger': PRE_TRIGGER, 'post_trigger': POST_TRIGGER}
        self.recorder = ros.start(
            'recorder_node', output=self.folder, judge_limits=limits, **times
        )
        self.crank: Process = self.turn()
        self.until(lambda: self.judged() is not None)
        subscribers = ros.probe.node.count_subscribers
        self.until(lambda: subscribers('joint_states') and subscribers('point_h'))

    def turn(self) -> Process:
        return self.ros.start('crank_node', rate=RATE, speed=2.0, min_subscribers=2)

    def until(self, condition: Any) -> None:
        self.ros.probe.until(condition)

    def judged(self) -> DiagnosticStatus | None:
        return self.status('judge')

    def status(self, name: str) -> DiagnosticStatus | None:
        statuses = [
            s for a in self.statuses for s in a.status if s.name == f'recorder_node: {name}'
        ]
        return statuses[-1] if statuses else None

    def is_reported(self, check: str) -> bool:
        """Return whether a finding of a kind was ever reported."""
        return any(
            value.key.endswith(' check') and value.value == check
            for array in self.statuses
            for status in array.status
            for value in status.values
        )

    def events(self) -> list[Path]:
        return sorted(self.folder.iterdir()) if self.folder.exists() else []

    def await_idle(self) -> None:
        """Wait until no event is being recorded, and nothing is found."""
        begin = time_ns()

        def is_quiet() -> bool:
            # A report may be on its way since before.
            self.statuses[:] = [array for array in self.statuses if stamp(array) > begin]
            judge, recording = self.status('judge'), self.status('recording')
            return (
                judge is not None
                and recording is not None
                and judge.message == 'nothing found'
                and recording.message == 'waiting for a trigger'
            )

        self.until(is_quiet)

    def trigger(self) -> tuple[list[Path], Trigger.Response]:
        """Ask for an event where none is under way; return those before, and the answer."""
        while True:
            self.await_idle()
            earlier_runs = self.events()
            # What it holds for `pre_trigger` begins again behind an event.
            self.ros.probe.spin(PRE_TRIGGER + 0.6)
            answer = self.call('trigger')
            events = self.events()
            self.await_idle()
            # A machine that stalled may have begun one.
            if events == [*earlier_runs, Path(answer.message)]:
                return earlier_runs, answer

    def call(self, name: str) -> Trigger.Response:
        return self.ros.probe.call(Trigger, f'recorder_node/{name}', Trigger.Request())


def stamp(array: DiagnosticArray) -> int:
    """Return when an array was published [ns since the epoch]."""
    time: int = Time.from_msg(array.header.stamp).nanoseconds
    return time


@pytest.fixture(scope='module')
def seen(module_ros: Domain) -> dict[str, Any]:
    """Let one fault come after another; return what was reported and written of each."""
    stage = Stage(module_ros)
    seen: dict[str, Any] = {'folder': stage.folder}
    earlier_runs, seen['answer'] = stage.trigger()
    seen['triggered'] = [run for run in stage.events() if run not in earlier_runs]
    for check, fault in (('geometry', longer), ('gap', stall), ('rejected', no_number)):
        count = len(stage.events())
        fault(stage)
        stage.until(lambda check=check: stage.is_reported(check))
        stage.until(lambda count=count: len(stage.events()) > count)
        if check == 'gap':
            stage.crank.popen.send_signal(signal.SIGCONT)
        stage.await_idle()
        seen[check] = stage.events()[count:]
    seen['code'] = stage.recorder.stop(signal.SIGINT)
    seen['errors'] = stage.recorder.errors
    return seen


def longer(stage: Stage) -> None:
    stage.ros.probe.set_parameters('solver_node', {'l_gh': 0.44})


def stall(stage: Stage) -> None:
    stage.crank.popen.send_signal(signal.SIGSTOP)


def no_number(stage: Stage) -> None:
    publisher = stage.ros.probe.publisher(Float64, 'crank_angle', subscribers=2)
    # The solver's subscription is best effort: a busy machine may lose a message.
    for _ in range(60):
        publisher.publish(Float64(data=float('nan')))
        stage.ros.probe.spin(0.5)
        if stage.is_reported('rejected'):
            return


def test_each_fault_is_reported_and_has_an_event_run(seen: dict[str, Any]) -> None:
    for check in ('geometry', 'gap', 'rejected'):
        checks = [recorded_finding(record).check for run in seen[check] for record in records(run)]
        assert check in checks, seen['errors']


def records(run: Path) -> list[dict[str, str]]:
    with open_log(run) as log:
        assert log.complete, log.problem
        return log.metadata[FINDING_RECORD]


def test_a_triggered_run_is_complete_before_and_after(seen: dict[str, Any]) -> None:
    # A machine that stalls may begin one of its own.
    run = Path(seen['answer'].message)
    assert seen['answer'].success
    assert run in seen['triggered']
    with open_log(run) as log:
        # A busy machine may lose messages meanwhile, which is reported as well.
        (trigger, *_) = map(recorded_finding, log.metadata[FINDING_RECORD])
        assert trigger.check == 'trigger'
        counts = topic_counts(log.metadata[LOSS_RECORD][0])
        for topic in ('/crank_angle', '/joint_states', '/point_h'):
            messages = [*log.messages([topic])]
            times = [message.log_time for message in messages]
            assert times[0] <= trigger.time - PRE_TRIGGER * 1e9
            assert times[-1] >= trigger.time + (POST_TRIGGER - MAX_HOLD_UP) * 1e9
            count = counts[topic]
            sequences = [message.sequence for message in messages]
            assert count.received == count.written == len(messages)
            missing = sequences[-1] - sequences[0] + 1 - len(sequences)
            assert missing <= (count.lost or 0)


def test_latched_messages_and_the_solver_are_in_every_run(seen: dict[str, Any]) -> None:
    runs = [run for check in ('triggered', 'geometry', 'gap', 'rejected') for run in seen[check]]
    assert len(runs) >= 4
    for run in runs:
        with open_log(run) as log:
            assert len([*log.messages(['/robot_description'])]) == 1
            assert log.metadata[SOLVER_RECORD]
            assert log.metadata['klann_ros.recorder']


def test_review_confirms_the_recorders_findings(seen: dict[str, Any]) -> None:
    # A machine that stalls may begin an event before.
    texts = []
    for run in seen['gap']:
        findings = review_run(run).findings
        texts += [finding.text for finding in findings if finding.check == 'recorder_finding']
    assert any('nothing on /' in text for text in texts)


def test_it_ends_in_order(seen: dict[str, Any]) -> None:
    assert seen['code'] == 0, seen['errors']
    assert 'Traceback' not in seen['errors']
    assert 'a callback failed' not in seen['errors']


def test_without_an_event_nothing_is_written_and_this_is_reported(ros: Domain) -> None:
    folder = ros.folder / 'runs'
    recorder = ros.start('recorder_node', output=folder, pre_trigger=5.0)
    ros.probe.until(lambda: 'waiting: a finding' in recorder.errors)
    assert recorder.stop(signal.SIGINT) == 0
    assert 'no trigger occurred; nothing was written' in recorder.errors
    assert list(folder.iterdir()) == []


def test_invalid_limits_are_refused_before_a_run_is_made(ros: Domain) -> None:
    bad = ros.folder / 'limits.yaml'
    bad.write_text('gap_tme: 3\n')
    recorder = ros.start(
        'recorder_node', output=ros.folder / 'run', judge='true', judge_limits=bad
    )
    assert recorder.wait() == 1
    assert recorder.errors.startswith('recorder_node: judge_limits: ')
    assert recorder.errors.count('\n') == 1
    assert not (ros.folder / 'run').exists()


def test_a_clock_that_is_set_forward_is_a_stall_and_a_late_thread_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # No test may set the clock of the machine.
    wall = [10.0, 10.1, 13.2, 13.3, 13.32]
    steady = [5.0, 5.1, 5.2, 5.3, 7.3]
    monkeypatch.setattr(topic_watch, 'time_ns', lambda: round(wall.pop(0) * 1e9))
    monkeypatch.setattr(topic_watch, 'steady_time', lambda: steady.pop(0))
    heartbeat = topic_watch.Heartbeat()
    stalls = [heartbeat.beat() for _ in range(4)]
    reasons = [stall and stall.reason for stall in stalls]
    late = 'the recorder stalled for 2.0 s (stopped, or suspended)'
    assert reasons == [None, 'the clock was set forward by 3.00 s', None, late]
    assert stalls[1] is not None
    assert (stalls[1].begin, stalls[1].end) == (10_100_000_000, 13_200_000_000)
