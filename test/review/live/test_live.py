"""What passes is judged while it passes: each fault at most a second later, and nothing else."""

from collections import deque
from collections.abc import Iterable
from dataclasses import replace

from drive_runs import DriveRun, FEEDBACK, SOLVER, VELOCITIES
from klann_ros.kinematics import KlannLeg
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import Pause, SolverParameters
from klann_ros.review.live import LiveFinding, LiveJudge
from leg_runs import LegRun, START
import pytest

GEOMETRY = {**KlannLeg().linkage.dimensions, 'assembly': [1, 1]}
SECOND = 10**9
# Time between two judgements, and duration of the whole run [ns].
STEP, LENGTH = SECOND // 2, 2 * SECOND


def solver(time: int = START, **changed: float) -> SolverParameters:
    return SolverParameters('/solver_node', time, {**GEOMETRY, **changed})


def judged(
    messages: Iterable[Message],
    *solvers: SolverParameters,
    until: int = LENGTH,
    published: list[str] | None = None,
) -> list[tuple[float, LiveFinding]]:
    """Return the findings with their times [s], judged every half second until a time."""
    judge = LiveJudge()
    messages = deque(messages)
    solvers = deque(solvers)
    findings = []
    for now in range(START + STEP, START + until + STEP, STEP):
        while solvers and solvers[0].time <= now:
            judge.set_solver(solvers.popleft())
        while messages and messages[0].log_time <= now:
            judge.add_all([messages.popleft()])
        findings += [((now - START) / 1e9, finding) for finding in judge.findings(now, published)]
    return findings


def new(findings: list[tuple[float, LiveFinding]]) -> list[tuple[float, str]]:
    return [(time, finding.check) for time, finding in findings if finding.is_new]


def until_one_second(run: LegRun) -> list[Message]:
    return [message for message in run.messages() if message.log_time < START + SECOND]


@pytest.mark.parametrize(
    ('solvers', 'until'),
    [
        ([solver()], LENGTH - STEP),
        ([], LENGTH - STEP),
        ([solver(), solver(START + SECOND)], SECOND),
    ],
    ids=['healthy', 'unknown leg', 'same leg again'],
)
def test_nothing_is_found_where_nothing_is_wrong(solvers, until) -> None:
    assert judged(LegRun().messages(), *solvers, until=until) == []


def test_a_pose_of_another_leg_is_found_at_once() -> None:
    findings = judged(LegRun().messages(), solver(l_ab=0.121), until=SECOND)
    # It is new once, though it goes on.
    assert new(findings) == [(0.5, 'closure')]
    assert {finding.check for _, finding in findings} == {'closure'}


def test_a_leg_that_is_changed_is_found() -> None:
    changed = solver(START + SECOND, l_gh=0.44)
    findings = judged(LegRun().messages(), solver(), changed, until=SECOND)
    (text,) = (finding.text for _, finding in findings if finding.check == 'geometry')
    assert text.startswith('/solver_node changed its leg: l_gh is 0.44 m, was ')


