"""The writer's thread: what was put is in the run, or is counted."""

from dataclasses import replace
import itertools
import os
import threading

from crank_runs import make_messages
from hypothesis import given, settings, strategies as st
from klann_ros.log.reader import open_log
from klann_ros.log.write import background_writer
from klann_ros.log.write.background_writer import BackgroundWriter, MESSAGE_OVERHEAD
from klann_ros.log.write.writer import RunWriter
import pytest


def dropped(background, topic):
    """Return how many messages of a topic were put and are not going to be in the run."""
    assert background.counters[topic].received == 0  # no subscription here
    return background.counters.counts()[topic].dropped


@pytest.mark.parametrize(('spare', 'dropped_count'), [(-1, 2501), (0, 2500), (1, 2500)])
def test_messages_beyond_the_queue_of_a_slow_disk_are_counted(
    tmp_path, monkeypatch, spare, dropped_count
) -> None:
    ready, is_waiting, write = threading.Event(), threading.Event(), os.write
    writer = RunWriter(tmp_path / 'run')

    def write_when_ready(*block):
        is_waiting.set()
        ready.wait()
        return write(*block)

    monkeypatch.setattr(os, 'write', write_when_ready)
    size = len(make_messages(1)[0].data) + MESSAGE_OVERHEAD
    background = BackgroundWriter(
        writer, flush_period=0.02, on_failure=lambda: None, capacity=3000 * size + spare
    )
    # From now on the thread takes nothing from the queue.
    background.put(make_messages(1, '/first')[0])
    assert is_waiting.wait(60.0)
    for pair in zip(make_messages(4000, '/one'), make_messages(4000, '/two'), strict=True):
        for message in pair:
            background.put(message)
    ready.set()
    assert background.close() is None
    with open_log(writer.path) as log:
        assert log.complete, log.problem
        counts = {t.name: len(list(log.messages([t.name]))) for t in log.topics}
    assert counts == writer.counts
    for name in ('/one', '/two'):
        assert counts[name] + dropped(background, name) == 4000
    assert dropped(background, '/two') == dropped_count


def test_a_message_larger_than_the_queue_is_written(tmp_path) -> None:
    writer = RunWriter(tmp_path / 'run')
    background = BackgroundWriter(
        writer, flush_period=0.01, on_failure=lambda: None, capacity=1000
    )
    background.put(replace(make_messages(1)[0], data=bytes(100_000)))
    assert background.close() is None
    assert writer.counts == {'/crank_angle': 1}


def test_messages_beyond_the_format_limits_are_counted(tmp_path) -> None:
    writer = RunWriter(tmp_path / 'run')
    background = BackgroundWriter(writer, flush_period=0.01, on_failure=lambda: None)
    sound_message, late_message = make_messages(2)
    background.put(sound_message)
    background.put(replace(late_message, log_time=2**64))
    assert background.close() is None
    assert writer.counts == {'/crank_angle': 1}
    assert dropped(background, '/crank_angle') == 1


@settings(max_examples=30)
@given(
    # Successful writes, and messages before a split and during its delay.
    numbers=st.tuples(st.integers(0, 20), st.integers(0, 60), st.integers(0, 30)),
    is_split=st.booleans(),
    chunk_size=st.sampled_from([100, 1024 * 1024]),
)
def test_whatever_a_failure_interrupts_is_counted(
    tmp_path_factory, numbers, is_split, chunk_size
) -> None:
    """A message in hand, a chunk in progress, what waits, what a split has put aside."""
    allowed_writes, first_count, late_count = numbers
    folder = tmp_path_factory.mktemp('put') / 'run'
    writer = RunWriter(folder, chunk_size=chunk_size, compression='none')
    messages = [
        replace(message, data=bytes(20_000))
        for message in make_messages(first_count + 2 * late_count)
    ]
    settled, put = threading.Event(), []
    writes, write = itertools.count(), os.write

    def refuse(*arguments):
        if next(writes) >= allowed_writes:
            raise OSError(5, 'Input/output error')
        return write(*arguments)

    def settle(seconds):
        if seconds == background_writer.REORDER_DELAY:
            for message in messages[first_count:]:
                background.put(replace(message, log_time=2**63))
                background.put(message)
            put.append(4 * late_count)
            settled.set()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('klann_ros.log.write.durable_file.os.write', refuse)
        patch.setattr(background_writer, 'sleep', settle)
        background = BackgroundWriter(writer, flush_period=0.002, on_failure=settled.set)
        for number, message in enumerate(messages[:first_count]):
            background.put(message)
            if number % 5 == 0:
                background.put_entry(lambda run: run.add_metadata('x', {'y': 'z' * 30_000}))
        if is_split:
            background.split()
            settled.wait(5.0)
        background.close()
    with open_log(writer.path) as log:
        written_count = len(list(log.messages()))
    assert written_count == writer.counts.get('/crank_angle', 0)
    assert written_count + dropped(background, '/crank_angle') == first_count + sum(put)
