"""Recovery: all that is intact comes back as it was, and the rest is reported."""

import hashlib
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from types import ModuleType

from klann_ros.log.reader import open_log
from klann_ros.log.records import Message
from klann_ros.log.recover_command import default_output, main
import pytest
from rosbags.highlevel import AnyReader

CHUNK = 6
ROOT = Path(__file__).parents[2]


def digest(path):
    files = [path] if path.is_file() else sorted(path.rglob('*'))
    return [(item.name, hashlib.sha256(item.read_bytes()).hexdigest()) for item in files]


@pytest.fixture
def recovered(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Return a function that recovers a log: exit code, messages and what was printed."""

    def run(log, output=None):
        output = output or tmp_path / 'again'
        before = digest(log)
        code = main([str(log), '-o', str(output)])
        assert digest(log) == before, 'the input was changed'
        if code not in (0, 3):
            assert not output.exists()
            return code, [], capsys.readouterr().err
        with open_log(output) as found:
            assert found.complete, found.problem
            return code, list(found.messages()), capsys.readouterr().out

    return run


def test_a_sound_run_comes_back_equal(
    run_file: Path, batches: list[list[Message]], runs: ModuleType, recovered, tmp_path: Path
) -> None:
    code, messages, text = recovered(run_file.parent)
    assert (code, messages) == (0, runs.joined(batches))
    assert 'kept: 240 messages of /crank_angle' in text
    with open_log(run_file) as before, open_log(tmp_path / 'again') as after:
        assert after.attachments == before.attachments
        assert after.metadata['solver'] == before.metadata['solver']
        assert len(after.metadata['rosbag2']) == 1
        assert after.topics == before.topics


KILLED = """
import sys, time
sys.path[:0] = {paths!r}
from crank_runs import make_messages
from klann_ros.log.write.writer import RunWriter
writer = RunWriter({folder!r}, compression={compression!r})
writer.attach('geometry.yaml', 'application/yaml', b'l_ab: 0.12', 1)
for number, message in enumerate(make_messages(1_000_000)):
    writer.write(message)
    if number % 50 == 49:
        writer.flush()
        print(number + 1, flush=True)
"""


@pytest.mark.parametrize('compression', ['zstd', 'lz4', 'none'])
def test_kill_9_costs_nothing_that_was_flushed(
    compression, runs: ModuleType, recovered, tmp_path: Path
) -> None:
    run = tmp_path / 'walk'
    code = KILLED.format(
        paths=[str(ROOT), str(ROOT / 'test')], folder=str(run), compression=compression
    )
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
    assert messages == runs.make_messages(len(messages))
    with AnyReader([tmp_path / 'again']) as reader:
        assert sum(1 for _ in reader.messages()) == len(messages)


def test_a_flipped_bit_costs_its_chunk_only(
    run_file: Path, batches: list[list[Message]], runs: ModuleType, recovered, tmp_path: Path
) -> None:
    data = run_file.read_bytes()
    chunks = [span for span in runs.record_spans(data) if span[0] == CHUNK]
    for number, (_, start, end) in enumerate(chunks):
        rotten = bytearray(data)
        rotten[(start + end) // 2] ^= 0x04
        run_file.write_bytes(rotten)
        code, messages, text = recovered(run_file.parent, tmp_path / f'again{number}')
        assert code == 3
        assert messages == runs.all_but(batches, number)
        assert f'lost: walk_0.mcap at byte {start}: {end - start} bytes with 40 messages' in text


def test_the_first_chunk_of_a_killed_run_takes_no_other_with_it(
    run_file: Path, batches: list[list[Message]], runs: ModuleType, recovered
) -> None:
    data = bytearray(run_file.read_bytes())
    spans = runs.record_spans(data)
    first = next(span for span in spans if span[0] == CHUNK)
    data[first[2] - 5] ^= 0xFF
    end = next(start for opcode, start, _ in spans if opcode == 0x0F)
    run_file.write_bytes(data[:end])
    code, messages, _ = recovered(run_file.parent)
    assert code == 3
    assert messages == runs.joined(batches[1:])


@pytest.mark.parametrize('position', [-1, -8, -10, -14, -20, -30, -37, -60, -200])
def test_a_rotten_footer_or_summary_discards_nothing(
    run_file: Path, batches: list[list[Message]], runs: ModuleType, recovered, position
) -> None:
    data = bytearray(run_file.read_bytes())
    data[position] ^= 0x40
    run_file.write_bytes(data)
    code, messages, text = recovered(run_file.parent)
    assert (code, messages) == (0, runs.joined(batches))
    assert 'note: ' in text


def test_cut_anywhere_all_intact_chunks_come_back(
    run_file: Path,
    batches: list[list[Message]],
    runs: ModuleType,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    data = run_file.read_bytes()
    chunks = [span for span in runs.record_spans(data) if span[0] == CHUNK]
    bag = next(start for opcode, start, _ in reversed(runs.record_spans(data)) if opcode == 12)
    cut = tmp_path / 'cut.mcap'

    def in_name(length):
        """Whether the file ends before the name of the last metadata record, which is rosbag2."""
        return bag < length < bag + 20

    for length in range(0, len(data), 97):
        cut.write_bytes(data[:length])
        output = tmp_path / f'again{length}'
        code = main([str(cut), '-o', str(output)])
        capsys.readouterr()
        whole = sum(end <= length for _, _, end in chunks)
        inside = any(start < length < end for _, start, end in chunks)
        if code == 2:
            assert whole == 0
            assert not output.exists()
            continue
        assert code == (3 if inside else 0) or whole == 0 or in_name(length), f'cut at {length}'
        with open_log(output) as log:
            assert log.complete, log.problem
            assert list(log.messages()) == runs.joined(batches[:whole])


@pytest.mark.parametrize('where', ['in a chunk', 'between records'])
def test_a_zeroed_tail_is_reported(
    run_file: Path, batches: list[list[Message]], runs: ModuleType, recovered, where
) -> None:
    data = run_file.read_bytes()
    chunks = [span for span in runs.record_spans(data) if span[0] == CHUNK]
    start = chunks[3][1] + (60 if where == 'in a chunk' else 0)
    run_file.write_bytes(data[:start] + bytes(len(data) - start))
    code, messages, text = recovered(run_file.parent)
    assert (code, messages) == (3, runs.joined(batches[:3]))
    assert 'only zeros' in text


def test_a_missing_metadata_yaml_is_written_anew(
    run_file: Path, batches: list[list[Message]], runs: ModuleType, recovered, tmp_path: Path
) -> None:
    (run_file.parent / 'metadata.yaml').unlink()
    code, messages, _ = recovered(run_file.parent)
    assert (code, messages) == (0, runs.joined(batches))
    assert (tmp_path / 'again' / 'metadata.yaml').exists()


def test_a_rotten_attachment_is_reported_and_the_messages_are_kept(
    run_file: Path, batches: list[list[Message]], runs: ModuleType, recovered
) -> None:
    data = run_file.read_bytes()
    run_file.write_bytes(data.replace(b'l_ab: 0.12', b'l_ab: 0.13'))
    code, messages, text = recovered(run_file.parent)
    assert (code, messages) == (3, runs.joined(batches))
    assert "the CRC of the attachment 'geometry.yaml' is wrong" in text


@pytest.mark.parametrize('content', [None, b'', b'nothing of the kind'])
def test_what_is_no_log_is_exit_code_2_and_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content
) -> None:
    path = tmp_path / 'x.mcap'
    if content is not None:
        path.write_bytes(content)
    assert main([str(path), '-o', str(tmp_path / 'again')]) == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert err.count('\n') == 1
    assert not (tmp_path / 'again').exists()


def test_an_existing_output_is_refused(
    run_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'again').mkdir()
    assert main([str(run_file), '-o', str(tmp_path / 'again')]) == 1
    assert 'exists already' in capsys.readouterr().err
    assert [*(tmp_path / 'again').iterdir()] == []


def test_an_output_inside_the_log_is_refused(
    run_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = digest(run_file.parent)
    assert main([str(run_file.parent), '-o', str(run_file.parent / 'again')]) == 1
    assert 'not to be changed' in capsys.readouterr().err
    assert digest(run_file.parent) == before


def test_the_default_output_is_beside_the_log(
    run_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert default_output(run_file) == run_file.parent / 'walk_0_recovered'
    assert default_output(run_file.parent) == tmp_path / 'walk_recovered'
    monkeypatch.chdir(run_file.parent)
    assert main(['.']) == 0
    assert (tmp_path / 'walk_recovered' / 'walk_recovered_0.mcap').exists()
    assert 'written: ' in capsys.readouterr().out


def test_an_interrupt_leaves_neither_traceback_nor_output(
    run_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr('klann_ros.log.write.writer.RunWriter.write', interrupt)
    assert main([str(run_file), '-o', str(tmp_path / 'again')]) == 130
    assert 'Traceback' not in capsys.readouterr().err
    assert not (tmp_path / 'again').exists()


def test_a_full_disk_is_exit_code_1_and_leaves_no_half_run(
    run_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write = os.write

    def fill(descriptor, data):
        if len(data) > 5000:
            raise OSError(28, 'No space left on device')
        return write(descriptor, data)

    monkeypatch.setattr('klann_ros.log.write.durable_file.os.write', fill)
    assert main([str(run_file), '-o', str(tmp_path / 'again')]) == 1
    assert 'No space left' in capsys.readouterr().err
    assert not (tmp_path / 'again').exists()