def test_a_non_finite_foot_is_found() -> None:
    run = LegRun(garbled={150: float('nan')})
    findings = judged(run.messages(), solver(), until=3 * SECOND // 2)
    assert new(findings)[0] == (1.0, 'nan')


@pytest.mark.parametrize('published', [None, ['/joint_states', '/point_h']])
def test_a_topic_that_falls_silent_is_found_within_a_second(published: list[str] | None) -> None:
    messages = until_one_second(LegRun())
    findings = judged(messages, solver(), until=4 * SECOND, published=published)
    silences = {(time, finding.leg) for time, finding in findings if finding.is_new}
    assert silences == {(1.5, '/joint_states'), (1.5, '/point_h')}
    # It is reported still when nothing of it is in the window any more.
    assert findings[-1][0] == 4.0


def test_a_topic_whose_publisher_left_is_not_waited_for() -> None:
    messages = until_one_second(LegRun())
    assert judged(messages, solver(), until=3 * SECOND, published=[]) == []


def test_missing_answers_are_reported_while_the_crank_publishes() -> None:
    run = LegRun(count=600, turns=3.0, cranks=True, iterations=False)
    messages = until_one_second(run)
    answers = ['/joint_states', '/point_h']
    assert judged(messages, solver(), until=3 * SECOND, published=answers) == []
    for message in run.messages():
        if message.topic.name == '/crank_angle' and message.log_time >= START + SECOND:
            messages.append(message)
    findings = judged(messages, solver(), until=5 * SECOND // 2)
    assert {finding.leg for _, finding in findings if finding.check == 'gap'} == {*answers}


@pytest.mark.parametrize(
    ('run', 'silent'),
    [
        (DriveRun(idle=False), []),
        (DriveRun(uncommanded=(2.0, 3.0)), [VELOCITIES]),
        (DriveRun(silent=(2.0, 3.5)), [FEEDBACK]),
    ],
    ids=['released commands', 'commands that stop', 'feedback that stops'],
)
def test_only_commands_to_move_are_waited_for(run: DriveRun, silent: list[str]) -> None:
    findings = judged(run.received(), SOLVER, until=6 * SECOND)
    gaps = {finding.leg for _, finding in findings if finding.check == 'gap'}
    assert sorted(gaps) == silent
    assert bool(findings) == bool(silent)


def test_lost_messages_are_found_by_their_numbers() -> None:
    messages = [m for m in LegRun().messages() if not 100 <= m.sequence < 110]
    findings = judged(messages, solver(), until=SECOND)
    assert 'lost' in {finding.check for _, finding in findings}


def with_reports(*numbers: int) -> list[Message]:
    """Return a run of 4 s, and diagnostics with these sequence numbers, evenly in it."""
    topic = Topic('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', '')
    run = LegRun(count=800, turns=4.0, iterations=False)
    messages = [*run.messages()]
    for index, number in enumerate(numbers):
        time = START + 1 + index * 4 * SECOND // len(numbers)
        messages.append(Message(topic, b'', time, time, number))
    return sorted(messages, key=lambda message: message.log_time)


@pytest.mark.parametrize(
    'numbers',
    [
        [n + offset for n in range(1, 5) for offset in (0, 2, 30)],
        [*range(100, 120), 3, *range(120, 140), 4, *range(140, 160), 5],
    ],
    ids=['alike', 'one faster'],
)
def test_several_publishers_of_a_topic_lose_nothing(numbers: list[int]) -> None:
    assert judged(with_reports(*numbers), solver(), until=7 * SECOND // 2) == []


def test_the_losses_that_a_recorder_counts_are_reported_once() -> None:
    judge = LiveJudge()
    judge.add_all(with_reports(1, 2, 9)[:1])
    texts = []
    for count in (0, 2, 2, 3):
        findings = judge.findings(START + SECOND, None, {'/diagnostics': count})
        texts.append([finding.text for finding in findings])
    two_lost = '2 messages of /diagnostics were lost'
    assert texts == [[], [two_lost], [], ['1 message of /diagnostics was lost']]


def test_messages_skipped_in_a_pause_are_not_lost_but_others_are() -> None:
    topic = Topic('/other', 'std_msgs/msg/String', '')
    judge = LiveJudge()
    texts = []
    for number in range(1, 401):
        if number in (60, 160):
            judge.excuse(Pause(START, START + number, {'/other': 20}))
        if (number % 100 in range(40, 60) and number < 200) or number in (300, 301):
            continue
        judge.add_all([Message(topic, b'', START + number, START + number, number)])
        # A gap in the numbers counts a few messages later: first a review before that.
        if number in (62, 400):
            texts += [finding.text for finding in judge.findings(START + number)]
    assert texts == ['2 messages of /other were lost']


def test_a_recurring_fault_is_reported_again() -> None:
    run = LegRun(garbled={20: float('nan'), 1100: float('nan')}, count=1200, turns=6.0)
    findings = judged(run.messages(), solver(), until=6 * SECOND)
    # Poses and feet have a finding each.
    assert [time for time, check in new(findings) if check == 'nan'] == [0.5, 0.5, 6.0, 6.0]


def test_other_topics_of_any_content_give_no_finding() -> None:
    other = Topic('/other', 'std_msgs/msg/String', 'string data')
    messages = LegRun(count=300).messages()
    noise = [replace(message, topic=other, data=b'\x00') for message in messages]
    assert judged(noise, until=SECOND) == []


def test_a_window_keeps_no_more_than_it_may() -> None:
    judge = LiveJudge()
    (message, *_) = LegRun(count=2).messages()
    judge.add_all([message] * 100_000)
    assert len(judge._window) == 40_000
