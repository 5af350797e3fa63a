"""Texts of others show what they are, and do nothing."""

import unicodedata

from hypothesis import given, strategies as st
from klann_ros.sanitize.text import (
    counted,
    decimal,
    error_with_place,
    in_words,
    listed,
    MAX_LINE_LENGTH,
    parse_json,
    printable,
    printable_line,
    times,
    verb,
)
import pytest


@given(st.text())
def test_printable_text_is_one_line_of_visible_characters(text: str) -> None:
    shown = printable(text)
    assert shown.isprintable()
    assert len(shown.splitlines()) <= 1
    assert not any(unicodedata.category(c) in {'Cc', 'Cf', 'Zl', 'Zp', 'Cs'} for c in shown)


@pytest.mark.parametrize(
    ('text', 'shown'),
    [
        ('/joint_states', '/joint_states'),
        ('não é', 'não é'),
        ('a\x1b[31mb', r'a\x1b[31mb'),
        ('a\x9b31mb', r'a\x9b31mb'),
        ('a\nb\rc\u2028d', r'a\nb\rc\u2028d'),
        ('a\u202eb', r'a\u202eb'),
        ('\udc80', r'\udc80'),
    ],
)
def test_control_characters_are_named(text: str, shown: str) -> None:
    assert printable(text) == shown


@pytest.mark.parametrize('digits', range(4))
@given(number=st.floats(-1e3, 1e3))
def test_zero_has_no_sign(number: float, digits: int) -> None:
    shown = decimal(number, f'.{digits}f')
    assert float(shown) == float(f'{number:.{digits}f}')
    assert shown.startswith('-') == (float(shown) < 0.0)


def test_long_text_is_truncated_with_a_mark() -> None:
    assert printable('x' * 1_000_000, 5) == 'xxxxx... (1000000 characters)'
    assert printable('x' * 5, 5) == 'xxxxx'


@given(st.text())
def test_a_whole_line_is_one_line(text: str) -> None:
    assert printable_line(text).isprintable()
    assert printable_line(printable_line(text)) == printable_line(text)


def test_a_line_of_a_library_loses_its_breaks_and_nothing_else() -> None:
    assert printable_line('in line 3:\n    a\tb\n  ^') == 'in line 3: a b ^'
    assert printable_line(KeyError('a\x1b')) == r"'a\\x1b'".replace('\\\\', '\\')
    assert len(printable_line('x' * 10**6)) < MAX_LINE_LENGTH + 30


def test_an_error_is_one_line_with_its_place() -> None:
    def fail() -> None:
        raise ValueError('two\nlines \x1b[2J' + 'x' * 1000)

    with pytest.raises(ValueError, match='two') as raised:
        fail()
    text = error_with_place(raised.value)
    assert text.isprintable()
    assert text.startswith('ValueError: two\\nlines \\x1b[2Jxxx')
    assert text.endswith(f'(test_text.py:{fail.__code__.co_firstlineno + 1})')
    assert len(text) < 400


def test_long_lists_of_names_are_shortened() -> None:
    assert listed([]) == ''
    assert listed(['/a', '/b\n']) == r'/a, /b\n'
    assert listed(map(str, range(25)), 3) == '0, 1, 2 and 22 more'
    assert len(listed(['x' * 10**6] * 1000)) < MAX_LINE_LENGTH


def test_numbers_agree_with_their_nouns_and_verbs() -> None:
    assert [counted(n, 'message') for n in range(3)] == ['0 messages', '1 message', '2 messages']
    assert counted(2, 'foot', 'feet') == '2 feet'
    assert [verb(n, 'was', 'were') for n in range(3)] == ['were', 'was', 'were']
    assert [times(n) for n in (1, 2, 3)] == ['once', 'twice', '3 times']
    assert [in_words(n) for n in (0, 2, 10, 11, -1)] == ['no', 'two', 'ten', '11', '-1']


@pytest.mark.parametrize('text', [f'1{"0" * 309}', f'[-{"9" * 5000}]', '[' * 100_000, '{', ''])
def test_json_that_no_float_holds_or_that_is_none_is_refused(text) -> None:
    assert parse_json(f'[1{"0" * 308}]') == [10**308]
    with pytest.raises(ValueError):  # noqa: PT011 - of any reason
        parse_json(text)
