"""Numbers in sentences."""

from klann_ros.log.wording import counted, in_words, times, verb
import pytest


@pytest.mark.parametrize(
    ('number', 'said'), [(0, '0 messages'), (1, '1 message'), (2, '2 messages')]
)
def test_one_is_not_many(number: int, said: str) -> None:
    assert counted(number, 'message') == said


def test_a_word_may_have_a_plural_of_its_own() -> None:
    assert counted(2, 'foot', 'feet') == '2 feet'


def test_the_verb_goes_with_the_number() -> None:
    assert [verb(n, 'was', 'were') for n in range(3)] == ['were', 'was', 'were']


def test_once_is_a_word() -> None:
    assert [times(n) for n in (1, 2, 3)] == ['once', 'twice', '3 times']


def test_small_numbers_are_words() -> None:
    assert [in_words(n) for n in (0, 2, 10, 11, -1)] == ['no', 'two', 'ten', '11', '-1']
