"""`review`: a healthy run has no finding, and each fault exactly its own."""

import math
from pathlib import Path
import re

from findings import checks, moments
from klann_ros.kinematics import KlannLeg
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import TopicCount
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


def test_a_foot_that_is_not_finite_is_found(healthy, make_run) -> None:
    healthy.change(7, foot=(math.nan, 0.0))
    review = review_run(make_run(healthy))
    assert moments(review) == [('nan', 0.035)]
    assert review.legs[0].figures.stride == pytest.approx(0.4910, abs=1e-4)


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
    healthy, make_run, *, name, kind, times, late
) -> None:
    topic, start = Topic(name, kind, ''), healthy.answers[0].stamp
    healthy.messages = [Message(topic, b'', start + t + late, start + t, 0) for t in times]
    assert checks(review_run(make_run(healthy))) == []


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
