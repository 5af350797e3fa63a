"""Texts for people: those of others as they may be shown, and numbers in sentences."""

from collections.abc import Iterable
from difflib import get_close_matches

LONGEST = 300
"""Whoever reads a line reads no more than so many characters of one name."""

LONGEST_LINE = 3000
"""Nor more of a whole line; it has room for ten such names."""


def printable(text: object, longest: int = LONGEST) -> str:
    r"""
    Return a text of somebody else's as one line that moves nothing but the reader.

    Control characters (C0, C1, ESC), line and paragraph separators, bidi marks and whatever else
    is invisible are written as Python writes them, such as ``\x1b`` and ``\u202e``; what is longer
    than may be shown is cut, and says how long it is.

    Parameters
    ----------
    text
        A text, or what `str` makes one of, such as a path or an error.
    longest
        How many characters may be shown.

    """
    shown = str(text)
    size = len(shown)
    if size > longest:
        shown = shown[:longest]
    if not shown.isprintable():
        shown = ''.join(c if c.isprintable() else ascii(c)[1:-1] for c in shown)
    return shown if size <= longest else f'{shown}... ({size} characters)'


def listed(names: Iterable[object], most: int = 20) -> str:
    """
    Return names of others one after the other; of more than may be shown, how many there are.

    So that what stands behind them in the same line can be read, each is cut at a third of what
    one alone may have.
    """
    found = list(names)
    shown = [printable(name, LONGEST // 3) for name in found[:most]]
    more = len(found) - most
    return ', '.join(shown) + (f' and {more} more' if more > 0 else '')


def printable_line(text: object) -> str:
    """
    Return a whole line of text that may hold texts of others, such as an error's.

    White space becomes a blank, line breaks included: libraries explain in several lines. Who puts
    names into a line makes each of them `printable`, so that one that is long does not cut off
    what stands behind it; this is the last door, for what was overlooked.
    """
    return printable(' '.join(str(text).split()), LONGEST_LINE)


def did_you_mean(name: object, names: Iterable[str]) -> str:
    """
    Return ``; did you mean NAME?`` for the nearest of some names; empty where none is near.

    A name of one letter is near to nothing but itself in the other case.
    """
    given, known = str(name)[:LONGEST], [*names]
    near = [other for other in known if other.casefold() == given.casefold()]
    near = near or get_close_matches(given, [each for each in known if len(each) > 1], n=1)
    return f'; did you mean {printable(near[0], LONGEST // 3)}?' if near else ''


def counted(number: int, one: str, many: str = '') -> str:
    """Return how many there are of something, such as `1 message` or `2 messages`."""
    return f'{number} {verb(number, one, many or f"{one}s")}'


def verb(number: int, one: str, many: str) -> str:
    """Return the word that goes with a number, such as `was` or `were`."""
    return one if number == 1 else many


def times(number: int) -> str:
    """Return how often something is: `once`, `twice` or `3 times`."""
    return {1: 'once', 2: 'twice'}.get(number, f'{number} times')


def in_words(number: int) -> str:
    """Return a small number as a word."""
    words = ('no', 'one', 'two', 'three', 'four', 'five', 'six', 'seven', 'eight', 'nine', 'ten')
    return words[number] if 0 <= number < len(words) else str(number)
