"""The code of the sketch, compiled once."""

from pathlib import Path

from motor_board import compiled, COMPILER
import pytest


@pytest.fixture(scope='session')
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if COMPILER is None:
        pytest.skip('there is no C++ compiler')
    return compiled(tmp_path_factory.mktemp('board'))
