"""The writer: what is on the disk when, and what it refuses."""

from dataclasses import replace
import errno
import os
from pathlib import Path
import subprocess
import sys
import textwrap
import tracemalloc

from crank_runs import make_messages
from klann_ros.log.errors import MalformedQosError, RunClosedError, RunExistsError, UnwritableError
from klann_ros.log.reader import open_log
from klann_ros.log.write.writer import RunWriter
from mcap.reader import make_reader
import pytest
from run_faults import disk_error, information

ROOT = Path(__file__).parents[3]


def test_header_and_metadata_yaml_are_on_the_disk_at_once(tmp_path) -> None:
    writer = RunWriter(tmp_path / 'deep' / 'run')
    try:
        assert writer.path == tmp_path / 'deep' / 'run'
        assert writer.file.path.stat().st_size > 8
        assert information(writer.path)['relative_file_paths'] == ['run_0.mcap']
    finally:
        writer.close()


THINGS = {
    'folder': Path.mkdir,
    'file': Path.touch,
    'pipe': os.mkfifo,
    'loop': lambda path: path.symlink_to(path),
    'link to nothing': lambda path: path.symlink_to('nothing'),
}
NO_FOLDER = 'it is no folder, so no run can be made in it|Too many levels of symbolic links'


@pytest.mark.parametrize(
    ('kind', 'run', 'error', 'reason'),
    [
        *((kind, 'x', RunExistsError, 'exists already, not overwriting') for kind in THINGS),
        *((kind, 'x/deep/run', OSError, NO_FOLDER) for kind in THINGS if kind != 'folder'),
        ('file', 'x' * 250, OSError, 'File name too long'),
    ],
)
def test_a_path_that_cannot_be_a_run_is_refused_and_left_as_it_is(
    tmp_path, kind, run, error, reason
) -> None:
    THINGS[kind](tmp_path / 'x')
    status = (tmp_path / 'x').lstat()
    with pytest.raises(error, match=reason):
        RunWriter(tmp_path / run)
    assert (tmp_path / 'x').lstat() == status
    assert [*tmp_path.rglob('*')] == [tmp_path / 'x']


def test_an_unknown_compression_is_refused_before_anything_is_made(tmp_path) -> None:
    with pytest.raises(UnwritableError, match="'zip', not one of"):
        RunWriter(tmp_path / 'run', compression='zip')
    assert not (tmp_path / 'run').exists()


def test_close_twice_is_fine_and_closed_runs_take_nothing(tmp_path) -> None:
    writer = RunWriter(tmp_path / 'run')
    writer.close()
    writer.close()
    assert writer.closed
    with pytest.raises(RunClosedError, match='is closed'):
        writer.write(make_messages(1)[0])
    with pytest.raises(RunClosedError):
        writer.flush()


def test_a_run_without_messages_is_whole(tmp_path) -> None:
    with RunWriter(tmp_path / 'run'):
        pass
    with open_log(tmp_path / 'run') as log:
        assert log.complete, log.problem
        assert list(log.messages()) == []


def test_an_exception_in_the_block_passes_and_the_run_is_finished(tmp_path) -> None:
    with pytest.raises(KeyError, match='mine'), RunWriter(tmp_path / 'run') as writer:
        writer.write(make_messages(1)[0])
        raise KeyError('mine')
    with open_log(tmp_path / 'run') as log:
        assert log.complete
        assert len(list(log.messages())) == 1


@pytest.mark.parametrize('times', [(-1, 0), (0, -1), (2**64, 0), (0, 2**64)])
def test_a_time_that_does_not_fit_is_refused_and_harms_nothing(tmp_path, times) -> None:
    first, second = make_messages(2)
    with RunWriter(tmp_path / 'run') as writer:
        writer.write(first)
        with pytest.raises(UnwritableError, match='must be within'):
            writer.write(replace(second, log_time=times[0], publish_time=times[1]))
        with pytest.raises(UnwritableError, match='must be within'):
            writer.attach('x', 'y', b'', -1)
        writer.write(second)
    with open_log(tmp_path / 'run') as log:
        assert list(log.messages()) == [first, second]


def test_a_malformed_qos_is_refused_and_numbers_become_words(tmp_path) -> None:
    (message,) = make_messages(1)
    # Until Iron policies were numbers of rmw.
    numbered = message.topic.qos.replace('keep_last', '1').replace('volatile', '2')
    with RunWriter(tmp_path / 'run') as writer:
        bad = replace(message.topic, qos='history: 1')
        with pytest.raises(MalformedQosError):
            writer.write(replace(message, topic=bad))
        writer.write(replace(message, topic=replace(message.topic, qos=numbered)))
    with open_log(tmp_path / 'run') as log:
        assert list(log.messages()) == [message]


