"""Behind damage whose end is not known all that is sound comes back, and nothing else."""

import struct

from crank_runs import (
    ATTACHMENT,
    BATCHES,
    CHUNK,
    HEADER,
    joined,
    killed,
    MESSAGE,
    MESSAGES,
    spans_of,
    write_mcap,
    write_run,
)
from klann_ros.log.reader import open_log
from klann_ros.log.recovery import recover
from klann_ros.log.write.writer import RunWriter
import pytest


@pytest.fixture(params=['closed', 'killed'])
def recovered(request, tmp_path):
    """Return a function that damages a run's bytes, given its chunks, and recovers it."""

    def make(change, compression):
        path = write_run(tmp_path / 'walk', BATCHES, compression=compression)
        data = path.read_bytes()
        body = bytearray(killed(data))
        file_end = data.removeprefix(body) if request.param == 'closed' else b''
        change(body, spans_of(data, CHUNK))
        path.write_bytes(body + file_end)
        return recovery_of(path.parent)

    return make


def recovery_of(run):
    """Recover a run; return the messages of the new one, and the recovery."""
    recovery = recover(run, run.with_name('again'))
    with open_log(run.with_name('again')) as log:
        assert log.complete, log.problem
        return list(log.messages()), recovery


def set_length(data, start, length):
    struct.pack_into('<Q', data, start + 1, length)


def _wrong_length(length):
    return lambda data, chunks: set_length(data, chunks[2][0], length)


def _overwrite(filling):
    def change(data, chunks):
        start, end = chunks[1][0] + 20, chunks[3][0] + 100
        data[start:end] = filling * (end - start)

    return change


def _miss(data, chunks):
    """Take bytes out of a chunk, so that it reaches over the next."""
    start, end = chunks[2]
    del data[slice(start + 100, end - 50)]


def _move(data, chunks):
    """Move a chunk into another."""
    start, end = chunks[3]
    chunk, data[start:end] = data[start:end], bytes(end - start)
    place = chunks[1][0] + 20
    data[slice(place, place + len(chunk))] = chunk
    set_length(data, chunks[1][0], 2**40)


# Each damage, and the chunks that it costs.
DAMAGES = {
    **{f'length {n}': (_wrong_length(n), [2]) for n in (0, 1, 77, 2**31, 2**50, 2**64 - 1)},
    'zeros': (_overwrite(b'\0'), [1, 2, 3]),
    'other bytes': (_overwrite(b'\xa5'), [1, 2, 3]),
    'missing bytes': (_miss, [2]),
    'a chunk moved onto another': (_move, [1]),
}


# A chunk that is not compressed is too long to lie within another.
CASES = [(damage, compression) for damage in DAMAGES for compression in ('zstd', 'lz4', 'none')]
CASES.remove(('a chunk moved onto another', 'none'))


@pytest.mark.slow
@pytest.mark.parametrize(('damage', 'compression'), CASES)
def test_damage_costs_only_the_chunks_that_it_touches(recovered, damage, compression) -> None:
    change, costs = DAMAGES[damage]
    messages, recovery = recovered(change, compression)
    kept = joined(batch for number, batch in enumerate(BATCHES) if number not in costs)
    assert sorted(messages, key=lambda message: message.log_time) == kept
    assert recovery.lost
    if 'length' in damage:
        assert len(recovery.lost) == 1
        assert '40 messages' in recovery.lost[0]


def test_a_header_of_a_wrong_length_is_lost_alone(run_file) -> None:
    data = bytearray(run_file.read_bytes())
    set_length(data, spans_of(data, HEADER)[0][0], 2**40)
    run_file.write_bytes(data)
    messages, recovery = recovery_of(run_file.parent)
    assert messages == MESSAGES
    (lost,) = recovery.lost
    assert 'the header should be' in lost


def test_a_chunk_across_the_end_of_an_attachment_is_recovered(run_file) -> None:
    data = run_file.read_bytes()
    ((_, end),) = spans_of(data, ATTACHMENT)
    last = slice(*spans_of(data, CHUNK)[5])
    # The zeros in the chunk's length are now where the attachment's CRC was: it has none.
    run_file.write_bytes(data[: end - 7] + data[last] + data[slice(end, last.start)])
    assert recovery_of(run_file.parent)[0] == MESSAGES


