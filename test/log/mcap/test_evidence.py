"""
Legal and damaged records can look alike; the evidence for each is weighed.

The length of a chunk that reaches exactly to the end of the next may be a flipped bit, or the next
be unknown fields; an unknown kind may be private, or a flipped bit as well.
"""

import struct
import zlib

from crank_runs import (
    all_but,
    BATCHES,
    killed,
    MESSAGES,
    NO_INDEX,
    spans_of,
    write_mcap,
    write_run,
)
from klann_ros.log.reader import open_log
from klann_ros.log.recovery import recover
from mcap_bytes import records as mcap
from mcap_bytes.conformance import CHUNKS, conformance_file, content_of, FLAGS, PAD, PADDING
import pytest

ENDS = ['closed', 'killed', 'without an index']


@pytest.fixture(params=ENDS)
def end(request):
    return request.param


@pytest.fixture
def sound(end, tmp_path):
    """Return a file of six chunks, with an end or without, and its chunks."""
    path = tmp_path / 'walk' / 'walk_0.mcap'
    if end == 'without an index':
        path.parent.mkdir()
        write_mcap(path, BATCHES, chunk_size=2**30, **NO_INDEX)
    else:
        write_run(path.parent, BATCHES, attachment=False)
    data = path.read_bytes()
    chunks = spans_of(data, mcap.CHUNK)
    if end == 'killed':
        path.write_bytes(killed(data))
    return path, bytearray(path.read_bytes()), chunks


def read(path):
    """Return the messages of a file and of its recovery, the problems, and the recovery."""
    recovery = recover(path, path.parent.with_name('again'))
    with open_log(path) as log:
        sum(map(len, log.blocks()))
        messages, problems = list(log.messages()), ' '.join(log.problems)
    with open_log(path.parent.with_name('again')) as log:
        recovered_messages = list(log.messages())
    return messages, recovered_messages, problems, recovery


def test_a_chunk_with_an_overlong_size_loses_no_other_chunk(sound, end) -> None:
    path, data, chunks = sound
    start, last = chunks[2][0], chunks[3][1]
    struct.pack_into('<Q', data, start + 1, last - start - 9)
    path.write_bytes(data)
    _, kept, problems, recovery = read(path)
    if end == 'without an index':
        # By the letter the file is sound, and the next chunk none: the recovery remarks it.
        assert kept == all_but(3)
        assert problems == ''
        assert 'looks like records' in ' '.join(recovery.remarks)
        return
    assert kept == MESSAGES
    assert 'the length of the chunk is damaged, its content is intact' in problems
    assert recovery.lost == []


@pytest.mark.parametrize('opcode', [0x10, 0x7F, 0x86, 0xFF])
def test_a_chunk_with_an_unknown_opcode_is_reported_missing(sound, opcode) -> None:
    path, data, chunks = sound
    data[chunks[2][0]] = opcode
    path.write_bytes(data)
    _, kept, problems, recovery = read(path)
    assert kept == all_but(2)
    assert f'record of unknown kind {opcode} is a chunk' in problems
    assert len(recovery.lost) == 1


def test_a_chunk_with_fields_behind_it_is_whole_though_damage_follows(tmp_path, end) -> None:
    flags = {CHUNKS, PAD} if end == 'without an index' else {*FLAGS}
    data = conformance_file(content_of(MESSAGES), flags, pad_inner=PADDING, chunks=6)
    _, behind = spans_of(data, mcap.CHUNK)[2]
    data = bytearray(killed(data) if end == 'killed' else data)
    data[slice(behind, behind + 9)] = b'\xff' * 9
    path = tmp_path / 'walk' / 'walk_0.mcap'
    path.parent.mkdir()
    path.write_bytes(data)
    _, kept, _, recovery = read(path)
    # What follows is the index of the chunk, or else the next one.
    intact = all_but(3) if end == 'without an index' else MESSAGES
    assert [message.sequence for message in kept] == [message.sequence for message in intact]
    assert recovery.lost


