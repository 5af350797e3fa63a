"""Where playback is: a position that runs, stands still, and never runs backwards by itself."""

from math import inf

from hypothesis import given, strategies as st
from klann_ros.log.transport import RATES, Timeline
import pytest

positions = st.floats(0.0, 1e5)
rates = st.floats(1e-3, 1e3)
waits = st.floats(0.0, 1e4)


courses = st.lists(
    st.tuples(
        waits,
        st.one_of(
            st.just(('started',)),
            st.just(('stopped',)),
            st.tuples(st.just('at_rate'), rates),
            st.tuples(st.just('delayed'), st.floats(0.0, 1.0)),
        ),
    ),
    max_size=12,
)


def changed(timeline, now, name, *values):
    if name == 'delayed':
        return timeline.delayed(timeline.at(now) - values[0], now)
    return getattr(timeline, name)(*values, now)


@given(start=positions, rate=rates, course=courses)
def test_a_position_never_runs_backwards_without_a_jump(start, rate, course) -> None:
    timeline, now, last = Timeline(start, rate), 0.0, start
    for wait, (name, *values) in course:
        now += wait
        position = timeline.at(now)
        assert position >= last
        timeline = changed(timeline, now, name, *values)
        last = timeline.at(now)
        assert last == position


@given(start=positions, rate=rates, now=waits, pause=waits, wait=waits)
def test_a_pause_freezes_the_position_and_takes_no_time_of_the_log(
    start, rate, now, pause, wait
) -> None:
    through = Timeline(start, rate).started(0.0)
    stopped = through.stopped(now)
    assert stopped.at(now + pause) == stopped.at(now)
    assert stopped.due(start + 1e9) == inf
    paused = stopped.started(now + pause)
    assert paused.at(now + pause + wait) == pytest.approx(
        through.at(now + wait), rel=1e-9, abs=1e-9
    )


@given(start=positions, rate=rates, ahead=st.floats(0.0, 1e6))
def test_a_position_is_reached_when_it_is_due(start, rate, ahead) -> None:
    timeline = Timeline(start, rate).started(7.0)
    assert timeline.at(timeline.due(start + ahead)) == pytest.approx(
        start + ahead, rel=1e-9, abs=1e-9
    )


@given(start=positions, rate=rates, other=rates, now=waits, wait=waits)
def test_a_change_of_rate_keeps_the_position(start, rate, other, now, wait) -> None:
    timeline = Timeline(start, rate).started(0.0)
    changed_line = timeline.at_rate(other, now)
    assert changed_line.at(now) == timeline.at(now)
    assert changed_line.at(now + wait) == pytest.approx(
        timeline.at(now) + wait * other, rel=1e-9, abs=1e-9
    )


@given(start=positions, target=positions, now=waits)
def test_a_jump_goes_anywhere_and_keeps_running_or_standing(start, target, now) -> None:
    standing = Timeline(start)
    running = standing.started(0.0)
    assert standing.moved(target, now).at(now + 1.0) == target
    assert running.moved(target, now).at(now) == target
    assert running.moved(target, now).due(target) == now


def test_a_delayed_timeline_waits_at_its_reported_position() -> None:
    running = Timeline().started(0.0)
    delayed = running.delayed(2.0, 5.0)
    assert delayed.at(5.0) == 5.0
    assert delayed.due(2.0) == 5.0
    assert delayed.at(8.0) == 5.0
    assert delayed.at(9.0) == 6.0


@pytest.mark.parametrize('rate', [0.0, -1.0, float('nan'), inf, RATES[0] / 2, RATES[1] * 2])
def test_a_rate_that_makes_no_sense_is_refused(rate) -> None:
    with pytest.raises(ValueError, match=r'must be within 1e-06 \.\. 1e\+06'):
        Timeline(rate=rate)
