"""Messages whose bytes are not what their type says, and numbers that no array holds."""

from dataclasses import replace
import re

from klann_ros.log.records import Message
from klann_ros.review.command import main
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


def found(run, capsys) -> list[str]:
    """Return the findings of a run."""
    assert main([str(run)]) in (0, 1)
    return re.findall(r'^FOUND (.*)', capsys.readouterr().out, flags=re.MULTILINE)


# Eight bytes of anything are a number, so few are garbled for the crank.
@pytest.mark.parametrize(
    ('kind', 'data'),
    [(kind, data) for kind in ('poses', 'feet') for data in GARBLED.values()]
    + [('crank', GARBLED['empty']), ('crank', GARBLED['short'])],
)
def test_what_cannot_be_decoded_is_counted(healthy, make_run, capsys, kind, data) -> None:
    healthy.messages = garbled(healthy, kind, data)
    name = getattr(healthy, kind).name
    text = f'3 messages of {name} cannot be decoded (first at 0.500 s)'
    assert found(make_run(healthy), capsys) == [f'decode: {text}']


@pytest.mark.parametrize(
    'change', [{'definition': ''}, {'definition': '%&! ['}, {'message_encoding': 'json'}]
)
def test_a_topic_without_a_decoder_is_told(healthy, make_run, capsys, change) -> None:
    healthy.feet = replace(healthy.feet, **change)
    assert found(make_run(healthy), capsys) == [
        'decode: 400 messages of /point_h cannot be decoded (first at 0.000 s)'
    ]


def test_times_beyond_every_array_do_no_harm(healthy, make_run, capsys) -> None:
    largest = 2**64 - 1
    (message,) = garbled(healthy, 'crank', b'\0\1\0\0' + b'\0' * 8, count=1)
    other = replace(healthy.crank, name='/other')
    healthy.messages = [
        replace(message, publish_time=largest),
        replace(message, topic=other, log_time=largest, publish_time=0),
    ]
    assert found(make_run(healthy), capsys) == []


@pytest.mark.parametrize('value', [1.7e308, -1.7e308])
def test_the_largest_numbers_do_no_harm(healthy, make_run, tmp_path, capsys, value) -> None:
    healthy.answers[7].pose[1:] = [value] * 4
    healthy.answers[8].pose[:] = [value] * 5
    healthy.answers[9].pose[:] = [float('nan'), 0.0, 0.0, 0.0, 0.0]
    healthy.change(7, foot=(value, -value))
    healthy.change(8, foot=(-value, value))
    picture = tmp_path / 'leg.png'
    assert main([str(make_run(healthy)), '--picture', str(picture)]) == 1
    assert 'FOUND foot: ' in capsys.readouterr().out
    assert picture.stat().st_size > 5000
