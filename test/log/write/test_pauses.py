"""What a pause leaves out: what was received in it, whenever it is taken."""

from hypothesis import given, strategies as st
from klann_ros.log.run_parameters import Pause, pause_record, recorded_pause
from klann_ros.log.write.drop_counters import DropCounters
from klann_ros.log.write.recording import Pauses
import pytest

TIMES = st.integers(0, 100)


def test_without_a_pause_nothing_is_left_out() -> None:
    counters = DropCounters(None)
    assert not Pauses(counters).skips(counters['/x'], 0)
    assert not Pauses(counters).skips(counters['/x'], 2**63)
    assert counters['/x'].skipped == 0


@given(begin=TIMES, length=TIMES, received=TIMES, is_taken_late=st.booleans())
def test_the_time_of_reception_decides(begin, length, received, is_taken_late) -> None:
    counters = DropCounters(None)
    pauses = Pauses(counters)
    pauses.begin(begin)
    end = begin + length
    if is_taken_late or received >= end:
        pauses.end(end)
    assert pauses.skips(counters['/x'], received) == (begin <= received < end)
    assert counters['/x'].skipped == (begin <= received < end)


def test_each_pause_has_counts_of_its_own() -> None:
    counters = DropCounters(None)
    pauses = Pauses(counters)
    for begin, topics in ((10, ['/x', '/x', '/y']), (30, ['/y'])):
        pauses.begin(begin)
        for topic in topics:
            assert pauses.skips(counters[topic], begin + 5)
        pauses.end(begin + 10)
        counts = {topic: topics.count(topic) for topic in topics}
        assert pauses.take_last() == Pause(begin, begin + 10, counts)
    assert counters.skipped() == {'/x': 2, '/y': 2}


def test_a_clock_that_is_set_back_into_a_pause_that_is_over_leaves_nothing_out() -> None:
    counters = DropCounters(None)
    pauses = Pauses(counters)
    pauses.begin(100)
    pauses.end(200)
    assert pauses.skips(counters['/x'], 150)
    assert pauses.take_last() == Pause(100, 200, {'/x': 1})
    assert not pauses.skips(counters['/x'], 150)
    assert counters['/x'].skipped == 1


def test_a_record_of_a_pause_comes_back() -> None:
    pause = Pause(10, 20, {'/x': 3})
    assert recorded_pause(pause_record(pause)) == pause


@pytest.mark.parametrize('key', ['from', 'to', 'skipped'])
@pytest.mark.parametrize('value', [None, 'much', '3'])
def test_an_invalid_pause_record_is_a_value_error(key, value) -> None:
    record = pause_record(Pause(10, 20, {}))
    if value is None:
        del record[key]
    elif value == '3' and key != 'skipped':
        return
    else:
        record[key] = value
    with pytest.raises(ValueError, match='not a record of a pause'):
        recorded_pause(record)
