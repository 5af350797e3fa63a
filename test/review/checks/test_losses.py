"""Lost messages: the recorder's count, or else the sequence numbers of one publisher."""

from dataclasses import replace
import re

from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.log.run_parameters import FAULT_RECORD, fault_record, LOSS_RECORD, TopicCount
import pytest

COUNTS = (
    '{"received": 1, "written": 1, "skipped": 0, "missed": 0, "before_discovery": 0, '
    '"departed": 0, "dropped": %s}'
)
GARBLED = [COUNTS % number for number in ('-1', '1e400', '9' * 30, '"many"')]


def lost(output: str) -> str:
    """Return the losses of the crank's topic in the table."""
    return re.search(r'^/crank_angle .* (\S+)$', output, flags=re.MULTILINE)[1]


def test_the_recorders_own_count_comes_first(healthy, printed) -> None:
    del healthy.answers[50:53]
    counted = {
        '/crank_angle': TopicCount(400, 397, dropped=3, missed=4),
        '/joint_states': TopicCount(500, 400, skipped=100),
        '/point_h': TopicCount(400, 400, missed=None),
    }
    healthy.add_counts(counted)
    output = printed(healthy, code=1)
    text = '7 messages of /crank_angle were lost (first at 0.265 s)'
    assert re.findall(r'WARNING lost: (.*)', output) == [text]
    assert re.search(r'/point_h .* \?\n', output)


FAULTS = {
    'removed': (
        TopicCount(400, 300, dropped=100),
        fault_record('', ['run_0.mcap was removed while it was recorded']),
        [
            '100 messages of /crank_angle were lost',
            (
                'the recorder had received 100 of them. Its reason: run_0.mcap was removed while '
                'it was recorded'
            ),
        ],
    ),
    'full disk': (
        TopicCount(400, 397, dropped=3, missed=4),
        fault_record('the disk is full', []),
        [
            'the recording ended early: the disk is full',
            (
                'the recorder had received 3 of them, 4 were published and did not reach the run: '
                'a short queue, or an overload. Its reason: the disk is full'
            ),
        ],
    ),
    # A stranger's text is one line of plain letters.
    'hostile': (
        TopicCount(9, 1, dropped=8),
        {'stopped': 'a\x1b[2J\nb'},
        [r'the recording ended early: a\x1b[2J b'],
    ),
}


@pytest.mark.parametrize(('counts', 'fault', 'lines'), FAULTS.values(), ids=FAULTS)
def test_a_fault_of_the_recording_is_the_reason_of_its_losses(
    healthy, printed, counts, fault, lines
) -> None:
    healthy.add_counts({'/crank_angle': counts})
    healthy.metadata.append((FAULT_RECORD, fault))
    shown = re.findall(
        r'^(?:WARNING \w+: |  +)(.*)$', printed(healthy, code=1), flags=re.MULTILINE
    )
    assert set(lines) <= set(shown)


def test_a_topic_that_is_lost_altogether_is_reported(healthy, printed) -> None:
    healthy.add_counts({'/velocity_h': TopicCount(9, 0, dropped=9)})
    output = printed(healthy, code=1)
    assert re.search(r'^/velocity_h +0( +-){4} +9$', output, flags=re.MULTILINE)
    assert 'WARNING lost: 9 messages of /velocity_h were lost' in output


@pytest.mark.parametrize('count', ['many', '-7', '', *GARBLED])
def test_an_invalid_count_is_ignored(healthy, count, printed) -> None:
    healthy.metadata.append((LOSS_RECORD, {'/crank_angle': count}))
    assert lost(printed(healthy)) == '0'


def test_messages_before_discovery_are_reported(healthy, printed) -> None:
    counted = {
        '/crank_angle': TopicCount(400, 400, before_discovery=20, departed=2),
        '/joint_states': TopicCount(400, 400, departed=1),
        '/point_h': TopicCount(400, 400, missed=None, departed=3),
    }
    healthy.add_counts(counted)
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


def test_one_step_back_is_a_publisher_that_restarted(healthy, printed) -> None:
    for n in range(100, 400):
        healthy.change(n, sequence=n - 99)
    del healthy.answers[250:254]
    # Of what it sent last before nothing is known.
    assert lost(printed(healthy, code=1)) == '4+'


def alternating(run) -> None:
    for n in range(0, 400, 2):
        run.change(n, sequence=90_000 + n)


def out_of_order(run) -> None:
    run.change(100, sequence=102)
    run.change(101, sequence=101)


def two_profiles(run) -> None:
    del run.answers[50:53]
    two = qos_to_yaml([Qos(), Qos()])
    run.crank, run.poses, run.feet = (
        replace(topic, qos=two) for topic in (run.crank, run.poses, run.feet)
    )


@pytest.mark.parametrize('change', [alternating, out_of_order, two_profiles])
def test_numbers_of_several_publishers_leave_losses_unknown(healthy, printed, change) -> None:
    change(healthy)
    assert lost(printed(healthy)) == '?'
