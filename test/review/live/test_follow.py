"""A run is judged as it grows, whatever becomes of it, and reviewed when it is closed."""

from collections.abc import Iterator
from dataclasses import replace
import os
from pathlib import Path
import signal
import subprocess
import sys
from threading import Thread
import time

from fork_server import called, PACKAGE
from klann_ros.kinematics import KlannLeg
from klann_ros.log.errors import NotALogError
from klann_ros.log.mcap.growing import GrowingFile
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import (
    Pause,
    PAUSE_RECORD,
    pause_record,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
)
from klann_ros.log.write.writer import RunWriter
from klann_ros.review.live import follow as following
from klann_ros.review.live.follow import follow
from klann_ros.review.model.limits import Limits
from leg_runs import LegRun, START
import pytest

GEOMETRY = {**KlannLeg().linkage.dimensions, 'assembly': [1, 1]}
GARBLED = LegRun(
    parameters=GEOMETRY, count=600, turns=3.0, garbled={150: float('nan'), 500: float('nan')}
)
LIMIT = 30.0


@pytest.fixture(autouse=True)
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(following, 'PERIOD', 0.01)
    monkeypatch.setattr(following, 'SPLIT', 0.2)


class Follower:
    """Follows a run in a thread."""

    def __init__(self, path: Path) -> None:
        self.findings: list[str] = []
        self.status: list[str] = []
        self.error: Exception | None = None
        self._path = path
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            follow(
                str(self._path),
                Limits(),
                on_finding=self.findings.append,
                on_status=self.status.append,
            )
        except (NotALogError, OSError) as error:
            self.error = error

    def until_found(self, count: int) -> None:
        end = time.monotonic() + LIMIT
        while len(self.findings) < count:
            assert time.monotonic() < end, self.status
            time.sleep(0.01)

    def until_ended(self) -> None:
        self._thread.join(LIMIT)
        assert not self._thread.is_alive(), self.status


@pytest.fixture
def run(tmp_path: Path) -> Iterator[RunWriter]:
    writer = begun(tmp_path / 'run')
    yield writer
    writer.close()


def begun(folder: Path) -> RunWriter:
    """Return a run in which there is only what the solver is."""
    writer = RunWriter(folder)
    record = solver_record(SolverParameters('/solver_node', START, GEOMETRY))
    writer.add_metadata(SOLVER_RECORD, record, in_every_file=True)
    writer.flush()
    return writer


def test_a_finding_is_reported_while_the_run_is_recorded(run: RunWriter) -> None:
    follower = Follower(run.path)
    everything = [*GARBLED.messages()]
    middle = len(everything) // 2
    for message in everything[:middle]:
        run.write(message)
    run.flush()
    follower.until_found(1)
    assert ' ERROR nan: ' in follower.findings[0]
    # By the clock of the log, which begins at this second.
    assert follower.findings[0].startswith('2023-11-14T22:13:20.')
    early_count = len(follower.findings)
    for message in everything[middle:]:
        run.write(message)
    run.close()
    follower.until_ended()
    assert len(follower.findings) > early_count
    assert follower.status == [f'following {run.path / "run_0.mcap"}']


def test_time_without_the_recorder_is_not_a_gap(run: RunWriter) -> None:
    messages = [*LegRun(parameters=GEOMETRY, count=600, turns=3.0, pause=(200, 2.0)).messages()]
    begin = START + 10**9
    end = START + 3 * 10**9
    follower = Follower(run.path)
    for message in messages:
        if message.log_time >= end and begin:
            stall = Pause(begin, end - 10**8, {}, 'the recorder did not run')
            run.add_metadata(PAUSE_RECORD, pause_record(stall))
            begin = 0
        run.write(message)
    run.close()
    follower.until_ended()
    assert follower.findings == []


def test_a_log_time_that_rolled_over_hides_no_later_finding(run: RunWriter) -> None:
    for number, message in enumerate(GARBLED.messages()):
        time = 2**64 - 5 * 10**9 if number == 50 else message.log_time
        run.write(replace(message, log_time=time))
    run.close()
    follower = Follower(run.path)
    follower.until_ended()
    assert {line.split()[2] for line in follower.findings} == {'nan:'}


def test_a_run_that_is_split_is_followed_into_its_next_file(run: RunWriter) -> None:
    follower = Follower(run.path)
    for number, message in enumerate(GARBLED.messages()):
        run.write(message)
        if number in (400, 800):
            run.split()
    run.close()
    follower.until_ended()
    assert [line.rpartition('_')[2] for line in follower.status] == ['0.mcap', '1.mcap', '2.mcap']
    assert len([line for line in follower.findings if ' nan: ' in line]) >= 2


