"""Lost messages: the recorder's count, or else the sequence numbers of one publisher."""

import re

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
