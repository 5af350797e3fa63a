"""Every test of a node has a domain, a context and processes of its own."""

from collections.abc import Iterator
from pathlib import Path

from domain import own_domain
import pytest
from ros_world import World, world


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[World]:
    with own_domain() as domain, world(domain, tmp_path) as made:
        yield made
