"""What Ray's workers answer is what those of this machine do; it is started once for all tests."""

from collections.abc import Iterator
from itertools import count
import os
from pathlib import Path
from typing import Any

from engine_functions import fragile, squared
from klann_ros.design import requirements_from, search
from klann_ros.design.report import report_content
from klann_ros.engines import parallel_map
from klann_ros.review.fleet.command import main as review_fleet
from leg_runs import LegRun
import pytest

pytestmark = pytest.mark.slow


@pytest.fixture(scope='module', autouse=True)
def started() -> Iterator[None]:
    """Have a Ray of our own as long as somebody waits for its answers."""
    pytest.importorskip('ray')
    answers: Any = parallel_map(squared, count(), engine='ray', jobs=2)
    assert next(answers) in ((0, 0), (1, 1))
    yield
    answers.close()


def test_each_item_has_the_same_answer(tmp_path: Path) -> None:
    items = ['a', 'die', f'die-once {tmp_path / "died"}', 'raise so', 'b']
    by_ray = sorted(parallel_map(fragile, items, engine='ray', jobs=2))
    (tmp_path / 'died').unlink()
    assert by_ray == sorted(parallel_map(fragile, items, jobs=2))


def test_a_search_finds_the_same_legs() -> None:
    requirements = requirements_from(
        {'linkage': 'klann', 'figures': {'stride': 'maximize'}, 'count': 1}
    )
    local_design = search(requirements, evaluations=480, engine='local')
    ray_design = search(requirements, evaluations=480, engine='ray')
    assert local_design.legs
    assert report_content(local_design, ['leg']) == report_content(ray_design, ['leg'])


def test_rows_are_the_same_byte_for_byte(tmp_path: Path) -> None:
    runs = tmp_path / 'runs'
    for name in ('good', 'cut'):
        LegRun().write(runs / name)
    (log,) = (runs / 'cut').glob('*.mcap')
    os.truncate(log, log.stat().st_size // 2)
    (runs / 'empty.mcap').touch()
    tables = []
    for engine in ('ray', 'local'):
        table = tmp_path / f'{engine}.csv'
        options = ['--table', str(table), '--engine', engine, '--jobs', '1']
        assert review_fleet(['--each', str(runs), *options]) == 2
        tables.append(table.read_bytes())
    assert tables[0] == tables[1]
    assert tables[0].count(b'unreadable') == 1
