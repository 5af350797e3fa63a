"""`review`: a healthy run has no finding, and each fault exactly its own."""

import math
from pathlib import Path
import re

from findings import checks, moments
from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import LOSS_RECORD, TopicCount
from klann_ros.review.command import main
from klann_ros.review.reviewing import review_run
import pytest

ROOT = Path(__file__).resolve().parents[2]
MS = 1_000_000


def test_a_healthy_run_has_no_finding(healthy, printed) -> None:
    output = printed(healthy)
    assert output.endswith('nothing found: every pose is the right one for its crank angle\n')
    assert re.search(r'turns of the crank +2\.000', output)
    assert re.search(r'stride +0\.4910 m', output)
    assert re.search(r'lift +0\.3001 m', output)
    assert re.search(r'worst transmission angle +23\.8\d deg', output)
    assert re.search(r'/joint_states +400 +200\.0 +5\.0 +0\.20 +0\.20 +0', output)
    worst = float(re.search(r'worst angle, solved again +(\S+)', output)[1])
    assert 0 < worst < 1e-13


def test_a_healthy_patent_leg_has_no_finding(make_script, make_run) -> None:
    assert checks(review_run(make_run(make_script(KlannGeometry.patent())))) == []


@pytest.mark.parametrize('count', [0, 1, 2])
def test_a_run_of_a_few_messages_is_reviewed(healthy, make_run, count) -> None:
    del healthy.answers[count:]
    assert checks(review_run(make_run(healthy))) == ([] if count else ['poses'])


@pytest.mark.parametrize(
    ('change', 'text'),
    [
        ({'l_gh': 0.4304}, 'foot 0.0: 400 of 400 feet '),
        ({'l_ef': 0.271}, 'closure 0.0: 400 of 400 poses do not close the loops'),
        ({'l_bc': 0.3497}, 'closure 0.0: 400 of 400 poses do not close the loops'),
        ({'y_e': 0.3141}, 'closure 0.0: 400 of 400 poses do not close the loops'),
    ],
)
def test_a_wrong_length_is_found_once(healthy, finds, change, text) -> None:
    healthy.geometry = KlannGeometry(**change)
    (line,) = finds(healthy)
    assert line.startswith(text)
    assert line.endswith('(by up to 0.0004 m)') == ('l_gh' in change)


@pytest.mark.parametrize('assembly', [(1, -1), (-1, 1), (-1, -1)])
def test_a_flipped_branch_is_found_at_its_time(healthy, finds, assembly) -> None:
    other = KlannLeg(KlannGeometry(assembly=assembly)).solve(healthy.answers[100].alpha)
    healthy.change(100, pose=list(other.joints), foot=other.h)
    # Both loops close, and it is the wrong pose all the same.
    (line,) = finds(healthy)
    assert line.startswith('branch 0.5: 1 of 400 poses is in another assembly mode than the leg')


@pytest.mark.parametrize('place', range(5))
@pytest.mark.parametrize('value', [math.nan, math.inf])
def test_an_angle_that_is_not_finite_is_found(healthy, make_run, place, value) -> None:
    healthy.answers[7].pose[place] = value
    assert moments(review_run(make_run(healthy))) == [('nan', 0.035)]


def test_a_foot_that_is_not_finite_is_found(healthy, make_run) -> None:
    healthy.change(7, foot=(math.nan, 0.0))
    review = review_run(make_run(healthy))
    assert moments(review) == [('nan', 0.035)]
    assert review.legs[0].figures.stride == pytest.approx(0.4910, abs=1e-4)


@pytest.mark.parametrize('kind', ['crank', 'poses', 'feet'])
def test_a_message_left_out_is_found_on_its_topic(healthy, make_run, without, finds, kind) -> None:
    topic = getattr(healthy, kind).name
    run = without(make_run(healthy), lambda m: (m.topic.name, m.sequence) == (topic, 51))
    assert finds(run) == [f'lost 0.255: 1 message of {topic} was lost']


def test_a_loss_is_not_also_a_gap_or_a_jump(healthy, make_run, without) -> None:
    run = without(make_run(healthy), lambda m: 51 <= m.sequence <= 150)
    assert moments(review_run(run)) == [('lost', 0.75)] * 3