def test_all_record_types_behind_damage_are_recovered(tmp_path) -> None:
    with RunWriter(tmp_path / 'walk') as writer:
        for message in BATCHES[0]:
            writer.write(message)
        writer.flush()
        writer.attach('note.txt', 'text/plain', b'behind it', 1)
        writer.add_metadata('note', {'behind': 'it'})
    data = writer.file.path.read_bytes()
    body = bytearray(killed(data))
    set_length(body, spans_of(data, CHUNK)[0][0], 2**40)
    writer.file.path.write_bytes(body)
    recovery = recover(tmp_path / 'walk', tmp_path / 'again')
    assert (recovery.messages, recovery.attachments, recovery.metadata) == (0, 1, 1)


def test_a_log_in_an_attachment_is_not_read_as_messages_of_the_run(run_file, tmp_path) -> None:
    inner = run_file.read_bytes()
    with RunWriter(tmp_path / 'outer') as writer:
        for message in BATCHES[0]:
            writer.write(message)
        writer.flush()
        writer.attach('inner.mcap', 'application/mcap', inner, 1)
        for message in BATCHES[1]:
            writer.write(message)
    data = bytearray(writer.file.path.read_bytes())
    first_chunk, last_chunk = spans_of(data, CHUNK)
    data[last_chunk[1] - 5] ^= 1
    body = bytearray(killed(data))
    # The chunk before it is damaged without an end, the one behind it is rotten.
    set_length(body, first_chunk[0], 2**40)
    writer.file.path.write_bytes(body)
    recovery = recover(tmp_path / 'outer', tmp_path / 'again')
    assert (recovery.messages, recovery.attachments) == (0, 1)
    with open_log(tmp_path / 'again') as log:
        assert log.attachments[0].data == inner
    # Now the attachment's own length is wrong, and the chunk behind it sound.
    data[last_chunk[1] - 5] ^= 1
    set_length(data, spans_of(data, ATTACHMENT)[0][0], 2**40)
    set_length(data, first_chunk[0], first_chunk[1] - first_chunk[0] - 9)
    writer.file.path.write_bytes(data)
    recovery = recover(tmp_path / 'outer', tmp_path / 'third')
    assert (recovery.messages, recovery.attachments) == (len(BATCHES[0] + BATCHES[1]), 0)


def test_messages_come_back_though_their_topic_is_described_only_behind_them(tmp_path) -> None:
    """Other recorders describe a topic within each chunk: the first chunk here has lost it."""
    topic = BATCHES[0][0].topic
    path = write_mcap(tmp_path / 'log.mcap', [BATCHES[0][:3]], chunk_size=1)
    data = path.read_bytes()
    chunks = [data[slice(*span)] for span in spans_of(data, CHUNK)]
    ((_, start),) = spans_of(data, HEADER)
    path.write_bytes(data[:start] + chunks[1] + chunks[2] + chunks[0])
    recover(path, tmp_path / 'again')
    with open_log(tmp_path / 'again') as log:
        assert [item.data for item in log.messages()] == [item.data for item in BATCHES[0][:3]]
        assert {item.name for item in log.topics} == {topic.name}


@pytest.mark.parametrize('place', ['before the chunk', 'in a summary'])
def test_of_two_descriptions_that_differ_the_one_under_a_crc_counts(
    run_file, tmp_path, place
) -> None:
    """The library writes them into the chunk; another one has no CRC."""
    data = bytearray(run_file.read_bytes())
    name = b'/crank_angle'
    if place == 'in a summary':
        data[-12:-8] = bytes(4)
        data[data.rindex(name) + 7] ^= 1
    else:
        data = bytearray(killed(data))
        data[data.index(name) + 7] ^= 1
    run_file.write_bytes(data)
    recovery = recover(run_file, tmp_path / 'again')
    assert [*recovery.counts] == ['/crank_angle']
    assert any('described in 2 ways' in remark for remark in recovery.remarks)


def test_unchunked_messages_are_found_again_one_by_one(tmp_path) -> None:
    path = write_mcap(tmp_path / 'log.mcap', [MESSAGES[:100]], use_chunking=False)
    data = bytearray(path.read_bytes())
    set_length(data, spans_of(data, MESSAGE)[40][0], 2**60)
    path.write_bytes(data)
    recover(path, tmp_path / 'again')
    with open_log(tmp_path / 'again') as log:
        found = [message.sequence for message in log.messages()]
    assert found == [*range(1, 41), *range(42, 101)]
