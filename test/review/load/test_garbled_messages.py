"""Messages whose bytes are not of their type, and numbers that no array holds."""

from dataclasses import replace
import struct

from findings import checks, found, moments
from klann_ros.log.records import Message
from klann_ros.review.reviewing import review_run
import pytest

GARBLED = {
    'empty': b'',
    'header only': b'\0\1\0\0',
    'short': b'\0\1\0\0\1\2\3',
    'endless': b'\0\1\0\0' + b'\xff' * 40,
    'no cdr': b'hello, world',
}


def garbled(run, kind: str, data: bytes, count: int = 3) -> list[Message]:
    """Return messages of a topic that are logged within the run."""
    time = run.answers[100].stamp + 200_000
    return [Message(getattr(run, kind), data, time + n, time + n, 0) for n in range(count)]


# Eight bytes of anything are a number, so few are garbled for the crank.
@pytest.mark.parametrize(
    ('kind', 'data'),
    [(kind, data) for kind in ('poses', 'feet') for data in GARBLED.values()]
    + [('crank', GARBLED['empty']), ('crank', GARBLED['short'])],
)
def test_undecodable_messages_are_counted(healthy, make_run, kind, data) -> None:
    healthy.messages = garbled(healthy, kind, data)
    name = getattr(healthy, kind).name
    review = review_run(make_run(healthy))
    assert moments(review) == [('decode', 0.5)]
    assert review.findings[0].text == f'3 messages of {name} cannot be decoded'


def test_joint_states_without_positions_are_ignored(healthy, make_run) -> None:
    healthy.answers[100].pose.pop()
    # The message is there, but the crank's angle has no answer in it.
    assert moments(review_run(make_run(healthy))) == [('decode', 0.5), ('answers', 0.5)]


@pytest.mark.parametrize(
    'change', [{'definition': ''}, {'definition': '%&! ['}, {'message_encoding': 'json'}]
)
def test_a_topic_without_a_decoder_is_reported(healthy, make_run, change) -> None:
    healthy.feet = replace(healthy.feet, **change)
    assert found(make_run(healthy)) == ['decode: 400 messages of /point_h cannot be decoded']


def test_times_beyond_every_array_do_no_harm(healthy, make_run) -> None:
    largest = 2**64 - 1
    alpha = struct.pack('<4xd', healthy.answers[100].alpha)
    (message,) = garbled(healthy, 'crank', b'\0\1\0\0' + alpha[4:], count=1)
    other = replace(healthy.crank, name='/other')
    healthy.messages = [
        replace(message, publish_time=largest),
        replace(message, topic=other, log_time=largest, publish_time=0),
    ]
    assert found(make_run(healthy)) == []


@pytest.mark.parametrize('value', [1.7e308, -1.7e308])
def test_the_largest_numbers_do_no_harm(healthy, make_run, value) -> None:
    healthy.change(6, foot=(value, -value))
    healthy.answers[7].pose[1:] = [value] * 4
    healthy.answers[8].pose[:] = [value] * 5
    healthy.answers[9].pose[:] = [float('nan'), 0.0, 0.0, 0.0, 0.0]
    healthy.change(8, foot=(-value, value))
    assert sorted(checks(review_run(make_run(healthy)))) == ['closure', 'foot', 'nan']
