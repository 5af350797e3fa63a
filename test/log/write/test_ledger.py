"""The ledger: each message in one place, each number told the same to everybody."""

from collections import Counter

from klann_ros.log.run_parameters import TopicCount
from klann_ros.log.write.ledger import Fate, Ledger


class Run:
    """A run of which the fate is known."""

    def __init__(self, written, gone):
        self._fate = Fate(Counter(written), Counter(gone))

    def fate(self):
        return self._fate


def test_an_account_is_opened_once() -> None:
    ledger = Ledger(Run({}, {}))
    assert ledger['/x'] is ledger['/x']
    assert ledger['/x'] is not ledger['/y']
    assert list(ledger.counts()) == ['/x', '/y']


def test_what_was_dropped_is_what_did_not_fit_was_not_written_or_is_gone() -> None:
    ledger = Ledger(Run({'/x': 80}, {'/x': 10}))
    account = ledger['/x']
    account.received, account.left_out, account.overrun, account.unwritten = 100, 5, 3, 2
    assert ledger.counts() == {'/x': TopicCount(100, 80, dropped=15, left_out=5, unheard=0)}


def test_what_was_lost_before_is_unknown_where_publishers_are_mixed() -> None:
    ledger = Ledger(Run({}, {}))
    ledger['/x'].loss.count(1)
    ledger['/x'].loss.count(5)
    assert ledger.counts()['/x'].lost == 3
    ledger['/x'].loss.count(6, publishers=2)
    assert ledger.counts()['/x'].lost is None