def test_a_silence_of_the_publisher_is_one_gap(healthy, finds) -> None:
    healthy.delay(100, 300 * MS)
    topics = '/crank_angle, /joint_states, /point_h'
    assert finds(healthy) == [f'gap 0.495: nothing on {topics} for 0.305 s']


BURSTS = [(500 * burst + n) * MS for burst in range(4) for n in range(12)]
# The name and type of a topic, its times, and its latency: the log of nodes waits for discovery.
EVENTS = [
    (
        '/markers',
        'visualization_msgs/msg/MarkerArray',
        [0, *range(1000 * MS, 2000 * MS, 50 * MS)],
        0,
    ),
    ('/rosout', 'rcl_interfaces/msg/Log', BURSTS, 300 * MS),
    ('/parameter_events', 'rcl_interfaces/msg/ParameterEvent', BURSTS, 300 * MS),
    ('/walker/cmd_vel', 'geometry_msgs/msg/TwistStamped', BURSTS, MS),
    ('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', BURSTS, MS),
]


@pytest.mark.parametrize(('name', 'kind', 'times', 'late'), EVENTS)
def test_a_topic_of_events_has_no_gap_and_no_latency(
    healthy, finds, *, name, kind, times, late
) -> None:
    topic, start = Topic(name, kind, ''), healthy.answers[0].stamp
    healthy.messages = [Message(topic, b'', start + t + late, start + t, 0) for t in times]
    assert finds(healthy) == []


# The middleware waits for one that died for seconds: there are two, and no loss is known.
@pytest.mark.parametrize(('lost', 'found'), [(0, ['restart']), (None, ['gap', 'jump'])])
def test_a_crank_that_restarts_is_a_note_after_an_orderly_end_only(
    healthy, make_run, lost, found
) -> None:
    del healthy.answers[100:160]
    first = healthy.answers[100].alpha
    for n in range(100, 340):
        pose = KlannLeg().solve(healthy.answers[n].alpha - first)
        healthy.change(n, sequence=n - 99, alpha=pose.alpha, pose=list(pose.joints), foot=pose.h)
    counts = {'/crank_angle': TopicCount(340, 340, missed=lost, departed=1)}
    # The solver went on, which no sequence number of these runs shows.
    counts |= dict.fromkeys(('/joint_states', '/point_h'), TopicCount(340, 340, missed=None))
    healthy.add_counts(counts)
    assert checks(review_run(make_run(healthy))) == found


# Begin and end of a pause from the messages before and after a silence, its reason, and findings.
PAUSES = {
    'a stall': (
        0,
        -150 * MS,
        'the recorder did not run\n',
        ['stall 0.495: the recorder did not run'],
    ),
    'a pause': (2 * MS, -2 * MS, '', []),
    'too short': (
        2 * MS,
        -503 * MS,
        '',
        ['gap 0.495: nothing on /crank_angle, /joint_states, /point_h for 1.005 s'],
    ),
}


@pytest.mark.parametrize(('begin', 'end', 'reason', 'lines'), PAUSES.values(), ids=PAUSES)
def test_a_silence_is_a_gap_a_note_in_a_stall_and_nothing_in_a_pause(
    healthy, finds, *, begin, end, reason, lines
) -> None:
    del healthy.answers[100:300]
    before, after = (answer.stamp for answer in healthy.answers[99:101])
    healthy.add_pause(before + begin, after + end, *filter(None, [reason]))
    if end > -500 * MS:
        healthy.metadata.append((LOSS_RECORD, {}))
    assert finds(healthy) == lines


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        (['nothing.mcap'], 'nothing.mcap is not a readable log'),
        (['text.mcap'], 'text.mcap is not a readable log'),
        (['nothing.mcap', '--geometry', 'text.mcap'], 'text.mcap holds no robot: '),
    ],
)
def test_an_unreadable_input_is_exit_code_2(
    arguments, reason, tmp_path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    Path('text.mcap').write_text('no log')
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith(f'review: {reason}')
    assert error.count('\n') == 1
