"""Losses by sequence numbers: never too many, and all where the numbers are unambiguous."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from hypothesis import example, given, strategies as st
from klann_ros.log.loss import LossCounter
from klann_ros.log.run_parameters import TopicCount
from klann_ros.log.write.recording import losses_in_words
import pytest

WHY = 'several publishers at once, or messages without sequence numbers'


@dataclass
class Stay:
    """The received numbers of a publisher, and when its departure is reported."""

    publisher: int
    received: list[int]
    reported_after: int = 0

    @property
    def missing(self) -> int:
        """Return what is missing between the first and the last."""
        return (
            self.received[-1] - self.received[0] + 1 - len(self.received) if self.received else 0
        )


@st.composite
def stays(draw: Any) -> list[Stay]:
    """Return publishers one after the other, of which some come back."""
    all_stays, last_numbers = [], {}
    for _ in range(draw(st.integers(0, 7))):
        publisher = draw(st.integers(0, 5))
        first = last_numbers.get(publisher, 0) + 1
        received = sorted(draw(st.sets(st.integers(first, first + 30), max_size=12)))
        last_numbers[publisher] = received[-1] if received else first - 1
        all_stays.append(Stay(publisher, received, draw(st.integers(0, len(received)))))
    return all_stays


def counted(all_stays: list[Stay], *, late: bool, known: bool) -> LossCounter:
    """Return the counter; changes may be reported before the last messages, with the publisher."""
    counter = LossCounter()
    for stay in all_stays:
        counter.publishers_changed()
        for place, number in enumerate(stay.received):
            if late and place == stay.reported_after:
                counter.publishers_changed()
            counter.count(number)
            if known:
                counter.identify(stay.publisher)
        counter.publishers_changed()
        if known and not late:
            counter.identify(None)
    return counter


def truth(all_stays: list[Stay]) -> tuple[int, int]:
    """Return the losses within each publisher, and those before its first message."""
    lost = early = 0
    last_stay: Stay | None = None
    for stay in (stay for stay in all_stays if stay.received):
        lost += stay.missing
        if last_stay is not None and last_stay.publisher == stay.publisher:
            lost += stay.received[0] - last_stay.received[-1] - 1
        elif last_stay is not None:
            early += stay.received[0] - 1
        last_stay = stay
    return lost, early


@given(stays(), st.booleans(), st.booleans())
def test_no_more_is_reported_than_was_missing(
    all_stays: list[Stay], late: bool, known: bool
) -> None:
    counter, (lost, early) = counted(all_stays, late=late, known=known), truth(all_stays)
    assert counter.lost <= lost
    assert counter.before_discovery <= early


@given(stays())
# Another publisher goes on with the very number of the last.
@example([Stay(0, [1, 5]), Stay(1, [5, 6])])
def test_all_is_reported_where_the_publishers_are_known(all_stays: list[Stay]) -> None:
    counter = counted(all_stays, late=False, known=True)
    # A number that goes on is believed to be the same one's.
    if all(
        b.received[0] != a.received[-1] + 1
        for a, b in pairwise(s for s in all_stays if s.received)
    ):
        assert (counter.lost, counter.before_discovery) == truth(all_stays)


@given(stays())
def test_sequence_gaps_are_always_counted(all_stays: list[Stay]) -> None:
    counter = counted(all_stays, late=False, known=False)
    assert counter.lost == sum(stay.missing for stay in all_stays)


@pytest.mark.parametrize(
    ('latched', 'numbers', 'counts'),
    [
        (False, [400, 401, 403], (1, 0)),
        (True, [9, 7], (0, 0)),
        # A number that comes again, or a lower one, is one of a later publisher.
        (False, [3, 3], (0, 2)),
        (False, [9, 7], (0, 6)),
    ],
)
def test_a_first_or_latched_publisher_has_sent_nothing_early(latched, numbers, counts) -> None:
    counter = LossCounter()
    counter.latched = latched
    for number in numbers:
        counter.count(number)
    assert (counter.lost, counter.before_discovery) == counts


@pytest.mark.parametrize(
    ('messages', 'lost'),
    [
        ({5: 5, 6: 6, 7: 7, 2: 2, 3: 3, 4: 4, 8: 8}, 0),
        # The sender's clock is set back.
        ({1: 10, 2: 5, 5: 6}, 2),
    ],
)
def test_messages_that_come_after_newer_ones_are_no_loss(messages, lost) -> None:
    counter = LossCounter()
    assert sum(counter.count(number, time=time) for number, time in messages.items()) == 1
    assert (counter.lost, counter.before_discovery) == (lost, 0)


@pytest.mark.parametrize(
    ('events', 'counts'),
    [
        ('1 A 5 changed 20 A', (17, 0)),
        ('1 A 5 changed 20 B', (3, 19)),
        # It is discovered before its first message.
        ('1 A 5 changed B 20 B', (3, 19)),
        # The old one's last message, or that of one which had sent as many.
        ('1 A 5 changed 6 B', (3, 0)),
        # Whose number it is stays unknown.
        ('1 A changed 10 unknown', (0, 0)),
        ('1 changed 10 B', (0, 0)),
        ('1 A changed 10 changed 11 A', (0, 0)),
        ('1 A changed 10 3 A', (0, 2)),
        ('7 A several 2 A', (0, 0)),
    ],
)
def test_a_gap_at_a_change_is_counted_once_its_publisher_is_known(events, counts) -> None:
    counter = LossCounter()
    is_first = True
    for event in events.split():
        if event.isdigit():
            assert counter.count(int(event)) == is_first
            is_first = False
        elif event == 'changed':
            counter.publishers_changed()
            is_first = True
        elif event == 'several':
            assert not counter.count(3, publishers=2)
            is_first = True
        else:
            counter.identify(None if event == 'unknown' else event)
    assert (counter.lost, counter.before_discovery) == counts


@pytest.mark.parametrize('arguments', [(None,), (5, 2)])
def test_nothing_is_known_without_numbers_or_of_several_at_once(arguments) -> None:
    counter = LossCounter()
    counter.count(1)
    assert counter.is_known
    counter.count(*arguments)
    assert not counter.is_known


@pytest.mark.parametrize(
    ('count', 'said'),
    [
        (TopicCount(5, 5), '0 were lost'),
        (TopicCount(5, 4, dropped=1), '1 was lost'),
        (TopicCount(5, 5, missed=3), '3 were lost'),
        (
            TopicCount(5, 5, before_discovery=20),
            '0 were lost; 20 were sent before the recorder discovered their publishers',
        ),
        (
            TopicCount(5, 5, departed=1),
            'at least 0 were lost; 1 publisher left (/a): losses at their end cannot be detected',
        ),
        (
            TopicCount(5, 4, dropped=1, missed=None, departed=2),
            f'at least 1 was lost; the loss of /a is unknown: {WHY}',
        ),
    ],
)
def test_losses_are_described_in_words(count: TopicCount, said: str) -> None:
    assert losses_in_words({'/a': count}) == said


def test_few_topics_are_named() -> None:
    names = [f'/{n}\n' for n in range(5)]
    said = losses_in_words(dict.fromkeys(names, TopicCount(1, 1, departed=1)))
    assert '5 publishers left (/0\\n, /1\\n, /2\\n and 2 more): losses at their end' in said
