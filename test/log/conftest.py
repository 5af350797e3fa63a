"""Runs to test with."""

from pathlib import Path
from types import ModuleType

import crank_runs
from klann_ros.log.records import Message
import pytest


@pytest.fixture(scope='session')
def runs() -> ModuleType:
    return crank_runs


@pytest.fixture
def batches() -> list[list[Message]]:
    """Return the messages of six chunks, 40 each."""
    messages = crank_runs.make_messages(240)
    return [messages[slice(end - 40, end)] for end in range(40, 280, 40)]


@pytest.fixture
def run_file(tmp_path: Path, batches: list[list[Message]]) -> Path:
    """Write a run, closed, with a chunk for each batch; return its file."""
    return crank_runs.write_run(tmp_path / 'walk', batches)
