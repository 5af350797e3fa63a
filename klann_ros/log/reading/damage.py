"""What in a file cannot be used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from klann_ros.log.wording import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

_MAX_LOSSES = 1000


@dataclass
class Loss:
    """
    Something in a file that cannot be used.

    Parameters
    ----------
    offset, length
        Where it is [bytes].
    reason
        What is wrong with it, in one line.
    messages
        How many messages it held; None if nothing says so.
    exact
        Whether there may not have been more.

    """

    offset: int
    length: int
    reason: str
    messages: int | None = None
    exact: bool = True

    def __str__(self) -> str:
        """Return it in one line, without the place."""
        least = '' if self.exact else 'at least '
        held = f' with {least}{counted(self.messages, "message")}' if self.messages else ''
        return f'{counted(self.length, "byte")}{held}: {self.reason}'


class Losses:
    """The losses in a file by their offset; from the thousandth on they are one."""

    def __init__(self) -> None:
        self._losses: list[Loss] = []

    def __iter__(self) -> Iterator[Loss]:
        return iter(self._losses)

    def __len__(self) -> int:
        return len(self._losses)

    def add(self, offset: int, length: int, reason: str, *, exact: bool = True) -> Loss:
        """Note a loss; the return value is to be told how many messages it held."""
        if len(self._losses) < _MAX_LOSSES:
            self._losses.append(Loss(offset, length, reason, exact=exact))
        else:
            last = self._losses[-1]
            last.length += length
            last.reason = 'this and all other damage behind it'
            last.exact = False
        return self._losses[-1]
