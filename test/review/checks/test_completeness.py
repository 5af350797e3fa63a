"""Damaged logs: the container is what is wrong, and nothing is missing where it is damaged."""

import struct

from klann_ros.review.reviewing import review_run
from mcap.opcode import Opcode
from mcap_bytes.records import spans
import pytest
from review_findings import checks, moments


def of_kind(data, kind):
    """Return the place and length of the content of each record of a kind."""
    records = spans(data, 8, len(data) - 8)
    return [(begin + 9, end - begin - 9) for opcode, begin, end in records if opcode == kind]


@pytest.fixture
def chunked(healthy, make_run, write_messages):
    """Return a healthy run in many chunks, and the path of its file."""
    run = make_run(healthy)
    run = write_messages(run, write_messages.read(run), chunk_size=8192)
    (path,) = run.glob('*.mcap')
    assert len(of_kind(path.read_bytes(), Opcode.CHUNK)) > 10
    return run, path


@pytest.mark.parametrize('is_closed', [True, False])
@pytest.mark.parametrize('index', [0, 3, -1])
def test_a_rotten_chunk_is_its_own_finding_and_no_other(chunked, index, is_closed) -> None:
    run, path = chunked
    data = bytearray(path.read_bytes())
    begin, length = of_kind(data, Opcode.CHUNK)[index]
    data[begin + length // 2] ^= 4
    path.write_bytes(data if is_closed else data[:-8])
    review = review_run(run)
    assert checks(review) == ['container']
    assert 'chunk' in review.findings[0].text
    times = struct.unpack_from('<QQ', data, begin)
    assert review.recording.unrecorded == (times,)
    assert review.legs[0].recording.poses.times.size < 400


@pytest.mark.parametrize('share', [0.5, 0.7, 0.93])
def test_a_run_that_is_cut_off_is_damaged_and_nothing_else(chunked, share) -> None:
    _, path = chunked
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    assert moments(review_run(path)) == [('container', None)]


def without_summary_crc(data: bytearray) -> bytearray:
    ((footer, _),) = of_kind(data, Opcode.FOOTER)
    struct.pack_into('<I', data, footer + 16, 0)
    return data


@pytest.mark.parametrize(
    ('kind', 'index', 'number', 'problem'),
    [
        (Opcode.STATISTICS, 0, 1201, 'the statistics count 1201 messages, there are 1200'),
        # The start time of a chunk, one nanosecond later.
        (Opcode.CHUNK_INDEX, 2, None, 'the index is wrong about 1 chunk'),
    ],
)
def test_a_wrong_summary_is_found(chunked, kind, index, number, problem) -> None:
    run, path = chunked
    data = without_summary_crc(bytearray(path.read_bytes()))
    begin, _ = of_kind(data, kind)[index]
    (first,) = struct.unpack_from('<Q', data, begin)
    struct.pack_into('<Q', data, begin, number or first + 1)
    path.write_bytes(data)
    review = review_run(run)
    assert checks(review) == ['container']
    assert any(problem in text for text in (review.findings[0].text, *review.recording.problems))