def test_a_sequence_number_keeps_its_lower_32_bits(tmp_path) -> None:
    with RunWriter(tmp_path / 'run') as writer:
        writer.write(replace(make_messages(1)[0], sequence=2**32 + 7))
    with open_log(tmp_path / 'run') as log:
        assert next(log.messages()).sequence == 7


def test_a_long_run_indexes_all_chunks_and_remembers_little_of_each(tmp_path) -> None:
    count = 5000
    with RunWriter(tmp_path / 'run', chunk_size=1, compression='none') as writer:
        messages = make_messages(count)
        tracemalloc.start()
        for number, message in enumerate(messages, 1):
            writer.write(message)
            if number % 500 == 0:
                writer.flush()
        memory, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    # Blocks that are still to be compressed, and the index of each chunk [bytes].
    assert memory < 150_000 + 80 * count
    with writer.file.path.open('rb') as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    offsets = [index.chunk_start_offset for index in summary.chunk_indexes]
    assert len({*offsets}) == count
    assert offsets == sorted(offsets)


def test_flushed_messages_are_in_the_file(tmp_path) -> None:
    writer = RunWriter(tmp_path / 'run')
    for message in make_messages(10):
        writer.write(message)
    writer.flush()
    with open_log(tmp_path / 'run') as log:
        assert not log.complete
        assert len(list(log.messages())) == 10
    writer.close()


def test_only_synced_messages_count_as_written_when_a_sync_fails(tmp_path, monkeypatch) -> None:
    writer = RunWriter(tmp_path / 'run')
    for count in (10, 7):
        for message in make_messages(count):
            writer.write(message)
        if count == 10:
            writer.flush()
            monkeypatch.setattr('klann_ros.log.write.durable_file._sync', disk_error(errno.EIO))
    with pytest.raises(OSError, match='Input/output error'):
        writer.flush()
    assert writer.counts == {'/crank_angle': 10}
    with pytest.raises(OSError, match='Input/output error'):
        writer.close()


FULL = """
import os, resource, signal, sys
sys.path[:0] = {paths!r}
from crank_runs import make_messages
from klann_ros.log.write.writer import RunWriter
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
writer = RunWriter({folder!r}, compression='none')
messages = make_messages(5000)
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
flushed = 0
error = None
try:
    for number, message in enumerate(messages):
        writer.write(message)
        if number % 100 == 99:
            writer.flush()
            flushed = number + 1
except OSError as problem:
    error = problem
for ask in (lambda: writer.write(messages[0]), writer.flush, writer.close):
    try:
        ask()
    except OSError as again:
        assert again is error, repr(again)
    else:
        raise AssertionError('silent')
writer.close()
print(flushed, error.errno)
"""


@pytest.mark.parametrize('limit', [20_000, 55_555, 100_001])
def test_a_full_disk_is_an_os_error_and_loses_only_unflushed_data(tmp_path, limit) -> None:
    code = textwrap.dedent(FULL).format(
        paths=[str(ROOT), str(ROOT / 'test' / 'support')],
        folder=str(tmp_path / 'run'),
        limit=limit,
    )
    done = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=False
    )
    assert done.stderr == ''
    flushed = int(done.stdout.split()[0])
    assert flushed > 100
    with open_log(tmp_path / 'run') as log:
        assert len(list(log.messages())) == flushed
        # The half record was cut off, so the only thing wrong is the missing footer.
        assert (tmp_path / 'run' / 'run_0.mcap').stat().st_size < limit
        assert len(log.problems) == 1
        assert 'not closed' in log.problem


def test_a_disk_that_is_full_from_the_start_leaves_nothing(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(os, 'write', disk_error(errno.ENOSPC))
    with pytest.raises(OSError, match='No space left'):
        RunWriter(tmp_path / 'run')
    assert not (tmp_path / 'run').exists()


@pytest.mark.parametrize('fails', [True, False])
def test_a_full_disk_leaves_the_with_block_with_the_error_in_it(
    tmp_path, monkeypatch, fails
) -> None:
    full = pytest.raises(OSError, match='No space left')
    with full as caught, RunWriter(tmp_path / 'run') as run:
        run.write(make_messages(1)[0])
        monkeypatch.setattr(os, 'write', disk_error(errno.ENOSPC))
        if fails:
            raise KeyError('mine')
        run.flush()
    assert isinstance(caught.value.__cause__, KeyError) == fails
