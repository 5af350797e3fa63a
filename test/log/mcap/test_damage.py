"""Files that are no log, truncated or damaged: one kind of error, and no intact message lost."""

import struct
import tracemalloc

from crank_runs import CHUNK, DATA_END, MESSAGES, spans_of
from klann_ros.log.mcap.decompression import MIN_LIMIT
from klann_ros.log.reader import open_log
from klann_ros.log.recovery import recover
from mcap.writer import MCAP0_MAGIC
import pytest
import zstandard


def test_a_rotten_summary_costs_nothing(run_file) -> None:
    data = run_file.read_bytes()
    ((_, end),) = spans_of(data, DATA_END)
    for position in range(end, len(data), 29):
        rotten = bytearray(data)
        rotten[position] ^= 1 << position % 8
        run_file.write_bytes(rotten)
        with open_log(run_file) as log:
            assert list(log.messages()) == MESSAGES, f'byte {position}'
            assert not log.complete, f'byte {position}'
    assert recover(run_file, run_file.parent / '../again').lost == []


def chunk_record(compression, data, size, crc=0):
    name = compression.encode()
    head = struct.pack('<QQQII', 0, 0, size, crc, len(name)) + name
    content = head + struct.pack('<Q', len(data)) + data
    return struct.pack('<BQ', CHUNK, len(content)) + content


HEADER = MCAP0_MAGIC + struct.pack('<BQII', 1, 8, 0, 0)
BOMBS = {
    'a chunk that claims 2^60 bytes': chunk_record('zstd', zstandard.compress(b'abc'), 2**60),
    'a frame that claims 2^40 bytes': chunk_record(
        'zstd', b'\x28\xb5\x2f\xfd\xe0' + struct.pack('<Q', 2**40) + b'\x01\x00\x00', 2**40
    ),
    'an lz4 frame that claims 2^40 bytes': chunk_record(
        'lz4', b'\x04\x22\x4d\x18\x68\x40' + struct.pack('<Q', 2**40) + b'\x00\x00\x00\x00', 2**40
    ),
    'a chunk that unpacks to too much': chunk_record(
        'zstd', zstandard.compress(bytes(MIN_LIMIT + 2**21)), MIN_LIMIT + 2**21
    ),
    'a record of 2^63 bytes': struct.pack('<BQ', CHUNK, 2**63) + b'x',
    'a schema of 2^32 bytes': struct.pack('<BQHI', 3, 6, 1, 2**32 - 1),
    'an attachment of 2^64 bytes': struct.pack('<BQQQIIQ', 9, 32, 0, 0, 0, 0, 2**64 - 1),
    'a message index of 2^32 bytes': struct.pack('<BQHI', 7, 6, 1, 2**32 - 1),
}


@pytest.mark.parametrize('bomb', BOMBS)
def test_a_length_is_not_believed(tmp_path, bomb) -> None:
    path = tmp_path / 'x.mcap'
    path.write_bytes(HEADER + BOMBS[bomb])
    limit = 2 * MIN_LIMIT if 'unpacks' in bomb else 10 * 2**20
    tracemalloc.start()
    try:
        with open_log(path) as log:
            assert list(log.messages()) == []
            assert log.attachments == ()
            assert len(log.problems) >= 2
        assert tracemalloc.get_traced_memory()[1] < limit
    finally:
        tracemalloc.stop()


def test_an_index_that_points_out_of_the_file_is_reported(run_file) -> None:
    """Without a CRC of the summary, as other recorders leave it out, an offset may be anything."""
    data = bytearray(run_file.read_bytes())
    index, _ = spans_of(data, 0x0A)[0]
    struct.pack_into('<Q', data, index + 9, 2**64 - 1)
    data[-12:-8] = bytes(4)
    run_file.write_bytes(data)
    with open_log(run_file) as log:
        assert [item.name for item in log.attachments] == ['geometry.yaml']
        assert list(log.messages()) == MESSAGES
        assert 'the index is wrong' in log.problem
