"""Recovery: all that is intact comes back as it was, and the rest is reported."""

import errno
from pathlib import Path
import signal
import struct
import subprocess
import sys
import time

from crank_runs import (
    all_but,
    ATTACHMENT,
    BATCHES,
    CHUNK,
    joined,
    killed,
    make_messages,
    MESSAGES,
    METADATA,
    spans_of,
)
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import default_output, main
from mcap_bytes import records as mcap
import pytest
from rosbag2_bags import digest
from rosbags.highlevel import AnyReader
from run_faults import disk_error

ROOT = Path(__file__).parents[2]


@pytest.fixture
def recovered(tmp_path, capsys):
    """Return a function that recovers a log: exit code, messages and what was printed."""

    def run(log, output=None):
        output = output or tmp_path / 'again'
        first_digest = digest(log)
        code = main([str(log), '-o', str(output)])
        assert digest(log) == first_digest, 'the input was changed'
        if code not in (0, 3):
            assert not output.exists()
            return code, [], capsys.readouterr().err
        with open_log(output) as recovered_log:
            assert recovered_log.complete, recovered_log.problem
            return code, list(recovered_log.messages()), capsys.readouterr().out

    return run


def test_a_sound_run_comes_back_equal(run_file, recovered, tmp_path) -> None:
    code, messages, text = recovered(run_file.parent)
    assert (code, messages) == (0, MESSAGES)
    assert 'kept: 240 messages of /crank_angle' in text
    with open_log(run_file) as log, open_log(tmp_path / 'again') as recovered_log:
        assert recovered_log.attachments == log.attachments
        assert recovered_log.metadata['solver'] == log.metadata['solver']
        assert len(recovered_log.metadata['rosbag2']) == 1
        assert recovered_log.topics == log.topics


KILLED = """
import sys, time
sys.path[:0] = {paths!r}
from crank_runs import make_messages
from klann_ros.log.write.writer import RunWriter
writer = RunWriter({folder!r})
writer.attach('geometry.yaml', 'application/yaml', b'l_ab: 0.12', 1)
for number, message in enumerate(make_messages(50_000)):
    writer.write(message)
    if number % 50 == 49:
        writer.flush()
        print(number + 1, flush=True)
"""


def test_kill_9_costs_nothing_that_was_flushed(recovered, tmp_path) -> None:
    run = tmp_path / 'walk'
    code = KILLED.format(paths=[str(ROOT), str(ROOT / 'test' / 'support')], folder=str(run))
    with subprocess.Popen([sys.executable, '-c', code], stdout=subprocess.PIPE) as process:
        # Some flushes, then the kill falls wherever the process is.
        lines = [process.stdout.readline() for _ in range(20)]
        time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        lines += process.stdout.readlines()
    flushed = int(lines[-1])
    code, messages, text = recovered(run)
    assert code == 0, text
    assert 'not closed' in text
    assert len(messages) >= flushed
    assert messages == make_messages(len(messages))
    with AnyReader([tmp_path / 'again']) as reader:
        assert sum(1 for _ in reader.messages()) == len(messages)


