"""A finding about one thing has no plural."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from findings import found, PLURAL
from klann_ros.kinematics import KlannGeometry
from klann_ros.log.run_parameters import TopicCount
import pytest


def lost(script: Any) -> None:
    counts = {
        '/crank_angle': TopicCount(400, 399, missed=1, before_discovery=1, departed=1),
        '/point_h': TopicCount(400, 400, missed=0, departed=2),
    }
    script.add_counts(counts)


def out_of_reach(script: Any) -> None:
    script.geometry = KlannGeometry(l_dc=0.12)
    for n in range(400):
        script.move(n, 1.0 + n / 1000)
    script.unanswered.append((script.answers[300].stamp + 1000, 2.6))


def answered_again(script: Any) -> None:
    again = replace(script, answers=[script.answers[50]], metadata=[], others=[], geometry=None)
    again.crank, again.latency = replace(script.crank, name='/other'), 1_200_000
    script.others.append(again)


def garbled(script: Any) -> None:
    script.ask_unstamped(399)
    message = script.messages.pop()
    script.messages.append(replace(message, data=bytes([0, 1, 0, 0, 1]), sequence=401))


def in_a_gap(script: Any) -> None:
    script.ask(219, 0)
    del script.answers[200:220]
    script.renumber()


def after_the_end(script: Any) -> None:
    script.ask(-1, 2_100_000_000)


CASES = {
    lost: '1 message of /crank_angle was lost',
    out_of_reach: '1 of 401 crank angles cannot be reached by this leg',
    answered_again: '1 of 400 crank angle was answered more than once',
    garbled: '1 message of /crank_angle cannot be decoded',
    in_a_gap: '1 crank angle was not answered meanwhile',
    after_the_end: '1 crank angle came after them',
}


@pytest.mark.parametrize('change', CASES, ids=lambda change: change.__name__)
def test_a_finding_about_one_thing_has_no_plural(
    healthy: Any, make_run: Any, change: Callable[[Any], None]
) -> None:
    change(healthy)
    assert CASES[change] in ' '.join(found(make_run(healthy)))


def test_a_plural_of_one_is_seen() -> None:
    for text in ('1 messages of', 'and 1 poses', ': 1 crank angles', '1 were', ' 1 feet'):
        assert PLURAL.search(text), text
    for text in ('1 of 400 poses is', '11 messages', '0.1 s after', '1 message of', '1 stamp is'):
        assert not PLURAL.search(text), text
