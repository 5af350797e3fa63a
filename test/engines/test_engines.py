"""Whatever becomes of a worker, each item has one answer, and the others theirs."""

from pathlib import Path

from engine_functions import fragile, nothing, squared, warned
from klann_ros.engines import EngineError, parallel_map, TaskError
import pytest


@pytest.mark.parametrize('jobs', [1, 3])
def test_each_item_is_answered_once(jobs: int) -> None:
    answers = sorted(parallel_map(squared, range(20), jobs=jobs))
    assert answers == [(k, k * k) for k in range(20)]


def test_an_answer_may_be_nothing() -> None:
    assert list(parallel_map(nothing, [1], jobs=1)) == [(0, None)]


def test_no_items_start_nothing() -> None:
    assert list(parallel_map(squared, [])) == []


def test_a_worker_that_dies_hangs_or_fails_costs_its_item_only(tmp_path: Path) -> None:
    items = ['a', 'die', f'die-once {tmp_path / "died"}', 'hang', 'raise so\nit is', 'b']
    assert dict(parallel_map(fragile, items, jobs=2, time_limit=8.0)) == {
        0: 'a',
        1: TaskError('its worker died while it worked on it, 2 times'),
        2: 'die-once',
        3: TaskError('it took longer than 8 s'),
        4: TaskError('ValueError: so\nit is'),
        5: 'b',
    }


def test_a_worker_prints_no_warning() -> None:
    # Of numpy, or of units: each worker would print it.
    assert list(parallel_map(warned, [1], jobs=1)) == [(0, '')]


def test_items_are_taken_as_workers_become_free() -> None:
    items = iter(range(100))
    answers = parallel_map(squared, items, jobs=1)
    next(answers)
    assert next(items) <= 3
    answers.close()


def test_an_unknown_engine_is_named() -> None:
    with pytest.raises(EngineError, match='local or ray'):
        parallel_map(squared, [1], engine='dask')
    with pytest.raises(ValueError, match='jobs = 0'):
        parallel_map(squared, [1], jobs=0)
