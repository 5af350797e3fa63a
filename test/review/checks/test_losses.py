"""Lost messages: what the recorder counted, or else what the numbers tell of one publisher."""

from dataclasses import replace
import re

from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.log.run_parameters import (
    FAULT_RECORD,
    fault_record,
    LOSS_RECORD,
    loss_record,
    TopicCount,
)
from klann_ros.review.command import main
import pytest

COUNTS = (
    '{"received": 1, "written": 1, "skipped": 0, "missed": 0, "before_discovery": 0, '
    '"departed": 0, "dropped": %s}'
)
GARBLED = [COUNTS % number for number in ('-1', '1e400', '9' * 30, '"many"')]


def lost(output: str) -> str:
    """Return what the table says about the crank's topic."""
    return re.search(r'^/crank_angle .* (\S+)$', output, flags=re.MULTILINE)[1]


def test_the_recorders_own_count_comes_first(healthy, printed) -> None:
    del healthy.answers[50:53]
    counted = {
        '/crank_angle': TopicCount(400, 397, dropped=3, missed=4),
        '/joint_states': TopicCount(500, 400, skipped=100),
        '/point_h': TopicCount(400, 400, missed=None),
    }
    healthy.metadata.append((LOSS_RECORD, loss_record(counted)))
    output = printed(healthy, code=1)
    said = '7 messages of /crank_angle were lost (first at 0.265 s)'
    assert re.findall(r'WARNING lost: (.*)', output) == [said]
    assert re.search(r'/point_h .* \?\n', output)


def judged(healthy, make_run, capsys, count: TopicCount, **harm: str) -> list[str]:
    """Return the findings of a run that tells of losses, and what was done to it."""
    healthy.metadata.append((LOSS_RECORD, loss_record({'/crank_angle': count})))
    healthy.metadata.append((FAULT_RECORD, harm))
    assert main([str(make_run(healthy))]) == 1
    return re.findall(r'^(?:WARNING \w+: |  +)(.*)$', capsys.readouterr().out, re.MULTILINE)


def test_what_was_taken_away_is_no_shallow_queue(healthy, make_run, capsys) -> None:
    file_fault = fault_record('', ['run_0.mcap was removed while it was recorded'])
    said = judged(healthy, make_run, capsys, TopicCount(400, 300, dropped=100), **file_fault)
    text, meaning = said[-2:]
    assert text.startswith('100 messages of /crank_angle were lost')
    assert meaning == (
        'the recorder had received 100 of them. Its reason: run_0.mcap was removed while it '
        'was recorded'
    )


def test_a_full_disk_is_told_and_what_else_was_lost(healthy, make_run, capsys) -> None:
    stopped = fault_record('the disk is full', [])
    said = judged(healthy, make_run, capsys, TopicCount(400, 397, dropped=3, missed=4), **stopped)
    assert 'the recording ended early: the disk is full' in said
    assert said[-1] == (
        'the recorder had received 3 of them, 4 were published and did not reach the run: a '
        'short queue, or an overload. Its reason: the disk is full'
    )


def test_what_a_strangers_run_says_of_itself_is_shown_in_one_line(
    healthy, make_run, capsys
) -> None:
    said = judged(healthy, make_run, capsys, TopicCount(9, 1, dropped=8), stopped='a\x1b[2J\nb')
    assert r'the recording ended early: a\x1b[2J b' in said


def test_a_topic_that_is_lost_altogether_is_told(healthy, printed) -> None:
    counted = {'/velocity_h': TopicCount(9, 0, dropped=9)}
    healthy.metadata.append((LOSS_RECORD, loss_record(counted)))
    output = printed(healthy, code=1)
    assert re.search(r'^/velocity_h +0( +-){4} +9$', output, flags=re.MULTILINE)
    assert 'WARNING lost: 9 messages of /velocity_h were lost' in output


@pytest.mark.parametrize('count', ['many', '-7', '', *GARBLED])
def test_a_garbled_count_is_no_count(healthy, count, printed) -> None:
    healthy.metadata.append((LOSS_RECORD, {'/crank_angle': count}))
    assert lost(printed(healthy)) == '0'


def test_numbers_of_two_publishers_tell_nothing(healthy, printed) -> None:
    for n in range(0, 400, 2):
        healthy.change(n, sequence=90_000 + n)
    assert lost(printed(healthy)) == '?'


def test_what_publishers_sent_before_they_were_heard_is_told(healthy, printed) -> None:
    counted = {
        '/crank_angle': TopicCount(400, 400, before_discovery=20, departed=2),
        '/joint_states': TopicCount(400, 400, departed=1),
        '/point_h': TopicCount(400, 400, missed=None, departed=3),
    }
    healthy.metadata.append((LOSS_RECORD, loss_record(counted)))
    output = printed(healthy, code=1)
    early, left = re.findall('^[A-Z]+ lost: (.*)', output, re.MULTILINE)
    of_cranks = '20 messages of /crank_angle were'
    assert early == f'{of_cranks} sent before the recorder discovered their publishers'
    assert left == '2 publishers of /crank_angle left during the run'
    shown = re.findall(r'^/\S+ .* ([0-9+?]+)$', output, re.MULTILINE)
    assert shown == ['0+', '0+', '?']
    assert '+: publishers left: losses at the end of their life cannot be detected\n' in output


def test_a_count_of_all_needs_no_explanation(healthy, printed) -> None:
    assert 'publishers left' not in printed(healthy)


def test_one_step_back_is_a_publisher_that_started_anew(healthy, printed) -> None:
    for n in range(100, 400):
        healthy.change(n, sequence=n - 99)
    del healthy.answers[250:254]
    # Of what it sent last before nothing is known.
    assert lost(printed(healthy, code=1)) == '4+'


def test_numbers_out_of_order_tell_nothing(healthy, printed) -> None:
    healthy.change(100, sequence=102)
    healthy.change(101, sequence=101)
    assert lost(printed(healthy)) == '?'


def test_profiles_of_two_publishers_tell_nothing(healthy, printed) -> None:
    del healthy.answers[50:53]
    two = qos_to_yaml([Qos(), Qos()])
    healthy.crank, healthy.poses, healthy.feet = (
        replace(topic, qos=two) for topic in (healthy.crank, healthy.poses, healthy.feet)
    )
    assert lost(printed(healthy)) == '?'
