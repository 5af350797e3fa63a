"""What a playback yields while others steer it; threads as in the node, but no ROS."""

from contextlib import contextmanager
from dataclasses import replace
from threading import Thread
import time

from crank_runs import make_messages, MESSAGES, write_run
from klann_ros.log.playback import Playback, Selection
from klann_ros.log.reader import open_log
from klann_ros.log.transport import PlaybackError
import pytest

NAME = '/crank_angle'
# A log of 240 messages takes 2.4 s at this rate, none is ever due at the other.
SLOW, STILL = 0.1, 1e-6


def until(condition):
    end = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end, 'waited in vain'
        time.sleep(0.001)


@contextmanager
def playing(log, *, rate=1.0, paused=False, topics=(NAME,), **selection):
    """Play in a thread; yield what moves it and the list of passes, each a list of messages."""
    chosen = Selection(frozenset(topics), **selection)
    playback_of_log, passes = Playback(log, chosen, rate=rate, paused=paused), []
    playback = playback_of_log.transport

    def play():
        for messages in playback_of_log.passes():
            passes.append([])
            for message in messages:
                passes[-1].append(message)

    thread = Thread(target=play)
    thread.start()
    playback.thread = thread
    try:
        yield playback, passes
    finally:
        playback.stop()
        thread.join(20.0)
        assert not thread.is_alive()


@pytest.fixture
def log(run_file):
    with open_log(run_file) as opened:
        yield opened


def test_all_messages_come_in_order_and_then_it_ends(log) -> None:
    with playing(log) as (playback, passes):
        playback.thread.join(20.0)
        assert passes == [MESSAGES]
        assert playback.position == playback.length == pytest.approx(0.239)
        assert playback.lateness.played == 240


def test_a_loop_plays_the_same_part_again_and_again_both_ends_included(log) -> None:
    with playing(log, begin=0.1, end=0.11, loop=True) as (_, passes):
        until(lambda: len(passes) > 3)
    assert passes[:3] == [MESSAGES[100:111]] * 3


def test_nothing_comes_while_it_is_paused_and_nothing_is_left_out(log) -> None:
    with playing(log, rate=SLOW) as (playback, passes):
        until(lambda: passes and len(passes[0]) > 10)
        playback.pause()
        position = playback.position
        time.sleep(0.05)
        count = len(passes[0])
        time.sleep(0.1)
        assert len(passes[0]) == count
        assert playback.position == position
        playback.set_rate(1.0)
        playback.resume()
        playback.thread.join(20.0)
        assert passes == [MESSAGES]


def test_a_step_is_exactly_the_next_message(log) -> None:
    with playing(log, paused=True) as (playback, passes):
        for count in range(1, 4):
            playback.step()
            until(lambda: len(passes[0]) >= count)  # noqa: B023, RUF100
            assert passes == [MESSAGES[:count]]
            assert playback.position == pytest.approx(0.001 * (count - 1))


def test_a_step_is_refused_while_it_plays_and_at_the_end(log) -> None:
    with playing(log, rate=STILL) as (playback, _):
        with pytest.raises(PlaybackError, match='pause it first'):
            playback.step()
        playback.pause()
        playback.seek(playback.length)
        playback.step()
        with pytest.raises(PlaybackError, match='no message is left'):
            playback.step()


def test_a_step_at_the_end_of_a_loop_is_its_first_message(log) -> None:
    with playing(log, paused=True, loop=True, begin=0.238) as (playback, passes):
        for _ in range(3):
            playback.step()
        until(lambda: len(passes) > 1 and passes[1])
        assert passes == [MESSAGES[238:], MESSAGES[238:239]]


def test_playback_continues_from_a_jump(log) -> None:
    with playing(log, rate=STILL) as (playback, passes):
        until(lambda: passes and passes[0])
        playback.seek(0.2)
        playback.set_rate(1.0)
        playback.thread.join(20.0)
        assert passes == [MESSAGES[:1], MESSAGES[200:]]


def test_a_jump_while_paused_stays_paused(log) -> None:
    with playing(log, paused=True) as (playback, passes):
        for position in (0.1, 0.2, 0.05):
            playback.seek(position)
            assert playback.position == position
        time.sleep(0.05)
        assert not any(passes)
        playback.step()
        until(lambda: any(passes))
        assert passes[-1][0].sequence == 51


@pytest.mark.parametrize('position', [-0.1, 1.0, float('nan')])
def test_a_jump_out_of_the_log_is_refused(log, position) -> None:
    with (
        playing(log, paused=True) as (playback, _),
        pytest.raises(PlaybackError, match=r'is not within 0 \.\. 0\.239 s'),
    ):
        playback.seek(position)


def test_latched_messages_from_before_come_first(tmp_path) -> None:
    crank = make_messages(100)
    latched = [
        replace(m, log_time=m.log_time - 1) for m in make_messages(3, '/latched', 20_000_000)
    ]
    messages = sorted([*crank, *latched], key=lambda m: m.log_time)
    path = write_run(tmp_path / 'run', [messages[:50], messages[50:]])
    topics, counts = [NAME, '/latched'], {'/latched': 2}
    with open_log(path) as log:
        begin = (crank[70].log_time - log.start_time) / 1e9
        with playing(log, topics=topics, latched=counts, begin=begin) as (playback, passes):
            playback.thread.join(20.0)
        assert passes == [latched[1:] + crank[70:]]
        with playing(log, topics=topics, latched=counts, paused=True) as (playback, passes):
            playback.seek(begin)
            until(lambda: len(passes) > 1 and len(passes[-1]) == 2)
            assert passes[-1] == latched[1:]


def test_after_a_stall_playback_is_delayed_and_not_a_burst(log) -> None:
    playback = Playback(log, Selection(frozenset([NAME]), end=0.02))
    for messages in playback.passes():
        for count, _ in enumerate(messages):
            if count == 10:
                time.sleep(0.8)
    assert count == 20
    assert playback.transport.lateness.delay >= 0.5
    assert playback.transport.lateness.worst < 0.5
    assert 'stalled for' in str(playback.transport.lateness)


def test_messages_out_of_order_hold_nothing_up(tmp_path) -> None:
    messages = make_messages(4, period=1_000_000_000)
    messages = [messages[0], messages[3], messages[1], messages[2]]
    path = write_run(tmp_path / 'run', [messages])
    path.write_bytes(path.read_bytes()[:-8])
    with open_log(path) as log, playing(log, rate=2.5) as (playback, passes):
        playback.thread.join(20.0)
        assert passes == [sorted(messages, key=lambda message: message.log_time)]
        assert playback.lateness.delay < 0.8
        assert not log.complete


def test_a_log_without_messages_ends_at_once(tmp_path) -> None:
    with open_log(write_run(tmp_path / 'run', [])) as log, playing(log) as (playback, passes):
        playback.thread.join(20.0)
        assert passes == [[]]


def test_many_messages_of_one_time_are_all_played_and_hold_no_control_up(tmp_path) -> None:
    """A million take 4 s: the rest of the log is put off by what they take."""
    messages = [replace(m, log_time=m.log_time // 10**9) for m in make_messages(30_000, period=0)]
    write_run(tmp_path / 'run', [messages])
    with open_log(tmp_path / 'run') as log, playing(log) as (playback, passes):
        until(lambda: passes and len(passes[0]) > 1000)
        playback.pause()
        time.sleep(0.05)
        count = len(passes[0])
        time.sleep(0.05)
        assert len(passes[0]) == count < len(messages)
        playback.resume()
        playback.thread.join(20.0)
        assert passes == [messages]
        assert playback.position == 0.0
