"""`review`: a healthy run has no finding, and each fault exactly its own."""

import math
from pathlib import Path
import re

from findings import checks, moments
from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.log.definitions import definition
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


def test_a_wrong_length_that_no_loop_knows_is_found(healthy, make_run) -> None:
    healthy.geometry = KlannGeometry(l_gh=0.4304)
    review = review_run(make_run(healthy))
    assert moments(review) == [('foot', 0.0)]
    assert review.findings[0].text.startswith('400 of 400 feet')
    assert review.findings[0].text.endswith('(by up to 0.0004 m)')


@pytest.mark.parametrize('change', [{'l_ef': 0.271}, {'l_bc': 0.3497}, {'y_e': 0.3141}])
def test_a_wrong_length_in_a_loop_is_found_once(healthy, make_run, change) -> None:
    healthy.geometry = KlannGeometry(**change)
    review = review_run(make_run(healthy))
    assert moments(review) == [('closure', 0.0)]
    assert review.findings[0].text.startswith('400 of 400 poses do not close the loops')


@pytest.mark.parametrize('assembly', [(1, -1), (-1, 1), (-1, -1)])
def test_a_flipped_branch_is_found_at_its_time(healthy, make_run, assembly) -> None:
    other = KlannLeg(KlannGeometry(assembly=assembly)).solve(healthy.answers[100].alpha)
    healthy.change(100, pose=list(other.joints), foot=other.h)
    review = review_run(make_run(healthy))
    # Both loops close, and it is the wrong pose all the same.
    assert moments(review) == [('branch', 0.5)]
    assert review.findings[0].text.startswith(
        '1 of 400 poses is in another assembly mode than the leg'
    )


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
def test_a_message_left_out_is_found_on_its_topic(healthy, make_run, without, kind) -> None:
    topic = getattr(healthy, kind).name
    run = without(make_run(healthy), lambda m: (m.topic.name, m.sequence) == (topic, 51))
    review = review_run(run)
    assert moments(review) == [('lost', 0.255)]
    assert review.findings[0].text == f'1 message of {topic} was lost'


def test_a_loss_is_no_gap_and_no_jump_as_well(healthy, make_run, without) -> None:
    run = without(make_run(healthy), lambda m: 51 <= m.sequence <= 150)
    assert moments(review_run(run)) == [('lost', 0.75)] * 3


def test_a_silence_of_the_publisher_is_one_gap(healthy, make_run) -> None:
    healthy.delay(100, 300 * MS)
    review = review_run(make_run(healthy))
    assert moments(review) == [('gap', 0.495)]
    silent = 'nothing on /crank_angle, /joint_states, /point_h for 0.305 s'
    assert review.findings[0].text == silent


def test_pictures_for_viewers_may_come_when_they_like(healthy, make_run) -> None:
    kind = 'visualization_msgs/msg/MarkerArray'
    markers = Topic('/markers', kind, definition(kind))
    start = healthy.answers[0].stamp
    times = [start + n * MS for n in (0, *range(1000, 2000, 50))]
    healthy.messages = [Message(markers, bytes(8), time, time, 0) for time in times]
    assert checks(review_run(make_run(healthy))) == []


EVENTS = [
    ('/rosout', 'rcl_interfaces/msg/Log'),
    ('/parameter_events', 'rcl_interfaces/msg/ParameterEvent'),
    ('/walker/cmd_vel', 'geometry_msgs/msg/TwistStamped'),
    ('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray'),
]


@pytest.mark.parametrize(('name', 'kind'), EVENTS)
def test_a_topic_that_comes_in_bursts_has_no_gap_and_no_latency(
    healthy, make_run, name, kind
) -> None:
    topic, start = Topic(name, kind, ''), healthy.answers[0].stamp
    times = [start + (500 * burst + n) * MS for burst in range(4) for n in range(12)]
    # The log of nodes waits for discovery; the others come at once.
    late = 300 * MS if 'rcl_interfaces' in kind else MS
    healthy.messages = [Message(topic, b'', time + late, time, 0) for time in times]
    assert checks(review_run(make_run(healthy))) == []


def restarted(healthy, make_run, lost: int | None) -> list[str]:
    """Return what is found where a crank restarts at 0 after 0.3 s."""
    del healthy.answers[100:160]
    first = healthy.answers[100].alpha
    for n in range(100, 340):
        pose = KlannLeg().solve(healthy.answers[n].alpha - first)
        healthy.change(n, sequence=n - 99, alpha=pose.alpha, pose=list(pose.joints), foot=pose.h)
    counts = {'/crank_angle': TopicCount(340, 340, missed=lost, departed=1)}
    # The solver went on, which no sequence number of these runs shows.
    counts |= dict.fromkeys(('/joint_states', '/point_h'), TopicCount(340, 340, missed=None))
    healthy.add_counts(counts)
    return checks(review_run(make_run(healthy)))


# The middleware waits for one that died for seconds: there are two, and no loss is known.
@pytest.mark.parametrize(('lost', 'found'), [(0, ['restart']), (None, ['gap', 'jump'])])
def test_a_crank_that_restarts_is_a_note_after_an_orderly_end_only(
    healthy, make_run, lost, found
) -> None:
    assert restarted(healthy, make_run, lost=lost) == found


def test_a_time_in_which_the_recorder_did_not_run_is_a_note(healthy, make_run) -> None:
    del healthy.answers[100:300]
    begin, end = healthy.answers[99].stamp, healthy.answers[100].stamp - 150 * MS
    healthy.add_pause(begin, end, 'the recorder did not run\n')
    healthy.metadata.append((LOSS_RECORD, {}))
    review = review_run(make_run(healthy))
    assert moments(review) == [('stall', 0.495)]
    assert review.findings[0].text == 'the recorder did not run'


def test_a_silence_in_a_pause_is_no_finding(healthy, make_run) -> None:
    del healthy.answers[100:300]
    begin, end = healthy.answers[99].stamp + 2 * MS, healthy.answers[100].stamp - 2 * MS
    healthy.add_pause(begin, end)
    healthy.metadata.append((LOSS_RECORD, {}))
    assert checks(review_run(make_run(healthy))) == []


def test_a_silence_behind_a_pause_is_a_gap_all_the_same(healthy, make_run) -> None:
    del healthy.answers[100:300]
    begin = healthy.answers[99].stamp + 2 * MS
    healthy.add_pause(begin, begin + 500 * MS)
    assert checks(review_run(make_run(healthy))) == ['gap']


@pytest.mark.parametrize('content', ['', '[1, 2]', 'a: 1', 'l_ab: -1.0', ': :', 'l_ab: {}'])
def test_a_geometry_file_that_holds_none_is_one_line(
    healthy, make_run, capsys, tmp_path, content
) -> None:
    file = tmp_path / 'geometry.yaml'
    file.write_text(content)
    assert main([str(make_run(healthy)), '--geometry', str(file)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f'review: {file} holds no robot: ')
    assert error.count('\n') == 1


@pytest.mark.parametrize('name', ['nothing.mcap', 'text.mcap'])
def test_what_is_no_log_is_exit_code_2(name: str, tmp_path, capsys) -> None:
    (tmp_path / 'text.mcap').write_text('no log')
    assert main([str(tmp_path / name)]) == 2
    error = capsys.readouterr().err
    assert 'is not a readable log' in error
    assert error.count('\n') == 1