def test_a_flipped_bit_costs_its_chunk_only(run_file, recovered, tmp_path) -> None:
    data = run_file.read_bytes()
    for number, (start, end) in enumerate(spans_of(data, CHUNK)):
        rotten = bytearray(data)
        rotten[(start + end) // 2] ^= 0x04
        run_file.write_bytes(rotten)
        with open_log(run_file) as log:
            assert log.complete
            assert list(log.messages()) == all_but(number)
            assert not log.complete
            assert f'at byte {start}' in log.problem
        code, messages, text = recovered(run_file.parent, tmp_path / f'again{number}')
        assert (code, messages) == (3, all_but(number))
        assert f'lost: walk_0.mcap at byte {start}: {end - start} bytes with 40 messages' in text


def test_the_first_chunk_of_a_killed_run_takes_no_other_with_it(run_file, recovered) -> None:
    data = bytearray(run_file.read_bytes())
    data[spans_of(data, CHUNK)[0][1] - 5] ^= 0xFF
    run_file.write_bytes(killed(data))
    code, messages, _ = recovered(run_file.parent)
    assert (code, messages) == (3, all_but(0))


def test_messages_that_only_the_statistics_have_are_lost(run_file, recovered) -> None:
    data = bytearray(run_file.read_bytes())
    struct.pack_into('<Q', data, spans_of(data, 0x0B)[0][0] + 9, 241)
    data[-12:-8] = bytes(4)
    run_file.write_bytes(data)
    code, messages, text = recovered(run_file.parent)
    assert (code, messages) == (3, MESSAGES)
    assert 'lost: walk_0.mcap: the statistics count 241 messages, there are 240' in text


def test_cut_anywhere_all_intact_chunks_are_read_and_come_back(run_file, tmp_path, capsys) -> None:
    data = run_file.read_bytes()
    chunks, (bag, _) = spans_of(data, CHUNK), spans_of(data, METADATA)[-1]
    ((_, attached),), cut = spans_of(data, ATTACHMENT), tmp_path / 'cut.mcap'
    in_index = spans_of(data, mcap.MESSAGE_INDEX)[0][0] + 10
    for length in (*range(0, len(data), 331), in_index):
        cut.write_bytes(data[:length])
        output = tmp_path / f'again{length}'
        code = main([str(cut), '-o', str(output)])
        capsys.readouterr()
        whole_count = sum(end <= length for _, end in chunks)
        inside = any(start < length < end for start, end in chunks)
        # Before the name of the last metadata record, which is rosbag2's.
        in_name = bag < length < bag + 20
        if length > 8:
            with open_log(cut) as log:
                assert list(log.messages()) == joined(BATCHES[:whole_count]), f'cut at {length}'
                assert not log.complete
                assert len(log.attachments) == (attached <= length)
        if code == 2:
            assert whole_count == 0
            assert not output.exists()
            continue
        assert code == (3 if inside else 0) or whole_count == 0 or in_name, f'cut at {length}'
        with open_log(output) as log:
            assert log.complete, log.problem
            assert list(log.messages()) == joined(BATCHES[:whole_count])


@pytest.mark.parametrize('where', ['in a chunk', 'between records'])
def test_a_zeroed_tail_is_reported(run_file, recovered, where) -> None:
    data = run_file.read_bytes()
    start = spans_of(data, CHUNK)[3][0] + (60 if where == 'in a chunk' else 0)
    run_file.write_bytes(data[:start] + bytes(len(data) - start))
    code, messages, text = recovered(run_file.parent)
    assert (code, messages) == (3, joined(BATCHES[:3]))
    assert 'only zeros' in text


def test_a_rotten_attachment_is_reported_and_the_messages_are_kept(run_file, recovered) -> None:
    data = run_file.read_bytes()
    run_file.write_bytes(data.replace(b'l_ab: 0.12', b'l_ab: 0.13'))
    code, messages, text = recovered(run_file.parent)
    assert (code, messages) == (3, MESSAGES)
    assert "the CRC of the attachment 'geometry.yaml' is wrong" in text


def test_the_default_output_is_beside_the_log(run_file, tmp_path, monkeypatch, capsys) -> None:
    assert default_output(run_file) == run_file.parent / 'walk_0_recovered'
    assert default_output(run_file.parent) == tmp_path / 'walk_recovered'
    monkeypatch.chdir(run_file.parent)
    assert main(['.']) == 0
    assert (tmp_path / 'walk_recovered' / 'walk_recovered_0.mcap').exists()
    assert 'written: ' in capsys.readouterr().out


def interrupt(*_):
    raise KeyboardInterrupt


# The output, a function of the writer with a fault in its place, the exit code and the reason.
FAILURES = {
    'existing output': ('existing', '', None, 1, 'exists already'),
    'output inside': ('walk/again', '', None, 1, 'not to be changed'),
    'interrupt': ('again', 'writer.RunWriter.write', interrupt, 130, 'nothing was written'),
    'full disk': ('again', 'durable_file._sync', disk_error(errno.ENOSPC), 1, 'No space left'),
}


@pytest.mark.parametrize('kind', FAILURES)
def test_a_recovery_that_fails_leaves_no_half_run(
    run_file, tmp_path, monkeypatch, capsys, kind
) -> None:
    output, place, fault, code, reason = FAILURES[kind]
    (tmp_path / 'existing').mkdir()
    first_digest = digest(run_file.parent)
    if fault is not None:
        monkeypatch.setattr(f'klann_ros.log.write.{place}', fault)
    assert main([str(run_file.parent), '-o', str(tmp_path / output)]) == code
    out, err = capsys.readouterr()
    assert (out, err.count('\n')) == ('', 1)
    assert reason in err
    assert digest(run_file.parent) == first_digest
    assert not list(tmp_path.rglob('*again*'))
    assert not [*(tmp_path / 'existing').iterdir()]
