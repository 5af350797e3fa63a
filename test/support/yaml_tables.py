"""The tables of tests, in YAML beside them."""

from pathlib import Path
from typing import Any

import yaml


def read_table(path: Path) -> Any:
    """Return a table, parsed by libyaml: each worker reads all tables."""
    return yaml.load(path.read_text('utf-8'), yaml.CSafeLoader)
