"""What became of every message of a recording: an account for each topic, one sum for all."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Protocol

from klann_ros.log.loss import LossCounter
from klann_ros.log.run_parameters import TopicCount


@dataclass(slots=True)
class Account:
    """
    What became of a topic's messages before they were written.

    Each number is counted by one thread only, so none needs a lock.

    Attributes
    ----------
    received : int
        How many came.
    loss : LossCounter
        How many were lost before they came.
    left_out : int
        How many came during a pause.
    overrun : int
        How many did not fit into the queue, or came when nothing was written any more.
    unwritten : int
        How many were taken out of the queue, and could not be written.

    """

    received: int = 0
    loss: LossCounter = field(default_factory=LossCounter)
    left_out: int = 0
    overrun: int = 0
    unwritten: int = 0


@dataclass(frozen=True)
class Fate:
    """
    What became of the messages that a run was given.

    Attributes
    ----------
    written : Counter
        How many are in it, by the topic's name.
    gone : Counter
        How many were written and are not in it any more, or not known to be.

    """

    written: Counter[str]
    gone: Counter[str]


class Run(Protocol):
    """A run that is being written."""

    def fate(self) -> Fate:
        """Return what became of the messages that it was given so far."""


class Ledger:
    """
    The accounts of a recording.

    What does not wait in the queue is in exactly one place: received = left out + dropped +
    written, for each topic.

    Parameters
    ----------
    run : Run
        Where messages are written.

    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._accounts: dict[str, Account] = {}

    def __getitem__(self, topic: str) -> Account:
        """Return the account of a topic, which is opened by asking."""
        account = self._accounts.get(topic)
        # Two threads may ask for the first time at once.
        return self._accounts.setdefault(topic, Account()) if account is None else account

    def left_out(self) -> Counter[str]:
        """Return how many messages of each topic were left out so far, in all pauses."""
        return Counter({name: account.left_out for name, account in self._items()})

    def counts(self) -> dict[str, TopicCount]:
        """Return what became of the messages of each topic so far; any thread may ask."""
        fate = self._run.fate()
        return {
            name: TopicCount(
                received=account.received,
                written=fate.written[name],
                dropped=account.overrun + account.unwritten + fate.gone[name],
                left_out=account.left_out,
                unheard=account.loss.lost if account.loss.is_known else None,
                early=account.loss.early,
                left=account.loss.left,
            )
            for name, account in self._items()
        }

    def _items(self) -> list[tuple[str, Account]]:
        # Another thread may open one meanwhile.
        return list(self._accounts.items())
