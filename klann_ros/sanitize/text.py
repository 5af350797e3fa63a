"""Untrusted texts made printable, numbers in sentences, untrusted JSON."""

from collections.abc import Iterable, Mapping
import json
from math import isfinite
from pathlib import Path
import sys
import traceback
from typing import Any

MAX_NAME_LENGTH = 300
"""Maximum length of a name in a message [characters]."""

MAX_LINE_LENGTH = 3000
"""Maximum length of a whole message, ten such names [characters]."""


def printable(text: object, max_length: int = MAX_NAME_LENGTH) -> str:
    r"""
    Return an untrusted text as one line without terminal control.

    Control characters (C0, C1, ESC), line and paragraph separators, bidi marks and other invisible
    characters are escaped as in Python, such as ``\x1b`` and ``\u202e``. A text longer than
    `max_length` characters is cut, and its length is appended.
    """
    whole = str(text)
    line = whole[:max_length]
    if not line.isprintable():
        line = ''.join(c if c.isprintable() else ascii(c)[1:-1] for c in line)
    return line if len(whole) <= max_length else f'{line}... ({len(whole)} characters)'


def listed(names: Iterable[object], max_names: int = 20) -> str:
    """
    Return untrusted names in a list, and the number of those beyond the maximum.

    Each is cut at a third of its usual maximum, which leaves room for the rest of the line.
    """
    all_names = list(names)
    text = ', '.join(printable(name, MAX_NAME_LENGTH // 3) for name in all_names[:max_names])
    excess = len(all_names) - max_names
    return f'{text} and {excess} more' if excess > 0 else text


def number_range(numbers: Iterable[float], form: str) -> str:
    """
    Return the smallest and the largest number in a format; one if both look alike.

    >>> number_range([0.25, 0.2501, 0.5], '.2f'), number_range([3.0, 3.0], 'g')
    ('0.25 to 0.50', '3')
    """
    ordered = sorted(numbers)
    ends = format(ordered[0], form), format(ordered[-1], form)
    return ' to '.join(dict.fromkeys(ends))


def decimal(number: float, form: str) -> str:
    """Return a number in a format, and 0 without a sign."""
    text = format(number, form)
    return text if text.strip('-0.') else text.removeprefix('-')


def printable_line(text: object) -> str:
    """
    Return a whole message, which may contain untrusted texts, as one printable line.

    White space, line breaks included, becomes a blank: libraries explain in several lines. Make
    each name in the message `printable` as well, or a long one cuts off the text behind it.
    """
    return printable(' '.join(str(text).split()), MAX_LINE_LENGTH)


def error_with_place(error: Exception) -> str:
    """Return a raised error on one line, with the file and the line that raised it."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    file = Path(place.filename).name
    return f'{type(error).__name__}: {printable(error)} ({file}:{place.lineno})'


def refusal(name: str, value: object, requirement: str) -> str:
    """Return the line about a refused value and its requirement."""
    text = printable(repr(value), MAX_NAME_LENGTH // 3)
    return f'{name} = {text} is refused: it must be {requirement}'


def did_you_mean(name: object, names: Iterable[str]) -> str:
    """
    Return ``; did you mean NAME?`` for the most similar name; empty without a similar one.

    A name of one letter is similar only to itself in the other case.
    """
    wrong_name = str(name)[:MAX_NAME_LENGTH]
    candidates = [*names]
    matches = [c for c in candidates if c.casefold() == wrong_name.casefold()]
    if not matches:
        from difflib import get_close_matches  # noqa: PLC0415 - only mistakes need it

        matches = get_close_matches(wrong_name, [c for c in candidates if len(c) > 1], n=1)
    return f'; did you mean {printable(matches[0], MAX_NAME_LENGTH // 3)}?' if matches else ''


def counted(number: int, singular: str, plural: str = '') -> str:
    """Return a number with its noun, such as `1 message` or `2 messages`."""
    return f'{number} {verb(number, singular, plural or f"{singular}s")}'


def verb(number: int, singular: str, plural: str) -> str:
    """Return the form that agrees with a number, such as `was` or `were`."""
    return singular if number == 1 else plural


def times(number: int) -> str:
    """Return `once`, `twice` or `3 times`."""
    return {1: 'once', 2: 'twice'}.get(number, f'{number} times')


def in_words(number: int) -> str:
    """Return a small number as a word."""
    words = ('no', 'one', 'two', 'three', 'four', 'five', 'six', 'seven', 'eight', 'nine', 'ten')
    return words[number] if 0 <= number < len(words) else str(number)


def parse_json(text: str) -> Any:
    """
    Return the content of an untrusted JSON text, or a ValueError.

    Deep nesting and whole numbers beyond all floats are refused.
    """
    try:
        return json.loads(text, parse_int=whole_number)
    except RecursionError:
        raise ValueError('it is nested too deeply') from None


def whole_number(text: str) -> int:
    """Return the whole number in a text; a ValueError for none, or one beyond all floats."""
    number = int(text)
    if abs(number) > sys.float_info.max:
        raise ValueError(f'{printable(text, 20)} is beyond 1.8e308')
    return number


def finite(value: Any) -> Any:
    """Return a value that JSON can hold: NaN and infinity become None."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: finite(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [finite(member) for member in value]
    return value
