"""What passes is judged while it passes: each fault at most a second later, and nothing else."""

from collections.abc import Iterable
from dataclasses import replace

from klann_ros.kinematics import KlannLeg
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import SolverParameters
from klann_ros.review.live import LiveFinding, LiveJudge
from leg_runs import LegRun, START
import pytest

GEOMETRY = {**KlannLeg().linkage.dimensions, 'assembly': [1, 1]}
SECOND = 10**9
# Between two judgements [s].
STEP = 0.5
# Of the whole run [ns].
LENGTH = 2 * SECOND


def solver(time: int = START, **changed: float) -> SolverParameters:
    return SolverParameters('/solver_node', time, {**GEOMETRY, **changed})


def judged(
    messages: Iterable[Message],
    *solvers: SolverParameters,
    until: int = LENGTH,
    published: list[str] | None = None,
) -> list[tuple[float, LiveFinding]]:
    """Return what is found and when [s], judged every half second until a time."""
    judge, left, later = LiveJudge(), [*messages], [*solvers]
    found, step = [], round(STEP * 1e9)
    for now in range(START + step, START + until + step, step):
        while later and later[0].time <= now:
            judge.set_solver(later.pop(0))
        judge.add_all(m for m in left if m.log_time <= now)
        left = [m for m in left if m.log_time > now]
        found += [((now - START) / 1e9, each) for each in judge.findings(now, published)]
    return found


def new(found: list[tuple[float, LiveFinding]]) -> list[tuple[float, str]]:
    return [(time, each.check) for time, each in found if each.is_new]


@pytest.mark.parametrize(
    ('solvers', 'until'),
    [
        ([solver()], LENGTH - SECOND // 2),
        ([], LENGTH - SECOND // 2),
        ([solver(), solver(START + SECOND)], SECOND),
    ],
    ids=['healthy', 'unknown leg', 'same leg again'],
)
def test_nothing_is_found_where_nothing_is_wrong(solvers, until) -> None:
    assert judged(LegRun().messages(), *solvers, until=until) == []


def test_a_pose_of_another_leg_is_found_at_once() -> None:
    found = judged(LegRun().messages(), solver(l_ab=0.121), until=SECOND)
    (first, *_) = found
    assert first[0] == 0.5
    assert {each.check for _, each in found} == {'closure'}
    # Once, though it goes on.
    assert len(new(found)) == 1


def test_a_leg_that_is_changed_is_found() -> None:
    changed = solver(START + SECOND, l_gh=0.44)
    found = judged(LegRun().messages(), solver(), changed, until=SECOND)
    (text,) = (each.text for _, each in found if each.check == 'geometry')
    assert text.startswith('/solver_node changed its leg: l_gh is 0.44 m, was ')


def test_a_non_finite_foot_is_found() -> None:
    run = LegRun(garbled={150: float('nan')})
    found = judged(run.messages(), solver(), until=3 * SECOND // 2)
    assert new(found)[0] == (1.0, 'nan')


@pytest.mark.parametrize('published', [None, ['/joint_states', '/point_h']])
def test_a_topic_that_falls_silent_is_found_within_a_second(published: list[str] | None) -> None:
    messages = [m for m in LegRun().messages() if m.log_time < START + SECOND]
    found = judged(messages, solver(), until=4 * SECOND, published=published)
    assert {(time, each.leg) for time, each in found if each.is_new} == {
        (1.5, '/joint_states'),
        (1.5, '/point_h'),
    }
    # It is reported still when nothing of it is in the window any more.
    assert found[-1][0] == 4.0


def test_a_topic_whose_publisher_left_is_not_waited_for() -> None:
    messages = [m for m in LegRun().messages() if m.log_time < START + SECOND]
    assert judged(messages, solver(), until=3 * SECOND, published=[]) == []


def turned(poses_until: float, crank_until: float) -> list[Message]:
    """Return a run of 3 s with its crank, each until a time [s]."""
    run = LegRun(count=600, turns=3.0, cranks=True, iterations=False)
    ends = {'/crank_angle': START + round(crank_until * SECOND)}
    end = START + round(poses_until * SECOND)
    return [m for m in run.messages() if m.log_time < ends.get(m.topic.name, end)]


def test_missing_answers_are_reported_while_the_crank_publishes() -> None:
    found = judged(turned(1.0, 3.0), solver(), until=5 * SECOND // 2)
    assert {each.leg for _, each in found if each.check == 'gap'} == {'/joint_states', '/point_h'}
    left_in_order = ['/joint_states', '/point_h']
    ended = judged(turned(1.0, 1.0), solver(), until=3 * SECOND, published=left_in_order)
    assert ended == []


def test_lost_messages_are_found_by_their_numbers() -> None:
    messages = [m for m in LegRun().messages() if not 100 <= m.sequence < 110]
    found = judged(messages, solver(), until=SECOND)
    assert 'lost' in {each.check for _, each in found}


def with_reports(*numbers: int) -> list[Message]:
    """Return a run of 4 s, and diagnostics with these sequence numbers, evenly in it."""
    topic = Topic('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', '')
    run = LegRun(count=800, turns=4.0, iterations=False)
    times = [START + 1 + n * 4 * SECOND // len(numbers) for n in range(len(numbers))]
    reports = [Message(topic, b'', t, t, n) for t, n in zip(times, numbers, strict=True)]
    return sorted([*run.messages(), *reports], key=lambda message: message.log_time)


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
    found = [judge.findings(START + SECOND, None, {'/diagnostics': n}) for n in (0, 2, 2, 3)]
    texts = [[each.text for each in findings] for findings in found]
    two, one = '2 messages of /diagnostics were lost', '1 message of /diagnostics was lost'
    assert texts == [[], [two], [], [one]]


def test_a_recurring_fault_is_reported_again() -> None:
    run = LegRun(garbled={20: float('nan'), 1100: float('nan')}, count=1200, turns=6.0)
    found = judged(run.messages(), solver(), until=6 * SECOND)
    # Of the poses, and of the foot.
    assert [time for time, check in new(found) if check == 'nan'] == [0.5, 0.5, 6.0, 6.0]


def test_other_topics_of_any_content_give_no_finding() -> None:
    other = Topic('/other', 'std_msgs/msg/String', 'string data')
    noise = [
        replace(message, topic=other, data=b'\x00') for message in LegRun(count=300).messages()
    ]
    assert judged(noise, until=SECOND) == []


def test_a_window_keeps_no_more_than_it_may() -> None:
    judge = LiveJudge()
    (message, *_) = LegRun(count=2).messages()
    judge.add_all([message] * 100_000)
    assert len(judge._window) == 40_000
