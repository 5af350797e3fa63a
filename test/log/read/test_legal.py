"""What the specification allows is no damage: each freedom alone, and all of them at once."""

import struct

from klann_ros.log.reader import open_log
from klann_ros.log.recovery import recover
from mcap_bytes import records as mcap
from mcap_bytes.conformance import UNKNOWN
import pytest

TIMES = range(100, 110)
SCHEMA = mcap.schema(1, 'std_msgs/msg/Empty', 'ros2msg', b'')
CHANNEL = mcap.channel(1, 1, '/a', 'cdr', {})
DEFINITIONS = SCHEMA + CHANNEL
HEADER = mcap.MAGIC + mcap.header('ros2', 'test')


def messages(times=TIMES, number=1):
    empty = b'\0\1\0\0'
    return b''.join(mcap.message(number, n, time, time, empty) for n, time in enumerate(times))


def closed(data, summary=b'', *, end=True):
    """Return a file of these records with an end, and with a summary if there is one."""
    data = HEADER + data + (mcap.data_end() if end else b'')
    return data + summary + mcap.footer(summary, len(data) if summary else 0, 0) + mcap.MAGIC


ALL, SPAN = DEFINITIONS + messages(), (TIMES[0], TIMES[-1])
STATISTICS = mcap.statistics((10, 1, 1, 0, 0, 0), SPAN, {})
SOUND = {
    'no end of the data': closed(ALL, end=False),
    'no end of the data, but a summary': closed(ALL, DEFINITIONS + STATISTICS, end=False),
    'an empty chunk': closed(mcap.chunk(b'') + mcap.chunk(ALL, SPAN)),
    'a chunk without messages': closed(mcap.chunk(DEFINITIONS) + mcap.chunk(messages(), SPAN)),
    'definitions again and again': closed(DEFINITIONS * 5 + messages() + DEFINITIONS),
    'the same topic on several channels': closed(
        ALL + mcap.channel(2, 1, '/a', 'cdr', {}), DEFINITIONS
    ),
    'the highest channel and schema': closed(
        mcap.schema(65535, 'a/msg/B', 'ros2msg', b'')
        + mcap.channel(65535, 65535, '/a', 'cdr', {})
        + messages(number=65535)
    ),
    'channel 0 without a schema': closed(mcap.channel(0, 0, '/a', 'cdr', {}) + messages(number=0)),
    'a schema with the number 0': closed(
        mcap.schema(0, 'a', 'ros2msg', b'\xff') + mcap.schema(0, 'b', 'ros2msg', b'') + ALL
    ),
    'times out of order': closed(DEFINITIONS + messages([5, 3, 9, 0, 1, 2, 8, 4, 7, 6])),
    'the first and the last time': closed(DEFINITIONS + messages([0] * 5 + [2**64 - 1] * 5)),
    'a private record that holds a log': closed(mcap.record(0x90, closed(ALL)) + ALL),
    'a private record that holds chunks': closed(mcap.record(0x90, mcap.chunk(ALL) * 3) + ALL),
    'every unknown kind': closed(
        b''.join(mcap.record(opcode, bytes([opcode]) * 40) for opcode in UNKNOWN) + ALL
    ),
}


# More than a record of most kinds may have.
MUCH = bytes(65 * 2**20)
LARGE = {
    'a large private record': lambda: closed(mcap.record(0x80, MUCH) + ALL),
    'a small record with much behind it': lambda: closed(mcap.metadata('m', {}, pad=MUCH) + ALL),
}


@pytest.mark.parametrize('freedom', [*SOUND, *LARGE])
def test_each_freedom_is_taken(tmp_path, freedom) -> None:
    path = tmp_path / 'x.mcap'
    path.write_bytes(SOUND[freedom] if freedom in SOUND else LARGE[freedom]())
    with open_log(path) as log:
        assert len(list(log.messages())) == 10
        assert sum(map(len, log.blocks())) == 10
        assert {topic.name for topic in log.topics} == {'/a'}
        assert log.problems == ()
    recovery = recover(path, tmp_path / 'again')
    assert (recovery.messages, recovery.lost) == (10, [])


@pytest.mark.parametrize('content', [b'', mcap.record(0x80, b'x'), mcap.chunk(b''), DEFINITIONS])
def test_a_log_without_messages_is_sound(tmp_path, content) -> None:
    path = tmp_path / 'x.mcap'
    path.write_bytes(closed(content))
    with open_log(path) as log:
        assert list(log.messages()) == []
        assert log.problems == ()
    assert recover(path, tmp_path / 'again').lost == []


def test_records_of_unknown_kinds_are_reported_to_be_left_out(tmp_path) -> None:
    path = tmp_path / 'x.mcap'
    inner = ALL + mcap.record(0x81, b'y') * 2
    path.write_bytes(closed(mcap.record(0x80, b'x') + mcap.chunk(inner, SPAN)))
    (remark,) = recover(path, tmp_path / 'again').remarks
    assert '3 records of kinds that are private' in remark


def test_an_extended_footer_is_refused(tmp_path) -> None:
    """The specification says that the footer and the end of the data are never extended."""
    data = closed(ALL)
    footer = mcap.record(mcap.FOOTER, struct.pack('<QQI', 0, 0, 0) + b'more')
    path = tmp_path / 'x.mcap'
    path.write_bytes(data[: -mcap.FOOTER_SIZE - 8] + footer + mcap.MAGIC)
    with open_log(path) as log:
        assert 'not closed' in log.problem
        assert len(list(log.messages())) == 10
