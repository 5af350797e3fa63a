"""What becomes of an item, whichever engine works on it."""

from typing import NamedTuple

# How often an item is given to a worker, which may die of something else.
TRIES = 2
# The same words for every engine, so that what is made of them is the same.
DIED = f'its worker died while it worked on it, {TRIES} times'


class EngineError(Exception):
    """An engine that cannot be had; the text says why."""


class Failed(NamedTuple):
    """
    An item without an answer.

    Attributes
    ----------
    reason : str
        Why there is none.

    """

    reason: str
