"""Runs to test with."""

from pathlib import Path

from crank_runs import BATCHES, write_run
import pytest


@pytest.fixture
def run_file(tmp_path: Path) -> Path:
    """Write a run, closed, with a chunk for each batch; return its file."""
    return write_run(tmp_path / 'walk', BATCHES)