@pytest.mark.parametrize('first', [3, 9, 17, 29])
def test_zeros_over_the_head_of_a_chunk_make_it_no_empty_one(sound, first) -> None:
    path, data, chunks = sound
    start = chunks[2][0]
    data[slice(start + first, start + 80)] = bytes(80 - first)
    path.write_bytes(data)
    _, kept, problems, recovery = read(path)
    assert kept == all_but(2)
    assert problems
    assert recovery.lost


def test_a_rotten_attachment_with_fields_behind_it_is_reported(tmp_path) -> None:
    path = tmp_path / 'x.mcap'
    sound = conformance_file(content_of(BATCHES[0]), {*FLAGS})
    path.write_bytes(sound)
    assert recover(path, tmp_path / 'sound').attachments == 1
    path.write_bytes(sound.replace(b'l_ab: 0.12', b'l_ab: 0.13'))
    recovery = recover(path, tmp_path / 'again')
    assert recovery.attachments == 0
    assert 'the CRC of the attachment' in recovery.lost[0]


def test_metadata_with_a_truncated_map_is_refused(tmp_path) -> None:
    entry = mcap.text('key') + mcap.text('value')
    cut = mcap.text('name') + struct.pack('<I', len(entry) - 3) + entry
    path = tmp_path / 'x.mcap'
    path.write_bytes(mcap.MAGIC + mcap.header() + mcap.record(mcap.METADATA, cut))
    with open_log(path) as log:
        assert log.metadata == {}
        assert any('metadata cannot be understood' in problem for problem in log.problems)


def test_the_same_channel_with_and_without_unknown_fields_is_one(tmp_path) -> None:
    plain = mcap.channel(1, 0, '/a', '', {})
    longer = mcap.channel(1, 0, '/a', '', {}, pad=b'\1\xff\xff')
    item = mcap.message(1, 1, 1, 1, b'')
    path = tmp_path / 'x.mcap'
    data = mcap.MAGIC + mcap.header() + mcap.chunk(plain + item, (1, 1)) + longer + mcap.data_end()
    path.write_bytes(data + longer + mcap.footer(longer, len(data), 0) + mcap.MAGIC)
    with open_log(path) as log:
        assert len(log.topics) == 1
        assert log.problems == ()


@pytest.mark.parametrize('chunked', [True, False])
def test_the_data_crc_covers_records_without_their_own(tmp_path, chunked) -> None:
    items = mcap.channel(1, 0, '/a', '', {}) + mcap.message(1, 1, 1, 1, b'content')
    data = mcap.MAGIC + mcap.header() + (mcap.chunk(items, (1, 1), crc=0) if chunked else items)
    end = mcap.data_end(zlib.crc32(data)) + mcap.footer(b'', 0, 0) + mcap.MAGIC
    path = tmp_path / 'x.mcap'
    path.write_bytes(data + end)
    recovery = recover(path, tmp_path / 'sound')
    assert (recovery.messages, recovery.lost, recovery.remarks) == (1, [], [])
    path.write_bytes(data.replace(b'content', b'kontent') + end)
    recovery = recover(path, tmp_path / 'changed')
    assert (recovery.messages, recovery.lost) == (1, [])
    assert any('the CRC of the data' in remark for remark in recovery.remarks)
    assert any('1 message has no CRC' in remark for remark in recovery.remarks)
    with open_log(path) as log:
        assert 'something in it was changed' in log.problem


def test_an_index_whose_length_is_wrong_is_not_taken_for_one_that_was_cut_off(tmp_path) -> None:
    path = write_run(tmp_path / 'walk', BATCHES, attachment=False)
    data = bytearray(path.read_bytes())
    start, end = spans_of(data, mcap.MESSAGE_INDEX)[0]
    struct.pack_into('<Q', data, start + 1, 2**40)
    path.write_bytes(data[:end] + bytes(len(data) - end))
    recovery = recover(path, tmp_path / 'again')
    assert recovery.messages == len(BATCHES[0])
    assert len(recovery.lost) == 1
