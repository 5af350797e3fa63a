"""What a pause leaves out: what was received in it, whenever it is taken."""

from hypothesis import given, strategies as st
from klann_ros.log.run_parameters import Pause, pause_of, pause_record
from klann_ros.log.write.ledger import Ledger
from klann_ros.log.write.recording import Pauses
import pytest

TIMES = st.integers(0, 100)


def test_without_a_pause_nothing_is_left_out() -> None:
    ledger = Ledger(None)
    assert not Pauses(ledger).leaves_out(ledger['/x'], 0)
    assert not Pauses(ledger).leaves_out(ledger['/x'], 2**63)
    assert ledger['/x'].left_out == 0


@given(begin=TIMES, length=TIMES, received=TIMES, is_taken_late=st.booleans())
def test_the_time_of_reception_decides(begin, length, received, is_taken_late) -> None:
    ledger = Ledger(None)
    pauses = Pauses(ledger)
    pauses.begin(begin)
    end = begin + length
    if is_taken_late or received >= end:
        pauses.end(end)
    assert pauses.leaves_out(ledger['/x'], received) == (begin <= received < end)
    assert ledger['/x'].left_out == (begin <= received < end)


def test_each_pause_has_counts_of_its_own() -> None:
    ledger = Ledger(None)
    pauses = Pauses(ledger)
    for begin, topics in ((10, ['/x', '/x', '/y']), (30, ['/y'])):
        pauses.begin(begin)
        for topic in topics:
            assert pauses.leaves_out(ledger[topic], begin + 5)
        pauses.end(begin + 10)
        counts = {topic: topics.count(topic) for topic in topics}
        assert pauses.last() == Pause(begin, begin + 10, counts)
    assert ledger.left_out() == {'/x': 2, '/y': 2}


def test_a_clock_that_is_set_back_into_a_pause_that_is_over_leaves_nothing_out() -> None:
    ledger = Ledger(None)
    pauses = Pauses(ledger)
    pauses.begin(100)
    pauses.end(200)
    assert pauses.leaves_out(ledger['/x'], 150)
    assert pauses.last() == Pause(100, 200, {'/x': 1})
    assert not pauses.leaves_out(ledger['/x'], 150)
    assert ledger['/x'].left_out == 1


def test_a_record_of_a_pause_comes_back() -> None:
    pause = Pause(10, 20, {'/x': 3})
    assert pause_of(pause_record(pause)) == pause


@pytest.mark.parametrize('key', ['from', 'to', 'left_out'])
@pytest.mark.parametrize('value', [None, 'much', '3'])
def test_what_is_no_record_of_a_pause_is_a_value_error(key, value) -> None:
    record = pause_record(Pause(10, 20, {}))
    if value is None:
        del record[key]
    elif value == '3' and key != 'left_out':
        return
    else:
        record[key] = value
    with pytest.raises(ValueError, match='not a record of a pause'):
        pause_of(record)
