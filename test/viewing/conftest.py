"""A prefix of ROS for each test that launches something."""

from collections.abc import Callable, Iterator
from pathlib import Path

from domain import own_domain
from launched import Prefix
import pytest


@pytest.fixture
def prefix(tmp_path: Path) -> Iterator[Callable[..., Prefix]]:
    made: list[Prefix] = []
    with own_domain() as domain:

        def make(**options: object) -> Prefix:
            made.append(Prefix(tmp_path / f'prefix {len(made)}', domain, **options))
            return made[-1]

        yield make
        for each in made:
            each.close()
