"""Runs of several files: nothing is lost, doubled or out of order between them."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
import sys
from threading import Event
from time import monotonic, sleep, time_ns

from crank_runs import BATCHES, make_messages, MESSAGES
from klann_ros.log import write
from klann_ros.log.errors import LowSpaceError
from klann_ros.log.reader import open_log
from klann_ros.log.write import background_writer
from klann_ros.log.write.background_writer import BackgroundWriter, SplitLimits
from klann_ros.log.write.writer import RunWriter
from mcap.reader import make_reader
import pytest
from rosbags.highlevel import AnyReader
from run_faults import information

WRITING = str(Path(write.__file__).parent)


def written_in(run, parts):
    """Write a run with a file for each part."""
    with RunWriter(run) as writer:
        writer.add_metadata('solver', {'tolerance': '1e-12'}, in_every_file=True)
        writer.attach('leg.yaml', 'text/yaml', b'l_ab: 0.12', 1, in_every_file=True)
        for number, part in enumerate(parts):
            if number:
                writer.split()
            for message in part:
                writer.write(message)
    return run


def test_a_run_of_several_files_is_one_and_each_file_explains_itself(tmp_path) -> None:
    run, names = written_in(tmp_path / 'run', BATCHES), [f'run_{n}.mcap' for n in range(6)]
    for path in (*run.glob('*.mcap'), run):
        with open_log(path) as log:
            assert log.metadata['solver'] == [{'tolerance': '1e-12'}]
            assert [attachment.data for attachment in log.attachments] == [b'l_ab: 0.12']
            assert log.complete, log.problem
    with open_log(run) as log:
        assert [path.name for path in log.paths] == names
        assert list(log.messages()) == MESSAGES
    with AnyReader([run]) as reader:
        assert reader.message_count == 240
    about = information(run)
    assert about['relative_file_paths'] == names
    assert [file['message_count'] for file in about['files']] == [40] * 6
    assert about['message_count'] == 240
    (topic,) = about['topics_with_message_count']
    assert topic['message_count'] == 240


def test_metadata_yaml_names_every_file_and_a_file_without_a_message_is_not_split(
    tmp_path,
) -> None:
    with RunWriter(tmp_path / 'run') as writer:
        writer.split()
        writer.write(BATCHES[0][0])
        writer.split()
        writer.split()
        assert information(writer.path)['relative_file_paths'] == ['run_0.mcap', 'run_1.mcap']
        assert writer.next_name == 'run_2.mcap'


def test_limits_are_of_size_and_time() -> None:
    file = 1000, 2.0
    assert not SplitLimits().are_reached(*file)
    assert SplitLimits(size=1000).are_reached(*file)
    assert not SplitLimits(size=1001, duration=2.1).are_reached(*file)
    assert SplitLimits(size=1001, duration=2.0).are_reached(*file)


def test_the_files_of_a_split_run_follow_each_other_in_time(tmp_path, monkeypatch) -> None:
    # A busy machine enqueues late.
    monkeypatch.setattr(background_writer, 'REORDER_DELAY', 1.0)
    # Two topics are taken one after the other, so the second one's messages come late.
    first_message, second_message = (make_messages(1, name)[0] for name in ('/one', '/two'))
    writer = RunWriter(tmp_path / 'run')
    background = BackgroundWriter(writer, flush_period=0.02, on_failure=lambda: None)
    for k in range(20):
        times = [time_ns() + n for n in range(10)]
        for message in (first_message, second_message):
            for time in times:
                background.put(replace(message, log_time=time))
        sleep(0.01)
        if k in (7, 13):
            name = background.split()
            assert name == f'run_{1 if k == 7 else 2}.mcap'
            while writer.next_name == name:
                sleep(0.01)
    assert background.close() is None
    spans = []
    for number in range(3):
        with open_log(writer.path / f'run_{number}.mcap') as log:
            spans.append((log.start_time, log.end_time))
    assert spans == sorted(spans)
    assert all(earlier_span[1] < later_span[0] for earlier_span, later_span in pairwise(spans))
    assert writer.counts == {'/one': 200, '/two': 200}


def test_a_split_keeps_the_order(tmp_path, monkeypatch) -> None:
    """What is received at its moment, while it settles, is written in the order of reception."""
    settled = Event()
    clock = [2**62]

    def settle(seconds: float) -> None:
        if seconds == background_writer.REORDER_DELAY:
            for message in make_messages(20):
                background.put(replace(message, log_time=clock[0]))
            clock[0] += 1
            settled.set()

    monkeypatch.setattr(background_writer, 'sleep', settle)
    monkeypatch.setattr(background_writer, 'time_ns', lambda: clock[0])
    writer = RunWriter(tmp_path / 'run')
    background = BackgroundWriter(writer, flush_period=0.01, on_failure=lambda: None)
    background.put(make_messages(1)[0])
    while writer.file_is_empty:
        sleep(0.01)
    background.split()
    assert settled.wait(20.0)
    assert background.close() is None
    with (writer.path / 'run_1.mcap').open('rb') as file:
        stored_messages = make_reader(file).iter_messages(log_time_order=False)
        assert [message.sequence for *_, message in stored_messages] == [*range(1, 21)]


@pytest.mark.parametrize(
    ('flush_period', 'count', 'is_split'),
    [(600.0, 1, True), (0.01, 1, False), (600.0, 256, False)],
    ids=['split', 'flush', 'long queue'],
)
def test_too_little_space_ends_the_recording(
    tmp_path, monkeypatch, *, flush_period: float, count: int, is_split: bool
) -> None:
    def refuse(writer: RunWriter, min_free_space: int) -> None:
        raise LowSpaceError(writer.path, 0, min_free_space)

    monkeypatch.setattr(RunWriter, 'check_space', refuse)
    has_failed, is_queued = Event(), Event()
    writer = RunWriter(tmp_path / 'run')
    background = BackgroundWriter(
        writer, flush_period=flush_period, on_failure=has_failed.set, min_free_space=1
    )
    background.put_entry(lambda _: is_queued.wait())
    for message in make_messages(count):
        background.put(message)
    is_queued.set()
    if is_split:
        background.split()
    assert has_failed.wait(60.0)
    assert isinstance(background.close(), LowSpaceError)


def test_statistics_read_during_a_split_are_consistent(tmp_path) -> None:
    seen = []

    def look(frame, *_):
        if frame.f_code.co_filename.startswith(WRITING):
            seen.append(dict(writer.stored_counts().written))
            return look
        return None

    with RunWriter(tmp_path / 'run') as writer:
        for message in BATCHES[0][:5]:
            writer.write(message)
        first_trace = sys.gettrace()
        # Another thread may come between any two lines.
        sys.settrace(look)
        try:
            writer.split()
        finally:
            sys.settrace(first_trace)
    assert len(seen) > 50
    assert all(counts == {'/crank_angle': 5} for counts in seen)


@pytest.mark.parametrize('hours', [-1, 1])
def test_a_clock_that_is_set_costs_a_split_and_no_message(tmp_path, hours) -> None:
    writer = RunWriter(tmp_path / 'run')
    limits = SplitLimits(duration=600.0)
    background = BackgroundWriter(
        writer, flush_period=0.01, on_failure=lambda: None, limits=limits
    )
    for number, message in enumerate(make_messages(200)):
        shift = hours * 3_600_000_000_000 if number >= 100 else 0
        background.put(replace(message, log_time=message.log_time + shift))
        if number % 10 == 0:
            sleep(0.02)
    # What is written when it closes is not split any more, and a busy machine is late.
    patience = monotonic() + 20.0
    while writer.next_name != 'run_2.mcap' and monotonic() < patience:
        sleep(0.01)
    assert background.close() is None
    assert writer.counts == {'/crank_angle': 200}
    assert len(list(writer.path.glob('*.mcap'))) == 2
    with open_log(writer.path) as log:
        assert len(list(log.messages())) == 200