def test_a_run_that_is_not_there_yet_is_waited_for(tmp_path: Path) -> None:
    folder = tmp_path / 'later'
    follower = Follower(folder)
    end = time.monotonic() + LIMIT
    while not follower.status:
        assert time.monotonic() < end
        time.sleep(0.01)
    GARBLED.write(folder)
    follower.until_ended()
    assert follower.status == [f'waiting for {folder}', f'following {folder / "later_0.mcap"}']
    assert follower.findings


@pytest.mark.parametrize(
    ('is_removed', 'status'),
    [(True, 'was removed'), (False, 'is unfinished, and its recorder has stopped')],
)
def test_an_abandoned_run_ends_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_removed: bool, status: str
) -> None:
    run = begun(tmp_path / 'run')
    for message in GARBLED.messages():
        run.write(message)
    run.flush()
    follower = Follower(run.path)
    follower.until_found(1)
    if is_removed:
        (run.path / 'run_0.mcap').unlink()
    else:
        # The end of its process takes the lock away.
        monkeypatch.setattr(following, '_is_written', lambda _: False)
    follower.until_ended()
    assert follower.status[-1] == f'run_0.mcap {status}'
    run.discard()


@pytest.mark.parametrize(
    ('content', 'problem'),
    [
        (b'this is no log at all', 'it does not start as an MCAP file does'),
        (b'\x89MCAP0\r\n' + bytes(100), 'what stands there is no record'),
        (b'\x89MCAP0\r\n' + b'\x06' + b'\xff' * 8 + bytes(100), 'what stands there is no record'),
        (b'\x89MCAP0\r\n' + b'\x06\x04' + bytes(7) + bytes(4), 'what stands there is no record'),
        (b'\x89MCAP0\r\n' + b'\x06\x28' + bytes(7) + b'\xff' * 40, ''),
    ],
)
def test_a_non_log_file_ends_it(tmp_path: Path, content: bytes, problem: str) -> None:
    path = tmp_path / 'bad_0.mcap'
    path.write_bytes(content)
    follower = Follower(path)
    follower.until_ended()
    assert follower.error is None
    assert 'bad_0.mcap cannot be read on: ' in follower.status[-1]
    assert problem in follower.status[-1]


def test_a_file_that_is_cut_off_meanwhile_ends_it(tmp_path: Path) -> None:
    path = GARBLED.write(tmp_path / 'run') / 'run_0.mcap'
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    file = GrowingFile(path)
    assert [*file.read()]
    os.truncate(path, 100)
    assert [*file.read()] == []
    assert file.problem == 'it was cut off at byte 100'
    file.close()


def test_each_byte_is_read_once_however_it_comes(tmp_path: Path) -> None:
    whole = (GARBLED.write(tmp_path / 'run') / 'run_0.mcap').read_bytes()
    path = tmp_path / 'growing_0.mcap'
    path.touch()
    file = GrowingFile(path)
    messages = []
    with path.open('ab') as out:
        for begin in range(0, len(whole), 1777):
            end = begin + 1777
            out.write(whole[begin:end])
            out.flush()
            messages += [record for record in file.read() if isinstance(record, Message)]
    assert file.is_finished
    assert [m.data for m in messages] == [m.data for m in GARBLED.messages()]
    file.close()


def test_non_mcap_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / 'bag.db3'
    path.touch()
    follower = Follower(path)
    follower.until_ended()
    assert 'only runs of MCAP files can be followed' in str(follower.error)


def test_ctrl_c_ends_it_with_a_review_so_far(run: RunWriter) -> None:
    for message in GARBLED.messages():
        run.write(message)
    run.flush()
    code = 'import sys; from klann_ros.executables import review; sys.exit(review())'
    process = subprocess.Popen(
        [sys.executable, '-c', code, '--follow', str(run.path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, 'PYTHONPATH': PACKAGE},
    )
    # The finding comes before the report.
    first = process.stdout.readline()
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=LIMIT)
    assert ' ERROR nan: ' in first
    assert 'review: stopped following; the report of the run so far' in errors
    assert 'not closed' in output
    assert process.returncode == 1


def test_a_run_that_is_closed_is_followed_by_its_review(tmp_path: Path) -> None:
    sound = LegRun(parameters=GEOMETRY).write(tmp_path / 'sound')
    done = called('review', '--follow', sound)
    assert (done.returncode, done.stderr.count('Traceback')) == (0, 0), done.stderr
    assert str(sound) in done.stdout


def test_one_run_is_followed_at_a_time() -> None:
    done = called('review', '--follow', 'one', 'two')
    assert done.returncode == 2
    assert '--follow takes one run' in done.stderr
