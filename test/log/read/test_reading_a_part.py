"""A part of a log is read without what comes before and after it."""

from dataclasses import replace

from crank_runs import BATCHES, CHUNK, MESSAGES, spans_of, START, write_run
from hypothesis import given, HealthCheck, settings, strategies as st
from klann_ros.log.reader import open_log
import numpy as np
import pytest


@pytest.fixture
def closed_and_not(tmp_path):
    """Write a run twice, with an index and without one."""
    files = [write_run(tmp_path / name, BATCHES) for name in ('closed', 'cut')]
    files[1].write_bytes(files[1].read_bytes()[:-8])
    return files


@settings(
    max_examples=20,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(first=st.integers(-10, 250), count=st.integers(0, 250))
def test_a_part_holds_exactly_its_time_range(closed_and_not, first, count) -> None:
    messages = MESSAGES
    start = START + first * 1_000_000
    end = start + count * 1_000_000
    expected = [m for m in messages if start <= m.log_time <= end]
    for path in closed_and_not:
        with open_log(path) as log:
            assert list(log.messages(start=start, end=end)) == expected
            assert list(log.messages(start=start)) == [m for m in messages if m.log_time >= start]


@settings(
    max_examples=20,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(before=st.integers(-10, 250), count=st.integers(1, 100))
def test_the_latest_messages_are_the_last_before_a_time(closed_and_not, before, count) -> None:
    time = START + before * 1_000_000
    expected = [m for m in MESSAGES if m.log_time < time][-count:]
    for path in closed_and_not:
        with open_log(path) as log:
            assert log.latest({'/crank_angle': count}, time) == expected


@pytest.mark.parametrize('time', [0, START - 11 * 365 * 86400 * 10**9, 2**63, 2**64 - 5 * 10**9])
@pytest.mark.parametrize('index', [0, 7, 239])
def test_an_impossible_log_time_is_not_in_the_span_of_a_log(tmp_path, time, index) -> None:
    messages = [*MESSAGES]
    messages[index] = replace(messages[index], log_time=time)
    rest = [message for message in messages if message.log_time != time]
    path = write_run(tmp_path / 'run', [messages])
    data = path.read_bytes()
    for content in (data, data[:-8]):
        path.write_bytes(content)
        with open_log(path) as log:
            assert (log.start_time, log.end_time) == (rest[0].log_time, rest[-1].log_time)
            assert str(log.times).startswith('1 of 240 log times is impossible (')
            assert list(log.messages(start=log.start_time, end=log.end_time)) == rest
            times = np.concatenate(
                [block.heads['log_time'] for block in log.times.repaired(log.blocks())]
            )
        expected = [message.log_time for message in messages]
        expected[index] = expected[index - 1] if index else rest[0].log_time
        assert times.tolist() == expected


def test_of_two_log_times_the_one_that_rolled_over_is_impossible(tmp_path) -> None:
    messages = [MESSAGES[0], replace(MESSAGES[1], log_time=2**64 - 5 * 10**9)]
    with open_log(write_run(tmp_path / 'run', [messages])) as log:
        assert log.start_time == log.end_time == START
        assert log.times.impossible_count == 1


def test_log_times_of_any_year_are_possible(tmp_path) -> None:
    late = [replace(message, log_time=2**64 - 10**9 + n) for n, message in enumerate(MESSAGES)]
    with open_log(write_run(tmp_path / 'run', [late])) as log:
        assert (log.start_time, log.end_time) == (late[0].log_time, late[-1].log_time)
        assert not log.times.impossible_count


def test_chunks_outside_of_a_part_are_not_unpacked(run_file) -> None:
    data = bytearray(run_file.read_bytes())
    chunks = spans_of(data, CHUNK)
    for _, end in (chunks[0], chunks[5]):
        data[end - 5] ^= 0xFF
    run_file.write_bytes(data)
    with open_log(run_file) as log:
        part = BATCHES[2] + BATCHES[3]
        times = {'start': part[0].log_time, 'end': part[-1].log_time}
        assert list(log.messages(**times)) == part
        assert log.latest({'/crank_angle': 5}, part[-1].log_time) == part[-6:-1]
        assert log.complete
        list(log.messages())
        assert len(log.problems) == 2
